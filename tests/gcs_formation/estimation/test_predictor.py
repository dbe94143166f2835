"""The prediction against a peer (scipy's integration of equation (7)) and against itself."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from airlink.clock import NANOSECONDS
from flight_model.vehicle_arrays import AutopilotModels, FlightStates, Setpoints, advance
from gcs_formation.estimation.setpoint_history import SetpointHistory
from tests.gcs_formation import tables


def index(*values: float) -> list[np.ndarray]:
    return [np.array([float(value)]) for value in values]


MODEL = AutopilotModels(*index(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0))


def derivative(_: float, y: Any, commands: tuple[float, float, float], updraught_mps: float) -> list[float]:
    north, east, height, climb, speed, heading = y
    del north, east
    error = (commands[1] - heading + np.pi) % (2 * np.pi) - np.pi
    return [
        speed * np.cos(heading) + 0.7,
        speed * np.sin(heading) - 0.4,
        climb,
        -(1 / 1.0 + 1 / 3.0) * (climb - updraught_mps) + (commands[2] - height) / 3.0,
        np.clip((commands[0] - speed) / 4.0, -1.5, 1.5),
        np.clip(error / 1.5, -0.25, 0.25),
    ]


@settings(max_examples=25, deadline=None)
@given(
    st.floats(16, 28),
    st.floats(-3, 3),
    st.floats(-3.0, 3.0),
    st.floats(16, 28),
    st.floats(-0.5, 0.5),
    st.floats(0.05, 0.3),
    st.floats(-1.0, 1.0),
)
def test_equals_the_integrated_model(
    speed: float,
    heading: float,
    climb_to: float,
    commanded_speed: float,
    turn: float,
    duration_s: float,
    rising_mps: float,
) -> None:
    start = (10.0, -20.0, 100.0, 0.2, speed, heading)
    commands = (commanded_speed, heading + turn, 100.0 + climb_to)
    args, span_s = (commands, rising_mps), (0, duration_s)
    peer = solve_ivp(derivative, span_s, start, args=args, rtol=1e-10, atol=1e-10, max_step=0.01).y[:, -1]
    ours = advance(
        FlightStates(*index(*start, 0.7, -0.4, rising_mps)),
        np.array(commands)[:, None],
        np.array([duration_s]),
        MODEL,
    )
    assert [v[0] for v in (ours.north_m, ours.east_m, ours.height_m, ours.climb_mps)] == pytest.approx(
        list(peer[:4]), abs=1e-4
    )
    assert [ours.airspeed_mps[0], ours.heading_rad[0]] == pytest.approx(list(peer[4:]), abs=1e-7)


@given(st.floats(0.02, 2.0), st.floats(0.1, 0.9))
def test_a_way_made_in_two_pieces_ends_at_the_same_place(duration_s: float, share: float) -> None:
    state = FlightStates(*index(0, 0, 100, 0.5, 20, 1.0, 1.0, 2.0))
    commands = np.array([24.0, 1.2, 101.0])[:, None]
    whole = advance(state, commands, np.array([duration_s]), MODEL)
    first = advance(state, commands, np.array([duration_s * share]), MODEL)
    both = advance(first, commands, np.array([duration_s * (1 - share)]), MODEL)
    for name in ("north_m", "east_m", "height_m", "climb_mps", "airspeed_mps", "heading_rad"):
        assert getattr(both, name) == pytest.approx(getattr(whole, name), abs=1e-4)


def test_setpoints_act_when_they_arrive() -> None:
    """The prediction through a history equals its pieces flown one after another, the first of them straight on."""
    history = SetpointHistory(10.0)
    commands = [(22.0, 0.0, 100.0), (24.0, 0.1, 101.0), (20.0, 0.3, 99.0)]
    for k, values in enumerate(commands):
        acts = np.array([round((0.1 * k + 0.3) * NANOSECONDS)])
        tables.send(history, acts, Setpoints(*index(*values)))
    state = FlightStates(*index(0, 0, 100, 0, 22, 0, 0, 0))
    since, until = np.array([round(0.25 * NANOSECONDS)]), np.array([round(0.65 * NANOSECONDS)])
    predicted = tables.predict(history, state, since, until, MODEL)
    for instant_s, values in ((0.35, commands[0]), (0.45, commands[1]), (9.0, commands[2])):
        assert history.commanded(round(instant_s * NANOSECONDS), 0) == values
    nothing = (math.nan,) * 3
    np.testing.assert_equal(history.commanded(round(0.2 * NANOSECONDS), 0), nothing)
    for values, duration_s in zip((nothing, *commands), (0.05, 0.1, 0.1, 0.15), strict=True):
        state = advance(state, np.array(values)[:, None], np.array([duration_s]), MODEL)
    for name in ("north_m", "east_m", "height_m", "airspeed_mps", "heading_rad"):
        assert getattr(predicted, name) == pytest.approx(getattr(state, name), abs=1e-6)


def test_vehicles_without_setpoints_fly_straight_on() -> None:
    state = FlightStates(*index(0, 0, 100, 1.0, 22, 0.5, 0, 0))
    later = advance(state, np.full((3, 1), np.nan), np.array([2.0]), MODEL)
    assert later.heading_rad == pytest.approx([0.5])
    assert later.airspeed_mps == pytest.approx([22.0])
    assert later.north_m == pytest.approx([44.0 * np.cos(0.5)])


@pytest.mark.parametrize("turn_rps", [0.0, 1e-9, 0.2, -0.2])
def test_a_turning_vehicle_without_setpoints_flies_an_arc(turn_rps: float) -> None:
    state, over_s = FlightStates(*index(0, 0, 100, 0, 22, 0.5, 3, -2)), 12.0
    straight = advance(state, np.full((3, 1), np.nan), np.array([over_s]), MODEL)
    turned = straight.turned(*index(turn_rps, over_s))

    def velocity(time_s: float, _: Any) -> list[float]:
        return [22 * np.cos(0.5 + turn_rps * time_s) + 3, 22 * np.sin(0.5 + turn_rps * time_s) - 2]

    place = solve_ivp(velocity, (0.0, over_s), [0.0, 0.0], rtol=1e-9, atol=1e-9).y[:, -1]
    assert turned.heading_rad == pytest.approx([0.5 + turn_rps * over_s])
    assert [turned.north_m[0], turned.east_m[0]] == pytest.approx(place.tolist(), abs=1e-5)


def test_limits_hold() -> None:
    state = FlightStates(*index(0, 0, 100, 0, 16, 0, 0, 0))
    later = advance(state, np.array([99.0, 3.0, 500.0])[:, None], np.array([1.0]), MODEL)
    assert later.airspeed_mps == pytest.approx([17.5])
    assert later.heading_rad == pytest.approx([0.25])
    assert later.height_m[0] <= 103.0


@pytest.mark.parametrize("difference", [0.0, 1e-9])
def test_equal_time_constants_of_the_height_make_a_double_pole(difference: float) -> None:
    """2 s after a step of 1 m with two lags of 2 s, 2/e m are left, and it climbs at 1/(2 e) m/s."""
    model = AutopilotModels(*index(4.0, 1.5, 2.0, 2.0 * (1 + difference), 16.0, 28.0, 1.5, 0.25, 3.0))
    state = FlightStates(*index(0, 0, 100, 0, 22, 0, 0, 0))
    later = advance(state, np.array([22.0, 0.0, 101.0])[:, None], np.array([2.0]), model)
    assert later.height_m == pytest.approx([101 - 2 / math.e], abs=1e-8)
    assert later.climb_mps == pytest.approx([0.5 / math.e], abs=1e-8)
