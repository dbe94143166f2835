"""What `check` says about circles at a flight's planned end over hills, and about the way up to them."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

from flight_model.arrays import Array
from formation_scenario import Scenario, load_scenario
from gcs_formation.features.ending.check_warnings import final_circles
from tests.flights.conftest import scenario

END_M = 5000.0
"""North of the origin, where the path ends; its east is 3000 m."""
AHEAD = {"speed_mps": 22, "waypoints_m": [[3000, 3000, 100], [END_M, 3000, 100]]}


def planned(*hills: dict[str, Any], **keys: Any) -> Scenario:
    """Return a flight to the end of its path, 100 m high, that keeps 60 m of clearance."""
    return load_scenario(scenario(**{"terrain": {"clearance_m": 60, "hills": hills}, "path": AHEAD} | keys))


def hill(north_m: float, east_m: float, height_m: float, radius_m: float) -> dict[str, Any]:
    return {"shape": "cosine", "north_m": north_m, "east_m": east_m, "height_m": height_m, "radius_m": radius_m}


def reported(flight: Scenario) -> list[str]:
    return list(final_circles(flight))


def long(**keys: Any) -> dict[str, Any]:
    return {"duration_s": 120} | keys


def test_over_level_ground_that_is_far_below_there_is_nothing_to_say() -> None:
    assert reported(planned(hill(0.0, -5000.0, 50.0, 100.0), **long())) == []
    assert reported(load_scenario(scenario())) == []


@pytest.mark.parametrize(("height_m", "lifted_m"), [(39.0, 0.0), (40.0, 0.0), (41.0, 1.0), (90.0, 50.0)])
def test_a_hill_below_the_circles_lifts_them_by_what_its_clearance_lacks(height_m: float, lifted_m: float) -> None:
    """150 m beside the end of the path; 60 m above it are asked for, and the path is 100 m high."""
    said = reported(planned(hill(END_M, 3150.0, height_m, 100.0), **long()))
    circles = [each for each in said if "vehicles circle" in each]
    assert len(circles) == (lifted_m > 0.0)
    for text in circles:
        assert text == (
            f"path at 2000 m, the flight's end: vehicles circle {lifted_m:.1f} m above it, at {100.0 + lifted_m:.0f} m "
            f"and higher, for the ground at north {END_M:.0f}, east 3150"
        )


@pytest.mark.parametrize(("beyond_m", "lifts"), [(800.0, True), (930.0, False)])
def test_hills_count_as_far_as_the_formation_flies_until_it_circles(beyond_m: float, lifts: bool) -> None:
    """660 m in 30 s at 22 m/s and 200 m for a circle; the hill has a radius of 60 m."""
    said = reported(planned(hill(END_M + beyond_m, 3000.0, 130.0, 60.0), **long()))
    assert any("vehicles circle" in each for each in said) is lifts


@pytest.mark.parametrize(("beyond_m", "lifts"), [(860.0, True), (990.0, False)])
@pytest.mark.parametrize("course_deg", [40.0, 130.0, 220.0, 310.0])
def test_on_any_course_hills_count_where_the_formation_flies_to(
    course_deg: float, beyond_m: float, lifts: bool
) -> None:
    """The hill is in line with the path, with a radius of 120 m."""
    north, east = math.cos(math.radians(course_deg)), math.sin(math.radians(course_deg))
    path = AHEAD | {"waypoints_m": [[3000, 3000, 100], [3000 + 2000 * north, 3000 + 2000 * east, 100]]}
    away_m = 2000.0 + beyond_m
    said = reported(planned(hill(3000 + away_m * north, 3000 + away_m * east, 130.0, 120.0), path=path, **long()))
    assert any("vehicles circle" in each for each in said) is lifts


@pytest.mark.parametrize(("slowest_mps", "lifts"), [(3.0, False), (1.0, True)])
def test_the_formation_flies_on_for_as_long_as_its_slowest_climb_takes(slowest_mps: float, lifts: bool) -> None:
    """The third vehicle climbs by 30 m: at 1 m/s in 30 s, and 15 s more make 990 m at 22 m/s instead of 660 m."""
    slow = {"id": 2, "role": "follower", "model": {"climb_max_mps": slowest_mps}}
    vehicles = [{"id": 1, "role": "leader"}, slow, {"id": 3, "role": "follower"}]
    said = reported(planned(hill(END_M + 1100.0, 3000.0, 130.0, 60.0), vehicles=vehicles, **long()))
    assert any("vehicles circle" in each for each in said) is lifts


def test_multirotors_that_hover_clear_of_the_ground_do_not_climb_and_nothing_is_said() -> None:
    vehicles = {"count": 3, "autopilot": "arducopter"}
    hovering = planned(hill(END_M, 3150.0, 35.0, 100.0), vehicles=vehicles, path=AHEAD | {"speed_mps": 5}, **long())
    assert hovering.hovers
    assert reported(hovering) == []


@pytest.mark.parametrize("turned", [1.0, -1.0])
def test_a_hill_straight_ahead_that_is_higher_than_they_can_climb_by_then_is_reported_with_the_lowest_clearance(
    turned: float,
) -> None:
    """The top is 150 m high and 250 m ahead, 11.4 s: at 3 m/s they are below 134 m by then; mirrored, it is alike."""
    path = AHEAD | {"waypoints_m": [[turned * 3000, 3000, 100], [turned * END_M, 3000, 100]]}
    said = reported(planned(hill(turned * (END_M + 250.0), 3000.0, 150.0, 300.0), path=path, **long()))
    (text,) = [each for each in said if "straight on" in each]
    found = re.search(r"come to (-?[\d.]+) m above the ground straight on, at north (-?\d+), east (\d+)", text)
    assert found is not None
    clearance_m, north_m, east_m = (float(each) for each in found.groups())
    assert -50.0 < clearance_m < 134.0 - 150.0
    assert turned * north_m == pytest.approx(END_M + 250.0, abs=50.0)
    assert east_m == pytest.approx(3000.0, abs=45.0)
    assert text.endswith("; 60 m are asked for (terrain.clearance_m)")
    assert text.startswith("path at 2000 m, the flight's end: vehicles that climb to circle ")


@pytest.mark.parametrize(("height_m", "low"), [(45.0, False), (76.0, True)])
def test_a_hill_that_they_are_above_in_time_is_not_reported(height_m: float, low: bool) -> None:
    """250 m ahead: to be 60 m above a top of 45 m they climb by 5 m in 11 s, but not by 36 m above one of 76 m."""
    said = reported(planned(hill(END_M + 250.0, 3000.0, height_m, 300.0), **long()))
    assert any("straight on" in each for each in said) is low


class Holes:
    """Level ground whose height is not known from a place on."""

    def __init__(self, from_north_m: float) -> None:
        self._from_m = from_north_m

    def height(self, north_m: Array, east_m: Array) -> Array:
        return np.where(np.broadcast_arrays(north_m, east_m)[0] > self._from_m, np.nan, 0.0)

    def bound_m(self, north_m: Array, east_m: Array, _: float) -> Array:
        return np.zeros_like(north_m + east_m)


@pytest.mark.parametrize(("beyond_m", "is_reported"), [(300.0, True), (920.0, False)])
def test_ground_that_is_not_known_below_the_circles_is_reported_with_the_first_place(
    beyond_m: float, is_reported: bool
) -> None:
    """Vehicles fly on for 660 m in 30 s, and circle within 200 m."""
    flight = planned(hill(0.0, -5000.0, 1.0, 100.0), **long())
    vars(flight)["ground"] = Holes(END_M + beyond_m)
    said = reported(flight)
    assert len(said) == is_reported
    for text in said:
        found = re.search(r"the flight's end: found no elevation at north (\d+), east (\d+), below the vehicles", text)
        assert found is not None
        north_m, east_m = (float(each) for each in found.groups())
        assert END_M + beyond_m < north_m < END_M + beyond_m + 410.0
        assert math.isclose(east_m, 3000.0, abs_tol=245.0)


def test_a_leader_that_is_virtual_circles_nowhere() -> None:
    """Three vehicles at 100 m need circles up to 130 m, with a leader or without; half a metre more isn't reported."""
    for max_m, is_reported in ((129.4, True), (129.6, False)):
        safety = {"fence": {"height_max_m": max_m}}
        real = load_scenario(scenario(safety=safety))
        each = [{"id": number, "role": "follower"} for number in (1, 2, 3)]
        shape = {"shape": "custom", "slots_m": {1: [0, -30, 0], 2: [0, 30, 0], 3: [-30, 0, 0]}}
        virtual = load_scenario(scenario(safety=safety, vehicles=each, formation=shape))
        for flight in (real, virtual):
            assert [text.endswith("129.4 m are allowed (safety.fence.height_max_m)") for text in reported(flight)] == [
                True
            ] * is_reported
