"""The autopilot model, equation (7), with limits: pure functions on arrays, an element a vehicle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

POLES_APART = 1e-3
"""Relative difference that equal time constants of the height are given, so that one closed form serves."""


@dataclass(frozen=True)
class State:
    """(N,) each: NED position from the origin with height upwards; airspeed and heading are air-relative."""

    north_m: Array
    east_m: Array
    height_m: Array
    climb_mps: Array
    airspeed_mps: Array
    heading_rad: Array


@dataclass(frozen=True)
class Command:
    """What the model is told, (N,) each, and the turn rate that the command itself allows."""

    speed_mps: Array
    heading_rad: Array
    height_m: Array
    turn_rate_rps: Array


@dataclass(frozen=True)
class Parameters:
    """Time constants in s and limits in SI units, (N,) each."""

    tau_v_s: Array
    tau_psi_s: Array
    tau_ha_s: Array
    tau_hb_s: Array
    speed_min_mps: Array
    speed_max_mps: Array
    accel_max_mps2: Array
    turn_rate_max_rps: Array
    climb_max_mps: Array


def step(state: State, command: Command, parameters: Parameters, drift_mps: Array, dt_s: float) -> State:
    """Return the state `dt_s` later.

    Airspeed, heading, height and climb rate follow the closed forms of (7): exponentials, straight lines while
    acceleration or turn rate is limited; a climb beyond its limit counts as the limit. The way over ground is Simpson's
    quadrature of air velocity, within 1 mm after 100 s of turning at 50 Hz. `drift_mps` (3, N), north, east and down,
    is added to the velocity.
    """
    speed_error = command.speed_mps - state.airspeed_mps
    turn = (command.heading_rad - state.heading_rad + np.pi) % (2 * np.pi) - np.pi
    rate_max = np.minimum(parameters.turn_rate_max_rps, command.turn_rate_rps)
    north_mps, east_mps = np.zeros_like(speed_error), np.zeros_like(speed_error)
    speed, heading = state.airspeed_mps, state.heading_rad
    for share, weight in ((0.0, 1 / 6), (0.5, 4 / 6), (1.0, 1 / 6)):
        speed = command.speed_mps - lag(speed_error, parameters.accel_max_mps2, parameters.tau_v_s, share * dt_s)
        heading = state.heading_rad + turn - lag(turn, rate_max, parameters.tau_psi_s, share * dt_s)
        north_mps += weight * speed * np.cos(heading)
        east_mps += weight * speed * np.sin(heading)
    height_m, climb_mps = _height(state, command.height_m, parameters, dt_s)
    return State(
        north_m=state.north_m + (north_mps + drift_mps[0]) * dt_s,
        east_m=state.east_m + (east_mps + drift_mps[1]) * dt_s,
        height_m=height_m - drift_mps[2] * dt_s,
        climb_mps=climb_mps,
        airspeed_mps=speed,
        heading_rad=heading,
    )


def lag(error: Array, rate_max: Array, tau_s: Array, time_s: float) -> Array:
    """Return what a first-order lag with a limited rate leaves of `error` after `time_s`."""
    size = np.abs(error)
    limited_s = np.minimum(np.maximum(size / rate_max - tau_s, 0.0), time_s)
    return np.sign(error) * (size - rate_max * limited_s) * np.exp((limited_s - time_s) / tau_s)


def _height(state: State, target_m: Array, parameters: Parameters, dt_s: float) -> tuple[Array, Array]:
    slow = np.maximum(parameters.tau_ha_s, parameters.tau_hb_s)
    fast = np.minimum(np.minimum(parameters.tau_ha_s, parameters.tau_hb_s), slow * (1 - POLES_APART))
    error = state.height_m - target_m
    slow_part = (error + fast * state.climb_mps) * slow / (slow - fast)
    fast_part = error - slow_part
    slow_left, fast_left = slow_part * np.exp(-dt_s / slow), fast_part * np.exp(-dt_s / fast)
    most = parameters.climb_max_mps
    moved_m = _within(slow_left + fast_left - error, most * dt_s)
    return state.height_m + moved_m, _within(-slow_left / slow - fast_left / fast, most)


def _within(value: Array, most: Array) -> Array:
    return np.minimum(np.maximum(value, -most), most)
