"""The formation law tick by tick: its feed-forward and its rates, against model (7) integrated finely."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from flight_model.vehicle_arrays import AutopilotModels, FlightStates, Setpoints
from formation_scenario.slot_motion import SlotMotion
from gcs_formation.control.follower import FollowerController
from gcs_formation.control.follower_loops import Controller, LawParameters
from gcs_formation.control.fuzzy_pid import FuzzyGainScheduler
from gcs_formation.control.law_interface import CycleInput
from gcs_formation.control.laws import FormationLaw, VelocityController
from gcs_formation.control.setpoint import AS_DECIDED
from tests.gcs_formation import tables
from tests.gcs_formation.control.law_ticks import (
    AT_ONCE_S,
    COUNT,
    DT_S,
    FOLLOWERS,
    HELD_S,
    LEADER,
    MODEL,
    SLOTS_M,
    SPEED_MPS,
    Array,
    carried,
    cycle_input,
    flown,
    in_formation,
    law,
    parameters,
    sent,
    with_rows,
)

TURNING = Setpoints(np.array((23.5, 22.0, 22.0)), np.array((0.25, 0.0, 0.0)), np.array((106.0, 104.0, 94.0)))
"""Setpoints with which the leader speeds up, turns right and climbs."""


def keeping_up() -> tuple[FlightStates, SlotMotion]:
    """Return a leader that turns right, and followers that move exactly as their moving slots do."""
    states = in_formation(0.1)
    turn_rps = (TURNING.heading_rad[0] - 0.1) / MODEL.tau_psi_s[0]
    velocity_mps = np.array([[0.0, 0.0, 0.0], [0.6, -0.5, 0.3], [-0.4, 0.7, -0.2]])
    acceleration_mps2 = np.array([[0.0, 0.0, 0.0], [0.05, 0.08, -0.06], [-0.07, 0.04, 0.09]])
    forward_mps = SPEED_MPS - turn_rps * SLOTS_M[:, 1] + velocity_mps[:, 0]
    right_mps = turn_rps * SLOTS_M[:, 0] + velocity_mps[:, 1]
    table = states.table.copy()
    table[3] = 0.5 + velocity_mps[:, 2]
    table[4], table[5] = np.hypot(forward_mps, right_mps), 0.1 + np.arctan2(right_mps, forward_mps)
    return FlightStates(*table), SlotMotion(SLOTS_M, velocity_mps, acceleration_mps2)


def slots_after(slots: SlotMotion, over_s: float) -> SlotMotion:
    return slots.after(np.full(COUNT, over_s))


def test_what_moves_as_its_slot_does_is_commanded_to_accelerate_as_it_does() -> None:
    """Error and rate are 0; the feed-forward leaves no error of second order in time, whatever leader and slots do."""
    states, slots = keeping_up()
    decided = law().decide(cycle_input(states, TURNING, turn_rps=0.06, slots=slots), AT_ONCE_S)
    np.testing.assert_allclose(decided.error_m, 0.0, atol=1e-12)
    commanded = Setpoints.of(np.concatenate((TURNING.table[:, :1], decided.setpoints.table), axis=1))
    over_s = 0.02
    after = flown(states, commanded, over_s, leader_turns_rps=0.06)
    left = law().decide(cycle_input(after, commanded, slots=slots_after(slots, over_s)), AT_ONCE_S)
    np.testing.assert_allclose(left.error_m / over_s**2, 0.0, atol=0.01)  # m/s²; the leader's own are 0.4 and more


def test_the_rate_is_that_of_the_mixed_error() -> None:
    """The derivative acts on the mixed error's rate by model (7), computed from states only."""
    states, slots = keeping_up()
    off = np.array([[2.0, -1.5], [-1.0, 2.5], [0.8, 1.2], [0.4, -0.3], [1.1, -0.9], [0.06, -0.08]])
    states = with_rows(states, slice(0, 6), states.table[:6, FOLLOWERS] + off)
    commanded = Setpoints.of(TURNING.table + np.array([[0.0, 1.0, -1.5], [0.0, 0.0, 0.0], [0.0, 3.0, -2.0]]))
    commanded.heading_rad[FOLLOWERS] = states.heading_rad[FOLLOWERS] + (0.2, -0.1)
    here = cycle_input(states, commanded, turn_rps=0.06, slots=slots)
    unit = np.ones(3)
    rate = sent(law(kd=unit).decide(here, AT_ONCE_S)) - sent(law().decide(here, AT_ONCE_S))
    step_s = 0.01
    mixed = [law().decide(here, AT_ONCE_S).mixed]
    for k in (1, 2):
        after = flown(states, commanded, k * step_s, leader_turns_rps=0.06)
        moved = Setpoints.of(commanded.table + np.array([[0.0], [0.06 * k * step_s], [0.0]]) * [1.0, 0.0, 0.0])
        mixed.append(law().decide(cycle_input(after, moved, 0.06, slots_after(slots, k * step_s)), AT_ONCE_S).mixed)
    expected = (-3.0 * mixed[0] + 4.0 * mixed[1] - mixed[2]) / (2.0 * step_s)
    np.testing.assert_allclose(rate, expected, atol=2e-4)


def test_a_proportional_law_is_the_mixer_times_its_gain() -> None:
    """Equation (13): 2 m behind, 3 m left, 1 m below; and 0.5 m/s too fast, 0.02 rad to the right of the path."""
    states, kp = in_formation(), np.array((1.0, 0.5, 2.0))
    off = with_rows(states, slice(0, 3), states.table[:3, FOLLOWERS] - np.array([[2.0], [3.0], [1.0]]))
    off = with_rows(off, slice(4, 6), off.table[4:6, FOLLOWERS] + np.array([[0.5], [0.02]]))
    decided = law(kp).decide(cycle_input(off), DT_S)
    mixed = np.array((0.1 * -0.5 + 1.0 * 2.0, 0.3 * -0.02 + 0.05 * 3.0, 0.7 * 1.0))
    np.testing.assert_allclose(decided.mixed, [mixed, mixed])
    np.testing.assert_allclose(sent(decided) - sent(law().decide(cycle_input(off), DT_S)), [kp * mixed, kp * mixed])


def test_scheduled_gains_are_base_and_span_of_the_nominal_ones() -> None:
    """Equation (14): k = k_nominal (base + span F), F from the mixed error and its rate by their scales."""
    kp, ki, kd, scales = np.array((3.0, 0.5, 2.0)), np.array((0.8, 0.1, 0.2)), np.array((6.5, 1.0, 0.5)), (8.0, 2.0)
    states = with_rows(in_formation(), 0, in_formation().table[0, FOLLOWERS] - 3.0)
    states = with_rows(states, 4, np.array((21.5, 22.4)))
    scheduler = FuzzyGainScheduler()
    decided = law(kp, ki, kd, scheduler=scheduler, scales=scales).decide(cycle_input(states), DT_S)
    rate = sent(law(kd=np.ones(3)).decide(cycle_input(states), DT_S)) - sent(law().decide(cycle_input(states), DT_S))
    share = 0.7 + 0.6 * scheduler.infer(decided.mixed / scales[0], rate / scales[1])
    expected = np.concatenate([share[:, :, each] * k for each, k in enumerate((kp, ki, kd))], axis=1)
    np.testing.assert_allclose(decided.gains, expected, atol=1e-12)
    assert np.ptp(share) > 0.1


def behind(metres: float) -> CycleInput:
    states = in_formation()
    return cycle_input(with_rows(states, 0, states.table[0, FOLLOWERS] - metres))


def test_an_integral_grows_by_gain_error_and_time() -> None:
    flying, ki = law(ki=np.array((0.5, 0.0, 0.0))), 0.5
    asked = [sent(flying.decide(behind(1.0), DT_S))[0, 0] - SPEED_MPS for _ in range(4)]
    np.testing.assert_allclose(asked, ki * 1.0 * DT_S * np.arange(4), atol=1e-12)


def test_nothing_is_estimated_of_a_setpoint_that_was_replaced_nor_kept_of_one_that_is_not_commanded() -> None:
    flying, here = law(ki=np.array((0.5, 0.0, 0.0))), behind(1.0)
    flying.decide(here, DT_S)
    replaced = [AS_DECIDED, (True, False, False), AS_DECIDED]
    flying.decide(tables.changed(here, replaced=replaced), DT_S)
    asked = sent(flying.decide(here, DT_S))[:, 0] - SPEED_MPS
    np.testing.assert_allclose(asked, (0.05, 0.10), atol=1e-12)
    flying.decide(tables.changed(here, active=[True, False, True]), DT_S)
    asked = sent(flying.decide(here, DT_S))[:, 0] - SPEED_MPS
    np.testing.assert_allclose(asked, (0.0, 0.20), atol=1e-12)


@pytest.mark.parametrize("controller", [FollowerController, VelocityController])
def test_other_gains_act_at_once_and_keep_what_is_integrated(controller: Callable[[LawParameters], Controller]) -> None:
    fast, slow = np.array((0.5, 0.2, 0.3)), np.array((0.1, 0.05, 0.2))
    plain = FormationLaw(parameters(kp=fast, ki=fast), tables.models(MODEL), controller)
    flying = tables.TableLaw(plain)
    before = [sent(flying.decide(behind(1.0), DT_S))[0, 0] for _ in range(4)][-1] - SPEED_MPS
    plain.retune(parameters(kp=slow, ki=slow))
    after, then = (sent(flying.decide(behind(1.0), DT_S))[0, 0] - SPEED_MPS for _ in range(2))
    integral = before - fast[0] + fast[0] * DT_S
    assert (after, then) == pytest.approx((slow[0] + integral, slow[0] + integral + slow[0] * DT_S))


def test_behind_a_new_leader_everything_begins_again() -> None:
    flying, here = law(ki=np.array((0.5, 0.0, 0.0))), behind(1.0)
    for _ in range(5):
        flying.decide(here, DT_S)
    decided = flying.decide(tables.changed(here, lead=tables.changed(here.lead, leader=1)), DT_S)
    assert decided.indices == [0, 2]
    np.testing.assert_allclose(decided.gains[0, 3:6], (0.5, 0.0, 0.0))
    again = flying.decide(here, DT_S)
    assert again.indices == [1, 2]
    np.testing.assert_allclose(sent(again)[:, 0], SPEED_MPS)


@pytest.mark.parametrize(("channel", "share", "limits"), [(0, 1.6, (1.2, 1.8)), (1, 1.04, (0.2, 0.3))])
def test_a_correction_grows_as_fast_as_the_vehicle_follows_and_shrinks_at_once(
    channel: int, share: float, limits: tuple[float, float]
) -> None:
    """Speed by 1.6 times the maximum acceleration, heading by 1.04 times the maximum turn rate."""
    gain = np.zeros(3)
    gain[channel] = (0.75, 2.0)[channel]
    flying, most = law(kp=gain), share * DT_S * np.array(limits)

    def asked(metres: float, *, replaced: bool = False) -> Array:
        states, rule = in_formation(), [AS_DECIDED] * COUNT
        rule[2] = (replaced and channel == 0, replaced and channel == 1, False)
        here = cycle_input(with_rows(states, channel, states.table[channel, FOLLOWERS] - metres))
        return sent(flying.decide(tables.changed(here, replaced=rule), DT_S))[:, channel] - (SPEED_MPS, 0.0)[channel]

    np.testing.assert_allclose(asked(0.0), 0.0, atol=1e-12)
    np.testing.assert_allclose(asked(4.0), most)
    np.testing.assert_allclose(asked(4.0), 2 * most)
    np.testing.assert_allclose(asked(0.05), 0.05 * gain[channel] * (1.0, 0.05)[channel])
    np.testing.assert_allclose(asked(-4.0), -most)
    np.testing.assert_allclose(asked(-4.0), -2 * most)
    as_wanted = -4.0 * gain[channel] * (1.0, 0.05)[channel]
    np.testing.assert_allclose(asked(-4.0, replaced=True), (-3 * most[0], as_wanted))


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("closing_mps", [-2.0, 0.0, 3.0])
def test_a_slot_is_closed_on_no_faster_than_can_be_braked_from(side: float, closing_mps: float) -> None:
    """v² = 2 a x with half the maximum acceleration, plus 1 m/s, plus the vehicle's shortfall against that."""
    states, errors_m = in_formation(), side * np.array((4.0, 6.0))
    states = with_rows(states, 0, states.table[0, FOLLOWERS] - errors_m)
    states = with_rows(states, 4, states.table[4, FOLLOWERS] + side * closing_mps)
    commanded = sent(law(kp=np.array((3.0, 0.0, 0.0))).decide(cycle_input(states), DT_S))[:, 0] - SPEED_MPS
    most = 1.0 + np.sqrt(MODEL.accel_max_mps2[FOLLOWERS] * np.abs(errors_m))
    most += np.maximum(most - closing_mps, 0.0)
    assert (most < 3.0 * (np.abs(errors_m) - 0.1 * closing_mps)).all()
    np.testing.assert_allclose(commanded, side * most)


def test_nothing_is_integrated_of_an_error_that_is_flown_off() -> None:
    """From 30 m behind at 3 m/s, until it has had its slot's speed for 5 s; a lasting offset is integrated."""
    flying = law(ki=np.array((0.5, 0.0, 0.0)))

    def gathers(metres: float, faster_mps: float, ticks: int) -> Array:
        states = with_rows(in_formation(), 0, in_formation().table[0, FOLLOWERS] - metres)
        states = with_rows(states, 4, states.table[4, FOLLOWERS] + faster_mps)
        commanded = [sent(flying.decide(cycle_input(states), DT_S))[:, 0] for _ in range(ticks)]
        return commanded[-1] - commanded[0]

    np.testing.assert_allclose(gathers(30.0, 3.0, 20), 0.0, atol=1e-9)
    np.testing.assert_allclose(gathers(0.5, 3.0, 10), 0.0, atol=1e-9)
    np.testing.assert_allclose(gathers(0.5, 0.0, 49), 0.0, atol=1e-9)
    assert (gathers(0.5, 0.0, 20) > 0.3).all()
    assert (gathers(30.0, 0.0, 5) > 0.3).all()


def test_the_height_of_a_correction_is_as_wanted() -> None:
    flying = law(kp=np.array((0.0, 0.0, 2.0)))
    for metres in (0.0, 8.0):
        states = in_formation()
        here = cycle_input(with_rows(states, 2, states.table[2, FOLLOWERS] - metres))
        np.testing.assert_allclose(sent(flying.decide(here, DT_S))[:, 2], (104.0, 94.0) + 2.0 * 0.7 * np.array(metres))


def test_a_gust_is_led_by_how_fast_its_drift_is_followed() -> None:
    """The drift's estimate has a lag of 1/2 s; the setpoint leads the required change of airspeed by tau."""
    flying, gust_mps, pole_radps = law(), np.array((0.5, 0.4)), 2.0
    flying.decide(cycle_input(carried((0.0, 0.0))), DT_S)
    for tick in range(3):
        here = cycle_input(carried(tuple(gust_mps)))
        forward = sent(law().decide(here, DT_S))
        change_mps2 = pole_radps * gust_mps * np.exp(-pole_radps * DT_S * tick)
        target_mps, angle = np.hypot(SPEED_MPS - 0.5, 0.4), np.arctan2(-0.4, SPEED_MPS - 0.5)
        along = -(change_mps2[0] * np.cos(angle) + change_mps2[1] * np.sin(angle))
        across = -(change_mps2[1] * np.cos(angle) - change_mps2[0] * np.sin(angle))
        lags = HELD_S[:, FOLLOWERS]
        led = sent(flying.decide(here, DT_S)) - forward
        np.testing.assert_allclose(led, np.array((lags[0] * along, lags[1] * across / target_mps, (0.0, 0.0))).T)


def test_a_change_of_wind_within_what_is_not_known_of_it_is_no_gust() -> None:
    """A change beyond three standard deviations counts, minus their square."""

    def led(gust_mps: float) -> float:
        flying, unknown = law(), [0.06**2, 0.08**2, 0.0]  # 0.1 m/s for the pair 0, 1
        flying.decide(tables.changed(cycle_input(carried((0.0, 0.0))), wind_variance=unknown), DT_S)
        here = tables.changed(cycle_input(carried((gust_mps, 0.0))), wind_variance=unknown)
        return float(SPEED_MPS - gust_mps - sent(flying.decide(here, DT_S))[0, 0])

    assert led(0.29) == pytest.approx(0.0, abs=1e-12)
    assert led(0.6) == pytest.approx(HELD_S[0, 1] * 2.0 * 0.6 * (1.0 - 0.09 / 0.36))


def test_a_share_of_the_bandwidth_is_that_of_the_gains_and_its_square_of_the_integral() -> None:
    gains, share = (np.array((3.0, 0.5, 2.0)), np.array((0.8, 0.1, 0.2)), np.array((6.5, 1.0, 0.5))), 0.5
    here = tables.changed(behind(0.0), bandwidth=[[share] * 3] * COUNT)
    shown = law(*gains).decide(here, DT_S).gains[0]
    np.testing.assert_allclose(shown, np.concatenate((share * gains[0], share**2 * gains[1], share * gains[2])))


def test_a_correction_grows_by_a_gusts_answer_besides() -> None:
    """1.6 times the maximum acceleration, plus the setpoint's lead on the change of the drift, in both directions."""
    for wind_mps in ((0.5, 0.0), (-0.5, 0.0), (0.0, 0.5)):
        flying, steady = law(kp=np.array((9.0, 0.0, 0.0))), law()
        for each in (flying, steady):
            each.decide(cycle_input(carried((0.0, 0.0))), DT_S)
        states = carried(wind_mps)
        here = cycle_input(with_rows(states, 0, states.table[0, FOLLOWERS] - 4.0))
        led = sent(steady.decide(here, DT_S))[:, 0]
        answer = np.abs(led - sent(law().decide(here, DT_S))[:, 0])
        assert answer.max() > 0.05
        most = 1.6 * DT_S * MODEL.accel_max_mps2[FOLLOWERS] + answer
        np.testing.assert_allclose(sent(flying.decide(here, DT_S))[:, 0], led + most)


@pytest.mark.parametrize("ahead_m", [60.0, -60.0])
def test_a_gust_is_answered_within_what_a_correction_at_its_limit_leaves(ahead_m: float) -> None:
    """Far ahead of the slot a vehicle is commanded the least airspeed, whatever the gust; far behind, the highest."""
    min_mps, max_mps = 18.0, 26.0
    rows = MODEL.table.copy()
    rows[4:6] = [[min_mps], [max_mps]]
    correcting = parameters(kp=np.array((9.0, 0.0, 0.0)))
    flying = tables.TableLaw(FormationLaw(correcting, tables.models(AutopilotModels(*rows))))
    wind_mps, commanded_mps = 0.0, list[Array]()
    for tick in range(80):
        wind_mps -= 0.0 if tick < 60 else float(np.copysign(0.1, ahead_m))
        states = carried((wind_mps, 0.0))
        here = cycle_input(with_rows(states, 0, states.table[0, FOLLOWERS] + ahead_m))
        commanded_mps.append(sent(flying.decide(here, DT_S))[:, 0])
    np.testing.assert_allclose(commanded_mps[60:], min_mps if ahead_m > 0.0 else max_mps)


def test_setpoints_held_from_tick_to_tick_keep_a_turning_slot() -> None:
    """In a steady turn heading setpoints move once a tick: followers stay in their slots, and rates are 0."""
    turn_rps, table = 0.03, in_formation().table
    forward_mps, right_mps = SPEED_MPS - turn_rps * SLOTS_M[:, 1], turn_rps * SLOTS_M[:, 0]
    table[4], table[5] = np.hypot(forward_mps, right_mps), np.arctan2(right_mps, forward_mps)
    states, plain, derivative = FlightStates(*table), law(), law(kd=np.ones(3))
    ended_s = HELD_S[1] - DT_S  # lags of vehicles that flew at their mean rate at the end of the previous tick
    commanded = Setpoints(states.airspeed_mps, states.heading_rad + ended_s * turn_rps, states.height_m)
    for tick in range(20):
        commanded.heading_rad[LEADER] = turn_rps * (DT_S * tick + HELD_S[1, LEADER])
        here = cycle_input(states, commanded, turn_rps)
        decided = plain.decide(here, DT_S)
        rate = sent(derivative.decide(here, DT_S)) - sent(decided)
        np.testing.assert_allclose(decided.error_m, 0.0, atol=5e-4)
        np.testing.assert_allclose(rate, 0.0, atol=2e-5)
        commanded = Setpoints.of(np.concatenate((commanded.table[:, [LEADER]], decided.setpoints.table), axis=1))
        states = flown(states, commanded, DT_S)


def test_who_was_not_commanded_meets_no_gust_and_no_slew_afterwards() -> None:
    flying, still = law(kp=np.array((0.75, 0.0, 0.0))), cycle_input(carried((0.0, 0.0)))
    flying.decide(still, DT_S)
    flying.decide(tables.changed(still, active=[True, False, True]), DT_S)
    states = carried((0.4, 0.0))
    here = cycle_input(with_rows(states, 0, states.table[0, FOLLOWERS] - 4.0))
    begun, going_on = sent(flying.decide(here, DT_S))[:, 0]
    assert begun == pytest.approx(SPEED_MPS - 0.4 + 0.75 * (4.0 - 0.1 * 0.4))
    assert going_on < begun - 1.0
