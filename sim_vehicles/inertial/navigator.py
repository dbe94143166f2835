"""Inertial navigation of an emulated vehicle: the errors of its telemetry.

The measured motion is the true one plus errors of the linear model. The full strap-down computation
(`inertial.experiment.navigate`) gives the same to first order. Here the errors themselves are propagated, and a filter
with their covariance corrects them by the aid's measurements.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import VehicleId
from airlink.random_streams import random_stream
from flight_model.arrays import Array
from flight_model.earth import GeodeticOrigin, gravity_mps2
from formation_scenario.navigation import InertialNavigation
from sim_vehicles.airframe.motion import Estimate, InnovationRatios, Motion, with_drift
from sim_vehicles.inertial.alignment import UPDATE_S, FineAlignment
from sim_vehicles.inertial.error_model import (
    ACCEL_BIAS,
    GYRO_BIAS,
    POSITION,
    SIZE,
    TILT,
    UP,
    ErrorFilter,
    aid,
    bias_covariance,
    dynamics,
    noise_density,
)
from sim_vehicles.inertial.imu import InertialSensors, attitude, inertial_sensors

RATE_HZ: Final = 10
USEFUL_M: Final = 50.0
"""Standard deviation of position beyond which it isn't reported as valid."""
ABSOLUTE: Final = m.EKF_POS_HORIZ_ABS | m.EKF_PRED_POS_HORIZ_ABS


class InertialNavigator:
    """One vehicle's navigation errors. They are constant until the next sample, however often they are read."""

    def __init__(
        self, keys: InertialNavigation, origin: GeodeticOrigin, heading_rad: float, vehicle: VehicleId, seed: int
    ) -> None:
        """Start at boot with a heading; `origin` is the origin of motions."""
        self._origin, self._aid, sensors = origin, aid(keys), inertial_sensors(keys, seed, vehicle)
        self._random = random_stream(seed, "inertial", *vehicle)
        self._density = noise_density(sensors)
        covariance, self._errors = _start(keys, sensors, origin, heading_rad, self._random)
        self._filter = ErrorFilter(covariance)
        self._pitot = random_stream(seed, "airspeed", *vehicle)
        self._airspeed_mps, self._airspeed_error_mps = keys.airspeed_sigma_mps, 0.0
        self._received: Array | None = None
        self._ratios = InnovationRatios(0.0, 0.0, 0.0, 0.0)
        self._samples = self._measurements = 0
        self._velocity: Array | None = None

    def sense(self, true: Motion, now: Instant) -> Motion:
        """Return the motion with the errors of the newest sample at `now`."""
        self._catch_up(true, now)
        sensed = _displaced(true, self._errors)
        sensed.heading_rad += float(self._errors[TILT.start + UP])
        sensed.airspeed_mps = max(0.0, true.airspeed_mps + self._airspeed_error_mps)
        return with_drift(sensed)

    def estimate(self, true: Motion, now: Instant) -> Estimate:
        """Return the filter's status, and the receiver's newest measurement if GNSS is the aid."""
        self._catch_up(true, now)
        about_east, about_north, _ = self._errors[TILT].tolist()
        sin, cos = math.sin(true.heading_rad), math.cos(true.heading_rad)
        return Estimate(
            received=None if self._received is None else _displaced(true, self._received),
            pitch_error_rad=about_north * sin - about_east * cos,
            bank_error_rad=-about_east * sin - about_north * cos,
            unknown=self._unknown(),
            ratios=self._ratios,
        )

    def _unknown(self) -> int:
        """Return the bits of EKF_STATUS_FLAGS whose estimates have become too uncertain."""
        east_m, north_m, up_m = np.sqrt(np.diag(self._filter.covariance)[POSITION]).tolist()
        level = ABSOLUTE if math.hypot(east_m, north_m) > USEFUL_M else 0
        return level | (m.EKF_POS_VERT_ABS if up_m > USEFUL_M else 0)

    def _catch_up(self, true: Motion, now: Instant) -> None:
        while self._samples <= now * RATE_HZ // NANOSECONDS:
            self._step(true)

    def _step(self, true: Motion) -> None:
        step_s = 1.0 / RATE_HZ
        model = self._dynamics(true, step_s)
        step = model * step_s
        noise = np.sqrt(self._density * step_s) * self._random.standard_normal(SIZE)
        self._errors = self._errors + step @ self._errors + step @ (step @ self._errors) / 2.0 + noise
        self._filter.predict(model, self._density, step_s)
        self._samples += 1
        self._airspeed_error_mps = self._airspeed_mps * float(self._pitot.standard_normal())
        aid = self._aid
        if aid is not None and self._samples * step_s * aid.rate_hz >= self._measurements + 1 - 1e-9:
            self._measurements += 1
            noise = aid.sigmas * self._random.standard_normal(aid.sigmas.size)
            errors, innovation = self._filter.update(aid.seen, aid.seen @ self._errors - noise, aid.sigmas)
            self._errors = self._errors - errors
            self._received = noise if aid.has_position else None
            self._ratios = aid.test_ratios(innovation)

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


def _displaced(true: Motion, errors: Array) -> Motion:
    """Return a motion with errors (6,) or more of position and velocity, east, north and up."""
    east, north, up, v_east, v_north, v_up = errors[:6].tolist()
    displaced = true.copy()
    displaced.north_m += north
    displaced.east_m += east
    displaced.height_m += up
    displaced.climb_mps += v_up
    displaced.velocity_north_mps += v_north
    displaced.velocity_east_mps += v_east
    displaced.velocity_down_mps -= v_up
    return displaced


def _start(
    keys: InertialNavigation,
    sensors: InertialSensors,
    position: GeodeticOrigin,
    heading_rad: float,
    random: np.random.Generator,
) -> tuple[Array, Array]:
    """Return the covariance (15, 15) and the errors (15,) at the start of a flight."""
    if keys.flight_start == "exact":
        errors = np.zeros(SIZE)
        errors[ACCEL_BIAS], errors[GYRO_BIAS] = sensors.accel_bias_mps2, sensors.gyro_bias_radps
        return bias_covariance(sensors), errors
    fine = FineAlignment(position, sensors)
    for _ in range(round(keys.alignment_s / UPDATE_S)):
        fine.update(np.zeros(2))
    level = attitude(*(np.array(angle) for angle in (heading_rad, 0.0, 0.0)))
    covariance = fine.covariance(level.T)
    return covariance, random.multivariate_normal(np.zeros(SIZE), covariance, method="eigh")
