"""Emulated vehicles that stand in for real autopilots."""

from __future__ import annotations

import pytest

from formation_scenario import Scenario, load_scenario
from sim_vehicles.config import stand_ins
from tests.flights.conftest import scenario
from tests.sim_vehicles.conftest import mavlink

PATH = {"waypoints_m": [[0, 0, 100], [900, 0, 100]]}


def of_families(*autopilots: str) -> Scenario:
    vehicles = [{"id": number, "role": "follower"} for number in range(1, len(autopilots) + 1)]
    vehicles[0]["role"] = "leader"
    planned = load_scenario(scenario(vehicles=vehicles))
    each = zip(planned.vehicles, autopilots, strict=True)
    return planned.model_copy(
        update={"vehicles": tuple(one.model_copy(update={"autopilot": family}) for one, family in each)}
    )


def test_it_is_said_which_real_vehicles_are_emulated() -> None:
    assert stand_ins(of_families("emulator", "emulator", "emulator")) == ""
    assert stand_ins(of_families("emulator", "arduplane", "emulator")) == "vehicle 2 (arduplane) is emulated"
    reported = "vehicle 1 (arduplane), vehicle 3 (arduplane) are emulated"
    assert stand_ins(of_families("arduplane", "emulator", "arduplane")) == reported


@pytest.mark.parametrize(
    ("autopilot", "armed", "disarmed"),
    [
        ("arduplane", "Throttle armed", "Throttle disarmed"),
        ("arducopter", "Arming motors", "Disarming motors"),
        ("px4", "Armed by external command", "Disarmed"),
    ],
)
def test_arming_and_disarming_are_said_in_its_own_words_and_once(make_air, autopilot, armed, disarmed):
    keys = {"count": 1, "autopilot": autopilot} | ({"model": "px4_copter"} if autopilot == "px4" else {})
    speed = {"speed_mps": 22 if autopilot == "arduplane" else 5}
    air = make_air(in_air=False, model=load_scenario({"vehicles": keys, "path": PATH | speed}).vehicles[0].model)
    air.ground.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    air.run(5.0)
    for order in (1, 1, 0, 0):
        assert air.command_long(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, order) == mavlink.MAV_RESULT_ACCEPTED
    said = [(each.severity, each.text) for each in air.ground.of("STATUSTEXT")]
    assert said == [(mavlink.MAV_SEVERITY_INFO, armed), (mavlink.MAV_SEVERITY_INFO, disarmed)]


def test_flags_of_heartbeats_tell_by_whom_an_ardupilot_is_flown(flying, make_air):
    for mode, flags in ((0, 81), (5, 81), (7, 81), (11, 89), (12, 89), (15, 89)):
        flying.set_mode(mode)
        assert flying.ground.of("HEARTBEAT")[-1].base_mode == flags | mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    keys = {"count": 1, "autopilot": "arducopter"}
    model = load_scenario({"vehicles": keys, "path": PATH | {"speed_mps": 5}}).vehicles[0].model
    air = make_air(model=model)
    air.run(2.0)
    for mode, flags in ((0, 81), (2, 81), (5, 89), (6, 89), (9, 89), (17, 89), (4, 89)):
        air.set_mode(mode)
        assert air.ground.of("HEARTBEAT")[-1].base_mode == flags | mavlink.MAV_MODE_FLAG_SAFETY_ARMED
