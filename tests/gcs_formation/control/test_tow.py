"""Slots in the followers' own frames: how (8) has a follower turn while its slot moves and the leader turns."""

import math

import numpy as np
import pytest

from formation_scenario.slot_motion import SlotMotion
from gcs_formation.control.feed_forward import CRAB_RADPS, Axes, LeaderMotion, TrailingSlots, Turning, feed_forward
from gcs_formation.control.mixer import slot_target
from gcs_formation.estimation.flight_state import AutopilotModels, FlightStates

SPEED_MPS, WAY_S = 22.0, 30.0
MODEL = AutopilotModels(*(np.array([value]) for value in (4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)))
FINE = 10
"""Steps of the integration a tick."""


def slot_at(time_s: float, start: np.ndarray, way: np.ndarray) -> SlotMotion:
    """Return a slot on its way, with the least jerk."""
    u = min(time_s / WAY_S, 1.0)
    share, rate, change = u**3 * (10 - 15 * u + 6 * u**2), 30 * (u * (1 - u)) ** 2, 60 * u * (1 - u) * (1 - 2 * u)
    return SlotMotion((start + share * way)[None], (rate * way)[None] / WAY_S, (change * way)[None] / WAY_S**2)


def leader_at(time_s: float) -> LeaderMotion:
    """Return a leader that swings through bends of up to 0.03 rad/s."""
    cos, sin = math.cos(0.3 * time_s), math.sin(0.3 * time_s)
    heading, turn, bend = (np.array([value]) for value in (0.1 * (1 - cos), 0.03 * sin, 0.009 * cos))
    zero, one = np.zeros(1), np.ones(1)
    state = FlightStates(zero, zero, zero, zero, SPEED_MPS * one, heading, zero, zero)
    return LeaderMotion(state, Turning(turn, bend), zero, zero)


@pytest.mark.parametrize("tick_s", [0.1, 0.02])
@pytest.mark.parametrize("forward_m", [(-30.0, -60.0), (-60.0, -30.0), (-30.0, 0.0)])
def test_who_turns_as_towed_at_the_slots_speed_stays_in_a_slot_that_goes_60_m_aside(
    forward_m: tuple[float, float], tick_s: float
) -> None:
    """Equation (8) integrated finely: the error that is left is of first order in the tick; headings turn as said."""
    start, end = np.array([forward_m[0], -30.0, 0.0]), np.array([forward_m[1], 30.0, 0.0])
    tow, (x_m, y_m), worst_m, headings = TrailingSlots(1), (0.0, 0.0), 0.0, list[tuple[float, float]]()
    for tick in range(int(40 / tick_s)):
        leader, slots = leader_at(tick * tick_s), slot_at(tick * tick_s, start, end - start)
        turning = tow.turning(leader, slots, tick_s)
        target = slot_target(leader.state, leader.state, turning.rate_rps, slots, "follower_heading")
        speed_mps, own_rad, turn_rps = (float(a[0]) for a in (target.speed_mps, target.heading_rad, turning.rate_rps))
        headings.append((own_rad, turn_rps))
        for step in range(FINE):
            now_s, step_s = tick * tick_s + step * tick_s / FINE, tick_s / FINE
            slots = slot_at(now_s, start, end - start)
            (forward, right, _), (forth_mps, aside_mps, _) = slots.position_m[0], slots.velocity_mps[0]
            off_rad = float(leader_at(now_s).state.heading_rad[0]) - own_rad
            x_mps = SPEED_MPS * math.cos(off_rad) - speed_mps + turn_rps * (y_m - right) + forth_mps
            y_mps = SPEED_MPS * math.sin(off_rad) - turn_rps * (x_m - forward) + aside_mps
            x_m, y_m, own_rad = x_m + x_mps * step_s, y_m + y_mps * step_s, own_rad + turn_rps * step_s
        worst_m = max(worst_m, abs(x_m), abs(y_m))
    assert worst_m < 1.3 * tick_s
    heading, turn = np.array(headings).T
    np.testing.assert_allclose(np.diff(heading) / tick_s, turn[:-1], atol=1e-3)


@pytest.mark.parametrize("forward_m", [(-30.0, -60.0), (-60.0, -30.0)])
def test_what_is_fed_forward_leads_the_towed_target_by_its_rate(forward_m: tuple[float, float]) -> None:
    """Setpoint minus target by the lag is how the target changes, while the leader bends and the slot moves."""
    start, way = np.array([forward_m[0], -30.0, 0.0]), np.array([forward_m[1] - forward_m[0], 60.0, 0.0])
    tow, tick_s, targets, led = TrailingSlots(1), 0.01, list[list[float]](), list[list[float]]()
    for tick in range(2000):
        leader, slots = leader_at(tick * tick_s), slot_at(tick * tick_s, start, way)
        turning = tow.turning(leader, slots, tick_s)
        target = slot_target(leader.state, leader.state, turning.rate_rps, slots, "follower_heading")
        forward = feed_forward(target, leader, Axes(target.heading_rad, turning), slots, MODEL)[0]
        wanted = np.array((target.speed_mps[0], target.heading_rad[0]))
        targets.append(wanted.tolist())
        led.append(((forward[:2] - wanted) / MODEL.air_lags_s[:, 0]).tolist())
    changes, led_by = np.diff(targets, axis=0) / tick_s, np.array(led)[:-1]
    np.testing.assert_array_less(np.abs(changes - led_by).max(axis=0), (0.005, 0.001))  # of 0.4 m/s² and 0.04 rad/s


def test_a_heading_crabs_slowly_against_a_gust_and_its_rates_are_those_of_its_angle() -> None:
    """Speed is led by the rates: what the slot at the side is swept by comes as no surprise."""
    tow, tick_s, gust_mps, speed = TrailingSlots(1), 0.001, 0.6, np.array([SPEED_MPS])
    time_s = np.arange(0.0, 8.0, tick_s)
    drift, change = gust_mps * -np.expm1(-2.0 * time_s), 2.0 * gust_mps * np.exp(-2.0 * time_s)
    crabs = [tow.crab(np.array([d]), np.array([c]), speed, tick_s) for d, c in zip(drift, change, strict=True)]
    angle, rate, acceleration = (np.array([getattr(crab, name)[0] for crab in crabs]) for name in crabs[0]._fields)
    assert angle[0] == 0.0
    assert angle[-1] == pytest.approx(-gust_mps / SPEED_MPS, rel=0.02)
    assert np.abs(rate).max() < CRAB_RADPS * gust_mps / SPEED_MPS
    np.testing.assert_allclose(np.diff(angle) / tick_s, rate[:-1], atol=1e-5)
    np.testing.assert_allclose(np.diff(rate) / tick_s, acceleration[:-1], atol=1e-4)
    tow.forget(np.array([True]))
    assert tow.crab(drift[-1:], change[-1:], speed, tick_s).angle_rad[0] == pytest.approx(-drift[-1] / SPEED_MPS)
