"""The formation law in the followers' own frame: slots swing with their followers' headings."""

from __future__ import annotations

import numpy as np

from flight_model.vehicle_arrays import FlightStates, Setpoints
from formation_scenario.slot_motion import SlotMotion
from tests.gcs_formation.control.law_ticks import (
    AT_ONCE_S,
    DT_S,
    FOLLOWERS,
    HELD_S,
    LEADER,
    SLOTS_M,
    SPEED_MPS,
    carried,
    cycle_input,
    flown,
    in_formation,
    law,
    sent,
    with_rows,
)


def towed_and_off() -> FlightStates:
    """Return vehicles northwards, followers beside their slots with headings that differ from the leader's."""
    states = in_formation()
    off = np.array([[2.0, -1.5], [-1.0, 2.5], [0.8, 1.2], [0.4, -0.3], [1.1, -0.9], [0.12, -0.08]])
    return with_rows(states, slice(0, 6), states.table[:6, FOLLOWERS] + off)


def test_what_a_heading_sweeps_a_slot_is_no_error_and_damps_as_30_m_behind() -> None:
    """20 m to the right, a slot moves forward by 20 m times the angle; 10 m behind, it swings like 1.36 s behind."""
    near = SLOTS_M + np.array([[0.0, 0.0, 0.0], [20.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    here = cycle_input(towed_and_off(), slots=SlotMotion.at_rest(near))
    decided = law(frame="follower_heading").decide(here, DT_S)
    off = np.sin(np.array((0.12, -0.08)))
    swept_m, swung_m = near[FOLLOWERS, 1] * off, np.array((1.36 * SPEED_MPS - 10.0, 0.0)) * off
    airspeed_mps = np.array([here.states.of(each, each).airspeed_mps for each in (1, 2)])
    along = 0.1 * (SPEED_MPS - airspeed_mps) + 1.0 * (decided.error_m[:, 0] + swept_m)
    to_side = 0.3 * -np.array((0.12, -0.08)) + 0.05 * (decided.error_m[:, 1] - swung_m)
    np.testing.assert_allclose(decided.mixed[:, :2].T, (along, to_side))


def test_the_rate_is_that_of_the_mixed_error() -> None:
    states = towed_and_off()
    commanded = Setpoints.of(np.array((states.airspeed_mps, states.heading_rad, states.height_m)))
    commanded.table[:, FOLLOWERS] += np.array([[1.0, -1.5], [0.2, -0.1], [3.0, -2.0]])
    commanded.height_m[LEADER] = 100.0
    here = cycle_input(states, commanded)
    decided = law(kd=np.ones(3), frame="follower_heading").decide(here, AT_ONCE_S)
    rate = (sent(decided) - sent(law(frame="follower_heading").decide(here, AT_ONCE_S))) / decided.gains[:, 6:]
    step_s = 0.01
    mixed = [
        law(frame="follower_heading")
        .decide(cycle_input(flown(states, commanded, k * step_s), commanded), AT_ONCE_S)
        .mixed
        for k in range(3)
    ]
    expected = (-3.0 * mixed[0] + 4.0 * mixed[1] - mixed[2]) / (2.0 * step_s)
    np.testing.assert_allclose(rate, expected, atol=2e-4)


def test_the_heading_of_a_slot_to_the_side_has_less_bandwidth() -> None:
    """0.6 s by itself, plus the time aside, of 1.36 s at most."""
    to_side = np.array([[0.0, 0.0, 0.0], [-30.0, -11.0, 0.0], [-30.0, 44.0, 0.0]])
    here = cycle_input(in_formation(), slots=SlotMotion.at_rest(to_side))
    shown = law(np.ones(3), frame="follower_heading").decide(here, DT_S).gains[:, :3]
    np.testing.assert_allclose(shown, [[1.0, 0.6 / (0.6 + 0.5), 1.0], [1.0, 0.6 / (0.6 + 1.36), 1.0]])


def test_a_steady_drift_is_flown_against() -> None:
    """Airspeed and heading give the leader's velocity over ground; the heading changes by the drift over the speed."""
    decided = law(frame="follower_heading").decide(cycle_input(carried((0.5, 0.4))), DT_S)
    heading = -np.arcsin(0.4 / SPEED_MPS)
    np.testing.assert_allclose(sent(decided)[:, :2], [[SPEED_MPS * np.cos(heading) - 0.5, heading]] * 2, atol=1e-4)


def test_a_gust_across_is_crabbed_against_slowly() -> None:
    """By 0.65 rad/s of what is left, led by the heading's lag; a slot aside swings, which the speed leads."""
    flying, across_mps, speed_mps = law(frame="follower_heading"), 0.44, SPEED_MPS
    flying.decide(cycle_input(carried((0.0, 0.0))), DT_S)
    asked = sent(flying.decide(cycle_input(carried((0.0, across_mps))), DT_S))[:, :2]
    followed_mps, followed_mps2 = across_mps * (1.0 - np.exp(-2.0 * DT_S)), 2.0 * across_mps  # by 2/s, from 0
    crab_rps = 0.65 * -followed_mps / speed_mps
    crab_rps2 = 0.65 * (-followed_mps2 / speed_mps - crab_rps)
    tau_s, swung_m = HELD_S[:, FOLLOWERS], -SLOTS_M[FOLLOWERS, 1]
    expected = speed_mps + swung_m * (crab_rps + tau_s[0] * crab_rps2), tau_s[1] * crab_rps
    np.testing.assert_allclose(asked, np.array(expected).T, atol=1e-9)
