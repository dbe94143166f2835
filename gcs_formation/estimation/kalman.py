"""The extended Kalman filter of FlightState's eight rows through the autopilot model (7), on arrays of N vehicles.

Source: Gelb, "Applied Optimal Estimation" (1974), chapter 6. A sample is (8, N): north, east, height, their rates over
ground, airspeed, heading.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import exprel

from gcs_formation.arrays import Array, wrap
from gcs_formation.estimation.flight_state import AutopilotModel, FlightState

STATES = 8
NORTH, EAST, HEIGHT, CLIMB, SPEED, HEADING, WIND_NORTH, WIND_EAST = range(STATES)
GROUND_NORTH, GROUND_EAST, RISE, AIRSPEED, YAW = range(3, STATES)
"""Rows of a sample after its north, east and height."""
_EYE = np.eye(STATES)


class Estimate(NamedTuple):
    """States of N vehicles and how far they may be off."""

    table: Array
    """(8, N), FlightState's rows."""
    covariance: Array
    """(N, 8, 8)."""


def transition(state: FlightState, elapsed_s: Array, model: AutopilotModel) -> Array:
    """Return the derivative of the states `elapsed_s` (N,) later by the states now, (N, 8, 8), at constant heading."""
    cos, sin, speed = np.cos(state.heading_rad), np.sin(state.heading_rad), state.airspeed_mps
    kept = np.exp(-elapsed_s / model.air_lags_s)
    speed_s, heading_s = model.air_lags_s * (1.0 - kept)
    slow_s, fast_s = np.maximum(model.tau_ha_s, model.tau_hb_s), np.minimum(model.tau_ha_s, model.tau_hb_s)
    slow, fast = np.exp(-elapsed_s / slow_s), np.exp(-elapsed_s / fast_s)
    # With equal poles, the limit of exprel gives the double pole's form.
    between_s = elapsed_s * slow * exprel(elapsed_s / slow_s - elapsed_s / fast_s)
    derivative = np.zeros((elapsed_s.size, STATES, STATES))
    derivative[:] = _EYE
    derivative[:, NORTH, SPEED], derivative[:, EAST, SPEED] = cos * speed_s, sin * speed_s
    derivative[:, NORTH, HEADING], derivative[:, EAST, HEADING] = -speed * sin * heading_s, speed * cos * heading_s
    derivative[:, NORTH, WIND_NORTH] = derivative[:, EAST, WIND_EAST] = elapsed_s
    derivative[:, SPEED, SPEED], derivative[:, HEADING, HEADING] = kept
    derivative[:, HEIGHT, HEIGHT], derivative[:, HEIGHT, CLIMB] = slow + between_s / slow_s, between_s
    derivative[:, CLIMB, HEIGHT] = -between_s / (slow_s * fast_s)
    derivative[:, CLIMB, CLIMB] = fast - between_s / slow_s
    return derivative


def expected(state: FlightState) -> Array:
    """Return the sample that vehicles in `state` would give, (8, N)."""
    ground_north = state.airspeed_mps * np.cos(state.heading_rad) + state.wind_north_mps
    ground_east = state.airspeed_mps * np.sin(state.heading_rad) + state.wind_east_mps
    return np.array((*state.place_m, ground_north, ground_east, state.climb_mps, *state.air_motion))


def innovation(sample: Array, state: FlightState) -> Array:
    """Return the sample minus the expected one, (8, N)."""
    difference = sample - expected(state)
    difference[YAW] = wrap(difference[YAW])
    return difference


def sensitivity(state: FlightState) -> Array:
    """Return the derivative of a sample by the state, (N, 8, 8)."""
    cos, sin, speed = np.cos(state.heading_rad), np.sin(state.heading_rad), state.airspeed_mps
    rows = np.zeros((cos.size, STATES, STATES))
    rows[:, (0, 1, 2), (NORTH, EAST, HEIGHT)] = 1.0
    rows[:, (GROUND_NORTH, GROUND_EAST), (WIND_NORTH, WIND_EAST)] = 1.0
    rows[:, (RISE, AIRSPEED, YAW), (CLIMB, SPEED, HEADING)] = 1.0
    rows[:, GROUND_NORTH, SPEED], rows[:, GROUND_NORTH, HEADING] = cos, -speed * sin
    rows[:, GROUND_EAST, SPEED], rows[:, GROUND_EAST, HEADING] = sin, speed * cos
    return rows


def diagonal(variances: Array) -> Array:
    """Return (N, 8, 8) diagonal matrices of (8, N) values."""
    return variances.T[:, :, None] * _EYE


def correct(predicted: Estimate, rows: Array, spread: Array, difference: Array, variances: Array) -> Estimate:
    """Return the estimate that a sample corrects.

    Args:
        predicted: the estimate before.
        rows: (N, 8, 8) of `sensitivity`.
        spread: (N, 8, 8) covariance of the innovation.
        difference: (8, N) the innovation.
        variances: (8, N) of the sample's noise.
    """
    gain = np.linalg.solve(spread, rows @ predicted.covariance).swapaxes(1, 2)
    table = predicted.table + (gain @ difference.T[:, :, None])[:, :, 0].T
    table[HEADING] = wrap(table[HEADING])
    kept = _EYE - gain @ rows
    noise = (gain * variances.T[:, None, :]) @ gain.swapaxes(1, 2)
    return Estimate(table, kept @ predicted.covariance @ kept.swapaxes(1, 2) + noise)
