"""Parts of the estimation by closed forms: interpolation, simulations, sums of products, correlation, stages."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from librt.vecs import vec

from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from formation_scenario import load_scenario
from formation_scenario.vehicles import VehicleModel
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.time_constants.estimator import VehicleEstimator
from gcs_formation.features.time_constants.feature import FEATURE
from gcs_formation.features.time_constants.interpolation import BOUND, Nodes
from gcs_formation.features.time_constants.model_set import ModelSet, ResidualBatch, Samples
from gcs_formation.features.time_constants.persistence import Persistence
from gcs_formation.features.time_constants.stages import MotionSeen, TimeConstants, TimeConstantsOff
from gcs_formation.features.time_constants.sums_of_products import (
    add_products,
    centred,
    count_of,
    information_of,
    inverse_with,
    projected,
    residual_square,
    weights_near,
    zeros,
)
from gcs_formation.from_scenario import autopilot_models
from tests.flights.conftest import scenario
from tests.gcs_formation import tables
from tests.gcs_formation.features.time_constants.test_estimation import models

RATIOS = st.floats(-BOUND, BOUND)
BELIEVED = VehicleModel()
SPEED_S, HEADING_S, SLOW_S, FAST_S = BELIEVED.tau_v_s, BELIEVED.tau_psi_s, BELIEVED.tau_ha_s, BELIEVED.tau_hb_s


def model() -> AutopilotModel:
    return tables.models(models(np.ones((1, 4))))[0]


@settings(deadline=None, max_examples=30, derandomize=True)
@given(at=RATIOS)
def test_five_simulations_interpolate_polynomials_of_the_fourth_degree_and_their_slopes(at: float) -> None:
    """Chebyshev points of the logarithms from half to double; weights of a constant add up to 1."""
    nodes = Nodes(5, 1)
    assert sorted(each[0] for each in nodes.at) == pytest.approx(
        [math.log(2.0) * math.cos(math.pi * odd / 10.0) for odd in (9, 7, 5, 3, 1)]
    )
    weights, slopes = nodes.weights([at])
    for power in range(5):
        values = [each[0] ** power for each in nodes.at]
        assert np.dot(weights, values) == pytest.approx(at**power, abs=1e-9)
        assert np.dot(slopes, values) == pytest.approx(power * at ** max(power - 1, 0), abs=1e-9)


@settings(deadline=None, max_examples=20, derandomize=True)
@given(one=RATIOS, other=RATIOS)
def test_sixteen_simulations_interpolate_products_of_two_cubics(one: float, other: float) -> None:
    nodes = Nodes(4, 2)
    weights, by_one, by_other = nodes.weights([one, other])
    values = [first**3 * second**2 for first, second in nodes.at]
    assert np.dot(weights, values) == pytest.approx(one**3 * other**2, abs=1e-9)
    assert np.dot(by_one, values) == pytest.approx(3.0 * one**2 * other**2, abs=1e-9)
    assert np.dot(by_other, values) == pytest.approx(one**3 * 2.0 * other, abs=1e-9)


def batches(count: int) -> list[ResidualBatch]:
    return [ResidualBatch(count, 40) for _ in range(3)]


def flown_by(setpoint: tuple[float, float, float], seconds: float) -> tuple[list[bool], list[list[float]]]:
    """Return which channels are usable, and the last values of the simulations, by half, declared and double."""
    ratios = [math.log(ratio) for ratio in (0.5, 1.0, 2.0)]
    simulated = ModelSet(model(), [[each] for each in ratios], [[each, each] for each in ratios])
    simulated.initialise([False] * 3, 0, (22.0, 3.1, 100.0, 0.0))
    assert simulated.flying
    samples = Samples(40)
    for tick in range(round(seconds * 10) + 1):
        samples.add(tick * 100_000_000, (0.0, 0.0, 0.0, 0.0))
    sent: Any = SimpleNamespace(acting=lambda _: 0, later=lambda index, _: index, mean=lambda *_: setpoint)
    found = batches(3)
    usable = simulated.fly(samples, sent, found)
    return usable, [list(each.rows[each.count - 1])[:3] for each in found]


@pytest.mark.parametrize("seconds", [0.1, 1.0, 3.0])
def test_simulations_follow_a_step_as_the_lags_of_equation_7_do(seconds: float) -> None:
    """exp(-t / tau), and of two lags (a exp(-t / a) - b exp(-t / b)) / (a - b), the climb 0 at first; over pi too."""
    usable, (speeds, headings, heights) = flown_by((22.5, -3.1, 101.0), seconds)
    assert usable == [True] * 3
    turn_rad = math.tau - 6.2
    for place, ratio in enumerate((0.5, 1.0, 2.0)):
        assert speeds[place] == pytest.approx(22.5 - 0.5 * math.exp(-seconds / (SPEED_S * ratio)))
        left_rad = turn_rad * math.exp(-seconds / (HEADING_S * ratio))
        assert math.remainder(headings[place] + 3.1 + left_rad, math.tau) == pytest.approx(0.0, abs=1e-9)
        slow_s, fast_s = SLOW_S * ratio, FAST_S * ratio
        left = slow_s * math.exp(-seconds / slow_s) - fast_s * math.exp(-seconds / fast_s)
        assert heights[place] == pytest.approx(101.0 - left / (slow_s - fast_s))


@pytest.mark.parametrize(("share", "usable"), [(0.59, True), (0.61, False)])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_beyond_six_tenths_of_a_rate_limit_a_batch_is_not_used(share: float, usable: bool, sign: float) -> None:
    """The error over the time constant is the rate that is asked for."""
    errors = (
        BELIEVED.accel_max_mps2 * SPEED_S,
        BELIEVED.turn_rate_max_rps * HEADING_S,
        BELIEVED.climb_max_mps * (SLOW_S + FAST_S),
    )
    speed_mps, turn_rad, climb_m = (sign * share * each for each in errors)
    found, _ = flown_by((22.0 + speed_mps, 3.1 + turn_rad, 100.0 + climb_m), 0.1)
    inside = BELIEVED.speed_min_mps <= 22.0 + speed_mps <= BELIEVED.speed_max_mps
    assert found[1:] == [usable] * 2
    assert found[0] is usable or not inside


def test_at_a_rate_limit_simulations_change_at_that_rate() -> None:
    _, (_, headings, heights) = flown_by((22.0, 3.1 - 2.9, 400.0), 1.0)
    turned = [math.remainder(3.1 - each, math.tau) for each in headings]
    assert turned[0] == pytest.approx(BELIEVED.turn_rate_max_rps, abs=1e-6)
    assert all(each <= 100.0 + BELIEVED.climb_max_mps + 1e-6 for each in heights)


def test_without_setpoints_nothing_is_used() -> None:
    assert flown_by((math.nan, 0.0, 100.0), 1.0)[0] == [False] * 3


def test_samples_are_interpolated_and_headings_the_short_way_round() -> None:
    samples = Samples(5)
    samples.add(1_000_000_000, (20.0, math.pi - 0.1, 100.0, 0.0))
    samples.add(1_000_000_000, (99.0, 9.0, 999.0, 0.0))
    samples.add(2_000_000_000, (22.0, -math.pi + 0.1, 104.0, 0.0))
    assert samples.count == 2
    assert samples.span_s == 1.0
    speed_mps, heading_rad, height_m = samples.near(1, 1_750_000_000)
    assert (speed_mps, height_m) == pytest.approx((21.5, 103.0))
    assert math.remainder(heading_rad - math.pi - 0.05, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_a_batch_is_excited_by_one_sample_in_which_simulations_differ() -> None:
    batch = ResidualBatch(3, 4)
    for last in (0.0, 0.11, 0.0):
        row = batch.next()
        row[0], row[1], row[2] = 0.3, 9.0, 0.3 - last
    assert batch.excited(0.1)
    assert not batch.excited(0.12)
    batch.clear()
    assert not batch.excited(0.1)


def test_independent_residuals_count_alike_and_slow_ones_for_as_long_as_they_last() -> None:
    """Of an autoregression with rho = 0.8: (1 + rho) / (1 - rho) = 9."""
    random = np.random.default_rng(3)
    white, slow, value = Persistence(0.1), Persistence(0.1), 0.0
    assert (white.batches, white.variance) == (pytest.approx(6.0), pytest.approx(0.01))
    worth, ended = list[float](), list[float]()
    for _ in range(3000):
        white.add_batch(random.normal())
        value = 0.8 * value + math.sqrt(1.0 - 0.64) * random.normal()
        slow.add_batch(value)
        worth.append(slow.batches)
        ended.append(white.batches)
    assert np.mean(ended[500:]) == pytest.approx(1.4, abs=0.35)
    assert np.mean(worth[500:]) == pytest.approx(8.0, abs=2.0)
    assert white.variance == pytest.approx(1.0, rel=0.4)


def test_the_first_two_batches_by_hand() -> None:
    """0.02 and 0.05: one step of 0.03; what was assumed is forgotten by exp(-1/60)."""
    found, kept = Persistence(0.1), math.exp(-1.0 / 60.0)
    found.add_batch(0.02)
    assert found.variance == pytest.approx(0.01)
    found.add_batch(0.05)
    assert found.variance == pytest.approx(kept * 0.01 / 2.0)
    seen = max(1.0, 4.0 * kept * 0.01 / (kept * 0.02 + 0.0009) - 1.0)
    assert found.batches == pytest.approx((5.0 * 6.0 + seen) / 6.0)
    found.add_batch(math.nan)
    found.add_batch(7.0)
    assert found.variance == pytest.approx(kept * 0.01 / 2.0), "no step over a gap"


@pytest.mark.parametrize("parameters", [1, 2])
def test_sums_of_products_are_those_of_weighted_means(parameters: int) -> None:
    """By arrays: residuals r = X w, their derivatives, about their means."""
    random = np.random.default_rng(parameters)
    rows = np.column_stack((random.normal(size=(30, 4)) + 1.5, np.ones(30)))
    weights = random.normal(size=(parameters + 1, 4))
    sums, same = zeros(5), zeros(5)
    for row in rows:
        add_products(vec[float](row.tolist()), sums, same)
    assert count_of(sums) == 30.0
    assert [list(each) for each in sums] == [list(each) for each in same]
    packed = vec[vec[float]]([vec[float](each) for each in weights.tolist()])
    seen = centred(projected(sums, packed))
    means = rows[:, :4] @ weights.T
    off = means - means.mean(axis=0)
    products = off.T @ off
    for one in range(parameters + 1):
        assert list(seen[one]) == pytest.approx(products[one, : one + 1].tolist())
    assert list(seen[parameters + 1]) == pytest.approx([*means.sum(axis=0).tolist(), 30.0])
    by = [0.3, -0.2][:parameters]
    moved = off[:, 0] + off[:, 1:] @ np.array(by)
    assert residual_square(seen, by) == pytest.approx(moved @ moved)
    assert list(weights_near(packed, by)) == pytest.approx((weights[0] + np.array(by) @ weights[1:]).tolist())
    information = np.array(information_of(seen, 2.0))
    assert information == pytest.approx(2.0 * products[1:, 1:])
    inverse = np.array(inverse_with(information.tolist(), 0.7))
    assert inverse @ (information + 0.7 * np.eye(parameters)) == pytest.approx(np.eye(parameters), abs=1e-9)


@pytest.mark.parametrize("by_course", [False, True])
def test_motion_is_taken_as_measured_and_a_course_as_the_heading_that_the_filter_shows(by_course: bool) -> None:
    """In a wind of 5 m/s from the side: ground velocity less wind is to the north."""
    taken = list[Any]()
    estimator: Any = SimpleNamespace(add_sample=lambda *given: taken.append(given))
    sample = SimpleNamespace(
        stamp=7,
        airspeed_mps=20.0,
        heading_rad=0.3,
        height_m=100.0,
        climb_mps=1.0,
        by_course=by_course,
        north_mps=20.0,
        east_mps=5.0,
    )
    state = FlightState(0.0, 0.0, 100.0, 1.0, 20.0, 0.0, 0.0, 5.0)
    filters = [SimpleNamespace(state=None), SimpleNamespace(state=state)]
    controller = SimpleNamespace(estimator=SimpleNamespace(filters=filters))
    cycle: Any = SimpleNamespace(controller=controller, samples=[None, sample])
    MotionSeen(estimator).run(cycle)
    ((index, stamp, motion),) = taken
    assert (index, stamp) == (1, 7)
    assert motion == (20.0, pytest.approx(0.0 if by_course else 0.3), 100.0, 1.0)


def test_only_those_commanded_that_obey_are_estimated_and_the_mismatch_is_a_finding() -> None:
    updated = list[list[bool]]()
    estimator: Any = SimpleNamespace(update=updated.append, mismatch=[[0.1], [0.2], [0.3]])
    links = [SimpleNamespace(disobeying=each) for each in (False, True, False)]
    tick, findings = SimpleNamespace(active=[True, True, False]), SimpleNamespace(time_constants_off=None)
    cycle: Any = SimpleNamespace(tick=tick, links=links, findings=findings)
    TimeConstants(estimator).run(cycle)
    TimeConstantsOff(estimator).run(cycle)
    assert updated == [[True, False, False]]
    assert findings.time_constants_off == estimator.mismatch


def test_three_stages_share_one_estimator_of_all_vehicles() -> None:
    loaded = load_scenario(scenario())
    controller = SimpleNamespace(models=autopilot_models(loaded), history=SetpointHistory(10.0))
    cycle: Any = SimpleNamespace(scenario=loaded, controller=controller)
    seen, fitted, off = FEATURE.stages(cycle)
    assert isinstance(seen, MotionSeen)
    assert isinstance(fitted, TimeConstants)
    assert isinstance(off, TimeConstantsOff)
    assert seen._estimator is fitted._estimator is off._estimator
    assert [each.model for each in off._estimator.vehicles] == controller.models
    assert off._estimator.mismatch == [[0.0] * 3] * 3


def test_an_older_sample_does_not_turn_time_back() -> None:
    estimator = VehicleEstimator(model(), Nodes(5, 1), Nodes(4, 2), 10, 10.0, estimated=True, in_use=True)
    estimator.add_sample(5, (22.0, 0.0, 100.0, 0.0))
    estimator.add_sample(3, (21.0, 0.0, 100.0, 0.0))
    assert estimator._stamp == 5
    assert estimator.log_ratios() == [0.0] * 4
