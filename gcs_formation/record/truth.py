"""Ground truth of a simulated flight. It goes to the record only; the control law never sees it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from airlink.identity import VehicleId
from gcs_formation.arrays import Array
from gcs_formation.record.timeseries import AIRBORNE, TRUTH


@dataclass(frozen=True)
class GroundTruth:
    """What the emulated vehicles really did: (T,) times in s since the clock's epoch, (T, V) everything else."""

    vehicles: tuple[VehicleId, ...]
    time_s: Array
    north_m: Array
    east_m: Array
    height_m: Array
    north_mps: Array
    east_mps: Array
    climb_mps: Array
    airspeed_mps: Array
    heading_rad: Array
    disturbance_north_mps: Array
    disturbance_east_mps: Array
    disturbance_down_mps: Array
    airborne: Array
    """1 in flight, 0 on the ground."""

    def at(self, vehicle: VehicleId, time_s: Array) -> dict[str, Array]:
        """Return a vehicle's true columns at the given times: places by cubic interpolation, the rest linearly."""
        column = self.vehicles.index(vehicle)
        heading = np.unwrap(self.heading_rad[:, column])
        values = (
            _hermite(self.time_s, self.north_m[:, column], self.north_mps[:, column], time_s),
            _hermite(self.time_s, self.east_m[:, column], self.east_mps[:, column], time_s),
            _hermite(self.time_s, self.height_m[:, column], self.climb_mps[:, column], time_s),
            np.interp(time_s, self.time_s, self.airspeed_mps[:, column]),
            np.interp(time_s, self.time_s, heading),
            *(np.interp(time_s, self.time_s, each[:, column]) for each in self._disturbance()),
        )
        # A place between one in flight and one on the ground is neither.
        airborne = np.interp(time_s, self.time_s, self.airborne[:, column]) >= 1.0
        return {**dict(zip(TRUTH, values, strict=True)), AIRBORNE: airborne.astype(np.float64)}

    def _disturbance(self) -> tuple[Array, Array, Array]:
        return self.disturbance_north_mps, self.disturbance_east_mps, self.disturbance_down_mps


def _hermite(known_s: Array, value: Array, rate: Array, wanted_s: Array) -> Array:
    """Return the cubic through values and rates, constant beyond the ends."""
    index = np.clip(np.searchsorted(known_s, wanted_s, side="right") - 1, 0, len(known_s) - 2)
    step_s = known_s[index + 1] - known_s[index]
    u = np.clip((wanted_s - known_s[index]) / step_s, 0.0, 1.0)
    before, after = value[index], value[index + 1]
    slope_before, slope_after = rate[index] * step_s, rate[index + 1] * step_s
    return (
        before * (1 + 2 * u) * (1 - u) ** 2
        + slope_before * u * (1 - u) ** 2
        + after * u**2 * (3 - 2 * u)
        + slope_after * u**2 * (u - 1)
    )
