"""The formation changes in flight: by schedule, by order, and because its leader is lost."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcs_formation.record.parquet import read_parquet
from gcs_formation.record.timeseries import flying
from tests.flights.conftest import Fly

STRAIGHT = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [3000, 0, 100], [6000, 0, 100]]}
BEFORE_M = 0.2
"""Largest errors of an undisturbed formation, changes included."""


def events(tmp_path: Path, kind: str) -> list[dict[str, Any]]:
    lines = (tmp_path / "run" / "events.jsonl").read_text().splitlines()
    return [event for event in map(json.loads, lines) if event["kind"] == kind]


def begun_s(tmp_path: Path) -> float:
    return next(event["t_s"] for event in events(tmp_path, "phase") if event["text"] == "flying")


def columns_of(tmp_path: Path, vehicle: int) -> dict[str, np.ndarray]:
    columns = read_parquet(tmp_path / "run" / "timeseries.parquet")
    mine = (columns["vehicle"] == vehicle) & flying(columns)
    return {name: values[mine] for name, values in columns.items()}


@pytest.mark.slow
def test_slots_change_without_errors_or_any_near(fly: Fly) -> None:
    changes = [{"at_s": 5, "shape": "line"}, {"at_s": 35, "shape": "circle"}, {"at_s": 60, "shape": "square"}]
    summary = fly(
        duration_s=90,
        vehicles={"count": 4},
        formation={"shape": "diamond", "changes": changes},
        start={"in_air": True, "run_in_s": 20},
        links={"default": {"delay_ms": 300}},
        path=STRAIGHT,
    ).to_dict()
    assert summary["safety"]["min_separation_m"] > 18.0
    assert max(f[f"error_{axis}_m"]["max"] for f in summary["followers"].values() for axis in "xyz") < BEFORE_M


@pytest.mark.slow
@pytest.mark.parametrize("lost", [1, 3])
def test_a_crash_breaks_no_limit_that_the_others_keep(fly: Fly, lost: int) -> None:
    """A wreck lies 0 m above the ground, and ever farther from its former followers; neither counts against them."""
    summary = fly(
        duration_s=20,
        vehicles={"count": 4},
        formation={"shape": "diamond"},
        faults=[{"at_s": 5, "vehicles": [lost], "kind": "crash"}],
        expect=[
            {"metric": "min_clearance_m", "above": 98.0},
            {"metric": "min_separation_m", "above": 25.0},
            *({"metric": f"error_{axis}_m.max", "below": 0.5} for axis in "xyz"),
        ],
    )
    assert summary.held, [*summary.breaches, *map(str, summary.verdicts)]
    assert summary.figures["safety"]["violations"] == 0


@pytest.mark.slow
def test_a_slot_that_goes_to_the_side_in_the_followers_own_frame_stays_occupied(fly: Fly) -> None:
    """It turns its own axes on the way, with a lag that changes; one of the slots moves 60 m to the side."""
    formation = {"shape": "arrow", "frame": "follower_heading", "changes": [{"at_s": 5, "shape": "square"}]}
    late = {"default": {"delay_ms": 300}}
    start = {"in_air": True, "run_in_s": 12}
    keys = {"formation": formation, "path": STRAIGHT, "links": late, "start": start}
    summary = fly(duration_s=40, vehicles={"count": 4}, **keys).to_dict()
    assert max(f[f"error_{axis}_m"]["max"] for f in summary["followers"].values() for axis in "xyz") < BEFORE_M


@pytest.mark.slow
def test_one_that_is_left_alone_is_near_none(fly: Fly) -> None:
    alone = {"metric": "min_separation_m", "from_s": 6, "above": 5.0}
    faults = [{"at_s": 5, "vehicles": [2], "kind": "crash"}]
    summary = fly(duration_s=10, vehicles={"count": 2}, faults=faults, expect=[alone]).to_dict()
    assert [(entry["value"], entry["held"]) for entry in summary["expect"]] == [(None, True)]


@pytest.mark.slow
def test_one_that_takes_over_on_its_way_to_the_side_goes_on_that_way_and_slots_far_off_are_kept(fly: Fly) -> None:
    """It moves 1.3 m/s to the right; if its nose came round at once, slots 120 m away would jump by 5 m."""
    summary = fly(
        duration_s=45,
        vehicles={"count": 6},
        path={"waypoints_m": [[0, 0, 100], [1500, 0, 100]]},
        formation={"shape": "diamond", "changes": [{"at_s": 5, "shape": "line"}, {"at_s": 17, "leader": 2}]},
    ).to_dict()
    assert max(f[f"error_{axis}_m"]["max"] for f in summary["followers"].values() for axis in "xyz") < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("law", ["fuzzy_pid", "consensus"])
def test_the_nearest_follower_takes_over_from_a_leader_that_crashes(fly: Fly, tmp_path: Path, law: str) -> None:
    summary = fly(
        duration_s=65,
        vehicles={"count": 4},
        formation={"shape": "diamond"},
        law={"type": law},
        path=STRAIGHT,
        faults=[{"at_s": 5, "vehicles": [1], "kind": "crash"}],
    ).to_dict()
    (change,) = events(tmp_path, "leader")
    assert change["vehicle"] == "2"
    assert change["t_s"] - begun_s(tmp_path) - 5 < 5.0
    assert summary["safety"]["min_separation_m"] > 25.0
    leader, third, fourth = (columns_of(tmp_path, vehicle) for vehicle in (2, 3, 4))
    late = leader["mission_time_s"] > 50
    assert leader["leads"][late].all()
    assert np.abs(leader["true_east_m"][late]).max() < 1.0  # the path's
    assert np.ptp(leader["true_north_m"][late]) > 15 * 21.5
    for follower in (third, fourth):
        assert max(np.abs(follower[f"error_{axis}_m"][late]).max() for axis in "xyz") < 0.5


@pytest.mark.slow
def test_without_succession_a_lost_leader_has_everyone_loiter(fly: Fly, tmp_path: Path) -> None:
    fly(
        duration_s=12,
        formation={"shape": "arrow", "succession": "none"},
        faults=[{"at_s": 5, "vehicles": [1], "kind": "crash"}],
    )
    assert not events(tmp_path, "leader")
    reported = {event["vehicle"] for event in events(tmp_path, "member") if event["text"] == "told to loiter"}
    assert reported == {"2", "3"}  # none follows the lost leader


@pytest.mark.slow
def test_a_leader_that_its_pilot_has_taken_comes_back_as_a_follower(fly: Fly, tmp_path: Path) -> None:
    summary = fly(
        duration_s=110,
        path=STRAIGHT,
        links={"default": {"delay_ms": 20, "jitter_ms": 2}},
        faults=[{"at_s": 10, "until_s": 14, "vehicles": [1], "kind": "pilot", "mode": "CRUISE"}],
    ).to_dict()
    (change,) = events(tmp_path, "leader")
    assert change["vehicle"] in {"2", "3"}  # depends on their links' jitter: they are equal otherwise
    own = columns_of(tmp_path, 1)
    late = own["mission_time_s"] > 100
    assert own["active"][late].all()
    assert not own["leads"][late].any()
    assert max(np.abs(own[f"error_{axis}_m"][late]).max() for axis in "xyz") < 0.5
    assert "1" in summary["followers"]
    assert (own["margin_used"][late] > 0).all(), "the loops that are watched are those of whoever follows"
    assert np.isnan(columns_of(tmp_path, int(change["vehicle"]))["margin_used"][late]).all()


@pytest.mark.parametrize(("shape", "count"), [pytest.param("arrow", 4, marks=pytest.mark.slow), ("follower", 2)])
def test_a_leader_that_hangs_is_led_to_its_new_slot_apart_from_the_others(
    fly: Fly, tmp_path: Path, shape: str, count: int
) -> None:
    """It reappears among them, ahead of its successor, and its slot is behind that one."""
    summary = fly(
        duration_s=25,
        vehicles={"count": count},
        formation={"shape": shape, "spacing_m": 30},
        path=STRAIGHT,
        faults=[{"at_s": 5, "until_s": 9, "vehicles": [1], "kind": "freeze"}],
    ).to_dict()
    assert [event["text"] for event in events(tmp_path, "formation")] == [f"{shape}, 30 m, behind vehicle 2"] * 2
    assert events(tmp_path, "separation") == []
    assert summary["safety"]["min_separation_m"] > 17.9  # 60 % of the spacing on the way
    own = columns_of(tmp_path, 1)
    late = own["mission_time_s"] > 20
    assert max(np.abs(own[f"error_{axis}_m"][late]).max() for axis in "xyz") < 0.5


@pytest.mark.slow
def test_orders_are_carried_out_or_refused_with_the_reason(fly: Fly, tmp_path: Path) -> None:
    orders = {
        5: "shape line",
        8: "speed 24",
        9: "speed 40",
        10: "speed 0",
        14: "spacing 3",
        18: "leader 3",
        19: "shape custom",
        44: "land",
        45: "rtl",
    }
    summary = fly(
        duration_s=50,
        path=STRAIGHT,
        finish={"loiter_s": 3},
        orders=[{"at_s": at_s, "order": order} for at_s, order in orders.items()],
        expect=[{"metric": "min_separation_m", "above": 17.9, "to_s": 44}],  # 60 % of the spacing on the way
    ).to_dict()
    assert [(event["accepted"], event["text"]) for event in events(tmp_path, "order")] == [
        (True, "shape line: accepted"),
        (True, "speed 24: accepted"),
        (False, "speed 40: refused: found 40 m/s; allowed: 16 to 28 m/s, leader 1's limits"),
        (False, "speed 0: refused: found 0 m/s; allowed: 16 to 28 m/s, leader 1's limits"),
        (
            False,
            "spacing 3: refused: found slots of the leader and vehicle 2 3 m apart in line; "
            "allowed: 5 m or more (safety.separation_m)",
        ),
        (True, "leader 3: accepted"),
        (False, "shape custom: refused: found no slot for vehicle 2; allowed: formation.slots_m for each follower"),
        (False, "land: refused: vehicle 1 lands where it took off, and that was not seen; allowed: rtl, loiter"),
        (True, "rtl: accepted"),
    ]
    assert [event["text"] for event in events(tmp_path, "mode")][-3:] == ["RTL"] * 3
    assert summary["duration_s"] == pytest.approx(45.0, abs=0.2)
    assert summary["expect"][0]["held"]
    assert [text.split(":")[0] for text in summary["undone"]] == [f"order at {at_s} s" for at_s in (9, 10, 14, 19, 44)]
    assert summary["safety"]["min_separation_m"] > 10.0  # on the way home
    assert max(f[f"error_{axis}_m"]["max"] for f in summary["followers"].values() for axis in "xyz") < 0.5


@pytest.mark.parametrize(("duration_s", "under_way"), [(12, True), pytest.param(30, False, marks=pytest.mark.slow)])
def test_a_change_that_the_flight_s_end_cuts_is_not_done(fly: Fly, duration_s: float, under_way: bool) -> None:
    """The change from diamond to line takes 14.7 s; until it is over the slots move, and errors say nothing of it."""
    summary = fly(
        duration_s=duration_s,
        path=STRAIGHT,
        formation={"shape": "diamond", "spacing_m": 30, "changes": [{"at_s": 5, "shape": "line"}]},
        finish={"loiter_s": 3},
    )
    said = ["the change to line, 30 m, behind vehicle 1 was under way when the flight was over"]
    assert summary.to_dict()["undone"] == (said if under_way else [])
    assert summary.held is (False if under_way else None)


def test_a_change_that_an_order_to_end_cuts_is_not_judged(fly: Fly) -> None:
    summary = fly(
        duration_s=40,
        path=STRAIGHT,
        formation={"shape": "diamond", "spacing_m": 30, "changes": [{"at_s": 5, "shape": "line"}]},
        orders=[{"at_s": 10, "order": "loiter"}],
        finish={"loiter_s": 3},
    )
    assert summary.to_dict()["undone"] == []
