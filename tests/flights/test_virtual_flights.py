"""Whole flights on real MAVLink bytes under the virtual clock."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from pymavlink import mavutil

import gcs_formation
from gcs_formation.record.parquet import read_parquet
from gcs_formation.record.timeseries import PHASES
from tests.flights.conftest import Fly, scenario

DOCS = Path(__file__).parents[2] / "docs"


def worst(summary: Any, figure: str) -> list[float]:
    followers = summary.to_dict()["followers"].values()
    return [max(f[f"error_{axis}_m"][figure] for f in followers) for axis in "xyz"]


@pytest.mark.parametrize(
    ("law", "frame"), [("fuzzy_pid", "leader_heading"), pytest.param("pid", "follower_heading", marks=pytest.mark.slow)]
)
def test_followers_settle_from_an_offset(fly: Fly, frame: str, law: str) -> None:
    summary = fly(
        duration_s=30,
        vehicles={"count": 2},
        start={"in_air": True, "run_in_s": 6, "offset_m": [8, 6, 4]},
        formation={"shape": "arrow", "frame": frame},
        law={"type": law},
    )
    for follower in summary.to_dict()["followers"].values():
        assert follower["settled_at_s"] < 40
        assert follower["left_at_s"] is None


@pytest.mark.slow
@pytest.mark.parametrize("to_side_m", [-150, 150])
def test_a_follower_far_to_the_side_flies_to_its_slot(fly: Fly, to_side_m: float) -> None:
    summary = fly(duration_s=50, start={"in_air": True, "run_in_s": 6, "offset_m": [0, to_side_m, 0]})
    for follower in summary.to_dict()["followers"].values():
        assert follower["settled_at_s"] < 60


@pytest.mark.slow
def test_an_assembled_formation_keeps_its_slots_to_centimetres(fly: Fly) -> None:
    assert max(worst(fly(duration_s=20), "max")) < 0.05


def test_a_turn_leaves_no_offset(fly: Fly) -> None:
    """Slot-consistent feed-forward: in a turn of 0.9 degrees per second the errors stay at centimetres."""
    turn = [[1400 * math.sin(a), 1400 * (1 - math.cos(a)), 100] for a in np.linspace(0, 1.2, 9)]
    assert max(worst(fly(duration_s=18, path={"speed_mps": 22, "waypoints_m": turn}), "max")) < 0.1


@pytest.mark.slow
def test_wind_on_all_does_not_disturb_the_formation(fly: Fly) -> None:
    summary = fly(
        duration_s=25,
        start={"in_air": True, "run_in_s": 15},
        wind={"velocity_mps": [3.0, -4.0, 0.0]},
        expect=[{"metric": "error_x_m.max", "from_s": 20, "below": 0.1}],
    )
    assert summary.held


@pytest.fixture(scope="module")
def left(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the run directory of a short flight in which a vehicle hangs for a second."""
    run = tmp_path_factory.mktemp("flight") / "run"
    fault = {"kind": "freeze", "vehicles": [2], "at_s": 1.0, "until_s": 2.0}
    keys = scenario(duration_s=5, expect=[{"metric": "error_x_m.max", "below": 1.0}], faults=[fault])
    gcs_formation.run(keys, clock="virtual", out=run)
    return run


def test_pymavlink_reads_every_frame_of_the_log(left: Path) -> None:
    summary = json.loads((left / "summary.json").read_text())
    log = mavutil.mavlink_connection(str(left / "flight.tlog"), dialect="ardupilotmega")
    frames, stamps = 0, [0.0]
    while (message := log.recv_match()) is not None:
        assert message.get_type() != "BAD_DATA"
        frames += 1
        stamps.append(message._timestamp)
    log.close()
    assert stamps == sorted(stamps)
    assert frames == sum(link["frames_in"] + link["frames_out"] for link in summary["links"].values())


def test_what_a_run_leaves_is_as_documented(left: Path) -> None:
    summary_schema = json.loads((DOCS / "summary.schema.json").read_text())
    jsonschema.validate(json.loads((left / "summary.json").read_text()), summary_schema)
    event_schema = json.loads((DOCS / "events.schema.json").read_text())
    for line in (left / "events.jsonl").read_text().splitlines():
        jsonschema.validate(json.loads(line), event_schema)
    described = (DOCS / "timeseries.md").read_text()
    for column in read_parquet(left / "timeseries.parquet"):
        known = (column, column.removeprefix("law_error"), column.removeprefix("error"), column.split("_", 1)[-1])
        assert any(f"`{name}`" in described for name in known) or column.startswith(("kp_", "ki_", "kd_"))


@pytest.mark.slow
def test_take_off_assembly_and_a_stack_of_circles_at_the_end(fly: Fly, tmp_path: Path) -> None:
    low = {"speed_mps": 22, "waypoints_m": [[0, 0, 60], [2000, 0, 60]]}
    seldom = {"telemetry": {"rate_hz": 5}, "law": {"rate_hz": 5}}
    summary = fly(duration_s=5, start={"in_air": False}, finish={"loiter_s": 5}, path=low, **seldom)
    assert max(worst(summary, "max")) < 0.5
    events = [json.loads(line) for line in (tmp_path / "run" / "events.jsonl").read_text().splitlines()]
    modes = [event["text"] for event in events if event["kind"] == "mode" and event["vehicle"] == "2"]
    assert modes == ["INITIALISING", "MANUAL", "TAKEOFF", "GUIDED", "LOITER"]
    log = mavutil.mavlink_connection(str(tmp_path / "run" / "flight.tlog"), dialect="ardupilotmega")
    heights: dict[int, float] = {}
    while (message := log.recv_match(type="GLOBAL_POSITION_INT")) is not None:
        heights[message.get_srcSystem()] = message.alt / 1e3
    log.close()
    assert min(abs(a - b) for i, a in heights.items() for j, b in heights.items() if i < j) > 10.0


@pytest.mark.slow
def test_an_expectation_that_is_broken_fails_the_run_and_says_so(fly: Fly) -> None:
    summary = fly(duration_s=5, expect=[{"metric": "min_separation_m", "above": 1000.0}])
    assert not summary.held
    assert "found 42.4" in str(summary.verdicts[0])
    assert str(summary.verdicts[0]).endswith("broken")


@pytest.mark.slow
def test_a_separation_below_the_limit_fails_the_run(fly: Fly) -> None:
    summary = fly(
        duration_s=5,
        formation={"shape": "custom", "slots_m": {2: [-30, 0, 0], 3: [-30, 6, 0]}},
        safety={"separation_m": 5.9},
    )
    assert summary.breaches == ()
    assert summary.to_dict()["safety"]["violations"] == 0


@pytest.mark.slow
def test_a_virtual_leader_flies_the_path(fly: Fly) -> None:
    vehicles = [{"id": 2}, {"id": 3}]
    slots = {"shape": "custom", "slots_m": {2: [-20, 20, 0], 3: [-20, -20, 0]}}
    summary = fly(duration_s=12, vehicles=vehicles, formation=slots)
    assert max(worst(summary, "max")) < 1.0


def test_two_networks_hold_the_same_system_ids_apart(fly: Fly) -> None:
    vehicles = [{"id": 1, "role": "leader"}, {"id": 2}, {"id": 2, "network": 2}]
    summary = fly(duration_s=6, vehicles=vehicles)
    assert set(summary.to_dict()["followers"]) == {"2", "2:2"}
    assert max(worst(summary, "max")) < 0.05


@pytest.mark.slow
def test_clocks_that_are_off_do_not_matter(fly: Fly) -> None:
    vehicles = [
        {"id": 1, "role": "leader", "clock": {"offset_s": 1000.0, "drift_ppm": 50}},
        {"id": 2, "clock": {"offset_s": 5.0, "drift_ppm": -50}},
    ]
    assert max(worst(fly(duration_s=20, vehicles=vehicles), "max")) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["line", "diamond"])
def test_slots_in_the_followers_own_frame_are_kept_in_bends_and_beside_the_leader(fly: Fly, shape: str) -> None:
    """A slot is towed: it turns x_rc / v later than the leader; beside the leader only the law damps it."""
    weave = [[600.0 * i, 250.0 * math.sin(0.9 * i), 100.0] for i in range(6)]
    summary = fly(
        duration_s=50,
        start={"in_air": True, "run_in_s": 6, "offset_m": [8, 6, 4]},
        formation={"shape": shape, "spacing_m": 40, "frame": "follower_heading"},
        vehicles={"count": 4},
        path={"speed_mps": 22, "waypoints_m": weave},
    )
    followers = summary.to_dict()["followers"].values()
    assert all(follower["settled_at_s"] < 40 for follower in followers)
    assert all(follower["left_at_s"] is None for follower in followers)


@pytest.mark.slow
def test_who_led_meanwhile_is_settled_by_what_it_flies_afterwards(fly: Fly) -> None:
    """It follows for 4 s, fewer than the 10 s for settling, and follows again from 20 s on."""
    changes = [{"at_s": 4, "leader": 2}, {"at_s": 20, "leader": 1}]
    summary = fly(duration_s=60, vehicles={"count": 3}, formation={"shape": "diamond", "changes": changes})
    assert summary.to_dict()["followers"]["2"]["settled_at_s"] >= 20.0


def test_a_virtual_leader_flies_its_speed_whatever_the_delay(fly: Fly) -> None:
    """Its setpoints act when its followers' do. It used to gain the delay at each tick: 22 m/s became 66."""
    vehicles = [{"id": 2}, {"id": 3}]
    start = {"in_air": True, "run_in_s": 40}
    summary = fly(duration_s=12, vehicles=vehicles, start=start, links={"default": {"delay_ms": 200}})
    assert max(worst(summary, "max")) < 0.1
    flown = read_parquet(summary.run_dir / "timeseries.parquet")
    flight = (flown["vehicle"] == 2) & (flown["mission_time_s"] >= 2.0) & (flown["mission_time_s"] <= 12.0)
    north_m, time_s = flown["north_m"][flight], flown["mission_time_s"][flight]
    assert np.ptp(north_m) / np.ptp(time_s) == pytest.approx(22.0, abs=0.05)


@pytest.mark.parametrize(
    "delay_ms", [pytest.param(0, marks=pytest.mark.slow), pytest.param(100, marks=pytest.mark.slow), 300]
)
def test_behind_a_virtual_leader_none_is_ahead_or_behind_whatever_the_delay(fly: Fly, delay_ms: float) -> None:
    """Its place is of the station's clock, theirs of the clocks that round trips tell: 3 ms off would be 6.3 cm."""
    start, links = {"in_air": True, "run_in_s": 40}, {"default": {"delay_ms": delay_ms}}
    summary = fly(duration_s=10, vehicles=[{"id": 2}, {"id": 3}], start=start, links=links)
    flown = read_parquet(summary.run_dir / "timeseries.parquet")
    flight = (flown["mission_time_s"] >= 2.0) & (flown["mission_time_s"] <= 10.0)
    for vehicle in (2, 3):
        assert abs(np.nanmean(flown["error_x_m"][flight & (flown["vehicle"] == vehicle)])) < 0.01


def test_behind_a_virtual_leader_errors_are_by_truth_as_behind_any_other(fly: Fly) -> None:
    """An unobservable split of the delay puts all of them behind by half of it, which the law doesn't see."""
    slots = {"shape": "custom", "slots_m": {2: [-20, 20, 0], 3: [-20, -20, 0]}}
    links = {"default": {"uplink": {"delay_ms": 300}, "downlink": {"delay_ms": 100}}}
    start = {"in_air": True, "run_in_s": 20}
    summary = fly(duration_s=20, vehicles=[{"id": 2}, {"id": 3}], start=start, formation=slots, links=links)
    flown = read_parquet(summary.run_dir / "timeseries.parquet")
    late = (flown["mission_time_s"] >= 10.0) & (flown["phase"] == PHASES.index("flying"))
    np.testing.assert_allclose(flown["error_x_m"][late], 22.0 * 0.1, atol=0.1)
    np.testing.assert_allclose(flown["error_y_m"][late], 0.0, atol=0.05)
    assert np.abs(flown["law_error_x_m"][late]).max() < 0.05
    north_m = flown["leader_north_m"][late] + 20.0 * np.sin(flown["leader_heading_rad"][late])
    assert np.isfinite(north_m).all()
