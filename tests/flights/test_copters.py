"""Emulated ArduCopters in formation: they take off, stop, change shape while hovering, turn and land."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
import yaml

import gcs_formation
from formation_scenario import load_scenario
from formation_scenario.feasibility import refused_orders
from gcs_formation.app.check_warnings import doomed_orders
from tests.flights.conftest import scenario
from tests.flights.in_memory import World

CONFIG = Path(__file__).parents[2] / "configs" / "arducopter.yaml"
FAMILY = "arducopter"


def events(directory: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in (directory / "events.jsonl").read_text().splitlines()]


@pytest.mark.slow
def test_they_keep_their_slots_through_stops_and_changes(tmp_path):
    flown = gcs_formation.run(CONFIG, clock="virtual", out=tmp_path / "run").to_dict()
    assert all(each["held"] for each in flown["expect"])
    for follower in flown["followers"].values():
        assert max(follower[axis]["rms"] for axis in ("error_x_m", "error_y_m", "error_z_m")) < 0.1
        assert max(follower[axis]["max"] for axis in ("error_x_m", "error_y_m", "error_z_m")) < 0.6
    assert flown["safety"]["min_separation_m"] > 8.0
    reported = events(tmp_path / "run")
    assert [each["text"] for each in reported if each["kind"] == "order"] == [
        "speed 0: accepted",
        "shape line 12: accepted",
        "speed 5: accepted",
        "shape square: accepted",
        "speed 0: accepted",
        "speed 5: accepted",
    ]
    assert not [each for each in reported if each["kind"] in ("disobeys", "separation", "unacknowledged")]


@pytest.mark.slow
@pytest.mark.parametrize(("shape", "other", "spacing_m"), [("plus", "line", 12), ("circle", "triangle", 13)])
def test_none_manoeuvres_in_a_change_that_is_planned(shape, other, spacing_m, tmp_path):
    """They pass at 0.6 of the slots' distance or more, which is closer than the rule keeps: they evaded for ever."""
    keys = {
        "start": {"in_air": True},
        "duration_s": 70,
        "vehicles": {"count": 5, "autopilot": FAMILY},
        "path": {"speed_mps": 5, "waypoints_m": [[0, 0, 40], [2000, 0, 40]]},
        "formation": {"shape": shape, "spacing_m": spacing_m, "changes": [{"at_s": 10, "shape": other}]},
    }
    flown = gcs_formation.run(keys, clock="virtual", out=tmp_path / "run").to_dict()
    assert not [each for each in events(tmp_path / "run") if each["kind"] == "separation"]
    assert flown["safety"]["min_separation_m"] > 0.6 * spacing_m
    assert all(follower["in_slot_share"] == 1.0 for follower in flown["followers"].values())


@pytest.mark.slow
@pytest.mark.parametrize("ends", [{"duration_s": 12}, {"orders": [{"at_s": 12, "order": "loiter"}]}])
def test_they_stop_together_before_they_are_left_alone(ends, tmp_path):
    """One receives the command to brake 0.8 s after the others: it used to fly 6 m on, into the one ahead of it."""
    keys = {
        "start": {"in_air": True, "run_in_s": 6},
        "duration_s": 30,
        "vehicles": {"count": 3, "autopilot": FAMILY},
        "path": {"speed_mps": 7, "waypoints_m": [[0, 0, 40], [2000, 0, 40]]},
        "formation": {"shape": "follower", "spacing_m": 8},
        "links": {"changes": [{"at_s": 2, "vehicles": [2], "delay_ms": 800}]},
        "safety": {"separation_m": 4},
    }
    flown = gcs_formation.run(keys | ends, clock="virtual", out=tmp_path / "run").to_dict()
    assert flown["safety"]["min_separation_m"] > 6.5
    phases = [each for each in events(tmp_path / "run") if each["kind"] == "phase"]
    began: dict[object, Any] = {each["text"]: each["t_s"] for each in phases}
    assert 2.0 < began["loitering"] - began["ending"] < 15.0


@pytest.mark.slow
def test_they_stand_through_gusts_while_they_stand(tmp_path):
    keys = yaml.safe_load(CONFIG.read_text()) | {
        "start": {"in_air": True, "run_in_s": 6, "offset_m": [2, -1, 1]},
        "duration_s": 45,
        "orders": [{"at_s": 10, "order": "speed 0"}],
        "disturbances": [{"at_s": 25, "velocity_mps": [1.0, -1.0, 0.0], "vehicles": [2, 3]}],
        "wind": {"velocity_mps": [4.0, 3.0, 0.0]},
        "expect": [{"metric": "error_x_m.max", "from_s": 35, "to_s": 45, "below": 0.1}],
    }
    flown = gcs_formation.run(keys, clock="virtual", out=tmp_path / "run").to_dict()
    assert all(each["held"] for each in flown["expect"])


@pytest.mark.slow
def test_another_leads_those_that_stand_by_order_or_where_the_leader_is_lost(tmp_path):
    """They set out 35 s after it was lost: for 30 s it may still hover where it was, and is avoided."""
    keys = yaml.safe_load(CONFIG.read_text()) | {
        "start": {"in_air": True, "run_in_s": 6},
        "duration_s": 95,
        "orders": [
            {"at_s": 20, "order": "speed 0"},
            {"at_s": 30, "order": "leader 3"},
            {"at_s": 80, "order": "speed 5"},
        ],
        "faults": [{"at_s": 45, "vehicles": [3], "kind": "crash"}],
        "expect": [],
    }
    flown = gcs_formation.run(keys, clock="virtual", out=tmp_path / "run").to_dict()
    led = [each for each in events(tmp_path / "run") if each["kind"] == "leader"]
    assert len(led) == 2
    assert led[0]["vehicle"] == "3"
    assert not flown["undone"]
    assert flown["safety"]["min_separation_m"] > 7.0
    for follower in flown["followers"].values():
        assert max(follower[axis]["max"] for axis in ("error_x_m", "error_y_m")) < 0.6


@pytest.mark.slow
def test_they_turn_on_the_spot_and_are_let_go_along_their_path_alone(tmp_path):
    keys = yaml.safe_load(CONFIG.read_text()) | {
        "start": {"in_air": True, "run_in_s": 6},
        "duration_s": 80,
        "orders": [
            {"at_s": 10, "order": "heading 90"},
            {"at_s": 10, "order": "speed 0"},
            {"at_s": 18, "order": "heading 180"},
            {"at_s": 48, "order": "speed 5"},
            {"at_s": 49, "order": "heading 0"},
            {"at_s": 75, "order": "speed 5"},
        ],
        "expect": [],
    }
    flown = gcs_formation.run(keys, clock="virtual", out=tmp_path / "run").to_dict()
    for follower in flown["followers"].values():
        assert follower["error_x_m"]["max"] < 1.5
        assert follower["error_y_m"]["max"] < 2.0
    answers = [each["text"] for each in events(tmp_path / "run") if each["kind"] == "order"]
    assert answers == [
        "heading 90: refused: found a formation that flies at 5 m/s; allowed: after `speed 0`",
        "speed 0: accepted",
        "heading 180: accepted",
        answers[3],
        "heading 0: accepted",
        "speed 5: accepted",
    ]
    assert str(answers[3]).startswith("speed 5: refused: the formation faces 17")
    rows = pq.read_table(tmp_path / "run" / "timeseries.parquet").to_pylist()
    faces = [row["heading_rad"] for row in rows if row["vehicle"] == 1 and 47.0 < (row["mission_time_s"] or 0.0) < 48.0]
    assert math.cos(faces[0] - math.pi) > 0.999
    behind = [row for row in rows if row["vehicle"] == 4 and 47.0 < (row["mission_time_s"] or 0.0) < 48.0]
    leader = [row for row in rows if row["vehicle"] == 1 and 47.0 < (row["mission_time_s"] or 0.0) < 48.0]
    assert behind[0]["north_m"] - leader[0]["north_m"] == pytest.approx(24.0, abs=0.5)


@pytest.mark.slow
@pytest.mark.parametrize(("north_mps", "east_mps"), [(-1.5, 0.0), (0.0, 1.5)])
def test_a_gust_that_pushes_a_standing_leader_doesnt_swing_the_formation_round(north_mps, east_mps, tmp_path):
    """If slots followed its course, followers would fly up to 48 m away from where they hovered."""
    keys = yaml.safe_load(CONFIG.read_text()) | {
        "start": {"in_air": True, "run_in_s": 6, "offset_m": [0, 0, 0]},
        "duration_s": 40,
        "orders": [{"at_s": 10, "order": "speed 0"}],
        "disturbances": [{"at_s": 25, "velocity_mps": [north_mps, east_mps, 0.0], "vehicles": [1]}],
        "expect": [],
    }
    flown = gcs_formation.run(keys, clock="virtual", out=tmp_path / "run").to_dict()
    for follower in flown["followers"].values():
        assert follower["error_x_m"]["max"] < 4.0
        assert follower["error_y_m"]["max"] < 6.5


def test_the_families_differ_in_a_word_and_in_nothing_else():
    keys = yaml.safe_load(CONFIG.read_text())
    real = load_scenario(keys)
    for vehicle in keys["vehicles"]:
        vehicle |= {"autopilot": "emulator", "model": FAMILY}
    emulated = load_scenario(keys)
    same = [each.model_copy(update={"autopilot": FAMILY}) for each in emulated.vehicles]
    assert emulated.model_copy(update={"vehicles": tuple(same)}) == real


def test_planes_may_not_stand():
    keys = {
        "vehicles": {"count": 2},
        "duration_s": 6,
        "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [900, 0, 100]]},
        "orders": [{"at_s": 2, "order": "speed 0"}],
    }
    ((_, reason),) = refused_orders(load_scenario(keys))
    assert reason.startswith("found 0 m/s; allowed: 16 to 28 m/s")


STANDING: dict[str, Any] = {
    "vehicles": {"count": 2, "model": FAMILY},
    "path": {"speed_mps": 5, "waypoints_m": [[0, 0, 40], [1000, 0, 40]]},
    "formation": {"spacing_m": 12},
}


def test_what_will_be_refused_of_those_that_hover_is_reported_before_the_flight():
    orders = [
        "heading 90",
        "speed 0",
        "heading 90",
        "speed 4",
        "heading 10",
        "speed 4",
        "heading 20",
        "speed 4",
        "speed 99",
    ]
    planned = [{"at_s": 10 * n, "order": order} for n, order in enumerate(orders, 1)]
    reported = list(doomed_orders(load_scenario(STANDING | {"orders": planned, "duration_s": 100})))
    assert reported == [
        "orders.0: 'heading 90' will be refused: found a formation that flies at 5 m/s; allowed: after `speed 0`",
        "orders.3: 'speed 4' will be refused: the formation faces 90° off its path; allowed: up to 15°, by `heading 0` "
        "first",
        "orders.6: 'heading 20' will be refused: found a formation that flies at 4 m/s; allowed: after `speed 0`",
        "orders.8: 'speed 99' will be refused: found 99 m/s; allowed: 0 to 9 m/s, leader 1's limits",
    ]
    ends = [{"at_s": 10, "order": "rtl"}, {"at_s": 20, "order": "land"}]
    assert list(doomed_orders(load_scenario(STANDING | {"orders": ends}))) == []


def test_they_are_refused_in_flight_with_the_same_words():
    world = World(**STANDING, start={"in_air": True, "run_in_s": 6})
    world.fly_to(1.0)
    texts = ("heading 90", "speed 0", "heading 90", "speed 4")
    answers = [world.station.orders.execute(text, world.clock.now()).text for text in texts]
    assert answers == [
        "heading 90: refused: found a formation that flies at 5 m/s; allowed: after `speed 0`",
        "speed 0: accepted",
        "heading 90: accepted",
        "speed 4: refused: the formation faces 90° off its path; allowed: up to 15°, by `heading 0` first",
    ]


def test_aircraft_that_may_be_able_to_land_are_not_reported_as_unable():
    keys = scenario(orders=[{"at_s": 5, "order": "land"}])
    assert list(doomed_orders(load_scenario(keys))) == []


def test_another_leads_only_when_a_turn_on_the_spot_is_over():
    """During a turn, noses of followers turn with their motion: slots relative to one of them were 15 m off."""
    world = World(
        vehicles={"count": 3, "model": FAMILY},
        path={"speed_mps": 5, "waypoints_m": [[0, 0, 40], [1000, 0, 40]]},
        formation={"shape": "diamond", "spacing_m": 12},
        start={"in_air": True, "run_in_s": 6},
    )
    world.fly_to(1.0)
    orders = world.station.orders
    assert orders.execute("speed 0", world.clock.now()).accepted
    world.run(5.0)
    assert orders.execute("heading 30", world.clock.now()).accepted
    world.run(1.0)
    said = "leader 3: refused: the formation turns on the spot; allowed: another leader once it hovers"
    assert orders.execute("leader 3", world.clock.now()).text == said
    world.run(8.0)
    assert orders.execute("leader 3", world.clock.now()).accepted
    world.run(3.0)
    assert world.worst_m() < 0.7


@pytest.mark.parametrize(
    ("model", "delay_ms"),
    [
        pytest.param(FAMILY, 0, marks=pytest.mark.slow),
        ({"hovers": True, "speed_min_mps": 0, "speed_max_mps": 12, "tau_v_s": 0.8, "accel_max_mps2": 3}, 300),
    ],
)
@pytest.mark.parametrize("above_m", [2.0, 8.0])
def test_heights_settle_from_any_start_although_they_climb_with_1_mps2_only(
    model: str | dict[str, object], delay_ms: float, above_m: float, tmp_path: Path
) -> None:
    """They swung by 1.2 m for good, and by 7 m with height lags that aren't the shipped models'."""
    keys = {
        "start": {"in_air": True, "run_in_s": 6, "offset_m": [0, 0, above_m], "tolerance_m": 20},
        "duration_s": 45,
        "finish": {"loiter_s": 0},
        "vehicles": {"count": 2, "model": model},
        "path": {"speed_mps": 4, "waypoints_m": [[0, 0, 40], [2000, 0, 40]]},
        "formation": {"shape": "follower", "spacing_m": 15},
        "links": {"default": {"delay_ms": delay_ms}},
        "expect": [{"metric": "error_z_m.max", "from_s": 35, "below": 0.1}],
    }
    flown = gcs_formation.run(keys, clock="virtual", out=tmp_path / "run").to_dict()
    assert [(each["value"], each["held"]) for each in flown["expect"] if not each["held"]] == []
