"""The loops' share of their margins in use, and the bandwidth that reduces it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from flight_model.frequency_response import FREQUENCIES
from formation_scenario import load_scenario
from formation_scenario.consensus_graph import graph_adjacency
from formation_scenario.vehicles import VehicleModel
from gcs_formation.control.fuzzy_pid import PidGains
from gcs_formation.control.setpoint import Mixer
from gcs_formation.stability import LoopDelay, Usage, consensus_delay_margin, law_loops, scenario_delay_margin
from gcs_formation.stability.consensus_loops import ground_consensus_loops, laplacian
from gcs_formation.stability.mismatch import BANDWIDTHS, predicted_mismatch_margin
from gcs_formation.stability.pid_margins import AircraftResponse, Loop, delay_margin, forward_plant, right_plant

MIXER = Mixer(k_v=0.1, k_x=1.0, k_psi=0.1, k_y=0.05, k_z=1.0)
MODEL = VehicleModel(tau_v_s=4.0, tau_psi_s=1.5, tau_ha_s=1.0, tau_hb_s=3.0)
FORWARD = Loop(PidGains(3.0, 0.8, 6.5), forward_plant(MIXER, MODEL))
LOOPS = {
    "x": FORWARD,
    "y, follower's frame": Loop(PidGains(1.0, 0.6, 0.1), right_plant(MIXER, MODEL, 22.0, 60.0)),
    "y, leader's frame": Loop(PidGains(1.2, 0.5, 1.8), right_plant(MIXER, MODEL, 22.0)),
}
DIRECTED_RING = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]


@pytest.mark.parametrize("name", LOOPS)
@pytest.mark.parametrize("predicted", [False, True])
def test_less_bandwidth_uses_less_of_the_margin(name: str, predicted: bool) -> None:
    usage, delay = Usage([LOOPS[name]], predicted=predicted), LoopDelay(1.1, 0.05)
    used = [usage.of(delay, bandwidth) for bandwidth in BANDWIDTHS[::4]]
    assert (np.diff(used) < 0.0).all()


@pytest.mark.parametrize("name", LOOPS)
def test_a_slowed_loop_is_damped_no_worse(name: str) -> None:
    """Without delay, the damping ratio of its worst pole is the same, or at least 0.55."""
    poles = [LOOPS[name].slowed(bandwidth).open_loop().closed_loop_poles() for bandwidth in (1.0, 0.5, 0.2)]
    ratios = [float(np.min(-each.real / np.abs(each))) for each in poles]
    assert min(ratios[1:]) > min(ratios[0], 0.55)


@given(mean_s=st.floats(0.2, 5.0), most=st.floats(0.3, 0.95))
def test_the_bandwidth_is_the_greatest_that_uses_no_more(mean_s: float, most: float) -> None:
    usage, delay = Usage([FORWARD], predicted=False), LoopDelay(mean_s, 0.0)
    bandwidth = usage.bandwidth(delay, most)
    assert usage.of(delay, bandwidth) <= most or bandwidth == BANDWIDTHS[-1]
    if bandwidth < 1.0:
        above = BANDWIDTHS[BANDWIDTHS.index(bandwidth) - 1]
        assert usage.of(delay, above) > most


def test_a_delay_that_does_not_vary_is_predicted_over_whatever_it_is() -> None:
    assert Usage([FORWARD], predicted=True).of(LoopDelay(2.0, 0.0)) == 0.0


def test_a_loop_that_is_unstable_without_delay_uses_all_of_its_margin_however_well_the_delay_is_known() -> None:
    unstable = Loop(PidGains(-1.0, 0.0, 0.0), FORWARD.plant)
    for predicted in (False, True):
        assert Usage([unstable], predicted=predicted).of(LoopDelay(0.1, 0.0)) == math.inf


def test_loops_are_stable_around_the_aircraft_or_have_no_margin() -> None:
    """ArduPlane's airspeed oscillates with the gains for noise, but not at a tenth of their bandwidth."""
    keys = {"vehicles": {"count": 2, "model": "arduplane"}, "path": {"waypoints_m": [[0, 0, 150], [5000, 0, 150]]}}
    (axes,) = law_loops(load_scenario(keys | {"law": {"type": "pid", "gains": "noise"}})).values()
    for predicted in (False, True):
        usage = Usage(axes["x"], predicted=predicted)
        assert usage.of(LoopDelay(0.1, 0.001)) == math.inf
        assert usage.of(LoopDelay(0.1, 0.001), 0.1) < 0.2
    (loop,) = axes["x"]
    assert delay_margin(loop.open_loop()) == pytest.approx(2.675, abs=1e-3), "around (7)"


def test_around_an_aircraft_that_flies_as_equation_7_says_the_margin_is_that_of_equation_7() -> None:
    """Within the resolution of the frequency grid, 2 %."""
    same = AircraftResponse(np.ones(FREQUENCIES.size, dtype=np.complex128))
    for loop in LOOPS.values():
        assert replace(loop, aircraft=same).delay_margin_s() == pytest.approx(loop.delay_margin_s(), rel=0.03)


def test_two_deviations_are_held_against_the_mismatch_margin() -> None:
    margin_s = predicted_mismatch_margin(FORWARD, 0.7).min_s()
    assert Usage([FORWARD], predicted=True).of(LoopDelay(0.7, 0.02)) == pytest.approx(0.04 / margin_s)


def test_the_modes_of_the_protocol_have_its_margin() -> None:
    weights = graph_adjacency("path", 4)
    least = min(delay_margin(loop.open_loop()) for loop in ground_consensus_loops(weights, 1.0, 1.0, 0.5, 0.0))
    assert least == pytest.approx(consensus_delay_margin(weights, 1.0, 1.0, 0.5), rel=1e-9)


def test_slowing_the_protocol_is_scaling_its_weights() -> None:
    weights = graph_adjacency("star", 5)
    slowed = [loop.slowed(0.3) for loop in ground_consensus_loops(weights, 0.2, 0.8, 0.25, 0.1)]
    scaled = ground_consensus_loops(0.3 * weights, 0.2, 0.8, 0.25, 0.03)
    found_s, wanted_s = (min(delay_margin(loop.open_loop()) for loop in loops) for loops in (slowed, scaled))
    assert found_s == pytest.approx(wanted_s, rel=1e-9)


def growth(weights: np.ndarray, gains: tuple[float, float, float, float], delay_s: float, predicted_s: float) -> float:
    """Return the growth of the disagreement in the time domain, with states predicted `predicted_s` ahead."""
    (k1, k2, c, d), step, duration_s = gains, 0.01, 100.0
    count, steps, late, ahead = len(weights), round(duration_s / step), round(delay_s / step), round(predicted_s / step)
    exact = expm(np.array([[0.0, 1.0, 0.0], [0.0, -c, 1.0], [0.0, 0.0, 0.0]]) * step)
    advance, push = exact[:2, :2], exact[:2, 2]
    kernel = np.array([np.linalg.matrix_power(advance, age) @ push for age in range(ahead)]).reshape(ahead, 2)
    carry, matrix = np.linalg.matrix_power(advance, ahead), laplacian(weights)
    sent, states = np.zeros((steps + ahead, count)), np.zeros((steps + 1, 2, count))
    states[0, 0] = np.arange(count) == 0
    for now in range(steps):
        ahead_of = kernel.T @ sent[now : now + ahead][::-1]
        position, velocity = carry @ states[max(now - late, 0)] * (now >= late) + ahead_of
        sent[now + ahead] = -matrix @ (k1 * position + k2 * velocity) - d * velocity
        states[now + 1] = advance @ states[now] + np.outer(push, sent[now + ahead])
    difference = np.abs(np.diff(states[:, 0], axis=1)).max(axis=1)
    fifth = steps // 5
    return float(difference[-fifth:].max() / difference[fifth : 2 * fifth].max())


@pytest.mark.parametrize(
    ("weights", "gains"),
    [
        pytest.param(graph_adjacency("path", 3), (0.4, 1.2, 0.5, 0.0), id="path"),
        pytest.param(np.array(DIRECTED_RING, dtype=np.float64), (0.4, 1.2, 0.5, -0.1), id="complex eigenvalues"),
    ],
)
def test_the_predicted_protocol_stands_mismatch_up_to_its_margin(weights: np.ndarray, gains) -> None:
    nominal_s = 1.0
    margins = [predicted_mismatch_margin(loop, nominal_s) for loop in ground_consensus_loops(weights, *gains)]
    longer_s = min(margin.longer_s for margin in margins)
    assert growth(weights, gains, nominal_s, nominal_s) < 0.5
    assert growth(weights, gains, nominal_s + 0.9 * longer_s, nominal_s) < 1.0
    assert growth(weights, gains, nominal_s + 1.1 * longer_s, nominal_s) > 1.0


def test_the_watched_loops_of_the_law_have_the_margin_that_is_reported() -> None:
    for law in ({"type": "fuzzy_pid"}, {"type": "pid"}, {"type": "consensus"}):
        scenario = load_scenario(
            {"schema": 1, "vehicles": {"count": 4}, "law": law, "path": {"waypoints_m": [[0, 0, 100], [3000, 0, 100]]}}
        )
        loops = [loop for axes in law_loops(scenario).values() for each in axes.values() for loop in each]
        least = min(delay_margin(loop.open_loop()) for loop in loops)
        assert least == pytest.approx(scenario_delay_margin(scenario), rel=1e-9)
