"""The same filter on arrays of vehicles, all values of a sample at once and in Joseph's form: a test oracle.

Source: Gelb, "Applied Optimal Estimation" (1974), chapter 6. States are rows of `FlightStates`; a sample is (8, N):
north, east, height, their rates over ground, airspeed, heading.
"""

from __future__ import annotations

import numpy as np
import scipy

from flight_model.arrays import Array
from flight_model.vehicle_arrays import AutopilotModels, FlightStates

STATES = 8
NORTH, EAST, HEIGHT, CLIMB, SPEED, HEADING, WIND_NORTH, WIND_EAST = range(STATES)
GROUND_NORTH, GROUND_EAST, RISE, AIRSPEED, YAW = range(3, STATES)
"""Rows of a sample after its north, east and height."""


def transition(state: FlightStates, elapsed_s: Array, model: AutopilotModels) -> Array:
    """Return the derivative of the states after `elapsed_s` (N,) by the present ones, (N, 8, 8); constant heading."""
    cos, sin, speed = np.cos(state.heading_rad), np.sin(state.heading_rad), state.airspeed_mps
    kept = np.exp(-elapsed_s / model.air_taus_s)
    speed_s, heading_s = model.air_taus_s * (1.0 - kept)
    slow_s, fast_s = np.maximum(model.tau_ha_s, model.tau_hb_s), np.minimum(model.tau_ha_s, model.tau_hb_s)
    slow, fast = np.exp(-elapsed_s / slow_s), np.exp(-elapsed_s / fast_s)
    # For equal poles the limit of exprel gives the double pole's form.
    between_s = elapsed_s * slow * scipy.special.exprel(elapsed_s / slow_s - elapsed_s / fast_s)
    derivative = np.zeros((elapsed_s.size, STATES, STATES))
    derivative[:] = np.eye(STATES)
    derivative[:, NORTH, SPEED], derivative[:, EAST, SPEED] = cos * speed_s, sin * speed_s
    derivative[:, NORTH, HEADING], derivative[:, EAST, HEADING] = -speed * sin * heading_s, speed * cos * heading_s
    derivative[:, NORTH, WIND_NORTH] = derivative[:, EAST, WIND_EAST] = elapsed_s
    derivative[:, SPEED, SPEED], derivative[:, HEADING, HEADING] = kept
    derivative[:, HEIGHT, HEIGHT], derivative[:, HEIGHT, CLIMB] = slow + between_s / slow_s, between_s
    derivative[:, CLIMB, HEIGHT] = -between_s / (slow_s * fast_s)
    derivative[:, CLIMB, CLIMB] = fast - between_s / slow_s
    return derivative


def expected(state: FlightStates) -> Array:
    """Return the expected sample of vehicles in `state`, (8, N)."""
    ground_north = state.airspeed_mps * np.cos(state.heading_rad) + state.wind_north_mps
    ground_east = state.airspeed_mps * np.sin(state.heading_rad) + state.wind_east_mps
    return np.array((*state.position_m, ground_north, ground_east, state.climb_mps, *state.air_motion))


def sensitivity(state: FlightStates) -> Array:
    """Return the derivative of a sample by the state, (N, 8, 8)."""
    cos, sin, speed = np.cos(state.heading_rad), np.sin(state.heading_rad), state.airspeed_mps
    rows = np.zeros((cos.size, STATES, STATES))
    rows[:, (0, 1, 2), (NORTH, EAST, HEIGHT)] = 1.0
    rows[:, (GROUND_NORTH, GROUND_EAST), (WIND_NORTH, WIND_EAST)] = 1.0
    rows[:, (RISE, AIRSPEED, YAW), (CLIMB, SPEED, HEADING)] = 1.0
    rows[:, GROUND_NORTH, SPEED], rows[:, GROUND_NORTH, HEADING] = cos, -speed * sin
    rows[:, GROUND_EAST, SPEED], rows[:, GROUND_EAST, HEADING] = sin, speed * cos
    return rows
