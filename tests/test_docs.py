"""Files, names and pictures that documents mention exist."""

import ast
import json
import re
from pathlib import Path

import pytest

from formation_scenario.schema import scenario_reference, scenario_schema
from gcs_formation.studies import Study
from tests.testing_reference import reference

ROOT = Path(__file__).parents[1]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])
CODE = r"`([\w./-]+\.(?:py|ya?ml|md|schema\.json))`"
PACKAGES = (
    "airlink",
    "flight_model",
    "formation_scenario",
    "sim_vehicles",
    "gcs_formation",
    "tests",
    "benchmarks",
    "configs",
    "docs",
)
FOLDER = rf"`((?:{'|'.join(PACKAGES)})/[\w/]*)`"
FILES = {path.name for package in PACKAGES for path in (ROOT / package).rglob("*.*")}
"""Names that may stand alone, after a document has said which folder is meant."""
OUTPUTS = {"run.yaml", "table.md", "rehearsal.yaml"}
"""Files of a run, a study or a survey, not of the source tree."""
TO_COME = "## Where to add things"


def written(document: Path) -> str:
    return document.read_text(encoding="utf-8").partition(TO_COME)[0]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_files_that_a_document_names_are_there(document):
    text = written(document)
    named = {*re.findall(CODE, text), *re.findall(FOLDER, text)} - OUTPUTS - FILES
    linked = {target for target in re.findall(r"\]\(([^)#]+)", text) if "://" not in target}
    assert sorted(name for name in named if not (ROOT / name).exists()) == []
    assert sorted(target for target in linked if not (document.parent / target).exists()) == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_scenarios_and_modules_in_commands_are_there(document):
    text = written(document)
    scenarios = re.findall(r"\bconfigs/[\w-]+\.yaml", text)
    named = re.findall(r"python\s+-m\s+((?:benchmarks|tests)(?:\.\w+)+)", text)
    modules = [ROOT / name.replace(".", "/") for name in named]
    missing = [name for name in scenarios if not (ROOT / name).exists()]
    missing += [
        str(path) for path in modules if not (path.with_suffix(".py").exists() or (path / "__main__.py").exists())
    ]
    assert missing == []


@pytest.mark.parametrize("document", ["paper.md", "architecture.md"])
def test_what_a_table_places_in_a_file_is_there(document):
    text = (ROOT / "docs" / document).read_text(encoding="utf-8")
    placed = re.findall(r"`([\w/]+\.py)`: ((?:`\w+`(?:, )?)+)", text)
    assert len(placed) >= 10
    for path, names in placed:
        code = (ROOT / path).read_text(encoding="utf-8")
        for name in re.findall(r"`(\w+)`", names):
            assert re.search(rf"^ *(?:def|class) {name}\b|^{name}\b.*=", code, re.MULTILINE), f"{name} isn't in {path}"


def test_the_reference_of_scenario_keys_and_their_schema_are_those_of_the_models():
    reference = (ROOT / "docs" / "scenario.md").read_text(encoding="utf-8")
    schema = (ROOT / "docs" / "scenario.schema.json").read_text(encoding="utf-8")
    fresh = reference == scenario_reference() and json.loads(schema) == json.loads(json.dumps(scenario_schema()))
    assert fresh, f"docs/scenario.md and docs/scenario.schema.json are stale; write them again by: {reference[:250]}"


def test_the_page_of_studies_says_how_many_samples_there_are_by_default():
    (row,) = re.findall(r"^\| `samples` .*", (ROOT / "docs" / "studies.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert f"{Study().samples} by default" in row


def test_the_reference_of_the_pytest_fixture_is_that_of_its_docstrings():
    written_by = "write it again: python -m tests.testing_reference > docs/testing.md"
    assert (ROOT / "docs" / "testing.md").read_text(encoding="utf-8") == reference(), written_by


def logged_kinds(source):
    """Yield the kinds of events that a module records."""
    for call in ast.walk(ast.parse(source)):
        if isinstance(call, ast.Call) and len(call.args) >= 3 and isinstance(call.args[1], ast.Constant):
            name = getattr(call.func, "attr", getattr(call.func, "id", ""))
            if "log_event" in name:
                yield str(call.args[1].value)


def test_every_kind_of_event_that_is_noted_is_in_the_events_schema():
    schema = json.loads((ROOT / "docs" / "events.schema.json").read_text())["properties"]["kind"]
    texts = (path.read_text() for path in (ROOT / "gcs_formation").rglob("*.py"))
    logged = {kind for text in texts if "log_event" in text for kind in logged_kinds(text)}
    assert len(logged) > 20
    ours = schema["anyOf"][0]["enum"]
    assert sorted(logged - set(ours)) == []
    assert sorted(kind for kind in ours if f"{kind}: " not in schema["description"]) == []
