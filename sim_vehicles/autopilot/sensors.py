"""Measurements of a vehicle: sensor errors of position, velocity, airspeed and heading, or inertial navigation."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import VehicleId
from airlink.random_streams import random_stream
from flight_model.arrays import Array
from formation_scenario.navigation import EstimatorNavigation, InertialNavigation, NoisyNavigation, OwnNavigation
from sim_vehicles.airframe.motion import Estimate, Motion, with_drift
from sim_vehicles.autopilot.estimator_errors import StateEstimator, errors_of
from sim_vehicles.autopilot.own_navigator import OwnNavigator
from sim_vehicles.config import FleetConfig, VehicleConfig
from sim_vehicles.inertial.navigator import InertialNavigator
from sim_vehicles.outside import Failures

SIZES: Final = (3, 3, 1, 1)
"""Number of components of position, velocity, airspeed and heading, each with a random stream of its own."""
BLOCK = 256


class Sensors:
    """One vehicle's sensors. A sample's errors are constant until the next sample, however often it is read."""

    def __init__(self, errors: NoisyNavigation, vehicle: VehicleId, seed: int) -> None:
        """Draw from the vehicle's own random streams."""
        self._random = [random_stream(seed, "sensors", *vehicle, sensor) for sensor in range(len(SIZES))]
        self._period_ns = round(NANOSECONDS / errors.rate_hz)
        heading_rad = math.radians(errors.heading_sigma_deg)
        each = errors.position_sigma_m, errors.velocity_sigma_mps, errors.airspeed_sigma_mps, heading_rad
        self._sigmas: Array = np.repeat(each, SIZES)
        correlated = errors.correlation_s > 0
        self._kept = math.exp(-1.0 / (errors.rate_hz * errors.correlation_s)) if correlated else 0.0
        self._block: Array = np.zeros((0, sum(SIZES)))
        self._number = 0
        self._error: Array = self._draw()
        self._outliers = random_stream(seed, "outliers", *vehicle)
        self._outlier_share, self._outlier_m = errors.outlier_share, errors.outlier_m
        self._off_m = 0.0, 0.0

    def sense(self, true: Motion, now: Instant) -> Motion:
        """Return the motion with the errors of the newest sample at `now`."""
        while self._number <= now // self._period_ns:
            self._error = self._kept * self._error + math.sqrt(1.0 - self._kept**2) * self._draw()
            self._off_m = self._draw_outlier()
        errors: list[float] = (self._sigmas * self._error).tolist()
        north, east, down, v_north, v_east, v_down, airspeed, heading = errors
        sensed = true.copy()
        sensed.north_m += north + self._off_m[0]
        sensed.east_m += east + self._off_m[1]
        sensed.height_m -= down
        sensed.climb_mps -= v_down
        sensed.airspeed_mps = max(0.0, true.airspeed_mps + airspeed)
        sensed.heading_rad += heading
        sensed.velocity_north_mps += v_north
        sensed.velocity_east_mps += v_east
        sensed.velocity_down_mps += v_down
        return with_drift(sensed)

    def estimate(self, true: Motion, now: Instant) -> Estimate:
        """Return the estimate, which is the receiver's measurement."""
        return Estimate(self.sense(true, now))

    def _draw_outlier(self) -> tuple[float, float]:
        """Return the next sample's outlier, north and east, usually 0."""
        if self._outlier_share == 0.0 or self._outliers.random() >= self._outlier_share:
            return 0.0, 0.0
        side = self._outliers.uniform(0.0, math.tau)
        return self._outlier_m * math.cos(side), self._outlier_m * math.sin(side)

    def _draw(self) -> Array:
        """Return the next sample's standard normal variates, (8,)."""
        index = self._number % BLOCK
        if index == 0:
            sizes = zip(self._random, SIZES, strict=True)
            self._block = np.concatenate([each.standard_normal((BLOCK, size)) for each, size in sizes], axis=1)
        self._number += 1
        return self._block[index]


def sensors_of(
    config: VehicleConfig, fleet: FleetConfig, failures: Failures
) -> Sensors | StateEstimator | InertialNavigator | OwnNavigator | None:
    """Return the sensors of a vehicle's telemetry; None if telemetry carries the exact state.

    Raises:
        ExtensionError: those of an extension can't begin.
    """
    keys, own = config.navigation, (config.identity, fleet.seed)
    if isinstance(keys, OwnNavigation):
        return OwnNavigator(keys, fleet.registered, *own, failures)
    if isinstance(keys, EstimatorNavigation):
        return StateEstimator(errors_of(keys, config.family), *own)
    if isinstance(keys, InertialNavigation):
        return InertialNavigator(keys, fleet.origin, config.start.heading_rad, *own)
    return Sensors(keys, *own) if isinstance(keys, NoisyNavigation) else None
