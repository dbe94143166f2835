"""How navigation errors grow in level flight straight on: the covariance of the error model that is flown."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from flight_model.earth import gravity_mps2
from formation_scenario.navigation import InertialNavigation
from sim_vehicles.inertial.error_model import POSITION, UP, ErrorFilter, bias_covariance, dynamics, noise_density
from sim_vehicles.inertial.imu import attitude, inertial_sensors

STEP_S, STEPS = 1.0, 1000
"""Shortest step of the covariance, s, and the most of them: Schuler's oscillation takes 84 min."""


class Growth(NamedTuple):
    """Standard deviations, m."""

    level_m: float
    """Of the position along the worse of the horizontal axes."""
    height_m: float


def growth(
    keys: InertialNavigation,
    lat_rad: float,
    north_mps: float,
    east_mps: float,
    after_s: float,
    *,
    biases: bool = True,
) -> Growth:
    """Return how large errors are after some time of flight without aids, from an exact start with unknown biases.

    Args:
        keys: with every default filled in.
        lat_rad: latitude.
        north_mps: velocity north.
        east_mps: velocity east.
        after_s: time of flight.
        biases: whether those of the sensors count.
    """
    sensors = inertial_sensors(keys, 0, VehicleId(1, 1))
    upwards = np.array((0.0, 0.0, gravity_mps2(lat_rad, 0.0)))
    heading = np.array(np.arctan2(east_mps, north_mps))
    level = attitude(heading, np.array(0.0), np.array(0.0))
    model = dynamics(lat_rad, 0.0, np.array((east_mps, north_mps, 0.0)), upwards, level)
    grown, density = ErrorFilter(bias_covariance(sensors) * biases), noise_density(sensors)
    steps = min(STEPS, max(1, round(after_s / STEP_S)))
    for _ in range(steps):
        grown.predict(model, density, after_s / steps)
    sigmas: Array = np.sqrt(np.diag(grown.covariance)[POSITION])
    return Growth(float(sigmas[:UP].max()), float(sigmas[UP]))
