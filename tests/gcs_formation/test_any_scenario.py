"""Any change of a scenario: it flies, or is refused in the user's words, alike by every command."""

from __future__ import annotations

import copy
import math
import traceback
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
import yaml
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from formation_scenario import Problem, ScenarioError, load_scenario
from formation_scenario.source import Dumper, read_text
from gcs_formation.cli import main
from tests.formation_scenario.test_load import EVERY_KEY

VALUES: list[Any] = [
    None, True, 0, -1, 1, 3, 1e9, -1e9, 1e-9, math.nan, math.inf, "", "diamnd", "12 m", "all", [], [1], [0, 0, 0],
    [[0, 0, 0]], {}, {"x": 1}, {1: 2}, 2**63, "udpin:127.0.0.1:99999", "\x1b[2J", "é" * 300,
]  # fmt: skip
FLYING = {"duration_s": 4, "start": {"in_air": True, "run_in_s": 6, "timeout_s": 5}, "finish": {"loiter_s": 0}}
PLAIN = read_text(EVERY_KEY).data | FLYING | {"faults": [], "expect": [], "disturbances": []}


def places(node: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the paths of everything inside a node."""
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    return [place for key, value in items for place in ((*path, key), *places(value, (*path, key)))]


def changed(data: Any, path: tuple[Any, ...], change: str, value: Any) -> Any:
    """Return the data with one place changed."""
    data = copy.deepcopy(data)
    *above, last = path
    parent = data
    for key in above:
        parent = parent[key]
    if change == "put":
        parent[last] = value
    elif change == "drop":
        del parent[last]
    elif change == "twice" and isinstance(parent, list):
        parent.append(copy.deepcopy(parent[last]))
    elif change == "misspell" and isinstance(parent, dict):
        word = str(last)
        parent[word[:1] + word[2:] + "x"] = parent.pop(last)
    return data


DONE = ("put", "put", "drop", "twice", "misspell")
JUNK = ("{", "]", ":", "\t", "'", "&a ", "*b", "!!x ", "\0", "- ")
FILE = "scenario.yaml"
changes = st.tuples(st.sampled_from(places(PLAIN)), st.sampled_from(DONE), st.sampled_from(VALUES))


def _file(directory: Path, text: str) -> Path:
    path = directory / FILE
    path.write_text(text, encoding="utf-8")
    return path


def problems(path: Path) -> tuple[Problem, ...]:
    """Return the problems of a scenario; any other exception is a failure."""
    try:
        load_scenario(path)
    except ScenarioError as error:
        return error.problems
    return ()


def written(data: Any) -> str:
    """Return a scenario as YAML."""
    return yaml.dump(data, Dumper=Dumper, allow_unicode=True, sort_keys=False)


@given(several=st.lists(changes, min_size=1, max_size=3))
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_is_changed_is_read_or_refused_with_every_problem_in_its_place(tmp_path: Path, several: Any) -> None:
    data = PLAIN
    for change in several:
        with suppress(KeyError, IndexError, TypeError):  # an earlier change may have removed the place
            data = changed(data, *change)
    found = problems(_file(tmp_path, written(data)))
    lines = [problem.line or 0 for problem in found]
    assert lines == sorted(lines)
    assert {problem.file for problem in found} <= {str(tmp_path / FILE)}


def invoke(*arguments: str) -> tuple[int, str]:
    """Run the command line; a traceback is a failure with any status."""
    result = CliRunner().invoke(main, arguments)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        pytest.fail("".join(traceback.format_exception(result.exception)))
    return result.exit_code, result.stderr


@pytest.mark.slow
@given(change=changes)
@settings(deadline=None, max_examples=15)
def test_a_changed_scenario_flies_or_is_refused_by_all_commands_alike(change: Any) -> None:
    with TemporaryDirectory() as directory:
        flies_or_is_refused(Path(directory), written(changed(PLAIN, *change)))


def flies_or_is_refused(directory: Path, text: str) -> None:
    """Check that `run` flies what `check` allows, and refuses everything else in its words, without a start."""
    path, out = _file(directory, text), directory / "run"
    status, words = invoke("check", str(path), "--no-fly")
    options = ("--clock", "virtual", "--until", "2", "--quiet", "--out", str(out))
    flown, said = invoke("run", str(path), *options)
    if status == 0:
        assert flown in (0, 1, 3), said
        return
    assert status == flown == 2
    assert said == words
    assert words.startswith(str(path))
    assert not out.exists()


@given(place=st.integers(0, len(EVERY_KEY)), junk=st.sampled_from(JUNK))
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_broken_text_is_refused_with_its_place(tmp_path: Path, place: int, junk: str) -> None:
    found = problems(_file(tmp_path, EVERY_KEY[:place] + junk + EVERY_KEY[place:]))
    assert {problem.file for problem in found} <= {str(tmp_path / FILE)}


@pytest.mark.parametrize("command", ["run", "fly"])
def test_an_unwritable_output_directory_is_refused_before_anything_starts(tmp_path: Path, command: str) -> None:
    (tmp_path / "file").write_text("")
    path = tmp_path / "scenario.yaml"
    path.write_text(EVERY_KEY)
    status, words = invoke(command, str(path), "--out", str(tmp_path / "file" / "run"))
    assert status == 2
    assert "cannot write the run directory" in words
