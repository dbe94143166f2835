"""What can't be true of telemetry before take-off, and which field says so."""

from __future__ import annotations

import math
from typing import Any

import pytest

from airlink.messages.telemetry import Attitude
from flight_model.earth import GeodeticOrigin
from formation_scenario import load_scenario
from gcs_formation.features.telemetry_health.before_take_off import findings
from gcs_formation.mission.gate import AsFound
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.reported_motion import ReportedMotion
from gcs_formation.vehicle.telemetry import Telemetry
from tests.flights.conftest import scenario

ORIGIN = GeodeticOrigin(0.6, 2.1, 40.0)
YAW_DEG = 350.0


def motion(at_s: float = 0.0, **changed: float) -> ReportedMotion:
    """Return what one says that stands on the ground at the origin's height and heads 350 degrees."""
    made = ReportedMotion(at_s, 100.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    made.heading_rad = math.radians(YAW_DEG)
    for name, value in changed.items():
        setattr(made, name, value)
    return made


def found(now: dict[str, float], *, flies: bool = False, **seen: Any) -> list[tuple[str, bool]]:
    """Return the fields in which something is found, and whether it refuses; 5 s after a first position."""
    telemetry = Telemetry(ORIGIN)
    telemetry.motion = motion(**({"at_s": 1.5 if flies else 5.0} | now))
    telemetry.attitude = Attitude(5.0, 0.0, 0.1, math.radians(YAW_DEG), 0.0, 0.0, 0.0)
    telemetry.hud_heading_rad, telemetry.airspeed_mps = math.radians(YAW_DEG), 1.0
    telemetry.home_height_m = 0.0
    for name, value in seen.items():
        setattr(telemetry, name, value)
    first = motion(**(now if flies else {}) | {"north_m": 100.0, "height_m": now.get("height_m", 0.0)})
    autopilot = ArduPlane(1, ORIGIN, 0.25)
    every = findings(AsFound(autopilot, load_scenario(scenario()), telemetry, 16.0, first, flies))
    return [(each.text.split(":")[0], each.refuses) for each in every]


def attitude(roll_deg: float, pitch_deg: float, yaw_deg: float) -> Attitude:
    return Attitude(5.0, math.radians(roll_deg), math.radians(pitch_deg), math.radians(yaw_deg), 0.0, 0.0, 0.0)


def test_nothing_is_found_of_one_that_stands_as_it_says() -> None:
    assert found({}) == []
    assert found({}, attitude=attitude(20.0, -40.0, -8.0), hud_heading_rad=0.0) == [], "north is where 360 is"


@pytest.mark.parametrize(
    ("field", "now", "seen"),
    [
        ("relative_alt", {"above_home_m": 30.0, "height_m": 30.0}, {}),
        ("vx, vy", {"north_mps": 2.5, "east_mps": -2.5}, {}),
        ("vx, vy", {"climb_mps": -3.5}, {}),
        ("ATTITUDE.roll", {}, {"attitude": attitude(-30.0, 0.0, YAW_DEG)}),
        ("ATTITUDE.pitch", {}, {"attitude": attitude(0.0, 50.0, YAW_DEG)}),
        ("VFR_HUD.airspeed", {}, {"airspeed_mps": 16.0}),
        ("ATTITUDE.yaw", {}, {"hud_heading_rad": math.radians(YAW_DEG - 25.0)}),
        ("ATTITUDE.yaw", {"heading_rad": math.radians(15.0)}, {}),
        ("relative_alt", {}, {"home_height_m": 12.0}),
        ("GLOBAL_POSITION_INT", {"north_m": 130.0}, {}),
    ],
)
def test_what_cant_be_of_one_that_stands_is_refused_by_its_field(
    field: str, now: dict[str, float], seen: dict[str, Any]
) -> None:
    assert found(now, **seen) == [(field, True)]


def test_headings_of_both_other_messages_off_the_attitudes_are_two_findings() -> None:
    assert found({}, attitude=attitude(0.0, 0.0, 170.0)) == [("ATTITUDE.yaw", True)] * 2


def test_in_the_air_it_may_move_as_its_velocity_says_and_nothing_refuses() -> None:
    flies = {"north_mps": 22.0, "height_m": 80.0, "above_home_m": 80.0}
    assert found(flies | {"north_m": 100.0 + 1.5 * 22.0}, flies=True) == []
    assert found(flies | {"north_m": 100.0 - 1.5 * 22.0}, flies=True) == [("GLOBAL_POSITION_INT", False)]
    assert found(flies | {"north_m": 100.0, "at_s": 5.0}, flies=True) == [], "it may have flown a circle meanwhile"
    assert found(flies | {"north_m": 133.0}, flies=True, home_height_m=-15.0) == [("relative_alt", False)]
