"""Whether a vehicle stands where the scenario flies, and its home on the scenario's ground; with limits by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from formation_scenario import Scenario, load_scenario
from gcs_formation.features.preflight.position import findings
from tests.flights.conftest import scenario

BEGIN_M = (500.0, -300.0)
PATH = {"speed_mps": 22, "waypoints_m": [[500, -300, 100], [2500, -200, 100], [3500, 700, 100], [2000, 700, 100]]}
ORIGIN = {"lat_deg": 35.0, "lon_deg": 125.0, "alt_m": 50.0}
SCENARIO = load_scenario(scenario(path=PATH, origin=ORIGIN), flown=True)
FARTHEST_KM = math.hypot(3.0, 1.0)
"""The third waypoint is the farthest from the first."""


def judged(
    north_m: float,
    east_m: float,
    height_m: float = 0.0,
    above_home_m: float = 0.0,
    *,
    flies: bool = False,
    over: Scenario = SCENARIO,
) -> list[Any]:
    """Return what is found of a vehicle, on a field 50 m above sea level."""
    motion = SimpleNamespace(north_m=north_m, east_m=east_m, height_m=height_m, above_home_m=above_home_m)
    found: Any = SimpleNamespace(
        seen=SimpleNamespace(motion=motion),
        scenario=over,
        flies=flies,
    )
    return findings(found)


@pytest.mark.parametrize("bearing_deg", [0.0, 37.0, 180.0, 290.0])
@pytest.mark.parametrize(("beyond_m", "too_far"), [(-1.0, False), (1.0, True)])
def test_ten_kilometres_more_than_the_farthest_waypoint_are_too_far(
    bearing_deg: float, beyond_m: float, too_far: bool
) -> None:
    away_m = 1000.0 * FARTHEST_KM + 10_000.0 + beyond_m
    bearing_rad = math.radians(bearing_deg)
    found = judged(BEGIN_M[0] + away_m * math.cos(bearing_rad), BEGIN_M[1] + away_m * math.sin(bearing_rad))
    assert [each.refuses for each in found] == [True] * too_far


@pytest.mark.parametrize("flies", [False, True])
@pytest.mark.parametrize(("away_km", "words"), [(50.0, "50.0"), (65.06, "65.1")])
def test_a_vehicle_elsewhere_refuses_whether_it_flies_or_not_and_both_distances_are_named(
    away_km: float, words: str, flies: bool
) -> None:
    """3-4-5: 30 km north and 40 km east of the path's begin, or farther in that direction."""
    (found,) = judged(BEGIN_M[0] + 600.0 * away_km, BEGIN_M[1] + 800.0 * away_km, flies=flies)
    assert found.refuses
    assert found.text == (
        f"place: found {words} km from the path's start; allowed: up to 13.2 km. "
        "Set origin.lat_deg and lon_deg to the field's"
    )


def test_distances_that_would_read_alike_are_reported_apart() -> None:
    (found,) = judged(BEGIN_M[0] + 1000.0 * FARTHEST_KM + 10_001.0, BEGIN_M[1])
    words = found.text.split()
    assert words[2] != words[words.index("to") + 1]
    assert float(words[2]) == pytest.approx(FARTHEST_KM + 10.001, abs=1e-3)
    assert float(words[words.index("to") + 1]) == pytest.approx(FARTHEST_KM + 10.0, abs=1e-3)


@pytest.mark.parametrize(("home_m", "off"), [(-30.1, True), (-29.9, False), (29.9, False), (30.1, True)])
@pytest.mark.parametrize("above_m", [0.0, 80.0])
@pytest.mark.parametrize("flies", [False, True])
def test_a_home_30_m_off_the_ground_refuses_unless_the_vehicle_flies(
    home_m: float, off: bool, above_m: float, flies: bool
) -> None:
    found = judged(*BEGIN_M, home_m + above_m, above_m, flies=flies)
    assert [each.refuses for each in found] == [not flies] * off


def test_both_heights_of_the_ground_are_named_above_sea_level() -> None:
    (found,) = judged(*BEGIN_M, 45.0, 5.0)
    assert found.text == (
        "home: found 90 m above sea level, where the scenario's ground is at 50 m; allowed: 30 m off. "
        "Set origin.alt_m, now 50, to the field's"
    )


@pytest.mark.parametrize(("home_m", "off"), [(39.9, True), (40.1, False), (70.0, False), (99.9, False), (100.1, True)])
def test_on_a_hill_the_home_must_be_on_the_hill(home_m: float, off: bool) -> None:
    """Its top, 70 m above the origin and so 120 m above the sea, is below the vehicle."""
    hill = {"shape": "cosine", "north_m": 700, "east_m": -260, "height_m": 70, "radius_m": 300}
    over = load_scenario(scenario(path=PATH, origin=ORIGIN, terrain={"clearance_m": 20, "hills": [hill]}), flown=True)
    found = judged(700.0, -260.0, home_m + 3.0, 3.0, over=over)
    assert len(found) == off
    for each in found:
        assert f"found {home_m + 50.0:.0f} m above sea level, where the scenario's ground is at 120 m" in each.text
    assert len(judged(700.0, -700.0, home_m + 3.0, 3.0, over=over)) == 1, "beside the hill it is level"


def test_of_one_without_a_position_nothing_is_said() -> None:
    found: Any = SimpleNamespace(seen=SimpleNamespace(motion=None), scenario=SCENARIO, flies=False)
    assert findings(found) == []
