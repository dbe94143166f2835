"""Vehicles simulated from their setpoints alone, by models (7) of several lags: `lags` compares them with telemetry."""

from __future__ import annotations

import numpy as np

from airlink.clock import NANOSECONDS
from flight_model.arrays import Array, Instants, Mask, within
from gcs_formation.estimation.flight_state import AutopilotModels
from gcs_formation.estimation.predictor import AirLags, Height, HeightSteps

FREE = 0.6
"""Share of a rate limit beyond which nothing is learnt of a lag: what flies at its limit doesn't show it, and the limit
may be lower than believed (an aircraft turns the slower, the faster it flies)."""


class Bank:
    """All vehicles' simulations from their setpoints alone, K each: airspeed and heading by one lag, height by two."""

    def __init__(self, believed: AutopilotModels, air: Array, height: Array) -> None:
        """Simulate lags that are the believed ones times e to the power of `air` (K,) and `height` (K', 2)."""
        self._columns = columns = believed.tau_v_s.size
        self.flying: Mask = np.zeros(columns, dtype=bool)
        """(C,) whether a vehicle's simulations have begun."""
        none = np.zeros_like
        self._believed = believed
        self._air_model = _spanned(believed, np.array((air, air, none(air), none(air))))
        self._height_model = _spanned(believed, np.array((*none(height.T), *height.T)))
        self._air: Array = np.zeros((2, columns * len(air)))
        self._height = Height(np.zeros(columns * len(height)), np.zeros(columns * len(height)))

    def begin(self, which: Mask, seen: Array) -> None:
        """Begin some simulations, (3, C) of airspeed, heading and height, from what was measured.

        `seen`, (4, C), is airspeed, heading, height and climb.
        """
        self.flying = np.isfinite(seen[0])
        air_k, height_k = self._air.shape[1] // self._columns, self._height.height_m.size // self._columns
        seen = np.where(self.flying, seen, 0.0)
        of_air, of_height = np.repeat(seen[:2], air_k, axis=1), np.repeat(seen[2:], height_k, axis=1)
        self._air = np.where(np.repeat(which[:2], air_k, axis=1), of_air, self._air)
        self._height = Height(*np.where(np.repeat(which[2], height_k), of_height, self._height))

    def fly(self, stamps: Instants, acts: Instants, told: Array) -> tuple[tuple[Array, Array, Array], Mask]:
        """Return airspeed, heading and height at all stamps but the first, (B, C, K) each.

        Also which of them, (3, C), kept clear of the rate limits.

        Args:
            stamps: (B + 1, C), in order; the simulations are at the first.
            acts: (R, C) in order, when the setpoints act.
            told: (R, 3, C).
        """
        borders = np.sort(np.concatenate((stamps, np.minimum(np.maximum(acts, stamps[0]), stamps[-1]))), axis=0)
        duration_s = np.diff(borders, axis=0) / NANOSECONDS
        newest = np.maximum((acts[:, None] <= borders[None, :-1]).sum(axis=0) - 1, 0)
        every = np.arange(self._columns)
        segments = told[newest, :, every].transpose(0, 2, 1)
        at = (borders[:, None] < stamps[None, 1:]).sum(axis=0)
        air, air_free = self._through_air(segments[:, :2], duration_s)
        height, height_free = self._through_heights(segments[:, 2], duration_s)
        return (air[at, 0, every], air[at, 1, every], height[at, every]), np.concatenate((air_free, height_free[None]))

    def _through_air(self, told: Array, duration_s: Array) -> tuple[Array, Mask]:
        """Return airspeeds and headings at the borders of S segments, (S + 1, 2, C, K), and which were free, (2, C)."""
        model, count = self._air_model, self._air.shape[1] // self._columns
        told = np.repeat(told, count, axis=2)
        told[:, 0] = within(told[:, 0], model.speed_min_mps, model.speed_max_mps)
        lags, each_s = AirLags.of(model), np.repeat(duration_s, count, axis=1)[:, None]
        values, errors = lags.through(self._air, told, each_s)
        self._air = values[-1]
        error = np.abs(errors).reshape(-1, 2, self._columns, count).mean(axis=3).max(axis=0)
        free: Mask = error < FREE * AirLags.of(self._believed).unlimited
        return values.reshape(-1, 2, self._columns, count), free

    def _through_heights(self, told_m: Array, duration_s: Array) -> tuple[Array, Mask]:
        """Return heights at the borders of S segments, (S + 1, C, K), and which were free, (C,)."""
        count = self._height.height_m.size // self._columns
        told_m = np.repeat(told_m, count, axis=1)
        steps = HeightSteps.of(self._height_model, np.repeat(duration_s, count, axis=1))
        height, heights = self._height, [self._height.height_m]
        for step, target_m in enumerate(told_m):
            height = steps.after(step, height, target_m)
            heights.append(height.height_m)
        self._height, table = height, np.array(heights)
        error_m = np.abs(told_m - table[:-1]).reshape(-1, self._columns, count).mean(axis=2).max(axis=0)
        free: Mask = error_m < FREE * self._believed.climb_max_mps * (self._believed.tau_ha_s + self._believed.tau_hb_s)
        return table.reshape(-1, self._columns, count), free


def _spanned(believed: AutopilotModels, logs: Array) -> AutopilotModels:
    """Return (C K,) models whose lags are the believed ones (C,) times e to the power of each of `logs` (4, K)."""
    table = np.repeat(believed.table, logs.shape[1], axis=1)
    table[:4] *= np.tile(np.exp(logs), believed.tau_v_s.size)
    return AutopilotModels.of(table)
