"""Aircraft of parameter files fly in formation, from the ground too, and `check` says what was taken of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from formation_scenario import load_scenario
from gcs_formation.app.check import check_report, check_text
from tests.flights.conftest import Fly, scenario

SLOWER = """\
ARSPD_FBW_MIN 12
ARSPD_FBW_MAX 22
TRIM_ARSPD_CM 1600
LIM_ROLL_CD 5500
TECS_SINK_MIN 2.2
TRIM_THROTTLE 42
NAVL1_PERIOD 15
"""
QGC = "".join(
    f"1\t1\t{name}\t{value}\t9\n"
    for name, value in {"FW_AIRSPD_MIN": 11, "FW_AIRSPD_MAX": 22, "FW_AIRSPD_TRIM": 16, "FW_R_LIM": 45}.items()
)
PATH = {"speed_mps": 16, "waypoints_m": [[0, 0, 100], [300, 10, 100], [650, 60, 103]]}


def flown(directory: Path, text: str, **keys: object) -> dict[str, object]:
    (directory / "plane.parm").write_text(text, encoding="utf-8")
    return scenario(vehicles={"count": 2, "model": {"parameters": str(directory / "plane.parm")}}, path=PATH, **keys)


@pytest.mark.parametrize("text", [SLOWER, pytest.param(QGC, marks=pytest.mark.slow)])
def test_they_keep_their_slots_over_links_of_300_ms(fly: Fly, tmp_path: Path, text: str) -> None:
    start = {"in_air": True, "run_in_s": 35}  # the first setpoints come late: what that leaves decays meanwhile
    keys = flown(tmp_path, text, links={"default": {"delay_ms": 300}}, start=start, duration_s=20)
    figures = fly(**keys).figures["followers"]
    for each in figures.values():
        assert max(each[axis]["rms"] for axis in ("error_x_m", "error_y_m", "error_z_m")) <= 0.1


@pytest.mark.slow
def test_an_older_arduplane_takes_off_and_its_limits_are_read_by_their_old_names(fly: Fly, tmp_path: Path) -> None:
    keys = flown(tmp_path, f"{SLOWER}FS_GCS_ENABL 1\nFS_LONG_ACTN 1\n", start={"in_air": False}, duration_s=10)
    summary = fly(**keys)
    assert summary.figures["safety"]["violations"] == 0
    events = (tmp_path / "run" / "events.jsonl").read_text(encoding="utf-8")
    assert "not checked" not in events


def test_check_says_what_was_taken_and_what_was_not(tmp_path: Path) -> None:
    found = load_scenario(flown(tmp_path, SLOWER))
    (file,) = check_report(found)["parameters"]
    assert file["vehicles"] == ["1", "2"]
    assert file["taken"]["ARSPD_FBW_MIN"] == {"value": 12.0, "key": "speed_min_mps"}
    assert file["not_taken"] == ["NAVL1_PERIOD"]
    assert file["defaults"]["TECS_CLMB_MAX"] == 5.0
    text = check_text(found)
    assert "7 parameters of ArduPlane" in text
    assert "LIM_ROLL_CD 5500 as turn_rate_max_rps" in text
    assert "not taken: NAVL1_PERIOD, 0 others" in text
