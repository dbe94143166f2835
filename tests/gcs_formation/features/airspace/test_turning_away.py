"""From which room on, to which side, and for how long vehicles are turned away from a fence; walls far apart."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from flight_model.fence_geometry import REACT_S, TURN_SHARE
from flight_model.flight_state import FlightState
from gcs_formation import from_scenario
from gcs_formation.control.setpoint import AS_DECIDED
from gcs_formation.features.airspace.airspace import FenceLimits
from gcs_formation.features.airspace.keys import Fence
from gcs_formation.recorder import Tick, VehicleLink
from tests.gcs_formation.features.airspace.test_fence import fenced

FAR_M = 20000.0
SPEED_MPS = 22.0
ASKED = (25.0, 0.3, 140.0)
"""Airspeed, heading and height that the law asks for."""
LONE = fenced(count=1)
MODELS = from_scenario.autopilot_models(LONE)
RADIUS_M = SPEED_MPS / (TURN_SHARE * MODELS[0].turn_rate_max_rps)
"""Of the circle to either side at that speed, in still air."""


def rotation(by_rad: float) -> Array:
    cos, sin = math.cos(by_rad), math.sin(by_rad)
    return np.array([[cos, -sin], [sin, cos]])


class Box:
    """A rectangle around the origin, turned and moved, with a vehicle that is placed by its distances to the sides."""

    def __init__(
        self, north_m: float, east_m: float, turned_rad: float = 0.0, at_m: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        """Take half the length of the sides."""
        corners = np.array([[-north_m, -east_m], [north_m, -east_m], [north_m, east_m], [-north_m, east_m]])
        self.turn, self.turned_rad, self.at_m = rotation(turned_rad), turned_rad, np.array(at_m)
        moved = corners @ self.turn.T + self.at_m
        safety = LONE.safety.model_copy(update={"fence": Fence(corners_m=moved.tolist())})
        self.limits, self.now = FenceLimits(LONE.model_copy(update={"safety": safety}), MODELS), Instant(0)
        self.events = list[Any]()

    def heading(
        self,
        north_m: float,
        east_m: float,
        heading_rad: float = 0.0,
        wind_mps: tuple[float, float] = (0.0, 0.0),
        wait_s: float = 0.1,
    ) -> float | None:
        """Return the heading commanded to a vehicle in the rectangle's own axes, None if it is the law's."""
        self.now = after(self.now, wait_s)
        tick = Tick(self.now, 0.0, "flying", 0, [VehicleLink(self.now)], [0.0], [0.0], [True])
        north, east = (self.turn @ np.array([north_m, east_m]) + self.at_m).tolist()
        wind = (self.turn @ np.array(wind_mps)).tolist()
        tick.state[0] = FlightState(north, east, 100.0, 0.0, SPEED_MPS, heading_rad + self.turned_rad, *wind)
        tick.setpoints[0] = ASKED
        self.limits.keep(tick)
        self.events += tick.events
        speed_mps, commanded_rad, height_m = tick.setpoints[0]
        assert (speed_mps, height_m) == (ASKED[0], ASKED[2])
        assert tick.replaced[0] == (False, commanded_rad != ASKED[1], False)
        return None if commanded_rad == ASKED[1] else commanded_rad - self.turned_rad


def alike(one: float | None, other: float | None) -> bool:
    """Return whether two headings are the same direction, or both none."""
    if one is None or other is None:
        return one is other
    return math.isclose(math.remainder(one - other, 2.0 * math.pi), 0.0, abs_tol=1e-6)


@settings(max_examples=15)
@given(st.floats(-3.0, 3.0), st.floats(-5000.0, 5000.0), st.floats(-5000.0, 5000.0), st.floats(0.5, 40.0))
def test_along_a_wall_a_vehicle_is_turned_away_from_10_m_on_wherever_the_wall_is(
    turned_rad: float, north_m: float, east_m: float, wall_m: float
) -> None:
    """A circle on the far side has as much room as the vehicle itself. Walls to the left turn it to the right."""
    for side in (1.0, -1.0):
        box = Box(FAR_M, FAR_M, turned_rad, (north_m, east_m))
        found = box.heading(0.0, side * (FAR_M - wall_m))
        assert abs(wall_m - 10.0) < 1e-3 or alike(found, -side * math.pi / 2.0 if wall_m < 10.0 else None)


def test_one_that_is_turned_away_is_released_with_25_m_and_said_to_be_turned_away_until_2_s_later() -> None:
    box = Box(FAR_M, FAR_M)
    held = [box.heading(0.0, FAR_M - wall_m) is not None for wall_m in (10.1, 9.9, 24.9, 25.1, 24.9, 10.1)]
    assert held == [False, True, True, False, False, False]
    box.heading(0.0, 0.0, wait_s=1.4)
    assert [each.text for each in box.events] == ["turned away, 10 m inside"]
    box.heading(0.0, 0.0, wait_s=0.4)
    box.heading(0.0, 0.0, wait_s=9.0)
    assert [each.text for each in box.events] == ["turned away, 10 m inside", "no longer turned away"]
    assert [each.details for each in box.events] == [{"begins": True}, {"begins": False}]
    assert {(each.kind, each.vehicle) for each in box.events} == {("fence", VehicleId(1, 1))}
    box.heading(0.0, FAR_M - 4.0)
    assert box.events[-1].text == "turned away, 4 m inside"


@pytest.mark.parametrize(("wind_mps", "ground_mps"), [(0.0, 22.0), (5.0, 27.0), (-5.0, 17.0)])
@pytest.mark.parametrize(("left_m", "turned"), [(9.9, True), (10.1, False)])
def test_towards_a_wall_there_is_room_for_2_s_of_flight_and_a_circle_at_airspeed_and_wind(
    wind_mps: float, ground_mps: float, left_m: float, turned: bool
) -> None:
    radius_m = RADIUS_M * (SPEED_MPS + abs(wind_mps)) / SPEED_MPS
    wall_m = REACT_S * ground_mps + radius_m + left_m
    found = Box(FAR_M, FAR_M).heading(FAR_M - wall_m, 0.0, 0.0, (wind_mps, 0.0))
    assert alike(found, math.pi / 2.0 if turned else None)


def test_a_crosswind_counts_by_its_size_and_carries_the_vehicle_sideways() -> None:
    """It heads along a wall, to which the wind carries it: room to the far side is less than its own distance."""
    calm, carried = Box(FAR_M, FAR_M), Box(FAR_M, FAR_M)
    assert calm.heading(0.0, FAR_M - 30.0) is None
    assert carried.heading(0.0, FAR_M - 30.0, 0.0, (0.0, 12.0)) is not None


def test_between_two_walls_the_wider_side_is_chosen_and_kept_until_it_has_no_room() -> None:
    """A circle to one side reaches two radii across. Where both leave as much the right one is flown."""
    half_m = 2.0 * RADIUS_M + 6.5
    box, other = Box(FAR_M, half_m), Box(FAR_M, half_m)
    left, right = -math.pi / 2.0, math.pi / 2.0
    assert alike(box.heading(0.0, 1.5), left)
    assert alike(box.heading(0.0, -1.5), left), "it is being turned to that side"
    assert alike(box.heading(0.0, -6.4), left)
    assert alike(box.heading(0.0, -6.6), right)
    assert alike(box.heading(0.0, 1.5), right)
    assert alike(box.heading(0.0, 6.4), right)
    assert alike(box.heading(0.0, 6.6), left)
    assert alike(other.heading(0.0, 0.0), right)


@settings(max_examples=15)
@given(st.floats(-3.1, 3.1), st.floats(-3.0, 3.0), st.floats(1.0, 300.0))
def test_one_that_has_left_the_fence_turns_inwards_by_the_smaller_angle_a_right_angle_at_most(
    heading_rad: float, turned_rad: float, beyond_m: float
) -> None:
    """Beyond the eastern wall inwards is west."""
    found = Box(FAR_M, FAR_M, turned_rad).heading(0.0, FAR_M + RADIUS_M + 100.0 + beyond_m, heading_rad)
    off_rad = math.remainder(-math.pi / 2.0 - heading_rad, 2.0 * math.pi)
    limited_rad = max(-math.pi / 2.0, min(off_rad, math.pi / 2.0))
    assert abs(abs(off_rad) - math.pi) < 1e-3 or alike(found, heading_rad + limited_rad)


@pytest.mark.parametrize("beyond", [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
def test_inwards_is_across_the_wall_that_was_left(beyond: tuple[float, float]) -> None:
    inwards_rad = math.atan2(-beyond[1], -beyond[0])
    north_m, east_m = ((FAR_M + 500.0) * each for each in beyond)
    found = Box(FAR_M, FAR_M).heading(north_m, east_m, inwards_rad + 0.4)
    assert alike(found, inwards_rad)


@pytest.mark.parametrize(
    ("asked_m", "flown_m"), [(60.0, 60.0), (59.9, 60.0), (120.0, 120.0), (120.1, 120.0), (-40.0, 60.0), (9e3, 120.0)]
)
def test_heights_from_the_lowest_to_the_highest_allowed_are_the_laws(asked_m: float, flown_m: float) -> None:
    limits = FenceLimits(fenced(count=1, height_min_m=60.0, height_max_m=120.0), MODELS)
    now = after(Instant(0), 1.0)
    tick = Tick(now, 0.0, "flying", 0, [VehicleLink(now)], [0.0], [0.0], [True])
    tick.setpoints[0] = (22.0, 0.5, asked_m)
    limits.keep(tick)
    assert tick.setpoints[0] == (22.0, 0.5, flown_m)
    assert tick.replaced[0] == ((False, False, True) if flown_m != asked_m else AS_DECIDED)
    assert [each.text for each in tick.events] == [f"height held at {flown_m:g} m"] * (flown_m != asked_m)


def test_only_vehicles_that_are_commanded_are_turned_away_and_without_a_fence_none() -> None:
    """Of three 5 m from a wall the second isn't commanded."""
    box = ((-FAR_M, -FAR_M), (FAR_M, -FAR_M), (FAR_M, FAR_M), (-FAR_M, FAR_M))
    now = after(Instant(0), 1.0)

    def turned(corners: Any, active: list[bool]) -> list[bool]:
        planned = fenced(corners, 3, height_max_m=120.0) if corners else fenced(None, 3)
        if not corners:
            planned = planned.model_copy(update={"safety": planned.safety.model_copy(update={"fence": None})})
        limits = FenceLimits(planned, from_scenario.autopilot_models(planned))
        tick = Tick(now, 0.0, "flying", 0, [VehicleLink(now)] * 3, [0.0] * 3, [0.0] * 3, active)
        for index in range(3):
            tick.state[index] = FlightState(0.0, FAR_M - 5.0, 100.0, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
            tick.setpoints[index] = ASKED
        limits.keep(tick)
        changed = [each != ASKED for each in tick.setpoints]
        assert changed == [each[1] for each in tick.replaced] == [each[2] for each in tick.replaced]
        return changed

    assert turned(box, [True, False, True]) == [True, False, True]
    assert turned(box, [False] * 3) == [False] * 3
    assert turned(None, [True] * 3) == [False] * 3


@pytest.mark.parametrize("at_first", [[True, True, True], [True, True, False]])
def test_one_that_is_not_commanded_for_a_tick_is_turned_away_from_10_m_on_again(at_first: list[bool]) -> None:
    """5 m from the wall all are turned away that are commanded; 15 m from it those that have been until now."""
    planned = fenced(((-FAR_M, -FAR_M), (FAR_M, -FAR_M), (FAR_M, FAR_M), (-FAR_M, FAR_M)), 3)
    limits, now = FenceLimits(planned, from_scenario.autopilot_models(planned)), Instant(0)

    def turned(wall_m: float, active: list[bool]) -> list[bool]:
        nonlocal now
        now = after(now, 0.1)
        tick = Tick(now, 0.0, "flying", 0, [VehicleLink(now)] * 3, [0.0] * 3, [0.0] * 3, active)
        for index in range(3):
            tick.state[index] = FlightState(0.0, FAR_M - wall_m, 100.0, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
            tick.setpoints[index] = ASKED
        limits.keep(tick)
        return [each != ASKED for each in tick.setpoints]

    assert turned(5.0, at_first) == at_first
    assert turned(15.0, [True, True, False]) == [True, True, False]
    assert turned(15.0, [True, True, True]) == [True, True, False]
