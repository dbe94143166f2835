"""Equation (7) against its closed form, a peer's integrator and its own limits."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from flight_model.autopilot_model import AutopilotModel, advance, rate, respond, signed, wrap
from flight_model.flight_state import FlightState

TAU_V, TAU_PSI, TAU_HA, TAU_HB = 4.0, 1.5, 1.0, 3.0
ACCEL, TURN, CLIMB = 1.5, 0.25, 3.0
FIELDS = ("north_m", "east_m", "height_m", "climb_mps", "airspeed_mps", "heading_rad")
AT_REST = dict.fromkeys((*FIELDS, "wind_north_mps", "wind_east_mps"), 0.0)


def model(tau_ha_s=TAU_HA, tau_hb_s=TAU_HB):
    return AutopilotModel(TAU_V, TAU_PSI, tau_ha_s, tau_hb_s, 16.0, 28.0, ACCEL, TURN, CLIMB)


def state(**changes):
    return FlightState(**AT_REST | {"height_m": 100.0, "airspeed_mps": 22.0} | changes)


def command(speed=22.0, heading=0.0, height=100.0, turn_rate=math.inf, accel=math.inf):
    return {
        "speed_mps": speed,
        "heading_rad": heading,
        "height_m": height,
        "accel_max_mps2": accel,
        "turn_rate_max_rps": turn_rate,
    }


def fly(begin, commanded, seconds, steps=1, of=None):
    end = begin.copy()
    for _ in range(steps):
        advance(end, of or model(), time_s=seconds / steps, **commanded)
    return end


@pytest.mark.parametrize("tau", ["tau_v_s", "tau_psi_s", "tau_ha_s", "tau_hb_s"])
@pytest.mark.parametrize("moves", [advance, respond])
def test_what_a_model_keeps_of_its_time_constants_ends_when_one_changes(tau, moves):
    kept = model()
    commands = {"speed_mps": 23.0, "heading_rad": 0.2, "height_m": 101.0, "time_s": 0.1}
    moves(state(), kept, **commands)
    fresh = AutopilotModel(*model().values())
    for each in (kept, fresh):
        setattr(each, tau, 2.5)
    one, other = state(), state()
    moves(one, kept, **commands)
    moves(other, fresh, **commands)
    assert one.values() == other.values()
    moves(one, kept, **commands | {"time_s": 0.3})
    moves(other, fresh, **commands | {"time_s": 0.3})
    assert one.values() == other.values()


@given(st.floats(-50.0, 50.0))
def test_angles_are_brought_near_zero_as_python_does(angle_rad):
    assert wrap(angle_rad) == (angle_rad + math.pi) % math.tau - math.pi
    assert signed(angle_rad) == math.remainder(angle_rad, math.tau)


def test_airspeed_closes_63_percent_of_a_small_step_in_its_time_constant():
    end = fly(state(), command(speed=24.0), TAU_V)
    assert end.airspeed_mps == pytest.approx(24 - 2 * math.exp(-1), abs=1e-12)


def test_heading_closes_63_percent_of_a_small_step_in_its_time_constant():
    end = fly(state(), command(heading=0.3), TAU_PSI)
    assert end.heading_rad == pytest.approx(0.3 * (1 - math.exp(-1)), abs=1e-12)


def test_height_follows_the_two_real_poles():
    end = fly(state(), command(height=104.0), 2.0)
    slow, fast = 3 * math.exp(-2 / 3), math.exp(-2.0)
    assert end.height_m == pytest.approx(104 - 4 * (slow - fast) / 2, abs=1e-12)
    assert end.climb_mps == pytest.approx(2 * (slow / 3 - fast), abs=1e-12)


def test_a_saturated_airspeed_is_a_straight_line_and_then_an_exponential():
    # 12 m/s of error: 1.5 m/s2 until 6 m/s are left, which takes 4 s.
    end = fly(state(airspeed_mps=16.0), command(speed=28.0), 2.0)
    assert end.airspeed_mps == pytest.approx(19.0, abs=1e-12)
    end = fly(state(airspeed_mps=16.0), command(speed=28.0), 8.0)
    assert end.airspeed_mps == pytest.approx(28 - 6 * math.exp(-1), abs=1e-12)


def test_a_saturated_turn_is_a_straight_line_and_then_an_exponential():
    # 0.25 rad/s until 0.375 rad are left.
    end = fly(state(), command(heading=1.375), 4.0 + TAU_PSI)
    assert end.heading_rad == pytest.approx(1.375 - 0.375 * math.exp(-1), abs=1e-12)


def test_the_shorter_way_round_is_taken():
    end = fly(state(heading_rad=math.radians(170)), command(heading=math.radians(-170)), 20.0, 20)
    assert end.heading_rad == pytest.approx(math.radians(190), abs=1e-4)


def test_the_command_s_own_turn_rate_counts_when_it_is_lower():
    end = fly(state(), command(heading=1.5, turn_rate=0.1), 5.0)
    assert end.heading_rad == pytest.approx(0.5, abs=1e-12)


def test_the_command_s_own_acceleration_counts_when_it_is_lower():
    end = fly(state(), command(speed=27.0, accel=0.5), 5.0)
    assert end.airspeed_mps == pytest.approx(24.5, abs=1e-12)


@given(
    speed=st.floats(20, 24),
    heading=st.floats(-0.3, 0.3),
    height=st.floats(97, 103),
    seconds=st.floats(0.001, 2.0),
)
@settings(deadline=None, max_examples=100)
def test_a_step_can_be_split_without_changing_the_model_s_answer(speed, heading, height, seconds):
    commanded = command(speed, heading, height)
    whole, split = fly(state(), commanded, seconds), fly(state(), commanded, seconds, 2)
    for name in ("airspeed_mps", "heading_rad", "height_m", "climb_mps"):
        assert getattr(whole, name) == pytest.approx(getattr(split, name), abs=1e-12)


@given(speed=st.floats(16, 28), heading=st.floats(-3.1, 3.1), seconds=st.floats(0.01, 30.0))
@settings(deadline=None, max_examples=100)
def test_saturated_speed_and_heading_can_be_split_too(speed, heading, seconds):
    commanded = command(speed, heading)
    whole, split = fly(state(), commanded, seconds), fly(state(), commanded, seconds, 3)
    for name in ("airspeed_mps", "heading_rad"):
        assert getattr(whole, name) == pytest.approx(getattr(split, name), abs=1e-11)


@given(speed=st.floats(16, 28), heading=st.floats(-3.1, 3.1), height=st.floats(-200, 400))
@settings(deadline=None, max_examples=40)
def test_no_limit_is_ever_passed(speed, heading, height):
    commanded, now, dt = command(speed, heading, height), state(), 0.02
    for _ in range(100):
        before, now = now, fly(now, commanded, dt)
        assert abs(now.airspeed_mps - before.airspeed_mps) <= ACCEL * dt + 1e-12
        assert abs(now.heading_rad - before.heading_rad) <= TURN * dt + 1e-12
        assert abs(now.climb_mps) <= CLIMB
        assert abs(now.height_m - before.height_m) <= CLIMB * dt + 1e-12


def test_a_climb_beyond_its_limit_comes_down_to_it_by_the_faster_time_constant():
    """9 m/s at first, 3 are allowed: 3 + 6 / e after the faster time constant, and 3 + 6 (1 - 1 / e) m higher."""
    end = fly(state(climb_mps=9.0), command(height=200.0), 1.0)
    assert end.climb_mps == pytest.approx(3.0 + 6.0 / math.e)
    assert end.height_m == pytest.approx(100.0 + 3.0 + 6.0 * (1.0 - 1.0 / math.e))
    assert fly(state(climb_mps=-9.0), command(height=0.0), 1.0).climb_mps == pytest.approx(-3.0 - 6.0 / math.e)


def test_a_long_climb_goes_at_the_limit_and_ends_without_overshoot():
    now, commanded = state(), command(height=160.0)
    heights = []
    for _ in range(2500):
        now = fly(now, commanded, 0.02)
        heights.append(now.height_m)
    rates = np.diff(heights) / 0.02
    assert rates.max() == pytest.approx(CLIMB, abs=1e-9)
    assert max(heights) <= 160.0 + 1e-9
    assert heights[-1] == pytest.approx(160.0, abs=1e-3)


def test_the_model_agrees_with_a_peer_s_integrator_limits_included():
    commanded = command(speed=27.0, heading=2.0, height=103.0)

    def slopes(_, y):
        _, _, height, climb, speed, heading = y
        return [
            speed * math.cos(heading) + 0.6,
            speed * math.sin(heading) - 0.4,
            climb,
            -(1 / TAU_HA + 1 / TAU_HB) * climb + (103.0 - height) / (TAU_HA * TAU_HB),
            min(max((27.0 - speed) / TAU_V, -ACCEL), ACCEL),
            min(max((2.0 - heading) / TAU_PSI, -TURN), TURN),
        ]

    begin = [0.0, 0.0, 100.0, 0.0, 22.0, 0.0]
    peer = solve_ivp(slopes, (0.0, 20.0), begin, rtol=1e-11, atol=1e-11, max_step=0.02).y[:, -1]
    end = fly(state(wind_north_mps=0.6, wind_east_mps=-0.4), commanded, 20.0, 1000)
    assert [getattr(end, name) for name in FIELDS] == pytest.approx(list(peer), abs=1e-6)


def test_a_turn_of_100_s_at_50_hz_ends_within_a_millimetre_on_its_circle():
    now = state()
    for i in range(5000):
        now = fly(now, command(heading=TURN * 0.02 * i + 1.5), 0.02)
    radius = 22 / TURN
    assert now.heading_rad == pytest.approx(25.0, abs=1e-9)
    assert now.north_m == pytest.approx(radius * math.sin(25.0), abs=1e-3)
    assert now.east_m == pytest.approx(radius * (1 - math.cos(25.0)), abs=1e-3)


def test_wind_is_added_to_the_path_over_ground():
    still, carried = (
        fly(state(**wind), command(), 10.0) for wind in ({}, {"wind_north_mps": 0.6, "wind_east_mps": -0.3})
    )
    assert carried.north_m - still.north_m == pytest.approx(6.0, abs=1e-9)
    assert carried.east_m - still.east_m == pytest.approx(-3.0, abs=1e-9)


@pytest.mark.parametrize("tau_s", [0.5, 2.0, 40.0])
@pytest.mark.parametrize("difference", [0.0, 1e-9])
def test_equal_time_constants_of_the_height_make_a_double_pole(tau_s, difference):
    end = fly(state(), command(height=101.0), 1.0, of=model(tau_s, tau_s * (1 + difference)))
    left = math.exp(-1 / tau_s)
    assert end.height_m == pytest.approx(101 - (1 + 1 / tau_s) * left, abs=1e-8)
    assert end.climb_mps == pytest.approx(left / tau_s**2, abs=1e-8)


@settings(max_examples=100, deadline=None)
@given(st.floats(16, 28), st.floats(-3, 3), st.floats(-3, 3), st.floats(16, 28), st.floats(-9, 9), st.floats(0.01, 5))
def test_a_response_is_the_flight_without_its_change_of_position(
    airspeed: float, climb: float, heading: float, speed: float, commanded_rad: float, seconds: float
) -> None:
    begin = state(airspeed_mps=airspeed, climb_mps=climb, heading_rad=heading)
    end, flown = begin.copy(), fly(begin, command(speed, commanded_rad, 120.0), seconds)
    respond(end, model(), speed, commanded_rad, 120.0, seconds)
    assert end.values()[2:] == flown.values()[2:]
    assert end.values()[:2] == begin.values()[:2]


@given(st.floats(0.02, 1.0), st.floats(-0.2, 0.2), st.floats(-4.0, 4.0))
def test_a_zero_order_hold_equivalents_rates_are_the_means_while_a_setpoint_is_held(held_s, to_side, faster):
    """Of the error at the beginning, and of the error at the end with time constants shorter by the elapsed time."""
    begin, held = state(heading_rad=1.0), model().held(held_s)
    end = fly(begin, command(speed=22.0 + faster, heading=1.0 + to_side), held_s)
    for value, less_s in ((begin, 0.0), (end, held_s)):
        meant_mps2 = rate(22.0 + faster - value.airspeed_mps, held.tau_v_s - less_s, ACCEL)
        meant_rps = rate(1.0 + to_side - value.heading_rad, held.tau_psi_s - less_s, TURN)
        assert meant_mps2 == pytest.approx((end.airspeed_mps - begin.airspeed_mps) / held_s, rel=1e-6, abs=1e-12)
        assert meant_rps == pytest.approx((end.heading_rad - begin.heading_rad) / held_s, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize(("error", "expected"), [(2.0, 0.5), (10.0, 1.5), (-12.0, -1.5), (math.nan, 0.0)])
def test_a_rate_is_the_error_by_the_time_constant_within_its_limit_and_none_without_a_setpoint(error, expected):
    assert rate(error, TAU_V, ACCEL) == expected


def test_a_held_model_has_the_airspeeds_that_are_within_reach_now():
    flies = model()
    assert flies.held(0.1).speed_max_mps == flies.speed_max_mps
    flies.reach(20.5, 23.5)
    assert (flies.held(0.1).speed_min_mps, flies.held(0.1).speed_max_mps) == (20.5, 23.5)
