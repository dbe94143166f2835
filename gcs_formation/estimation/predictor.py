"""A state now from a delayed one: the autopilot model (7) run through the setpoints that are in flight."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from scipy.special import exprel

from airlink.clock import NANOSECONDS
from gcs_formation.arrays import Array, Instants, wrap
from gcs_formation.estimation.flight_state import AutopilotModel, FlightState, Indices, Setpoints

HISTORY_S = 6.0
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
_NODES = ((_GAUSS + 1) / 2)[:, None, None]
"""Gauss's points of a segment of time, as shares of it: where speed and heading are evaluated for the way made good."""
_SHARES = (_WEIGHTS / 2)[:, None, None]


class SentSetpoints(NamedTuple):
    """One tick's setpoints and when each is expected to act: (V,) arrays over all vehicles."""

    acts: Instants
    setpoints: Setpoints


class SetpointHistory:
    """What was sent to every vehicle in the last seconds, oldest first."""

    def __init__(self, rate_hz: float) -> None:
        """Keep `HISTORY_S` of ticks at `rate_hz`."""
        self.length = max(8, int(HISTORY_S * rate_hz))
        self._sent: deque[SentSetpoints] = deque(maxlen=self.length)

    def add(self, sent: SentSetpoints) -> None:
        """Add a tick's; its arrays may still be filled in."""
        self._sent.append(sent)

    def predict(
        self, state: FlightState, since: Instants, until: Instants, vehicles: Indices, model: AutopilotModel
    ) -> FlightState:
        """Return the state of each column at `until`, from its `state` at `since`.

        Column i is vehicle `vehicles[i]`; a vehicle may stand in several columns. Before the oldest setpoint
        known it flies on as that one says; where none was told, straight on.
        """
        rows = list(self._sent)
        first = self._first_relevant(rows, since, vehicles)
        acts = np.array([row.acts for row in rows[first:]])[:, vehicles]
        acts[0] = since
        borders = np.clip(np.maximum.accumulate(acts), since, np.maximum(until, since))
        ends = np.vstack((borders[1:], np.maximum(until, since)))
        told = np.array([row.setpoints.table for row in rows[first:]])[:, :, vehicles]
        return advance(state, told, (ends - borders) / NANOSECONDS, model)

    def _first_relevant(self, rows: list[SentSetpoints], since: Instants, vehicles: Indices) -> int:
        """Return the last row that acts before all of `since`."""
        for index in range(len(rows) - 1, 0, -1):
            if (rows[index].acts[vehicles] <= since).all():
                return index
        return 0


def advance(state: FlightState, told: Array, duration_s: Array, model: AutopilotModel) -> FlightState:
    """Return the state after K segments of constant setpoints, by the closed forms of equation (7).

    Speed and heading errors decay exponentially, linearly while a limit holds them; the way made good is
    Gauss's quadrature of them; the height follows its two real poles. Wind is constant.

    Args:
        state: (N,) columns.
        told: (K, 3, N) speed, heading and height; NaN means straight on.
        duration_s: (K, N).
        model: (N,) columns.
    """
    lags = AirLags(
        np.stack((model.accel_max_mps2, model.turn_rate_max_rps)), np.stack((model.tau_v_s, model.tau_psi_s))
    )
    told = told.copy()
    np.clip(told[:, 0], model.speed_min_mps, model.speed_max_mps, out=told[:, 0])
    value = np.stack((state.airspeed_mps, state.heading_rad))
    begins, errors = np.empty((len(told), *value.shape)), np.empty((len(told), *value.shape))
    height = Height(state.height_m, state.climb_mps)
    for k, segment_s in enumerate(duration_s):
        error = told[k, :2] - value
        error[1] = wrap(error[1])
        error[np.isnan(error)] = 0.0
        begins[k], errors[k] = value, error
        value = value + error - lags.remaining(error, segment_s)
        height = height.after(segment_s, told[k, 2], model)
    time_s = _NODES * duration_s
    speed, heading = np.moveaxis(begins + errors - lags.remaining(errors, time_s[:, :, None]), 2, 0)
    north_m = (_SHARES * duration_s * speed * np.cos(heading)).sum(axis=(0, 1))
    east_m = (_SHARES * duration_s * speed * np.sin(heading)).sum(axis=(0, 1))
    total_s = duration_s.sum(axis=0)
    return FlightState(
        north_m=state.north_m + north_m + state.wind_north_mps * total_s,
        east_m=state.east_m + east_m + state.wind_east_mps * total_s,
        height_m=height.height_m,
        climb_mps=height.climb_mps,
        airspeed_mps=value[0],
        heading_rad=value[1],
        wind_north_mps=state.wind_north_mps,
        wind_east_mps=state.wind_east_mps,
    )


def turn_rate(state: FlightState, setpoints: Setpoints, model: AutopilotModel) -> Array:
    """Return psi' of equation (7), rad/s (N,), within the limit; 0 where no heading was told."""
    rate = wrap(setpoints.heading_rad - state.heading_rad) / model.tau_psi_s
    return np.clip(np.nan_to_num(rate), -model.turn_rate_max_rps, model.turn_rate_max_rps)


class AirLags(NamedTuple):
    """First-order lags with limited rates: (2, N) for speed and heading."""

    rate_max: Array
    tau_s: Array

    def remaining(self, error: Array, time_s: Array) -> Array:
        """Return what is left of `error` after `time_s`."""
        size = np.abs(error)
        limited_s = np.minimum(np.maximum(size / self.rate_max - self.tau_s, 0.0), time_s)
        left = (size - self.rate_max * limited_s) * np.exp((limited_s - time_s) / self.tau_s)
        return np.copysign(left, error)


class Height(NamedTuple):
    """Height and climb rate, (N,)."""

    height_m: Array
    climb_mps: Array

    def after(self, time_s: Array, target_m: Array, model: AutopilotModel) -> Height:
        """Return what they are `time_s` later; a climb beyond the limit counts as the limit.

        With equal time constants exprel's limit makes it the double pole's form.
        """
        slow, fast = np.maximum(model.tau_ha_s, model.tau_hb_s), np.minimum(model.tau_ha_s, model.tau_hb_s)
        straight_m = -(slow + fast) * self.climb_mps
        error = np.where(np.isnan(target_m), straight_m, self.height_m - target_m)
        slow_left = np.exp(-time_s / slow)
        between_s = time_s * slow_left * exprel(time_s / slow - time_s / fast)
        push_mps = self.climb_mps + error / slow
        left_m = slow_left * error + between_s * push_mps
        climb_mps = np.exp(-time_s / fast) * push_mps - left_m / slow
        most_m = model.climb_max_mps * time_s
        return Height(
            self.height_m + np.minimum(np.maximum(left_m - error, -most_m), most_m),
            np.minimum(np.maximum(climb_mps, -model.climb_max_mps), model.climb_max_mps),
        )
