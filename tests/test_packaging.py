"""What a package needs around it: wheels of every Python and processor, how to cite it, no trace of a machine."""

import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
TOPS = (
    *("airlink", "flight_model", "formation_scenario", "sim_vehicles", "gcs_formation"),
    *("benchmarks", "configs", "docs", "examples", "studies", "tests", ".ci", ".github"),
)
SUFFIXES = {".py", ".md", ".toml", ".yaml", ".yml", ".cff", ".json", ".cfg", ".txt", ".sh", ""}
HOSTS = tuple(".".join(parts) for parts in (("pypi", "org"), ("pythonhosted", "org")))
INDEX = "-".join(("index", "url"))
"""Put together, so that this file has none of them itself."""


def test_wheels_are_built_for_every_python_and_processor_that_is_asked_for():
    wanted = PROJECT["tool"]["cibuildwheel"]
    assert wanted["build"] == [f"cp3{minor}-*" for minor in (11, 12, 13, 14)]
    assert wanted["linux"]["archs"] == ["x86_64", "aarch64"]
    assert wanted["environment"]["GCS_FORMATION_COMPILE"] == "1", "or an uncompiled wheel would be published silently"
    assert wanted["macos"]["environment"]["GCS_FORMATION_COMPILE"] == "1"
    (script,) = (each for each in wanted["test-command"] if "{project}" in each)
    assert (ROOT / script.partition("{project}/")[2]).is_file()


def test_the_workflow_builds_on_each_of_these_systems():
    flow = yaml.safe_load((ROOT / ".github" / "workflows" / "wheels.yml").read_text(encoding="utf-8"))
    systems = flow["jobs"]["wheels"]["strategy"]["matrix"]["system"]
    assert [each.partition("-")[0] for each in systems] == ["ubuntu", "ubuntu", "macos"]
    assert any(each.endswith("-arm") for each in systems)


def test_how_to_cite_it_names_this_version_and_licence():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    project = PROJECT["project"]
    assert (cited["version"], cited["license"]) == (project["version"], project["license"])
    assert cited["cff-version"] == "1.2.0"


def test_no_file_names_a_registry_or_a_place_on_somebody_s_machine():
    traces = (*HOSTS, INDEX, f"{Path.home()}/", f"{ROOT}/")
    files = [each for each in ROOT.iterdir() if each.is_file()] + [
        each for top in TOPS for each in (ROOT / top).rglob("*")
    ]
    found = list[str]()
    for file in files:
        name = file.relative_to(ROOT).as_posix()
        if file.is_file() and file.suffix in SUFFIXES and "__pycache__" not in name:
            text = file.read_text(encoding="utf-8", errors="replace")
            found += [f"{name}: {each}" for each in traces if each in text]
    assert found == []
