"""Gains of the consensus protocol by design, against the closed loops that they make."""

import math

import numpy as np
import pytest

from flight_model.consensus_design import Axis, Delays, consensus_gains
from flight_model.energy import AirframeParameters
from flight_model.frequency_response import airframe_responses, lag_responses
from flight_model.gain_design import BANDWIDTHS, DELAY_MARGIN_S, FREQUENCIES, PAIR, PEAK, STEPS, late, stable_delay_s
from formation_scenario.vehicles import EnergyAirframe

SPEED_MPS, TAU_V_S, TAU_PSI_S = 22.0, 2.0, 3.0
SENSOR_M, SAMPLING_S, NEAR = 0.02, 0.1, Delays(0.1, 0.0)
STAR_OF_4 = (0.0, 1.0, 1.0, 4.0)


def axes(responses):
    return Axis.along(TAU_V_S, responses.speed), Axis.across(TAU_PSI_S, responses.heading, SPEED_MPS)


AIRCRAFT = axes(airframe_responses(FREQUENCIES, AirframeParameters.of(EnergyAirframe().parameters()), SPEED_MPS))
LAGS = axes(lag_responses(FREQUENCIES, TAU_V_S, TAU_PSI_S, (1.0, 3.0)))


def loop(gains, axis, mode):
    k1, k2, k3 = gains
    s = 1j * FREQUENCIES
    return axis.lag_s * (mode * (k1 / s + k2) + k3 - 1.0 / axis.lag_s) * axis.response * late(SAMPLING_S)


@pytest.mark.parametrize("links_s", [0.0, 0.6])
def test_every_mode_around_the_aircraft_has_the_delay_margin_and_the_peak_that_a_pids_loops_have(links_s):
    gains = consensus_gains([AIRCRAFT], STAR_OF_4, SENSOR_M, Delays(SAMPLING_S, links_s))
    for mode in (0.0, 1.0, 4.0):
        for axis in AIRCRAFT:
            closed = loop(gains, axis, mode)
            assert stable_delay_s(closed, 1 if mode else 0) >= DELAY_MARGIN_S + links_s
            assert np.max(1.0 / np.abs(1.0 + closed)) <= PEAK


def test_the_papers_gains_are_unstable_around_an_aircraft_and_stable_around_its_model():
    paper = 0.1, 0.6, 0.25
    assert stable_delay_s(loop(paper, AIRCRAFT[0], 4.0), 1) == 0.0
    assert stable_delay_s(loop(paper, LAGS[0], 4.0), 1) > 0.5


def test_the_fastest_mode_is_as_fast_on_every_graph():
    (few, _, damping), (many, _, same) = (
        consensus_gains([AIRCRAFT], (0.0, 1.0, most), SENSOR_M, NEAR) for most in (4.0, 10.0)
    )
    assert 4.0 * few == pytest.approx(10.0 * many)
    assert damping == same == 1.0 / TAU_V_S


def test_noise_of_positions_moves_setpoints_by_no_more_than_a_pids():
    noise_m = 0.2
    k1, _, _ = consensus_gains([AIRCRAFT], STAR_OF_4, noise_m, NEAR)
    assert TAU_V_S * 4.0 * k1 * PAIR * noise_m <= STEPS[0]
    assert TAU_PSI_S * 4.0 * k1 * PAIR * noise_m <= STEPS[1] * SPEED_MPS
    assert 4.0 * k1 < 4.0 * consensus_gains([AIRCRAFT], STAR_OF_4, SENSOR_M, NEAR)[0]


def test_links_over_which_nothing_holds_leave_the_slowest_that_is_tried():
    k1, _, _ = consensus_gains([AIRCRAFT], STAR_OF_4, SENSOR_M, Delays(SAMPLING_S, math.inf))
    assert 4.0 * k1 == pytest.approx(BANDWIDTHS[-1])


def test_a_loop_of_gain_1_at_the_highest_frequency_counts_as_unstable():
    assert stable_delay_s(np.full(FREQUENCIES.size, 1.01 + 0j), 0) == 0.0
    assert stable_delay_s(np.full(FREQUENCIES.size, 0.99 + 0j), 0) == math.inf
