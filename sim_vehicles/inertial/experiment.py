"""The navigation experiment of a scenario: a vehicle stands and aligns, then navigates along the leader's path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from flight_model.arrays import Array
from flight_model.earth import GeodeticOrigin
from formation_scenario import Scenario, Vehicle
from formation_scenario.navigation import InertialNavigation
from sim_vehicles.inertial.alignment import Alignment, FineAlignment, align, limits
from sim_vehicles.inertial.config import aid, inertial_sensors
from sim_vehicles.inertial.flight import NavigationRecord, Start, exact_start, navigate
from sim_vehicles.inertial.imu import sensor_random
from sim_vehicles.inertial.rotation import displaced
from sim_vehicles.inertial.trajectory import Trajectory

SCHEMA: Final = 1
LEAST_S: Final = 1.0
RATE_HZ: Final = 100.0
"""Increments of the sensors a second."""
AXES: Final = ("east", "north", "up")
ANGLES: Final = ("east_arcsec", "north_arcsec", "heading_arcmin")
UNITS: Final = np.radians((1.0 / 3600.0, 1.0 / 3600.0, 1.0 / 60.0))


@dataclass(frozen=True)
class Experiment:
    """A navigation experiment and its results."""

    scenario: Scenario
    vehicle: Vehicle
    keys: InertialNavigation
    limit_rad: Array
    """(3,) limits of the alignment about east, north and up: b / g, b / g, epsilon / (Omega cos L)."""
    alignment: Alignment
    flight: NavigationRecord


def inertial_vehicles(scenario: Scenario) -> tuple[Vehicle, ...]:
    """Return the vehicles of a scenario with inertial navigation."""
    return tuple(each for each in scenario.vehicles if isinstance(each.navigation, InertialNavigation))


def experiment(scenario: Scenario, vehicle: Vehicle) -> Experiment:
    """Align, then fly from t = 0 to the scenario's duration or the path's end, whichever is first, but at least 1 s.

    Raises:
        DivergedError: without aids, the computed height diverged during so long a flight.
    """
    keys = vehicle.navigation
    assert isinstance(keys, InertialNavigation)
    origin = _origin(scenario)
    sensors = inertial_sensors(keys, scenario.seed, vehicle.vehicle_id)
    random = sensor_random(scenario.seed, vehicle.vehicle_id)
    path, speed_mps = scenario.leader_path, scenario.path.speed_mps
    duration_s = max(LEAST_S, min(scenario.duration_s, path.length_m / speed_mps))
    trajectory = Trajectory.along(path, speed_mps, origin, duration_s)
    fine, heading_rad = FineAlignment(origin, sensors), path.at(0.0).course_rad
    alignment = align(fine, heading_rad, sensors, keys.alignment_s, RATE_HZ, random)
    start = exact_start(trajectory, sensors)
    if keys.flight_start == "aligned":
        attitude = displaced(start.state.attitude, alignment.error_rad[-1])
        start = Start(start.state._replace(attitude=attitude), alignment.bias, alignment.covariance)
    flight = navigate(trajectory, start, sensors, aid(keys), RATE_HZ, random)
    return Experiment(scenario, vehicle, keys, limits(sensors, origin), alignment, flight)


def summary(done: Experiment) -> dict[str, Any]:
    """Return summary.json; every error is an absolute value."""
    alignment, flight = done.alignment, done.flight
    return {
        "schema": SCHEMA,
        "name": done.scenario.name,
        "seed": done.scenario.seed,
        "vehicle": str(done.vehicle.vehicle_id),
        "grade": done.keys.grade,
        "aiding": done.keys.aiding,
        "alignment": {
            "sigma": _angles(alignment.sigma_rad[-1]),
            "error": _angles(alignment.error_rad[-1]),
            "limit": _angles(done.limit_rad),
            "coarse_error": _angles(alignment.coarse_rad),
            "duration_s": float(alignment.times_s[-1]),
        },
        "flight": {
            "start": done.keys.flight_start,
            "duration_s": float(flight.times_s[-1]),
            "error_m": _figures(flight.errors[:, :3], AXES),
            "velocity_error_mps": _figures(flight.errors[:, 3:6], AXES),
            "attitude_error": _figures(flight.errors[:, 6:] / UNITS, ANGLES),
            "sigma_m": dict(zip(AXES, flight.sigmas[-1, :3].tolist(), strict=True)),
        },
    }


def _origin(scenario: Scenario) -> GeodeticOrigin:
    origin = scenario.origin
    return GeodeticOrigin(math.radians(origin.lat_deg), math.radians(origin.lon_deg), origin.alt_m)


def _angles(rad: Array) -> dict[str, float]:
    return dict(zip(ANGLES, np.abs(rad / UNITS).tolist(), strict=True))


def _figures(errors: Array, names: tuple[str, ...]) -> dict[str, dict[str, float]]:
    sizes = np.abs(errors)
    return {name: {"max": float(sizes[:, i].max()), "final": float(sizes[-1, i])} for i, name in enumerate(names)}
