"""A value that is NaN or infinite is an error that names its maker, its vehicle and the value."""

from __future__ import annotations

import math

import pytest
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import NANOSECONDS
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.slot import UNKNOWN, Slot
from gcs_formation.control.finite import (
    FiniteStates,
    is_finite,
    require_decision,
    require_route,
    require_setpoint,
    require_slots,
)
from gcs_formation.control.fuzzy_pid import NO_GAINS
from gcs_formation.control.law_interface import LawOutput
from gcs_formation.errors import NotFiniteError
from gcs_formation.estimation.projection import MeasuredStates, Prediction
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.guidance.tracking import RouteHeading

BAD = math.nan, math.inf, -math.inf
NINE = [float(each) for each in range(1, 10)]


def with_value(values: list[float], place: int, value: float) -> list[float]:
    return [*values[:place], value, *values[place + 1 :]]


def state_of(values: list[float]) -> FlightState:
    return FlightState(*values)


def states_of(*each: FlightState) -> MeasuredStates:
    count = len(each)
    return MeasuredStates(list(each), vec[i64]([7] * count), [True] * count, vec[i64]([9] * count))


@pytest.mark.parametrize("bad", BAD)
def test_a_state_is_finite_while_each_of_its_nine_values_is(bad: float) -> None:
    assert is_finite(state_of(NINE))
    for place in range(9):
        assert not is_finite(state_of(with_value(NINE, place, bad)))


def test_a_predicted_state_is_passed_on_with_its_instant() -> None:
    first, second = state_of(NINE), state_of(NINE)
    states = FiniteStates(states_of(first, second))
    assert states.of(1, 0) is second
    assert states.of(0, 1) is first
    assert states.instant(1) == 7


def test_a_predicted_state_that_is_not_finite_is_shown_with_names_and_units() -> None:
    states = FiniteStates(states_of(state_of(NINE), state_of(with_value(NINE, 5, math.nan))))
    shown = "north (m) 1, east (m) 2, height (m) 3, climb (m/s) 4, airspeed (m/s) 5, heading (rad) nan"
    with pytest.raises(NotFiniteError) as raised:
        states.of(1, 0)
    assert (raised.value.part, raised.value.index) == ("predictor", 1)
    assert raised.value.found == f"state: {shown}, wind north (m/s) 7, wind east (m/s) 8, updraught (m/s) 9"


def test_a_state_that_cannot_be_computed_is_the_predictors_error() -> None:
    """Here by (7) with a lag of 0."""
    history, acts = SetpointHistory(10.0), vec[i64]([NANOSECONDS])
    history.begin_tick(vec[i64]([-1]))
    history.record([(22.0, 0.0, 100.0)])
    states = Prediction(history, [AutopilotModel(0.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)], 10.0)
    state = FlightState(0.0, 0.0, 100.0, 0.0, 21.0, 0.0, 0.0, 0.0)
    states.predict(MeasuredStates([state], vec[i64]([0]), [True], acts))
    with pytest.raises(NotFiniteError, match="predictor: ZeroDivisionError: ") as raised:
        FiniteStates(states).of(0, 0)
    assert raised.value.index is None


@pytest.mark.parametrize("bad", BAD)
def test_a_setpoint_that_is_not_finite_is_shown(bad: float) -> None:
    require_setpoint("guidance", 2, (22.0, -0.5, 100.0))
    for place, shown in enumerate(("{bad:g}, {1:g}, {2:g}", "{0:g}, {bad:g}, {2:g}", "{0:g}, {1:g}, {bad:g}")):
        setpoint = with_value([22.0, -0.5, 100.0], place, bad)
        one, two, three = shown.format(22.0, -0.5, 100.0, bad=bad).split(", ")
        with pytest.raises(NotFiniteError) as raised:
            require_setpoint("guidance", 2, (setpoint[0], setpoint[1], setpoint[2]))
        words = f"setpoint: airspeed (m/s) {one}, heading (rad) {two}, height (m) {three}"
        assert (raised.value.part, raised.value.index, raised.value.found) == ("guidance", 2, words)


def test_of_a_route_each_value_and_the_commanded_turn_must_be_finite() -> None:
    usual = [0.2, 1.0, 0.3, 0.04, 0.5, 22.0]
    require_route(RouteHeading(*usual[1:]), usual[0], 3)
    names = ("turn (rad/s)", "heading (rad)", "its rate (rad/s)", "the rate of that (rad/s²)", "climb (m/s)")
    for place, name in enumerate((*names, "speed (m/s)")):
        for bad in BAD:
            values = with_value(usual, place, bad)
            with pytest.raises(NotFiniteError) as raised:
                require_route(RouteHeading(*values[1:]), values[0], 3)
            assert (raised.value.part, raised.value.index) == ("guidance", 3)
            assert f"{name} {bad:g}" in raised.value.found
            assert raised.value.found.startswith(f"route: turn (rad/s) {values[0]:g}, heading")


def test_of_an_active_vehicles_slot_each_value_must_be_finite() -> None:
    names = [f"{axis} ({unit}) " for unit in ("m", "m/s", "m/s²") for axis in ("forward", "right", "up")]
    fine = Slot(NINE[:3], NINE[3:6], NINE[6:])
    require_slots([fine, fine], [True, True])
    for place in range(9):
        for bad in BAD:
            values = with_value(NINE, place, bad)
            slots = [fine, Slot(values[:3], values[3:6], values[6:])]
            require_slots(slots, [True, False])
            with pytest.raises(NotFiniteError) as raised:
                require_slots(slots, [False, True])
            assert (raised.value.part, raised.value.index) == ("guidance", 1)
            listed = [name + f"{value:g}" for name, value in zip(names, values, strict=True)]
            assert raised.value.found == "slot: " + ", ".join(listed)


def test_a_law_owes_a_finite_setpoint_to_everyone_and_a_finite_error_to_followers() -> None:
    state, setpoint, error_m = state_of(NINE), (22.0, 0.1, 100.0), (1.0, math.inf, 3.0)
    unknown = LawOutput(0, state, setpoint, UNKNOWN, UNKNOWN, NO_GAINS)
    require_decision(unknown, 0)
    require_decision(LawOutput(1, state, setpoint, (1.0, 2.0, 3.0), UNKNOWN, NO_GAINS), 0)
    with pytest.raises(NotFiniteError) as raised:
        require_decision(LawOutput(1, state, setpoint, error_m, UNKNOWN, NO_GAINS), 0)
    assert (raised.value.part, raised.value.index) == ("law", 1)
    assert raised.value.found == "error: forward (m) 1, right (m) inf, up (m) 3"
    with pytest.raises(NotFiniteError, match="law: setpoint: airspeed"):
        require_decision(LawOutput(0, state, UNKNOWN, UNKNOWN, UNKNOWN, NO_GAINS), 0)
