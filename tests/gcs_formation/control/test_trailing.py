"""Slots in the followers' own frames: by (8) followers turn as their slots move and the leader turns."""

import math

import numpy as np
import pytest

from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.slot import Slot
from gcs_formation.control.setpoint import CRAB_RADPS, LeaderMotion, Target, TrailingSlot, feed_forward, slot_target

SPEED_MPS, WAY_S = 22.0, 30.0
MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)
FINE = 10
"""Steps of the integration per tick."""


def slot_at(time_s: float, start: np.ndarray, way: np.ndarray) -> Slot:
    """Return a slot on its way, with minimum jerk."""
    u = min(time_s / WAY_S, 1.0)
    share, rate, change = u**3 * (10 - 15 * u + 6 * u**2), 30 * (u * (1 - u)) ** 2, 60 * u * (1 - u) * (1 - 2 * u)
    return Slot((start + share * way).tolist(), (rate * way / WAY_S).tolist(), (change * way / WAY_S**2).tolist())


def leader_at(time_s: float) -> LeaderMotion:
    """Return a leader on a winding path, with turns of up to 0.03 rad/s."""
    cos, sin = math.cos(0.3 * time_s), math.sin(0.3 * time_s)
    state = FlightState(0.0, 0.0, 0.0, 0.0, SPEED_MPS, 0.1 * (1 - cos), 0.0, 0.0)
    return LeaderMotion(state, 0.03 * sin, 0.009 * cos, 0.0, 0.0)


def target_of(leader: LeaderMotion, turn_rps: float, slot: Slot) -> Target:
    return slot_target(leader.state, 0.0, 0.0, turn_rps, slot, "follower_heading")


@pytest.mark.parametrize("tick_s", [0.1, 0.02])
@pytest.mark.parametrize("forward_m", [(-30.0, -60.0), (-60.0, -30.0), (-30.0, 0.0)])
def test_one_that_turns_as_trailing_at_the_slots_speed_stays_in_a_slot_that_goes_60_m_to_the_side(
    forward_m: tuple[float, float], tick_s: float
) -> None:
    """Equation (8) integrated finely: the error left is of first order in the tick; headings turn as computed."""
    start, end = np.array([forward_m[0], -30.0, 0.0]), np.array([forward_m[1], 30.0, 0.0])
    trailing, (x_m, y_m), worst_m, headings = TrailingSlot(), (0.0, 0.0), 0.0, list[tuple[float, float]]()
    for tick in range(int(40 / tick_s)):
        leader, slot = leader_at(tick * tick_s), slot_at(tick * tick_s, start, end - start)
        turn_rps, _ = trailing.turning(leader, slot, tick_s)
        target = target_of(leader, turn_rps, slot)
        speed_mps, own_rad = target.speed_mps, target.heading_rad
        headings.append((own_rad, turn_rps))
        for step in range(FINE):
            now_s, step_s = tick * tick_s + step * tick_s / FINE, tick_s / FINE
            slot = slot_at(now_s, start, end - start)
            off_rad = leader_at(now_s).state.heading_rad - own_rad
            x_mps = SPEED_MPS * math.cos(off_rad) - speed_mps + turn_rps * (y_m - slot.right_m) + slot.forward_mps
            y_mps = SPEED_MPS * math.sin(off_rad) - turn_rps * (x_m - slot.forward_m) + slot.right_mps
            x_m, y_m, own_rad = x_m + x_mps * step_s, y_m + y_mps * step_s, own_rad + turn_rps * step_s
        worst_m = max(worst_m, abs(x_m), abs(y_m))
    assert worst_m < 1.3 * tick_s
    heading, turn = np.array(headings).T
    np.testing.assert_allclose(np.diff(heading) / tick_s, turn[:-1], atol=1e-3)


@pytest.mark.parametrize("forward_m", [(-30.0, -60.0), (-60.0, -30.0)])
def test_what_is_fed_forward_leads_the_trailing_target_by_its_rate(forward_m: tuple[float, float]) -> None:
    """(Setpoint minus target) / lag is the target's rate, while the leader turns and the slot moves."""
    start, way = np.array([forward_m[0], -30.0, 0.0]), np.array([forward_m[1] - forward_m[0], 60.0, 0.0])
    trailing, tick_s, targets, led = TrailingSlot(), 0.01, list[list[float]](), list[list[float]]()
    for tick in range(2000):
        leader, slot = leader_at(tick * tick_s), slot_at(tick * tick_s, start, way)
        turning = trailing.turning(leader, slot, tick_s)
        target = target_of(leader, turning[0], slot)
        speed_mps, heading_rad, _ = feed_forward(target, leader, target.heading_rad, *turning, slot, MODEL, 0.0)
        targets.append([target.speed_mps, target.heading_rad])
        led.append(
            [(speed_mps - target.speed_mps) / MODEL.tau_v_s, (heading_rad - target.heading_rad) / MODEL.tau_psi_s]
        )
    changes, led_by = np.diff(targets, axis=0) / tick_s, np.array(led)[:-1]
    np.testing.assert_array_less(np.abs(changes - led_by).max(axis=0), (0.005, 0.001))  # of 0.4 m/s² and 0.04 rad/s


def test_a_heading_crabs_slowly_against_a_gust_and_its_rates_are_those_of_its_angle() -> None:
    """The speed setpoint leads by the rates, so the sweep of a slot at the side is anticipated."""
    trailing, tick_s, gust_mps = TrailingSlot(), 0.001, 0.6
    time_s = np.arange(0.0, 8.0, tick_s)
    drift, change = gust_mps * -np.expm1(-2.0 * time_s), 2.0 * gust_mps * np.exp(-2.0 * time_s)
    crabs = [trailing.crab(d, c, SPEED_MPS, tick_s) for d, c in zip(drift, change, strict=True)]
    angle, rate, acceleration = np.array(crabs).T
    assert angle[0] == 0.0
    assert angle[-1] == pytest.approx(-gust_mps / SPEED_MPS, rel=0.02)
    assert np.abs(rate).max() < CRAB_RADPS * gust_mps / SPEED_MPS
    np.testing.assert_allclose(np.diff(angle) / tick_s, rate[:-1], atol=1e-5)
    np.testing.assert_allclose(np.diff(rate) / tick_s, acceleration[:-1], atol=1e-4)
    trailing.reset()
    assert trailing.crab(drift[-1], change[-1], SPEED_MPS, tick_s)[0] == pytest.approx(-drift[-1] / SPEED_MPS)


def test_a_slot_far_behind_turns_as_its_equation_says_in_a_long_bend() -> None:
    """It trails by 0.4 rad then. For an angle in place of its sine it was 0.009 rad off, 1.5 m for this slot."""
    trailing, slot, tick_s, fine = TrailingSlot(), Slot([-288.0, 167.0, 0.0], [0.0] * 3, [0.0] * 3), 0.1, 100
    leader_rad = exact_rad = axes_rad = worst_rad = trailed_rad = 0.0
    for tick in range(600):
        turn_rps, bend_rps2 = 0.036 * math.sin(0.05 * tick * tick_s), 0.0018 * math.cos(0.05 * tick * tick_s)
        state = FlightState(0.0, 0.0, 0.0, 0.0, SPEED_MPS, leader_rad, 0.0, 0.0)
        axes_rps, _ = trailing.turning(LeaderMotion(state, turn_rps, bend_rps2, 0.0, 0.0), slot, tick_s)
        for _ in range(fine):
            exact_rad += SPEED_MPS * math.sin(leader_rad - exact_rad) / 288.0 * tick_s / fine
            leader_rad += turn_rps * tick_s / fine
        axes_rad += axes_rps * tick_s
        worst_rad, trailed_rad = max(worst_rad, abs(axes_rad - exact_rad)), max(trailed_rad, leader_rad - exact_rad)
    assert trailed_rad > 0.35
    assert worst_rad < 0.002
