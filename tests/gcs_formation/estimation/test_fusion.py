"""The filter of noisy telemetry: its errors are as large as it says, and it lets go of a model that doesn't hold."""

import math

import numpy as np
import pytest

from gcs_formation.estimation.flight_state import AutopilotModel, FlightState, Setpoints
from gcs_formation.estimation.fusion import HEADING, UNMODELLED, Fusion, Noise
from gcs_formation.estimation.predictor import SentSetpoints, SetpointHistory

STEP_NS, COLUMN = 100_000_000, np.array([0])
GNSS = Noise(0.3, 0.1, 0.2, math.radians(0.5), wind_walk=0.05)
MODEL = AutopilotModel(*(np.array([value]) for value in (4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)))
START = np.array((0.0, 0.0, 100.0, 0.0, 22.0, 0.3, 1.0, -2.0))


class Flight:
    """A vehicle that follows its setpoints by model (7), and the filter that watches it."""

    def __init__(self, seed=1):
        self.random = np.random.default_rng(seed)
        self.history = SetpointHistory(10.0)
        self.fusion = Fusion(GNSS, 0, self.history, MODEL)
        self.now, self.true = 0, START
        self.seen = self.measured()
        self.estimate = np.concatenate((self.seen[:3], self.seen[5:], (0.0, 0.0)))

    def measured(self):
        speed, heading = self.true[4:6]
        ground = speed * math.cos(heading) + self.true[6], speed * math.sin(heading) + self.true[7]
        exact = np.array((*self.true[:3], *ground, self.true[3], speed, heading))
        return exact + np.sqrt(GNSS.variances) * self.random.standard_normal(8)

    def fly(self, speed_mps=22.0, heading_rad=0.5, height_m=110.0, yanked_rad=0.0):
        told = Setpoints(*(np.array([value]) for value in (speed_mps, heading_rad, height_m)))
        since = np.array([self.now])
        self.history.add(SentSetpoints(since, told))
        self.now += STEP_NS
        until = np.array([self.now])
        self.true = self.history.predict(FlightState(*self.true[:, None]), since, until, COLUMN, MODEL).table[:, 0]
        walk = UNMODELLED + np.array((0, 0, 0, 0, 0, 0, GNSS.wind_walk, GNSS.wind_walk))
        self.true = self.true + walk * math.sqrt(0.1) * self.random.standard_normal(8)
        self.true[HEADING] += yanked_rad
        self.seen = self.measured()
        self.estimate = self.fusion.update(self.estimate, since, self.seen, until)

    def error(self):
        error = self.estimate - self.true
        error[HEADING] = math.remainder(error[HEADING], math.tau)
        return error


def test_errors_are_as_large_as_the_filter_says():
    """The mean of the normalised error squared is the number of states (Bar-Shalom's consistency test)."""
    normalised = []
    for seed in range(40):
        flight = Flight(seed)
        for step in range(200):
            flight.fly(heading_rad=0.5 if step % 100 < 50 else -0.2)
        normalised.append(flight.error() @ np.linalg.solve(flight.fusion.covariance, flight.error()))
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


def test_a_vehicle_that_somebody_else_turns_is_followed_at_once():
    flight = Flight()
    for _ in range(100):
        flight.fly()
    for _ in range(20):
        flight.fly(yanked_rad=0.25)
        assert abs(flight.error()[HEADING]) < 4 * GNSS.heading_rad


@pytest.mark.parametrize("elapsed_s", [0.02, 0.1])
def test_the_transition_is_the_derivative_of_the_prediction(elapsed_s):
    flight, until = Flight(), np.array([round(elapsed_s * 1e9)])
    flight.history.add(SentSetpoints(np.array([0]), Setpoints(*(np.array([value]) for value in (22.5, 0.3, 101.0)))))

    def predicted(state):
        return flight.history.predict(FlightState(*state[:, None]), np.array([0]), until, COLUMN, MODEL).table[:, 0]

    small = 1e-5 * np.eye(8)
    derivative = np.stack([(predicted(START + each) - predicted(START - each)) / 2e-5 for each in small], axis=1)
    assert flight.fusion.transition(START, elapsed_s) == pytest.approx(derivative, abs=1e-3)
