"""The state filter: errors match its covariance, it learns the noise, and outliers don't mislead it."""

import math

import numpy as np
import pytest

from airlink.clock import Instant, after
from flight_model.arrays import Array
from flight_model.flight_state import FlightState
from flight_model.gain_design import UNMODELLED, WIND_WALK
from flight_model.vehicle_arrays import AutopilotModels, FlightStates, Setpoints
from formation_scenario import load_scenario
from gcs_formation.controller.controller import FormationController
from gcs_formation.estimation.estimator import StateEstimator
from gcs_formation.estimation.large_gust import LargeGust
from gcs_formation.estimation.noise_and_plausibility import RESOLUTION, VehicleNoise
from gcs_formation.estimation.sample import Sample
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.estimation.updraught import Updraught
from gcs_formation.from_scenario import declared_noise
from tests.flights.conftest import scenario
from tests.gcs_formation import tables
from tests.gcs_formation.estimation import filter_on_arrays
from tests.gcs_formation.estimation.filter_on_arrays import HEADING, WIND_NORTH

QUANTITY_OF = np.array((0, 0, 1, 2, 2, 3, 4, 5))
RATE_HZ, STEP_NS = 10.0, 100_000_000
GNSS = np.array((0.3, 0.3, 0.1, 0.1, 0.2, math.radians(0.5)))
MODEL = AutopilotModels(*(np.array([value]) for value in (4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)))
START = np.array((0.0, 0.0, 100.0, 0.0, 22.0, 0.3, 1.0, -2.0))


class Flight:
    """A vehicle that follows its setpoints by model (7), and its filter."""

    def __init__(self, seed=1, sigma=GNSS, declared=GNSS):
        self.random = np.random.default_rng(seed)
        self.sigma = np.asarray(sigma)
        self.history = SetpointHistory(RATE_HZ)
        sigma = np.maximum(np.asarray(declared), RESOLUTION)
        noise = VehicleNoise(tuple(sigma.tolist()), tuple(np.maximum(sigma / 4, RESOLUTION).tolist()))
        self.filter = StateEstimator([noise], self.history, RATE_HZ, 2.0)
        self.now, self.true = 0, START
        self.see()

    def see(self, off: float | Array = 0.0):
        exact = filter_on_arrays.expected(FlightStates(*self.true[:, None]))[:, 0]
        seen = exact + self.sigma[QUANTITY_OF] * self.random.standard_normal(8) + off
        self.filter.update_states([Sample(Instant(self.now), *seen)], tables.models(MODEL)[:1], [True])

    def fly(self, heading_rad=0.5, yanked_rad=0.0, gust_mps=0.0, off: float | Array = 0.0):
        commanded = Setpoints(*(np.array([value]) for value in (22.0, heading_rad, 110.0)))
        since = np.array([self.now])
        tables.send(self.history, since, commanded)
        self.now += STEP_NS
        until = np.array([self.now])
        self.true = tables.predict(self.history, FlightStates(*self.true[:, None]), since, until, MODEL).table[:8, 0]
        walk = np.array((0, 0, 0, *UNMODELLED, WIND_WALK, WIND_WALK))
        self.true = self.true + walk * math.sqrt(0.1) * self.random.standard_normal(8)
        self.true[HEADING] += yanked_rad
        self.true[WIND_NORTH:] += gust_mps
        self.see(off)

    @property
    def state(self):
        state = self.filter.filters[0].state
        assert state is not None
        return state

    def error(self):
        error = np.array(self.state.values()[:8]) - self.true
        error[HEADING] = math.remainder(error[HEADING], math.tau)
        return error

    def covariance(self):
        """Return the covariance of the state's errors, (8, 8)."""
        its, whole, places = self.filter.filters[0], np.zeros((8, 8)), [0, 1, 4, 5, 6, 7]
        level, height = its.level, its.height
        rows = level.north, level.east, level.speed, level.heading, level.wind_north, level.wind_east
        whole[np.ix_(places, places)] = rows
        whole[2:4, 2:4] = (height.height, height.cross), (height.cross, height.climb)
        return whole

    def estimated(self):
        """Return the learned noise of each quantity relative to the true one."""
        return np.array(self.filter.filters[0].noise.sigma()) / self.sigma


@pytest.mark.slow
def test_errors_are_as_large_as_the_filter_says():
    """The mean normalised error squared is the number of states (Bar-Shalom's consistency test)."""
    normalised = []
    for seed in range(40):
        flight = Flight(seed)
        for step in range(200):
            flight.fly(heading_rad=0.5 if step % 100 < 50 else -0.2)
        normalised.append(flight.error() @ np.linalg.solve(flight.covariance(), flight.error()))
    assert np.mean(normalised) == pytest.approx(8.0, abs=2.5)


def test_the_estimate_is_several_times_better_than_a_sample():
    flight, errors = Flight(), []
    for step in range(1000):
        flight.fly()
        if step > 100:
            errors.append(flight.error())
    north, east, height, _, speed, heading, _, _ = np.sqrt(np.mean(np.square(errors), axis=0))
    assert max(north, east, height) < 0.3 / 2.5
    assert speed < 0.2 / 4
    assert heading < math.radians(0.5) / 2.5


@pytest.mark.parametrize("times", [0.3, 1.0, 4.0, 10.0])
def test_noise_that_is_not_as_declared_is_estimated(times):
    flight = Flight(sigma=times * GNSS)
    for _ in range(600):
        flight.fly()
    assert flight.estimated() == pytest.approx(np.ones(6), abs=0.5)


@pytest.mark.parametrize("wind_radps", [0.2, 2.0])
def test_positions_that_are_not_the_integral_of_velocities_tell_of_no_airspeed(wind_radps):
    """A PX4's positions drift by 0.15 m/s for seconds, although each is precise to the millimetre."""
    flight = Flight(sigma=np.array([0.001, 0.001, 0.003, 0.003, 0.2, 0.001]))
    flight.filter.observe_wind(wind_radps)
    kept, slide_mps, off, errors = math.exp(-0.1 / 3.0), 0.0, np.zeros(8), []
    steps = np.random.default_rng(1)
    for step in range(800):
        slide_mps = kept * slide_mps + 0.15 * math.sqrt(1.0 - kept**2) * steps.standard_normal()
        off[0] += 0.1 * slide_mps
        flight.fly(off=off)
        if step > 300:
            errors.append(flight.error()[4])
    assert np.abs(errors).max() < 0.2


def test_one_noisy_quantity_does_not_change_the_others():
    flight = Flight(sigma=GNSS * (10 / 3, 1, 1, 1, 1, 1))
    for _ in range(600):
        flight.fly()
    assert flight.estimated() == pytest.approx(np.ones(6), abs=0.4)


def test_a_take_off_that_climbs_faster_than_the_model_may_is_followed():
    """As ArduPlane hands over: 9.6 m/s where the model's limit is 3; it has come down to 1 m/s 2.6 s later."""
    flight, errors_m, height_m = Flight(), [], 45.0
    for step in range(30):
        climb_mps = max(9.6 - 3.3 * 0.1 * step, 1.0)
        flight.true = np.array((2.2 * step, 0.0, height_m, climb_mps, 22.0, 0.0, 0.0, 0.0))
        flight.see()
        errors_m.append(flight.error()[2])
        commanded = Setpoints(*(np.array([value]) for value in (22.0, 0.0, height_m + 8.0)))
        tables.send(flight.history, np.array([flight.now]), commanded)
        flight.now += STEP_NS
        height_m += 0.1 * climb_mps
    assert np.abs(errors_m).max() < 1.0


def test_a_wind_that_changes_is_not_taken_for_noise():
    """Exact samples in turbulence whose wind changes by 0.3 m/s from one sample to the next."""
    flight = Flight(sigma=RESOLUTION, declared=RESOLUTION)
    gusts = np.random.default_rng(5).standard_normal(600)
    for gust in gusts:
        flight.fly(gust_mps=0.3 * gust)
    assert flight.filter.filters[0].noise.sigma()[2] < 0.1
    assert np.abs(flight.error()[WIND_NORTH:]).max() < 0.2


def test_a_gust_on_exact_telemetry_is_accepted_at_once():
    flight = Flight(sigma=RESOLUTION, declared=RESOLUTION)
    for _ in range(100):
        flight.fly()
    flight.fly(gust_mps=0.6)
    assert np.abs(flight.error()[WIND_NORTH:]).max() < 0.05


@pytest.mark.parametrize("gust_mps", [4.0, 5.0, 12.0])
def test_a_gust_too_large_to_be_plausible_is_accepted_once_the_next_sample_shows_it_too(gust_mps):
    flight = Flight(sigma=RESOLUTION, declared=RESOLUTION)
    for _ in range(100):
        flight.fly()
    flight.fly(gust_mps=gust_mps)
    flight.fly()
    assert np.abs(flight.error()[WIND_NORTH:]).max() < 0.05


@pytest.mark.parametrize(
    ("off", "what"),
    [
        ((0.0, 0.0, 0.0, 6.0, 0.0, 0.0, 0.0, 0.0), "a velocity over ground that its positions don't show"),
        ((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 6.0, 0.0), "an airspeed"),
        ((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.4), "a heading"),
    ],
)
def test_what_only_looks_like_a_large_gust_is_not_accepted_as_one(off, what):
    """Two wrong samples, of which each shows the same wind."""
    flight = Flight(sigma=RESOLUTION, declared=RESOLUTION)
    for _ in range(100):
        flight.fly()
    for _ in range(2):
        flight.fly(off=np.array(off))
    assert np.abs(flight.error()[WIND_NORTH:]).max() < 0.5, what


def test_what_carries_a_vehicle_up_is_distinguished_from_its_own_climb():
    """It climbs by 10 m as commanded; then 0.5 m/s of rising air are added, which (7) doesn't know."""
    flight, felt_mps = Flight(sigma=RESOLUTION, declared=RESOLUTION), []
    for step in range(200):
        commanded = Setpoints(*(np.array([value]) for value in (22.0, 0.5, 110.0)))
        since, until = np.array([flight.now]), np.array([flight.now + STEP_NS])
        tables.send(flight.history, since, commanded)
        flown = FlightStates(*flight.true[:, None])
        flight.true = tables.predict(flight.history, flown, since, until, MODEL).table[:8, 0]
        carried_mps = 0.5 if step >= 100 else 0.0
        flight.true[2] += carried_mps * STEP_NS / 1e9
        flight.now += STEP_NS
        flight.see(off=np.array((0.0, 0.0, 0.0, 0.0, 0.0, carried_mps, 0.0, 0.0)))
        felt_mps.append(flight.state.updraught_mps)
    assert felt_mps[:100] == pytest.approx([0.0] * 100, abs=0.02)
    assert felt_mps[115] > 0.2
    assert felt_mps[150:] == pytest.approx([0.5] * 50, abs=0.05)
    taus_s = MODEL.tau_ha_s[0] + MODEL.tau_hb_s[0]
    assert flight.filter.sway_m == pytest.approx(taus_s * 0.5 * math.sqrt(0.5), rel=0.15), "of the time, half"


def test_what_moves_heights_is_remembered_for_a_minute_also_where_states_begin_again():
    updraught, still = Updraught(followed=False), FlightState(0.0, 0.0, 100.0, 0.0, 22.0, 0.0, 0.0, 0.0)
    (model,) = tables.models(MODEL)

    def fly(seconds, climbs_mps):
        for _ in range(10 * seconds):
            updraught.update(still, climbs_mps, 1e-6, 0.1, model)
        return updraught.sway_m2

    rough_m2 = fly(60, 0.2)
    updraught.clear()
    assert rough_m2 > 1.0
    assert fly(60, 0.0) == pytest.approx(rough_m2 / math.e, rel=0.05)
    assert still.updraught_mps == 0.0


def test_outliers_are_ridden_through():
    """One sample in twenty is 20 m off."""
    flight, errors = Flight(), []
    strays = np.random.default_rng(3)
    for _ in range(1000):
        flight.fly(off=np.array((20.0, -20.0, 20.0, 0, 0, 0, 0, 0)) * (strays.random() < 0.05))
        errors.append(flight.error()[:3])
    assert np.abs(errors).max() < 1.5
    assert np.sqrt(np.mean(np.square(errors))) < 0.3 / 1.5


def test_a_vehicle_that_somebody_else_turns_is_followed():
    flight = Flight()
    for _ in range(100):
        flight.fly()
    errors = []
    for _ in range(30):
        flight.fly(yanked_rad=0.25)
        errors.append(abs(flight.error()[HEADING]))
    assert max(errors) < 1.5
    assert min(errors[-6:]) < 4 * GNSS[-1]


def test_the_wind_is_kept_where_a_state_begins_again():
    """Somebody else turns the vehicle while its airspeed reads 3 m/s too low: its wind must not change."""
    flight = Flight()
    noise = VehicleNoise(tuple(GNSS.tolist()), tuple((GNSS / 4).tolist()))
    flight.filter = StateEstimator([noise], flight.history, RATE_HZ, 0.1)
    for _ in range(300):
        flight.fly()
    before, headings, changes_mps = flight.state, [], []
    for _ in range(12):
        flight.fly(yanked_rad=0.3, off=np.array((0, 0, 0, 0, 0, 0, -3.0, 0)))
        headings.append(abs(flight.error()[HEADING]))
        changes_mps.append(abs(flight.state.wind_north_mps - before.wind_north_mps))
        changes_mps.append(abs(flight.state.wind_east_mps - before.wind_east_mps))
    assert min(headings) < 0.05, "it has begun anew"
    assert max(changes_mps) < 0.5


def test_a_column_without_wind_keeps_none():
    flight = Flight(sigma=RESOLUTION, declared=RESOLUTION)
    finest = tuple(RESOLUTION.tolist())
    flight.filter = StateEstimator([VehicleNoise(finest, finest)], flight.history, RATE_HZ, 0.0)
    for _ in range(100):
        flight.fly()
    assert flight.state.wind_north_mps == flight.state.wind_east_mps == 0.0
    assert np.abs(flight.error()[:2]).max() < 0.05


@pytest.mark.parametrize("elapsed_s", [0.02, 0.1])
def test_the_transition_is_the_derivative_of_the_prediction(elapsed_s):
    flight, until = Flight(), np.array([round(elapsed_s * 1e9)])
    tables.send(flight.history, np.array([0]), Setpoints(*(np.array([value]) for value in (22.5, 0.3, 101.0))))

    def predicted(state):
        return tables.predict(flight.history, FlightStates(*state[:, None]), np.array([0]), until, MODEL).table[:8, 0]

    small = 1e-5 * np.eye(8)
    derivative = np.stack([(predicted(START + each) - predicted(START - each)) / 2e-5 for each in small], axis=1)
    found = filter_on_arrays.transition(FlightStates(*START[:, None]), np.array([elapsed_s]), MODEL)[0]
    assert found == pytest.approx(derivative, abs=1e-3)


@pytest.mark.parametrize("commanded", [True, False])
@pytest.mark.parametrize("off_m", [0.005, 0.9])
def test_a_step_is_the_extended_kalman_filters(commanded, off_m, monkeypatch):
    """P' = F P F^T + Q, K = P' H^T S^-1, Joseph's form; Q by how far vehicles stray with and without setpoints.

    A position that is u times too far off to be plausible, including 1 m/s of straying, counts as if S were u² times as
    large.
    """
    fine = GNSS / 20
    flight, estimated = Flight(sigma=0 * GNSS, declared=fine), []

    def note(_noise, unexplained, _own):
        estimated.append(unexplained)

    monkeypatch.setattr(VehicleNoise, "adapt", note)
    tables.send(flight.history, np.array([0]), Setpoints(*(np.array([each]) for each in (22.0, 0.3, 100.0))))
    before, until = FlightStates.from_each([flight.state]), np.array([STEP_NS])
    covariance, variance = flight.covariance(), fine[QUANTITY_OF] ** 2
    state = tables.predict(flight.history, before, np.array([0]), until, MODEL)
    off = np.array((off_m, -off_m, off_m, *0.3 * fine[QUANTITY_OF][3:]))
    sample = Sample(Instant(STEP_NS), *(filter_on_arrays.expected(state)[:, 0] + off))
    flight.filter.update_states([sample], tables.models(MODEL)[:1], [commanded])
    moved, rows = filter_on_arrays.transition(before, np.array([0.1]), MODEL)[0], filter_on_arrays.sensitivity(state)[0]
    strays = (0, 0, 0, 0.05, 0.05, 0.003) if commanded else (0, 0, 0, 1.0, 1.0, 0.3)
    wind = 2.0 * math.hypot(fine[2], fine[4]) / math.sqrt(RATE_HZ)
    predicted = moved @ covariance @ moved.T + np.diag((*strays, wind, wind)) ** 2 * 0.1
    own = np.diag(rows @ predicted @ rows.T) + variance
    excess = off**2 / (9.0 * (own + np.array((0.1, 0.1, 0.1, 1.0, 1.0, 1.0, 1.0, 0.1)) ** 2))
    assert (excess.max() > 1.0) == (off_m > 0.1)
    variance = variance + own * np.maximum(excess - 1.0, 0.0)
    gain = predicted @ rows.T @ np.linalg.inv(rows @ predicted @ rows.T + np.diag(variance))
    kept = np.eye(8) - gain @ rows
    corrected = kept @ predicted @ kept.T + gain @ np.diag(variance) @ gain.T
    np.testing.assert_allclose(flight.covariance(), corrected, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(flight.state.values()[:8], state.table[:8, 0] + gain @ off, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(estimated[0], off, rtol=1e-6, atol=1e-9)


def test_the_sensitivity_is_the_derivative_of_the_sample():
    small = 1e-5 * np.eye(8)

    def seen(state):
        return filter_on_arrays.expected(FlightStates(*state[:, None]))[:, 0]

    derivative = np.stack([(seen(START + each) - seen(START - each)) / 2e-5 for each in small], axis=1)
    assert filter_on_arrays.sensitivity(FlightStates(*START[:, None]))[0] == pytest.approx(derivative, abs=1e-6)


def test_headings_stay_within_half_a_turn():
    flight = Flight()
    for step in range(200):
        flight.fly(heading_rad=0.3 + 0.02 * step)
        assert -math.pi <= flight.state.heading_rad < math.pi
    assert abs(flight.error()[HEADING]) < 0.05


def test_of_whom_nothing_is_declared_noise_is_taken_as_of_a_gnss_receiver_and_of_the_emulated_as_rounding():
    vehicles = [{"id": 1, "role": "leader", "autopilot": "arduplane"}, {"id": 2, "role": "follower"}]
    leader, follower = declared_noise(load_scenario(scenario(vehicles=vehicles)))
    finest = (0.003, 0.001, 0.003, 0.003, 0.0001, 0.00002)
    np.testing.assert_allclose(leader.sigma(), (0.3, 0.3, 0.1, 0.1, 0.3, 0.01))
    np.testing.assert_allclose(follower.sigma(), finest)
    for each in (leader, follower):
        np.testing.assert_allclose(np.sqrt(each._minimum), finest)
        assert not each._stated


@pytest.mark.parametrize(
    ("keys", "factor", "least"),
    [
        ({}, 1.0, 0.25),
        ({"correlation_s": 20}, 1.0, 1.0),
        ({"rate_hz": 2.5}, 2.0, 2.0),  # an error lasts for four samples, which tell as much as one
        ({"rate_hz": 0.5, "correlation_s": 20}, math.sqrt(10.0), math.sqrt(10.0)),  # those of a second
    ],
)
def test_errors_that_last_are_taken_as_large_as_they_are_and_no_smaller(keys, factor: float, least: float):
    """Averages over the time for which model (7) can be trusted don't reduce them."""
    vehicles = {"count": 2, "navigation": {"source": "noisy", **keys}}
    noise, _ = declared_noise(load_scenario(scenario(vehicles=vehicles, telemetry={"rate_hz": 10})))
    white = np.array((0.3, 0.3, 0.1, 0.1, 0.2, math.radians(0.5)))
    np.testing.assert_allclose(noise.sigma(), factor * white)
    np.testing.assert_allclose(np.sqrt(noise._minimum), least * white)


def test_the_controller_filters_what_noisy_vehicles_tell():
    """The second of three flies straight on; its samples have the declared noise."""
    controller = FormationController(load_scenario(scenario(vehicles={"count": 3, "navigation": {"source": "noisy"}})))
    commanded = (np.full(3, value) for value in (22.0, 0.4, 100.0))
    tables.send(controller.history, np.zeros(3, dtype=np.int64), Setpoints(*commanded))
    random, errors = np.random.default_rng(1), []
    for tenth in range(300):
        at_s, over_ground_mps = 0.1 * tenth, (22.0 * math.cos(0.4), 22.0 * math.sin(0.4), 0.0)
        true = np.array((*(at_s * each for each in over_ground_mps[:2]), 100.0, 22.0))
        north, east, height, airspeed = true + np.array((0.3, 0.3, 0.3, 0.2)) * random.standard_normal(4)
        sample = Sample(after(Instant(0), at_s), north, east, height, *over_ground_mps, airspeed, 0.4)
        controller.update_states([None, sample, *[None] * (controller.count - 2)])
        found = controller.estimator.filters[1].state
        assert found is not None
        errors.append(np.array((found.north_m, found.east_m, found.height_m, found.airspeed_mps)) - true)
    assert np.all(np.sqrt(np.square(errors[100:]).mean(axis=0)) < 0.6 * np.array((0.3, 0.3, 0.3, 0.2)))


def test_a_gust_that_two_samples_of_one_stamp_show_is_not_repeated_by_the_second() -> None:
    values, one = (3.0, 0.0, 100.0, 20.0, 0.0, 0.0, 20.0, 0.0), LargeGust(30.0, 0.0, 3.0, 0.0)
    before = LargeGust(30.0, 0.0, 1.0, 0.0)
    assert one.repeats(before, values, 0.01, 0.1)
    assert not one.repeats(before, values, 0.01, 0.0)
