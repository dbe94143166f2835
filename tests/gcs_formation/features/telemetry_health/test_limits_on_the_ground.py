"""Each limit on the ground from both of its sides, and what a finding says with the figures found."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from airlink.messages.telemetry import Attitude
from flight_model.earth import GeodeticOrigin
from formation_scenario import load_scenario
from gcs_formation.features.telemetry_health.before_take_off import findings
from gcs_formation.mission.gate import AsFound
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.telemetry import Telemetry
from tests.flights.conftest import scenario
from tests.gcs_formation.features.telemetry_health.test_before_take_off import ORIGIN, YAW_DEG, attitude, motion

SCENARIO = load_scenario(scenario())


def texts(
    now: dict[str, float],
    *,
    flies: bool = False,
    hovers: bool = False,
    first: dict[str, float] | None = None,
    **seen: Any,
) -> list[str]:
    """Return all findings in words; 5 s after `first` on the ground, 1.5 s in the air."""
    telemetry = Telemetry(GeodeticOrigin(0.6, 2.1, 40.0))
    telemetry.motion = motion(**({"at_s": 1.5 if flies else 5.0} | now))
    telemetry.attitude, telemetry.home_height_m = attitude(0.0, 0.0, YAW_DEG), 0.0
    telemetry.hud_heading_rad, telemetry.airspeed_mps = math.radians(YAW_DEG), 1.0
    for name, value in seen.items():
        setattr(telemetry, name, value)
    pilot: Any = SimpleNamespace(hovers=True, mounting_parameter="X") if hovers else ArduPlane(1, ORIGIN, 0.25)
    begun = motion(**(first or {}))
    return [each.text for each in findings(AsFound(pilot, SCENARIO, telemetry, 16.0, begun, flies))]


@pytest.mark.parametrize(
    ("within", "beyond"),
    [
        ({"above_home_m": 10.0, "height_m": 10.0}, {"above_home_m": 10.1, "height_m": 10.0}),
        ({"above_home_m": -10.0, "height_m": -10.0}, {"above_home_m": -10.1, "height_m": -10.0}),
        ({"north_mps": 3.0}, {"north_mps": 3.01}),
        ({"east_mps": -3.0}, {"east_mps": -3.01}),
        ({"climb_mps": 3.0}, {"climb_mps": 3.01}),
        ({"climb_mps": -3.0}, {"climb_mps": -3.01}),
        ({"north_m": 125.0}, {"north_m": 125.1}),
        ({"east_m": 25.0}, {"east_m": 24.9}),
        ({"north_m": 115.0, "east_m": 70.0}, {"north_m": 115.1, "east_m": 70.0}),
        ({"above_home_m": 5.0, "height_m": 15.0}, {"above_home_m": 5.0, "height_m": 15.1}),
        ({"above_home_m": 5.0, "height_m": -5.0}, {"above_home_m": 5.0, "height_m": -5.1}),
        ({"heading_rad": math.radians(YAW_DEG + 19.9)}, {"heading_rad": math.radians(YAW_DEG + 20.1)}),
        ({"heading_rad": math.radians(YAW_DEG - 19.9)}, {"heading_rad": math.radians(YAW_DEG - 20.1)}),
    ],
)
def test_what_is_at_a_limit_is_allowed_and_what_is_beyond_is_found(
    within: dict[str, float], beyond: dict[str, float]
) -> None:
    """10 m of height and datum, 3 m/s, 5 m/s of a position over 5 s (15 m and 20 m are 25 m), 20 degrees."""
    first = {"height_m": within.get("height_m", 0.0)}
    assert texts(within, first=first) == []
    assert len(texts(beyond, first=first)) == 1


@pytest.mark.parametrize(
    ("within", "beyond"),
    [
        (attitude(24.9, -44.9, YAW_DEG), attitude(25.1, 44.9, YAW_DEG)),
        (attitude(-24.9, 44.9, YAW_DEG), attitude(0.0, -45.1, YAW_DEG)),
    ],
)
def test_banks_of_25_and_pitches_of_45_degrees_are_of_uneven_ground(within: Attitude, beyond: Attitude) -> None:
    assert texts({}, attitude=within) == []
    assert len(texts({}, attitude=beyond)) == 1


@pytest.mark.parametrize(("north_m", "is_found"), [(114.7, False), (115.3, True)])
def test_a_position_moves_in_the_time_since_the_first_one_whenever_that_was(north_m: float, is_found: bool) -> None:
    """15 m in 3 s, from the hundredth second of its clock on, are at the limit of 5 m/s."""
    assert bool(texts({"at_s": 103.0, "north_m": north_m}, first={"at_s": 100.0})) == is_found
    assert texts({"at_s": 100.9, "north_m": north_m}, first={"at_s": 100.0}) == [], "too soon to tell"


@pytest.mark.parametrize(("at_s", "is_found"), [(0.99, False), (1.0, True), (2.0, True), (2.01, False)])
def test_a_speed_is_reported_in_the_air_by_positions_one_to_two_seconds_apart(at_s: float, is_found: bool) -> None:
    said = texts(
        {"at_s": at_s, "north_m": 150.0, "height_m": 80.0, "above_home_m": 80.0}, flies=True, first={"height_m": 80.0}
    )
    assert bool(said) == is_found


def test_a_position_moves_by_the_mean_of_its_velocities() -> None:
    """From 10 m/s to 30 m/s it moves 30 m in 1.5 s, and by 2 m/s up to 4 m/s 4.5 m."""
    first = {"north_mps": 10.0, "east_mps": -10.0, "climb_mps": 2.0}
    now = {"north_mps": 30.0, "east_mps": -30.0, "climb_mps": 4.0, "height_m": 4.5, "above_home_m": 4.5}
    assert texts(now | {"north_m": 130.0, "east_m": 20.0}, flies=True, first=first) == []
    assert texts(now | {"north_m": 137.6, "east_m": 20.0}, flies=True, first=first) != []
    assert texts(
        now | {"north_m": 130.0, "east_m": 20.0, "height_m": -3.1, "above_home_m": -3.1}, flies=True, first=first
    )


def test_a_position_that_moves_otherwise_is_reported_north_east_and_down() -> None:
    """10 m, 20 m and 30 m up in 5 s."""
    said = texts({"north_m": 110.0, "east_m": 70.0, "height_m": 30.0, "above_home_m": 30.0, "climb_mps": 1.5})
    moved = "vx 0.0, vy 0.0, vz -1.5 m/s while its position moves by 2.0, 4.0, -6.0 m/s; allowed: 5 m/s off"
    assert moved in said[0]
    assert said[1].startswith("relative_alt: found 30 m above home while it stands disarmed; allowed: 10 m off")


@pytest.mark.parametrize(
    ("now", "seen", "words"),
    [
        ({"north_mps": 3.0, "east_mps": 4.0, "climb_mps": -2.0}, {}, "vx, vy: found 5.0 m/s over ground, vz 2.0 m/s"),
        ({}, {"home_height_m": -12.0}, "found 0 m, where alt is 12 m above HOME_POSITION's altitude; allowed: 10 m"),
        ({}, {"attitude": attitude(-30.0, 0.0, YAW_DEG)}, "roll: found -30 degrees while it stands"),
        ({}, {"attitude": attitude(0.0, 50.0, YAW_DEG)}, "pitch: found 50 degrees"),
        ({}, {"attitude": attitude(0.0, 50.0, YAW_DEG)}, "allowed: 45 degrees"),
        ({}, {"hud_heading_rad": math.radians(-45.0)}, "found 350 degrees, where VFR_HUD.heading is 315; allowed: 20"),
        ({}, {"airspeed_mps": 16.0}, "airspeed: found 16.0 m/s while it stands disarmed; allowed: less than 16 m/s"),
    ],
)
def test_a_finding_has_what_was_found_and_what_is_allowed(
    now: dict[str, float], seen: dict[str, Any], words: str
) -> None:
    (said,) = texts(now, **seen)
    assert words in said


def test_an_airspeed_is_judged_of_fixed_wings_from_the_slowest_that_flies() -> None:
    assert texts({}, airspeed_mps=15.9) == texts({}, airspeed_mps=math.nan) == []
    assert texts({}, airspeed_mps=16.0, hovers=True) == []


def test_what_was_not_reported_is_not_found() -> None:
    assert texts({}, attitude=None, hud_heading_rad=math.nan, home_height_m=math.nan) == []
    assert texts({"heading_rad": math.nan}) == []
    telemetry = Telemetry(ORIGIN)
    assert findings(AsFound(ArduPlane(1, ORIGIN, 0.25), SCENARIO, telemetry, 16.0, motion(), False)) == []
