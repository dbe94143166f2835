"""The JSON schema and the reference of scenario keys."""

import json
import re
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator

from formation_scenario import dump_scenario, load_scenario
from formation_scenario.derived_defaults import MAY_BE_EMPTY
from formation_scenario.schema import example, scenario_reference, scenario_schema, written_model
from formation_scenario.source import read_text
from tests.formation_scenario.test_load import EVERY_KEY
from tests.formation_scenario.test_messages import BASE, WRONG_VALUES

ROOT = Path(__file__).parents[2]
SHIPPED = sorted([*(ROOT / "configs").glob("*.yaml"), *(ROOT / "examples").glob("*.yaml")])
SCHEMA = scenario_schema()
VALIDATOR = Draft202012Validator(SCHEMA)


def errors(text: str) -> list[str]:
    """Return what the schema finds wrong in YAML text; JSON's keys are always text."""
    return [error.message for error in VALIDATOR.iter_errors(json.loads(json.dumps(read_text(text).data)))]


def test_the_schema_is_one_of_draft_2020_12():
    Draft202012Validator.check_schema(SCHEMA)
    assert SCHEMA["$schema"] == "https://json-schema.org/draft/2020-12/schema"


@pytest.mark.parametrize("file", SHIPPED, ids=lambda path: path.stem)
def test_shipped_scenarios_are_allowed(file):
    assert errors(file.read_text(encoding="utf-8")) == []


def test_a_scenario_with_every_key_is_allowed_and_what_one_resolves_to():
    assert errors(EVERY_KEY) == []
    assert errors(dump_scenario(load_scenario(read_text(BASE).data))) == []


@pytest.mark.parametrize("key", [*MAY_BE_EMPTY, "start", "law", "formation", "safety", "terrain"])
def test_what_may_be_left_empty_is_allowed(key):
    assert errors(f"{BASE}{key}:\n") == []
    assert load_scenario(read_text(f"{BASE}{key}:\n").data)


@pytest.mark.parametrize("key", ["vehicles", "path"])
def test_what_must_be_there_is_required(key):
    assert errors(re.sub(f"^{key}:.*\n", "", BASE, flags=re.MULTILINE))


# The schema checks neither the words of an order nor the keys of a mapping of slots; JSON has no infinity.
@pytest.mark.parametrize(
    "text", [text for text in WRONG_VALUES if not text.startswith(("orders", "formation: {slots_m: {x"))]
)
def test_a_value_that_is_refused_is_refused_by_the_schema_too(text):
    assert errors(BASE + text)


def fields(model):
    for name, field in model.model_fields.items():
        yield model, field.alias or name, field


def groups(schema):
    yield "Scenario", schema
    yield from ((name, group) for name, group in schema["$defs"].items() if "properties" in group)


@pytest.mark.parametrize(
    ("name", "group"), list(groups(SCHEMA)), ids=lambda each: each if isinstance(each, str) else ""
)
def test_examples_of_keys_and_defaults_are_allowed_values(name, group):
    for key, value in group["properties"].items():
        validator = Draft202012Validator({"$defs": SCHEMA["$defs"]} | value)
        for each in [*value.get("examples", []), *([value["default"]] if "default" in value else [])]:
            found = [error.message for error in validator.iter_errors(json.loads(json.dumps(each)))]
            assert found == [], f"{name}.{key}: {each}"


def test_every_yaml_block_of_the_reference_flies(tmp_path, monkeypatch):
    (tmp_path / "ping.csv").write_text("t_s,rtt_ms\n0,100\n")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```yaml\n(.*?)```", scenario_reference(), re.DOTALL)
    assert len(blocks) > 10
    for block in blocks:
        written = yaml.safe_load(block) or {}
        assert errors(yaml.safe_dump(yaml.safe_load(BASE) | written)) == []
        assert load_scenario(yaml.safe_load(BASE) | written)


def test_an_example_is_the_keys_own_or_a_choice_that_is_not_its_default():
    known = {key: field for _, key, field in fields(written_model())}
    assert example(known["duration_s"]) == 600
    frame = written_model().model_fields["formation"].default
    assert example(type(frame).model_fields["frame"]) == "follower_heading"
