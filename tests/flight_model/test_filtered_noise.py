"""Noise left by a filter, against a filter that is run on noise."""

import math

import numpy as np
import pytest

from flight_model.gain_design import WIND_WALK, left_by_filter

SAMPLE, WALK_MPS, TAU_S, PERIOD_S = (0.3, 0.1, 0.2), 0.05, 4.0, 0.1


def filtered_noise(samples):
    """Return filtered position and airspeed of a vehicle that is in the model's equilibrium, (K, 2)."""
    kept, noise = math.exp(-PERIOD_S / TAU_S), np.array(SAMPLE)
    carry = np.array([[1, TAU_S * (1 - kept), PERIOD_S], [0, kept, 0], [0, 0, 1]])
    seen, walk = np.array([[1, 0, 0], [0, 1, 1], [0, 1, 0]]), np.diag([0, WALK_MPS**2, WIND_WALK**2]) * PERIOD_S
    covariance, gain = np.diag(noise**2), np.zeros((3, 3))
    for _ in range(2000):  # longer than they take to settle
        covariance = carry @ covariance @ carry.T + walk
        gain = covariance @ seen.T @ np.linalg.inv(seen @ covariance @ seen.T + np.diag(noise**2))
        covariance = covariance - gain @ seen @ covariance
    state, states, kept_of_state = np.zeros(3), [], (np.eye(3) - gain @ seen) @ carry
    for corrected in noise * np.random.default_rng(1).standard_normal((samples, 3)) @ gain.T:
        state = kept_of_state @ state + corrected
        states.append(state[:2])
    return np.array(states)


def test_what_is_left_moves_the_states_as_much_as_a_filter_of_noise_does():
    steps = np.diff(filtered_noise(20_000)[1000:], axis=0).std(axis=0)
    assert np.array(left_by_filter(SAMPLE, WALK_MPS, TAU_S, PERIOD_S)) * math.sqrt(2) == pytest.approx(steps, rel=0.05)


def test_of_positions_that_velocities_smooth_a_small_part_is_left():
    """Noise of 0.3 m moves a filtered position by a centimetre from sample to sample."""
    assert left_by_filter(SAMPLE, WALK_MPS, TAU_S, PERIOD_S)[0] < 0.3 / 20
