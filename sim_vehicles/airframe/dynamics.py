"""The autopilot model, equation (7), with limits: pure functions on tables, a column a vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from scipy.special import exprel

from flight_model.arrays import Array, wrap
from formation_scenario.vehicles import VehicleModel

SHARES = np.array([0.0, 0.5, 1.0])[:, None, None]
SIMPSON = np.array([1.0, 4.0, 1.0]) / 6
"""Simpson's rule: the points of a step, as shares of it, and their weights."""


@dataclass(frozen=True)
class State:
    """(6, N): NED position from the origin with height upwards, climb, and air-relative speed and heading."""

    table: Array

    @property
    def north_m(self) -> Array:
        """(N,)."""
        return self.table[0]

    @property
    def east_m(self) -> Array:
        """(N,)."""
        return self.table[1]

    @property
    def height_m(self) -> Array:
        """(N,) above the origin."""
        return self.table[2]

    @property
    def climb_mps(self) -> Array:
        """(N,) upwards, through the air."""
        return self.table[3]

    @property
    def airspeed_mps(self) -> Array:
        """(N,)."""
        return self.table[4]

    @property
    def heading_rad(self) -> Array:
        """(N,) clockwise from north; it isn't wrapped."""
        return self.table[5]


@dataclass(frozen=True)
class Command:
    """What the model is told."""

    air_motion: Array
    """(2, N) airspeed in m/s and heading in rad."""
    rate_max: Array
    """(2, N) acceleration in m/s² and turn rate in rad/s that the command itself allows."""
    height_m: Array
    """(N,)."""


@dataclass(frozen=True)
class Parameters:
    """Time constants in s and limits in SI units, and the step that they are for."""

    tau_s: Array
    """(2, N) of airspeed and heading."""
    rate_max: Array
    """(2, N) acceleration in m/s² and turn rate in rad/s."""
    fast_s: Array
    """(N,) the height's smaller time constant."""
    slow_s: Array
    """(N,) the height's larger one."""
    climb_max_mps: Array
    """(N,)."""
    dt_s: float

    @classmethod
    def of(cls, models: list[VehicleModel], dt_s: float) -> Self:
        """Return the parameters of N models that fly in steps of `dt_s`."""
        return cls(
            tau_s=np.array([(each.tau_v_s, each.tau_psi_s) for each in models]).T,
            rate_max=np.array([(each.accel_max_mps2, each.turn_rate_max_rps) for each in models]).T,
            fast_s=np.array([min(each.tau_ha_s, each.tau_hb_s) for each in models]),
            slow_s=np.array([max(each.tau_ha_s, each.tau_hb_s) for each in models]),
            climb_max_mps=np.array([each.climb_max_mps for each in models]),
            dt_s=dt_s,
        )

    @cached_property
    def left(self) -> Left:
        """What a step leaves of errors."""
        slow_s, fast_s, dt_s = self.slow_s, self.fast_s, self.dt_s
        slow_left = np.exp(-dt_s / slow_s)
        return Left(
            air_motion=np.exp(-SHARES * dt_s / self.tau_s),
            slow=slow_left,
            fast=np.exp(-dt_s / fast_s),
            between_s=dt_s * slow_left * exprel(dt_s / slow_s - dt_s / fast_s),
        )


class Left(NamedTuple):
    """What a step leaves of errors that no limit holds, a share of each."""

    air_motion: Array
    """(3, 2, N) of airspeed and heading, at `SHARES` of the step."""
    slow: Array
    """(N,) by the height's slow pole."""
    fast: Array
    between_s: Array
    """(N,) what comes of a climb rate meanwhile; with equal poles exprel's limit makes it the double pole's form."""


def step(state: State, command: Command, parameters: Parameters, drift_mps: Array) -> State:
    """Return the state a step later.

    Airspeed, heading, height and climb rate follow the closed forms of (7): exponentials, straight lines while
    acceleration or turn rate is limited; a climb beyond its limit counts as the limit. The way over ground is Simpson's
    quadrature of air velocity, within 1 mm after 100 s of turning at 50 Hz. `drift_mps` (3, N), north, east and down,
    is added to the velocity.
    """
    air_motion = state.table[4:]
    error = command.air_motion - air_motion
    error[1] = wrap(error[1])
    rate_max = np.minimum(parameters.rate_max, command.rate_max)
    along = air_motion + (error - _left(error, rate_max, parameters))
    speed, heading = along[:, 0], along[:, 1]
    table = np.empty_like(state.table)
    table[0] = SIMPSON.dot(speed * np.cos(heading)) + drift_mps[0]
    table[1] = SIMPSON.dot(speed * np.sin(heading)) + drift_mps[1]
    table[:2] *= parameters.dt_s
    table[:2] += state.table[:2]
    height_m, table[3] = _height(state, command.height_m, parameters)
    table[2] = height_m - drift_mps[2] * parameters.dt_s
    table[4:] = along[2]
    return State(table)


def ground_velocity(state: State, drift_mps: Array) -> Array:
    """Return (3, N) north, east and down in m/s."""
    climb_mps, airspeed_mps, heading_rad = state.table[3:]
    return drift_mps + np.array((airspeed_mps * np.cos(heading_rad), airspeed_mps * np.sin(heading_rad), -climb_mps))


def lag(error: Array, rate_max: Array, tau_s: Array, time_s: Array) -> Array:
    """Return what first-order lags with limited rates leave of `error` after `time_s`; shapes broadcast."""
    size = np.abs(error)
    limited_s = np.minimum(np.maximum(size / rate_max - tau_s, 0.0), time_s)
    return np.copysign((size - rate_max * limited_s) * np.exp((limited_s - time_s) / tau_s), error)


def _left(error: Array, rate_max: Array, parameters: Parameters) -> Array:
    """Return what is left of errors of air motion (2, N) at `SHARES` of a step, (3, 2, N)."""
    if np.count_nonzero(np.abs(error) <= rate_max * parameters.tau_s) == error.size:
        return error * parameters.left.air_motion
    return lag(error, rate_max, parameters.tau_s, SHARES * parameters.dt_s)


def _height(state: State, target_m: Array, parameters: Parameters) -> tuple[Array, Array]:
    """Return height and climb rate."""
    slow_s, left, most_mps = parameters.slow_s, parameters.left, parameters.climb_max_mps
    error = state.height_m - target_m
    push_mps = state.climb_mps + error / slow_s
    left_m = left.slow * error + left.between_s * push_mps
    climb_mps = left.fast * push_mps - left_m / slow_s
    return state.height_m + _within(left_m - error, most_mps * parameters.dt_s), _within(climb_mps, most_mps)


def _within(value: Array, most: Array) -> Array:
    return np.minimum(np.maximum(value, -most), most)
