"""Heights on ramps: which are commanded ahead of what is wanted, and from when on."""

from __future__ import annotations

import pytest

from airlink.clock import Instant, after
from gcs_formation.vehicle.held_setpoint import HeldSetpoint

TICK_S = 0.1
BEGIN_M = 200.0


def ahead_m(wanted_m: list[float]) -> list[float]:
    """Return by how much the height of each tick is commanded above what is wanted, after a second at one height."""
    held, found = HeldSetpoint(), list[float]()
    for tick, height_m in enumerate([BEGIN_M] * 10 + wanted_m):
        now = after(Instant(10**10), TICK_S * tick)
        commanded_m = held.height_ahead_m(height_m, now)
        values = 22.0, 0.3, commanded_m
        held.send(values, values, held.news(values, now))
        found.append(commanded_m - height_m)
    return found[10:]


def ramp(climb_mps: float, ticks: int) -> list[float]:
    return [BEGIN_M + climb_mps * TICK_S * tick for tick in range(1, ticks + 1)]


@pytest.mark.parametrize("climb_mps", [-3.0, 1.0, 3.0])
def test_a_change_of_height_may_be_a_step_at_its_first_tick_and_is_a_ramp_from_the_second_on(climb_mps: float) -> None:
    """Taken for a ramp, a step would be overshot by half of the next one; a ramp that is found late begins behind."""
    up = 1.0 if climb_mps > 0.0 else -1.0
    first_m, *others_m = ahead_m(ramp(climb_mps, 20))
    assert first_m == 0.0
    assert all(up * each > 0.1 for each in others_m)


@pytest.mark.parametrize("step_m", [-5.0, 0.3, 5.0])
def test_a_step_of_height_and_what_follows_it_are_commanded_as_wanted(step_m: float) -> None:
    assert ahead_m([BEGIN_M + step_m] * 20) == [0.0] * 20


def test_where_a_ramp_slows_to_a_third_its_heights_are_commanded_as_wanted_until_its_rate_is_known() -> None:
    """By the rate of before they would be too far ahead; a rate that changes by a third is the ramp's still."""
    begun = ramp(3.0, 20)
    slower, alike = ([begun[-1] + mps * TICK_S * tick for tick in range(1, 11)] for mps in (1.0, 2.0))
    assert ahead_m(begun + slower)[20] == 0.0
    assert ahead_m(begun + slower)[29] > 0.1
    assert all(each > 0.1 for each in ahead_m(begun + alike)[20:])


@pytest.mark.parametrize(("climb_mps", "is_late"), [(0.2, True), (-0.2, True), (0.5, False), (-0.5, False)])
def test_a_height_that_changes_by_20_cm_a_second_is_commanded_as_wanted_and_by_50_is_not_late_any_more(
    climb_mps: float, is_late: bool
) -> None:
    """Held for long at 0.2 m/s it is late by 15 cm on average, and telemetry's rounding is half of the rate.

    At 0.5 m/s it would be late by 23 cm.
    """
    found_m = ahead_m(ramp(climb_mps, 40))[20:]
    assert (found_m == [0.0] * 20) == is_late
    if not is_late:
        assert [abs(each) for each in found_m] == pytest.approx([0.23] * 20, abs=0.01)
