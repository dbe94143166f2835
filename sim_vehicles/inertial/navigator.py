"""Telemetry of an emulated vehicle with inertial navigation: its true motion plus errors by the linear model.

The full strap-down computation (`flight.navigate`) would give the same to first order in the errors. Here the errors
themselves are propagated, and a filter with their covariance corrects them by the aid's measurements.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from airlink.clock import NANOSECONDS, Instant
from airlink.geodesy import GeodeticOrigin
from airlink.identity import VehicleId
from formation_scenario.arrays import Array
from sim_vehicles.inertial.alignment import UPDATE_S, FineAlignment
from sim_vehicles.inertial.config import InertialConfig
from sim_vehicles.inertial.earth import gravity_mps2
from sim_vehicles.inertial.error_model import (
    ACCEL_BIAS,
    GYRO_BIAS,
    SIZE,
    TILT,
    UP,
    dynamics,
    noise_density,
)
from sim_vehicles.inertial.imu import sensor_random
from sim_vehicles.inertial.kalman import ErrorFilter
from sim_vehicles.inertial.rotation import attitude
from sim_vehicles.motion import Motion, with_drift

RATE_HZ: Final = 10


class InertialNavigator:
    """One vehicle's navigation errors. They stay the same until the next sample, however often they are read."""

    def __init__(
        self, keys: InertialConfig, origin: GeodeticOrigin, heading_rad: float, vehicle: VehicleId, seed: int
    ) -> None:
        """Begin at boot with a heading; `origin` is the origin of motions."""
        self._origin, self._aid = origin, keys.aid
        self._random = sensor_random(seed, vehicle)
        self._density = noise_density(keys.sensors)
        covariance, self._errors = _start(keys, origin, heading_rad, self._random)
        self._filter = ErrorFilter(covariance)
        self._samples = self._measurements = 0
        self._velocity: Array | None = None

    def sense(self, true: Motion, now: Instant) -> Motion:
        """Return the motion with the errors of the newest sample at `now`."""
        while self._samples <= now * RATE_HZ // NANOSECONDS:
            self._go_on(true)
        east, north, up, v_east, v_north, v_up = self._errors[:6].tolist()
        return with_drift(
            true._replace(
                north_m=true.north_m + north,
                east_m=true.east_m + east,
                height_m=true.height_m + up,
                climb_mps=true.climb_mps + v_up,
                heading_rad=true.heading_rad + float(self._errors[TILT.start + UP]),
                velocity_north_mps=true.velocity_north_mps + v_north,
                velocity_east_mps=true.velocity_east_mps + v_east,
                velocity_down_mps=true.velocity_down_mps - v_up,
            )
        )

    def _go_on(self, true: Motion) -> None:
        step_s = 1.0 / RATE_HZ
        model = self._dynamics(true, step_s)
        step = model * step_s
        noise = np.sqrt(self._density * step_s) * self._random.standard_normal(SIZE)
        self._errors = self._errors + step @ self._errors + step @ (step @ self._errors) / 2.0 + noise
        self._filter.predict(model, self._density, step_s)
        self._samples += 1
        aid = self._aid
        if aid is not None and self._samples * step_s * aid.rate_hz >= self._measurements + 1 - 1e-9:
            self._measurements += 1
            seen = aid.seen @ self._errors - aid.sigmas * self._random.standard_normal(aid.sigmas.size)
            self._errors = self._errors - self._filter.update(aid.seen, seen, aid.sigmas).errors

    def _dynamics(self, true: Motion, step_s: float) -> Array:
        lat_rad, _, height_m = self._origin.from_ned(true.north_m, true.east_m, -true.height_m)
        velocity = np.array((true.velocity_east_mps, true.velocity_north_mps, -true.velocity_down_mps))
        before = velocity if self._velocity is None else self._velocity
        self._velocity = velocity
        gravity = gravity_mps2(lat_rad, height_m)
        force = (velocity - before) / step_s
        force[UP] += gravity
        pitch = math.asin(min(max(true.climb_mps / max(true.airspeed_mps, 1.0), -1.0), 1.0))
        bank = math.atan(true.turn_rate_radps * true.airspeed_mps / gravity)
        body = attitude(*(np.array(angle) for angle in (true.heading_rad, pitch, bank)))
        return dynamics(lat_rad, height_m, velocity, force, body)


def _start(
    keys: InertialConfig, place: GeodeticOrigin, heading_rad: float, random: np.random.Generator
) -> tuple[Array, Array]:
    """Return the covariance (15, 15) and the errors (15,) at the start of a flight."""
    sensors = keys.sensors
    if keys.aligned_s is None:
        sigmas, errors = np.zeros(SIZE), np.zeros(SIZE)
        sigmas[ACCEL_BIAS], sigmas[GYRO_BIAS] = sensors.accel_bias_sigma, sensors.gyro_bias_sigma
        errors[ACCEL_BIAS], errors[GYRO_BIAS] = sensors.accel_bias_mps2, sensors.gyro_bias_radps
        return np.diag(sigmas**2), errors
    fine = FineAlignment(place, sensors)
    for _ in range(round(keys.aligned_s / UPDATE_S)):
        fine.update(np.zeros(2))
    level = attitude(*(np.array(angle) for angle in (heading_rad, 0.0, 0.0)))
    covariance = fine.covariance(level.T)
    return covariance, random.multivariate_normal(np.zeros(SIZE), covariance, method="eigh")
