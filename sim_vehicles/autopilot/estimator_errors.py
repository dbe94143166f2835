"""Errors of an autopilot's own state estimate, which its telemetry has, and by which its control loops fly.

An autopilot holds the velocity that it takes to be its own. Where the estimate is wrong, the aircraft truly flies the
opposite direction by as much: its telemetry shows the commanded velocity, and its position wanders.

The numbers of each family are those of its simulator, `ESTIMATES`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import VehicleId
from airlink.random_streams import random_stream
from flight_model.arrays import Array
from formation_scenario.navigation import EstimatorNavigation
from sim_vehicles.airframe.motion import Estimate, Motion, with_drift

RATE_HZ: Final = 10.0
BLOCK: Final = 256
VARIATES: Final = 8
"""Of a sample: velocity north, east, down; position north, east, down; heading; airspeed."""


class EstimatorErrors(NamedTuple):
    """Standard deviations, and time constants of first-order Gauss-Markov processes, s."""

    velocity_sigma_mps: float
    velocity_correlation_s: float
    climb_sigma_mps: float
    climb_correlation_s: float
    position_sigma_m: float
    height_sigma_m: float
    heading_offset_deg: float
    heading_sigma_deg: float
    heading_correlation_s: float
    airspeed_sigma_mps: float


PX4_PLANE: Final = EstimatorErrors(0.10, 1.3, 0.115, 2.4, 0.057, 0.14, 0.4, 0.39, 3.4, 0.2)
ESTIMATES: Final = {
    # ArduPlane 4.7.0-dev, SITL: XKF1 and ARSP against SIM and SIM2 of the logs of three aircraft in a calm, 130 s.
    # What all have alike at the same time (0.15 m of position, 0.7 m along the path) is left out.
    "arduplane": EstimatorErrors(0.015, 0.5, 0.006, 3.5, 0.02, 0.05, 0.37, 0.28, 31.0, 0.054),
    # ArduCopter 4.7.0-dev, SITL, likewise, of four, 150 s each.
    "arducopter": EstimatorErrors(0.02, 3.0, 0.005, 3.5, 0.05, 0.03, 0.46, 0.12, 14.0, 0.0),
    # PX4 1.17 (development), SIH, `sihsim_airplane`, EKF2_ACC_NOISE 1, EKF2_GYR_NOISE 0.1: vehicle_local_position and
    # airspeed_validated against their ground truth in its logs, of four, 170 s each.
    "px4_plane": PX4_PLANE,
    "px4_course": PX4_PLANE,
    # The same with `sihsim_quadx`.
    "px4_copter": EstimatorErrors(0.10, 1.1, 0.107, 2.3, 0.058, 0.126, 0.7, 0.57, 20.0, 0.0),
}
"""By family."""
ROUGH_AIR: Final[Mapping[str, Mapping[str, float]]] = {
    # As above, in 6 m/s of wind with SIM_WIND_TURB 1: the estimate of height follows an accelerometer and a barometer
    # that gusts shake, and the airspeed sensor measures them. Of the 0.11 m/s, 0.33 m and 0.95 m/s of its log a part:
    # with all of it, emulated formations err 1.5 times as much as simulated ones.
    "arduplane": {
        "climb_sigma_mps": 0.06, "climb_correlation_s": 4.5, "height_sigma_m": 0.2, "airspeed_sigma_mps": 0.75,
    },
}  # fmt: skip
"""What differs in rough air, by family; nothing where it isn't here."""


def errors_of(keys: EstimatorNavigation, family: str) -> EstimatorErrors:
    """Return the errors by a vehicle's keys, and where they don't say, its family's in such air."""
    rough: Mapping[str, float] = ROUGH_AIR.get(family, {}) if keys.air == "rough" else {}
    given: dict[str, Any] = {
        name: value for name in EstimatorErrors._fields if (value := getattr(keys, name)) is not None
    }
    return ESTIMATES[family]._replace(**{**rough, **given})


class StateEstimator:
    """One vehicle's estimate. Its errors are constant until the next sample, ten times a second."""

    def __init__(self, errors: EstimatorErrors, vehicle: VehicleId, seed: int) -> None:
        """Draw from the vehicle's own random stream."""
        self._random = random_stream(seed, "estimator", *vehicle)
        self._offset_rad = math.radians(errors.heading_offset_deg)
        heading_rad = math.radians(errors.heading_sigma_deg)
        level, upright = errors.velocity_correlation_s, errors.climb_correlation_s
        self._sigmas: Array = np.array(
            (
                *(errors.velocity_sigma_mps,) * 2,
                errors.climb_sigma_mps,
                *(errors.position_sigma_m,) * 2,
                errors.height_sigma_m,
                heading_rad,
                errors.airspeed_sigma_mps,
            )
        )
        times_s = np.array((level, level, upright, level, level, upright, errors.heading_correlation_s))
        self._kept: Array = np.append(np.exp(-1.0 / (RATE_HZ * times_s)), 0.0)
        self._block: Array = np.zeros((0, VARIATES))
        self._number = 0
        self._state: Array = self._draw()
        self._errors: list[float] = (self._sigmas * self._state).tolist()

    def unknown_mps(self, now: Instant) -> tuple[float, float, float]:
        """Return the velocity north, east and down at which the vehicle flies without knowing, at `now`, m/s."""
        self._advance(now)
        return -self._errors[0], -self._errors[1], -self._errors[2]

    def sense(self, true: Motion, now: Instant) -> Motion:
        """Return the motion as estimated at `now`."""
        self._advance(now)
        v_north, v_east, v_down, north, east, down, heading, airspeed = self._errors
        sensed = true.copy()
        sensed.north_m += north
        sensed.east_m += east
        sensed.height_m -= down
        sensed.climb_mps -= v_down
        sensed.airspeed_mps = max(0.0, true.airspeed_mps + airspeed)
        sensed.heading_rad += self._offset_rad + heading
        sensed.velocity_north_mps += v_north
        sensed.velocity_east_mps += v_east
        sensed.velocity_down_mps += v_down
        return with_drift(sensed)

    def estimate(self, true: Motion, now: Instant) -> Estimate:
        """Return the estimate, which its receiver is taken to say too."""
        return Estimate(self.sense(true, now))

    def _advance(self, now: Instant) -> None:
        while self._number <= now * RATE_HZ // NANOSECONDS:
            self._state = self._kept * self._state + np.sqrt(1.0 - self._kept**2) * self._draw()
            self._errors = (self._sigmas * self._state).tolist()

    def _draw(self) -> Array:
        """Return the next sample's standard normal variates, (8,)."""
        index = self._number % BLOCK
        if index == 0:
            self._block = self._random.standard_normal((BLOCK, VARIATES))
        self._number += 1
        return self._block[index]
