"""`check` says what would do against what can't be flown, `check --repair` writes it, `check --plan` draws it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from formation_scenario import load_scenario
from gcs_formation.cli import main

LOW = [[0, 0, 100], [2000, 0, 3], [4000, 0, 100]]
PLAN = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t47.4\t8.54\t488\t1
1\t0\t3\t16\t0\t0\t0\t0\t47.4\t8.54\t100\t1
2\t0\t3\t16\t0\t0\t0\t0\t47.42\t8.54\t1\t1
3\t0\t3\t16\t0\t0\t0\t0\t47.44\t8.56\t100\t1
"""


def check(folder: Path, path: dict[str, Any], *options: str, **keys: Any) -> tuple[int, str]:
    scenario = folder / "mission.json"
    scenario.write_text(json.dumps({"vehicles": {"count": 3}, "path": {"kind": "legs", **path}, **keys}))
    result = CliRunner().invoke(main, ["check", str(scenario), "--no-fly", *options])
    return result.exit_code, result.output


def test_a_refusal_says_what_would_do_and_how_to_have_it_written(tmp_path: Path) -> None:
    status, said = check(tmp_path, {"waypoints_m": LOW})
    assert status == 2
    assert "would do: path.waypoints_m.1: moved 2.0 m up, from [2000, 0, 3] to [2000, 0, 5.02]" in said
    assert said.rstrip().endswith("next: --repair OUT.yaml writes the nearest scenario that flies")


def test_the_repaired_file_is_accepted_and_lists_its_changes(tmp_path: Path) -> None:
    out = tmp_path / "out.yaml"
    status, said = check(tmp_path, {"waypoints_m": LOW}, "--repair", str(out))
    assert (status, said.splitlines()[0]) == (
        0,
        "path.waypoints_m.1: moved 2.0 m up, from [2000, 0, 3] to [2000, 0, 5.02]",
    )
    assert "# path.waypoints_m.1: moved 2.0 m up" in out.read_text(encoding="utf-8")
    assert CliRunner().invoke(main, ["check", str(out), "--no-fly"]).exit_code == 0
    assert check(tmp_path, {"waypoints_m": LOW[::2]}, "--repair", str(out))[1].startswith("nothing to repair")


def test_a_mission_file_is_repaired_with_its_waypoints_inline(tmp_path: Path) -> None:
    (tmp_path / "mission.waypoints").write_text(PLAN)
    status, said = check(tmp_path, {"file": "mission.waypoints"}, "--repair", str(tmp_path / "sub.yaml"))
    assert status == 0
    assert "path.waypoints_m.1: moved 4.0 m up" in said
    found = load_scenario(tmp_path / "sub.yaml")
    assert found.path.read_from == "mission.waypoints"
    assert found.path.waypoints_m[1][2] == pytest.approx(5.02)
    assert found.origin.alt_m == 488


def test_json_has_the_problems_the_changes_and_what_is_left(tmp_path: Path) -> None:
    _, text = check(tmp_path, {"waypoints_m": LOW}, "--json")
    (problem,) = json.loads(text[: text.rindex("}") + 1])["problems"]
    assert problem["would_do"].startswith("path.waypoints_m.1: moved 2.0 m up")
    _, text = check(tmp_path, {"waypoints_m": LOW}, "--json", "--repair", str(tmp_path / "out.yaml"))
    found = json.loads(text[: text.rindex("}") + 1])
    assert (found["valid"], found["repaired"], found["left"]) == (False, True, [])
    assert [each["key"] for each in found["changes"]] == ["path.waypoints_m.1"]


def test_where_nothing_helps_nothing_is_written_and_the_limit_is_named(tmp_path: Path) -> None:
    out = tmp_path / "out.yaml"
    status, said = check(
        tmp_path, {"waypoints_m": [[0, 0, 100], [500, 0, 300]]}, "--repair", str(out), repair={"order": ["frame"]}
    )
    assert status == 2
    assert "what is in the way" in said
    assert "vehicle 1's climb_max_mps" in said
    assert not out.exists()


def test_keys_that_contradict_each_other_are_no_matter_of_repair(tmp_path: Path) -> None:
    status, said = check(
        tmp_path, {"waypoints_m": LOW}, "--repair", str(tmp_path / "out.yaml"), start={"in_air": True, "row_m": 9}
    )
    assert (status, "start.row_m" in said) == (2, True)


def test_the_plan_is_drawn_of_what_flies_and_of_what_does_not(tmp_path: Path) -> None:
    for name, waypoints, status in (("bad", LOW, 2), ("good", LOW[::2], 0)):
        file = tmp_path / f"{name}.png"
        assert check(tmp_path, {"waypoints_m": waypoints}, "--plan", str(file))[0] == status
        assert file.read_bytes().startswith(b"\x89PNG")
    assert check(tmp_path, {"waypoints_m": LOW}, "--plan", str(tmp_path / "plan.pdf"))[0] == 2


def test_a_mission_that_ends_with_a_short_steep_leg_behind_a_detour_is_repaired_by_that_height_alone(
    tmp_path: Path,
) -> None:
    mission, out = Path(__file__).parents[2] / "missions" / "delivery.waypoints", tmp_path / "out.yaml"
    code, said = check(tmp_path, {"file": str(mission)}, "--repair", str(out), vehicles={"count": 4})
    assert code == 0
    assert [line for line in said.splitlines() if line.startswith("path.waypoints_m.")] == [
        "path.waypoints_m.34: moved 5.0 m up, from [-86.259813, -10791.829, 35] to [-86.259813, -10791.829, 40]"
    ]
    checked = CliRunner().invoke(main, ["check", str(out), "--no-fly"])
    assert (checked.exit_code, checked.exception) == (0, None)


@pytest.mark.parametrize("option", ["--repair", "--export"])
def test_the_scenario_itself_is_not_written_over(tmp_path: Path, option: str) -> None:
    status, said = check(tmp_path, {"waypoints_m": LOW[::2]}, option, str(tmp_path / "mission.json"))
    assert (status, "found the scenario itself" in said) == (2, True)
    assert json.loads((tmp_path / "mission.json").read_text())["vehicles"] == {"count": 3}
