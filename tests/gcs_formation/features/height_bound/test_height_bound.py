"""Commanded heights stay within 15 m of path and slot, or between these and where a vehicle joined."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant
from flight_model.flight_state import FlightState
from flight_model.slot import Vector3
from gcs_formation.control.setpoint import AS_DECIDED
from gcs_formation.features.height_bound.feature import FEATURE
from gcs_formation.recorder import Tick, VehicleLink

NOW = Instant(0)
PATH_M = 200.0
SLOTS_M: list[Vector3] = [(-30.0, 20.0, up_m) for up_m in (12.0, math.nan, -7.0)]
"""Of three vehicles, the second of which leads."""
STEPS_M = (0.75, 1.25, 0.5)
"""Climb limits of 3, 5 and 2 m/s at 4 Hz."""
PLANNED_M = (212.0, 200.0, 193.0)


class Bounded:
    """Three vehicles, each commanded 22 m/s, 0.4 rad and a height, at 4 ticks a second."""

    def __init__(self) -> None:
        models = [SimpleNamespace(climb_max_mps=each) for each in (3.0, 5.0, 2.0)]
        self.controller = SimpleNamespace(models=models, fault=None, leader_m=PATH_M, slots_m=SLOTS_M)
        self.active, self.slots_left, self.mission_time_s = [True] * 3, False, 5.0
        scenario = SimpleNamespace(law=SimpleNamespace(rate_hz=4.0))
        cycle: Any = SimpleNamespace(controller=self.controller, scenario=scenario)
        self.cycle, (self.stage,) = cycle, FEATURE.stages(cycle)

    def tick(self, heights_m: tuple[float, float, float], own_m: tuple[float, float, float] = PLANNED_M) -> Tick:
        """Return the tick after vehicles that say to be at `own_m` were commanded `heights_m`."""
        tick = Tick(
            NOW, self.mission_time_s, "flying", 1, [VehicleLink(NOW)] * 3, [0.0] * 3, [0.0] * 3, list(self.active)
        )
        tick.state = [FlightState(0.0, 0.0, height_m, 0.0, 22.0, 0.4, 0.0, 0.0) for height_m in own_m]
        tick.setpoints = [(22.0, 0.4, height_m) for height_m in heights_m]
        tick.slots_left = self.slots_left
        self.cycle.tick = tick
        self.stage.run(self.cycle)
        return tick

    def heights_m(self, height_m: float, own_m: float) -> list[float]:
        """Return what vehicles are commanded that say to be at one height and are commanded another."""
        return [each[2] for each in self.tick((height_m,) * 3, (own_m,) * 3).setpoints]


@pytest.mark.parametrize("index", [0, 1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_height_more_than_15_m_from_path_and_slot_is_replaced_by_that_bound_and_nothing_else_is(
    index: int, sign: float
) -> None:
    bounded, heights_m = Bounded(), list(PLANNED_M)
    for off_m, beyond in ((14.9, False), (15.0, False), (15.1, True), (80.0, True)):
        heights_m[index] = PLANNED_M[index] + sign * off_m
        tick = bounded.tick((heights_m[0], heights_m[1], heights_m[2]))
        expected = list(heights_m)
        expected[index] = PLANNED_M[index] + sign * min(off_m, 15.0)
        assert [each[2] for each in tick.setpoints] == pytest.approx(expected)
        assert {each[:2] for each in tick.setpoints} == {(22.0, 0.4)}
        replaced = [AS_DECIDED] * 3
        replaced[index] = (False, False, beyond)
        assert tick.replaced == replaced


def test_what_a_vehicle_says_of_its_height_later_changes_no_bound() -> None:
    bounded = Bounded()
    bounded.tick(PLANNED_M)
    for own_m in (190.0, 260.0, 480.0):
        assert bounded.heights_m(500.0, own_m) == pytest.approx([227.0, 215.0, 208.0])
        assert bounded.heights_m(-500.0, own_m) == pytest.approx([197.0, 185.0, 178.0])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_one_that_joins_from_another_height_may_be_commanded_anything_from_there_to_its_slot(sign: float) -> None:
    """The bound on its side approaches the slot's by the climb limit; the other one is the slot's at once."""
    bounded, joined_m = Bounded(), 200.0 + sign * 90.0
    beyond_m, short_m = 200.0 + sign * 400.0, 200.0 - sign * 400.0
    assert bounded.heights_m(joined_m, joined_m) == [joined_m] * 3
    for ticks in (1, 2, 3):
        bounds_m = [joined_m + sign * (15.0 - ticks * step_m) for step_m in STEPS_M]
        assert bounded.heights_m(beyond_m, joined_m) == pytest.approx(bounds_m)
    assert bounded.heights_m(short_m, joined_m) == pytest.approx([each - sign * 15.0 for each in PLANNED_M])
    for _ in range(250):
        bounded.tick(PLANNED_M)
    assert bounded.heights_m(beyond_m, joined_m) == pytest.approx([each + sign * 15.0 for each in PLANNED_M])


@pytest.mark.parametrize("unbounded", ["not commanded", "slots left", "no slots"])
def test_one_without_a_slot_or_a_command_is_not_bounded_and_joins_again_from_where_it_is_afterwards(
    unbounded: str,
) -> None:
    bounded = Bounded()
    for own_m, is_bounded in ((250.0, True), (260.0, False), (300.0, True)):
        bounded.active = [is_bounded or unbounded != "not commanded"] * 3
        bounded.slots_left = not is_bounded and unbounded == "slots left"
        bounded.controller.slots_m = [] if not is_bounded and unbounded == "no slots" else SLOTS_M
        assert bounded.heights_m(900.0, own_m) == [own_m + 15.0 if is_bounded else 900.0] * 3


def test_each_vehicle_joins_by_itself() -> None:
    bounded = Bounded()
    bounded.active = [True, True, False]
    assert bounded.heights_m(900.0, 300.0) == [315.0, 315.0, 900.0]
    bounded.active = [False, True, True]
    assert bounded.heights_m(900.0, 400.0) == pytest.approx([900.0, 313.75, 415.0])


def test_a_height_that_is_not_known_is_no_bound_and_a_setpoint_without_a_height_has_none() -> None:
    """Neither the path's before its first setpoint, nor one to fly level: a vehicle hasn't joined by then."""
    bounded = Bounded()
    bounded.controller.leader_m = math.nan
    assert bounded.heights_m(900.0, 260.0) == [900.0] * 3
    bounded.controller.leader_m = PATH_M
    tick = bounded.tick((math.nan,) * 3, (280.0,) * 3)
    assert tick.replaced == [AS_DECIDED] * 3
    assert all(math.isnan(each[2]) for each in tick.setpoints)
    assert bounded.heights_m(900.0, 300.0) == [315.0] * 3


@pytest.mark.parametrize(("mission_time_s", "is_bounded"), [(math.nan, False), (-0.1, False), (0.0, True), (0.5, True)])
def test_heights_are_bounded_from_the_start_of_the_path_on(mission_time_s: float, is_bounded: bool) -> None:
    bounded = Bounded()
    bounded.mission_time_s = mission_time_s
    assert bounded.heights_m(900.0, 300.0) == [315.0 if is_bounded else 900.0] * 3


def test_vehicles_that_fly_straight_on_after_a_fault_are_not_bounded() -> None:
    bounded = Bounded()
    bounded.controller.fault = "not finite"
    assert bounded.heights_m(900.0, 300.0) == [900.0] * 3
