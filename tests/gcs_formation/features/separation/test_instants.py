"""Predictions of all vehicles begin at one instant, whenever each one's setpoint acts and however old its state is."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tests.gcs_formation.features.separation.crossing import Crossing


def abreast(beside_m: float, acts_s: tuple[float, float]) -> Crossing:
    """Return two side by side at one instant; each state is of the instant at which the vehicle's setpoint acts."""
    beside = Crossing()
    beside.ours[:], beside.acts_s = True, acts_s
    beside.heading[:], beside.north, beside.east = 0.0, 22.0 * np.array(acts_s), np.array((0.0, beside_m))
    return beside


@pytest.mark.parametrize(("acts_s", "yields"), [((0.0, 0.0), False), ((0.0, 1.0), True), ((1.0, 0.0), False)])
def test_one_that_turns_before_anothers_setpoint_acts_has_turned_by_then(
    acts_s: tuple[float, float], yields: bool
) -> None:
    """It is commanded to the right, where the other flies 16 m beside it."""
    beside = abreast(16.0, acts_s)
    beside.commanded_rad = [math.pi / 2, 0.0]
    assert any(beside.keep(at_s=7.0).yielding) is yields


@pytest.mark.parametrize("acts_s", [0.5, 2.0])
def test_an_uncommanded_one_is_predicted_to_the_instant_at_which_the_others_setpoints_act(acts_s: float) -> None:
    """They meet 5 s after now."""
    crossing = Crossing()
    crossing.acts_s = acts_s, 0.0
    (begun,) = crossing.keep(at_s=3.0).events
    assert begun.details["nearest_m"] == pytest.approx(6.0, abs=0.1)
    assert begun.details["in_s"] == pytest.approx(5.0 - acts_s, abs=0.2)


@pytest.mark.parametrize(("ahead_m", "yields"), [(30.0, True), (35.0, False), (9.0, False)])
def test_where_the_law_does_not_compensate_delays_states_of_different_ages_are_still_compared_at_one_instant(
    ahead_m: float, yields: bool
) -> None:
    """One that was 30 m behind a second ago has flown 22 m since."""
    column = Crossing(law={"type": "fuzzy_pid", "delay_compensation": False})
    column.ours[:], column.heading[:], column.seen_s = True, 0.0, 4.0
    column.north, column.east = np.array((ahead_m, 0.0)), np.zeros(2)
    assert any(column.keep(at_s=5.0).yielding) is yields


def test_with_all_well_apart_no_manoeuvre_is_searched_for(monkeypatch: pytest.MonkeyPatch) -> None:
    def unexpected(*_: Any) -> None:
        raise AssertionError

    beside = abreast(60.0, (0.0, 0.0))
    monkeypatch.setattr("gcs_formation.features.separation.resolver.resolve", unexpected)
    assert not any(beside.keep().yielding)
    beside.east[1] = 8.0
    with pytest.raises(AssertionError):
        beside.keep(at_s=0.1)
