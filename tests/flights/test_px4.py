"""Emulated PX4s in formation, alone and with others: what commanding them requires of the station."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import gcs_formation
from airlink import mavlink as m
from airlink.clock import Instant
from airlink.engine import Datagram
from airlink.frame import HEADER_V2
from airlink.stream_parser import StreamParser
from formation_scenario import load_scenario
from gcs_formation.app.check import check_text
from sim_vehicles.autopilot.modes_and_failsafe import Px4Mode
from tests.flights.conftest import scenario
from tests.flights.in_memory import Between, World

ROOT = Path(__file__).parents[2]
CONFIGS = ROOT / "configs"
PX4_COPTER = {"autopilot": "emulator", "model": "px4_copter"}
HOVERS: dict[str, Any] = {
    "vehicles": {"count": 3} | PX4_COPTER,
    "formation": {"shape": "arrow", "spacing_m": 12},
    "path": {"speed_mps": 5, "waypoints_m": [[0, 0, 50], [300, 0, 50]]},
    "safety": {"separation_m": 3, "clearance_m": 5},
}
PX4_MODEL: dict[str, Any] = yaml.safe_load((ROOT / "formation_scenario" / "aircraft" / "px4.yaml").read_text())["model"]
SLOW_PATH = {"speed_mps": 17, "waypoints_m": [[0, 0, 100], [2000, 0, 100]]}
MIXED: list[dict[str, Any]] = [
    {"id": 1, "role": "leader", "autopilot": "arduplane"},
    {"id": 2, "autopilot": "px4"},
    {"id": 3},
]


class Listener(Between):
    """Keeps the ids of all messages sent to vehicles."""

    def __init__(self, fleet: Any) -> None:
        super().__init__(fleet)
        self.parser, self.ids = StreamParser(), list[int]()

    def take(self, datagram: Datagram, now: Instant) -> None:
        self.ids += [frame.message_id for frame in self.parser.feed(datagram.data)]
        super().take(datagram, now)


class Jammed(Between):
    """Setpoints no longer reach the last vehicle once `since` has passed."""

    since = Instant(2**62)

    def take(self, datagram: Datagram, now: Instant) -> None:
        setpoint = m.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED.to_bytes(3, "little")
        if now < self.since or datagram.socket != 2 or datagram.data[HEADER_V2 - 3 : HEADER_V2] != setpoint:
            super().take(datagram, now)


def test_one_that_leaves_offboard_by_its_failsafe_is_not_said_to_be_its_pilot_s() -> None:
    world = World(Jammed, **HOVERS)
    world.fly_to(2.0)
    assert isinstance(world.between, Jammed)
    world.between.since = world.clock.now()
    world.run(3.0)
    assert world.vehicle(3).mode is Px4Mode.RTL
    assert world.words("member")[3:] == ["parted by its failsafe: 'Offboard control signal lost'"]


@pytest.mark.parametrize(("config", "model"), [("px4", "px4"), ("px4_copter", "px4_copter")])
def test_emulated_and_real_differ_in_a_word_and_in_nothing_else(config, model):
    keys = yaml.safe_load((CONFIGS / f"{config}.yaml").read_text())
    real = load_scenario(keys)
    for vehicle in keys["vehicles"]:
        vehicle |= {"autopilot": "emulator", "model": model}
    emulated = load_scenario(keys)
    same = [each.model_copy(update={"autopilot": "px4"}) for each in emulated.vehicles]
    assert emulated.model_copy(update={"vehicles": tuple(same)}).vehicles == real.vehicles


@pytest.mark.slow
def test_the_shipped_fixed_wings_are_not_said_to_disobey_while_their_airspeed_settles(tmp_path):
    """After a climb at full throttle it flies 1 m/s too slowly for a minute, until its integrator has settled."""
    gcs_formation.run(CONFIGS / "px4.yaml", clock="virtual", out=tmp_path, until=20.0)
    events = [json.loads(line) for line in (tmp_path / "events.jsonl").read_text().splitlines()]
    assert [each["text"] for each in events if each["kind"] in {"disobeys", "obeys"}] == []


@pytest.mark.slow
def test_multirotors_follow_in_offboard_with_clocks_that_are_late_by_14_ms_a_second():
    """PX4's simulator has such a clock. No SYSTEM_TIME is sent, because PX4 would set its host's clock by it."""
    late: dict[str, Any] = {"vehicles": {"count": 3, "clock": {"drift_ppm": -14000}} | PX4_COPTER}
    world = World(Listener, **(HOVERS | late))
    world.fly_to(25.0)
    assert world.worst_m(from_s=8.0) < 0.15
    assert {world.vehicle(number).mode for number in (1, 2, 3)} == {Px4Mode.OFFBOARD}
    received = world.between
    assert isinstance(received, Listener)
    assert m.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED in received.ids
    assert m.MAVLINK_MSG_ID_SYSTEM_TIME not in received.ids


@pytest.mark.slow
def test_a_stream_that_stops_for_two_seconds_is_taken_up_again_by_everybody():
    """Without setpoints for longer than COM_OF_LOSS_T a PX4 returns home; when they resume it is in OFFBOARD again."""
    world = World(**HOVERS)
    world.fly_to(10.0)
    world.process.stop(world.clock.now(), 2.0)
    world.run(1.9)
    assert {world.vehicle(number).mode for number in (1, 2, 3)} == {Px4Mode.RTL}
    world.run(3.0)
    assert {world.vehicle(number).mode for number in (1, 2, 3)} == {Px4Mode.OFFBOARD}
    begun_s = world.station.flight.mission_time_s(world.clock.now())
    world.run(15.0)
    assert world.worst_m(from_s=begun_s + 12.0) < 0.3


@pytest.mark.parametrize("share", [0.55, *(pytest.param(share, marks=pytest.mark.slow) for share in (0.4, 0.75))])
def test_fixed_wings_that_leave_half_of_a_change_of_airspeed_to_an_integrator_keep_their_slots(share):
    """Their commanded changes are larger for it. The leader changes speed, and some aircraft have another share."""
    steps = [{"at_s": 2.0, "for_s": 12.0, "speed_mps": 1.5}, {"at_s": 14.0, "for_s": 12.0, "speed_mps": -1.5}]
    world = World(
        vehicles={
            "count": 3,
            "autopilot": "emulator",
            "model": "px4",
            "true_model": PX4_MODEL | {"prompt_share": share},
        },
        path={"speed_mps": 14, "waypoints_m": [[0, 0, 100], [1000, 0, 100]], "steps": steps},
    )
    world.run(30.0)
    assert np.nanmax([np.abs(tick.state[0].airspeed_mps - 14.0) for tick in world.recorder.ticks]) > 1.0
    assert world.worst_m(from_s=0.0) < (0.1 if share == 0.55 else 1.0)


@pytest.mark.slow
def test_fixed_wings_of_three_families_fly_in_one_formation():
    world = World(vehicles=MIXED, path=SLOW_PATH)
    world.run(40.0)
    assert world.vehicle(2).mode is Px4Mode.HOLD
    assert world.worst_m(from_s=15.0) < 0.5
    assert world.words("disobeys") == []


@pytest.mark.slow
def test_multirotors_of_two_firmwares_fly_in_one_formation():
    """They set out 30 s before their path: the PX4, which takes setpoints 1 s after the others, catches up."""
    families: list[dict[str, Any]] = [
        {"id": 1, "role": "leader", "autopilot": "arducopter"},
        {"id": 2} | PX4_COPTER,
        {"id": 3, "model": "arducopter"},
    ]
    keys: dict[str, Any] = HOVERS | {"vehicles": families, "start": {"in_air": True, "run_in_s": 30}}
    world = World(**keys)
    world.fly_to(25.0)
    assert [vehicle.mav_type for vehicle in world.fleet.vehicles] == [m.MAV_TYPE_QUADROTOR] * 3
    assert world.vehicle(2).mode is Px4Mode.OFFBOARD
    assert world.worst_m(from_s=8.0) < 0.15


def test_check_says_whose_limits_bound_a_formation_of_several_kinds():
    mixed = check_text(load_scenario(scenario(vehicles=MIXED, path=SLOW_PATH)))
    assert "what all vehicles can fly: 16 m/s (vehicle 3) to 20 m/s (vehicle 2), climbs of 2 m/s (vehicle 2)" in mixed
    assert "what all vehicles can fly" not in check_text(load_scenario(scenario()))
