"""The ground station against the real autopilot: two simulated ArduPlanes, through the same start-up as the emulators.

Set ARDUPLANE_SITL to the path of ArduPilot's `arduplane` binary for SITL to run it.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

from airlink import mavlink as m
from tests.processes import events_of
from tests.real.simulators import ARDUPLANE, acknowledgements, flown, needs

pytestmark = needs("ARDUPLANE_SITL", "an arduplane SITL binary")

SPEEDUP = 3
METRES_A_DEGREE = 111_200.0
APART_M = ARDUPLANE.apart_deg * METRES_A_DEGREE * math.cos(math.radians(35.0))
MODEL = {
    "tau_v_s": 4.0,
    "tau_psi_s": 3.4,
    "tau_ha_s": 1.5,
    "tau_hb_s": 2.0,
    "speed_min_mps": 14,
    "speed_max_mps": 29,
    "accel_max_mps2": 1.0,
    "turn_rate_max_rps": 0.25,
    "climb_max_mps": 3.0,
}
LAW = {
    "mixer": {"k_v": 0.0},
    "speed": {"kp": 0.15, "ki": 0.01, "kd": 0.0},
    "heading": {"kp": 1.0, "ki": 0.05, "kd": 1.5},
    "height": {"kp": 0.1, "ki": 0.04, "kd": 0.0},
    "anti_windup_s": 20,
    "disturbance_observer_radps": 0.2,
}
SCENARIO = {
    "schema": 1,
    "name": "real",
    "duration_s": 40,
    "start": {"run_in_s": 50, "tolerance_m": 6},
    "vehicles": [
        {"id": 1, "role": "leader", "autopilot": "arduplane", "model": MODEL},
        {"id": 2, "role": "follower", "autopilot": "arduplane", "model": MODEL},
    ],
    "formation": {"shape": "diamond", "spacing_m": 40},
    "law": LAW,
    "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 80], [700, 0, 80], [1400, 150, 85]]},
    "finish": {"loiter_s": 5},
}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fly, and return the run directory."""
    return flown(ARDUPLANE, tmp_path_factory.mktemp("real"), SCENARIO, SPEEDUP)


def test_every_vehicle_goes_through_take_off_and_guided_to_loiter(run):
    events = events_of(run)
    for vehicle in ("1", "2"):
        modes = [event["text"] for event in events if event["kind"] == "mode" and event.get("vehicle") == vehicle]
        assert modes[-3:] == ["TAKEOFF", "GUIDED", "LOITER"]
    phases = [event["text"] for event in events if event["kind"] == "phase"]
    assert phases == ["assembling", "flying", "ending", "loitering", "done"]


def test_they_land_one_after_another_where_they_took_off(tmp_path):
    run = flown(ARDUPLANE, tmp_path, SCENARIO | {"orders": [{"at_s": 10, "order": "land"}]}, SPEEDUP)
    modes = [(event["vehicle"], event["text"], event["t_s"]) for event in events_of(run) if event["kind"] == "mode"]
    lands = [(who, at_s) for who, mode, at_s in modes if mode == "AUTOLAND"]
    assert sorted(who for who, _ in lands) == ["1", "2"]
    standing = places_at_the_end(run)
    for number in (1, 2):
        north_m, east_m, height_m, armed = standing[number]
        assert not armed
        assert abs(height_m) < 2.0
        assert math.hypot(north_m, east_m - (number - 1) * APART_M) < 60.0


def places_at_the_end(run: Path) -> dict[int, tuple[float, float, float, bool]]:
    """Return each vehicle's last position, m north, east and up of the first one's home, and whether it is armed."""
    log = mavutil.mavlink_connection(str(run / "flight.tlog"), dialect="ardupilotmega")
    last: dict[int, dict[str, Any]] = {1: {}, 2: {}}
    while (message := log.recv_match(type=["GLOBAL_POSITION_INT", "HEARTBEAT"])) is not None:
        last.get(message.get_srcSystem(), {})[message.get_type()] = message
    log.close()
    found: dict[int, tuple[float, float, float, bool]] = {}
    for number, told in last.items():
        place, beat = told["GLOBAL_POSITION_INT"], told["HEARTBEAT"]
        north_m = (place.lat / 1e7 - 35.0) * METRES_A_DEGREE
        east_m = (place.lon / 1e7 - 125.0) * METRES_A_DEGREE * math.cos(math.radians(35.0))
        found[number] = north_m, east_m, place.relative_alt / 1e3, bool(beat.base_mode & m.MAV_MODE_FLAG_SAFETY_ARMED)
    return found


def test_the_autopilot_refuses_nothing(run):
    counts = acknowledgements(run)
    assert {result for _, result in counts} == {m.MAV_RESULT_ACCEPTED}
    guided = [counts[command, m.MAV_RESULT_ACCEPTED] for command in (43000, 43001, 43002)]
    assert min(guided) > 1000


def test_the_follower_keeps_its_slot(run):
    summary = json.loads((run / "summary.json").read_text())
    follower = summary["followers"]["2"]
    assert follower["error_x_m"]["max"] < 8.0
    assert follower["error_y_m"]["max"] < 4.0
    assert follower["error_z_m"]["max"] < 5.0
    assert summary["safety"]["violations"] == 0


def test_none_is_said_to_disobey(run):
    events = events_of(run)
    assert [event for event in events if event["kind"] == "disobeys"] == []
