"""The navigation experiment of a scenario: a vehicle at rest aligns, then navigates, free-inertial or aided."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from airlink.random_streams import random_stream
from flight_model.arrays import Array
from flight_model.earth import radii_m
from formation_scenario import Scenario, Vehicle
from formation_scenario.navigation import InertialNavigation
from sim_vehicles.inertial.alignment import Alignment, FineAlignment, align, limits
from sim_vehicles.inertial.error_model import (
    ACCEL_BIAS,
    GYRO_BIAS,
    POSITION,
    SIZE,
    TILT,
    VELOCITY,
    Aid,
    ErrorFilter,
    aid,
    bias_covariance,
    dynamics,
    noise_density,
)
from sim_vehicles.inertial.imu import (
    Increments,
    InertialSensors,
    NavigationState,
    Trajectory,
    inertial_sensors,
    measured,
    misalignment,
)
from sim_vehicles.inertial.strapdown import Strapdown, displaced

STEP_S: Final = 0.1
"""Step of the covariance propagation, and of the times at which aids measure."""
EACH: Final = 10
"""Number of steps between two rows of the record."""
BLOCK_STEPS: Final = 200
FARTHEST_M: Final = 1e6
"""Largest computed height; gravity has no meaning beyond."""
SCHEMA: Final = 1
MIN_S: Final = 1.0
RATE_HZ: Final = 100.0
"""Rate of the sensors' increments."""
AXES: Final = ("east", "north", "up")
ANGLES: Final = ("east_arcsec", "north_arcsec", "heading_arcmin")
UNITS: Final = np.radians((1.0 / 3600.0, 1.0 / 3600.0, 1.0 / 60.0))


@dataclass(frozen=True)
class Start:
    """The start of a flight: a state, and the knowledge of its errors."""

    state: NavigationState
    bias: Array
    """(6,) estimated biases, accelerometers' and gyroscopes', body components."""
    covariance: Array
    """(15, 15) covariance of the errors."""


@dataclass(frozen=True)
class NavigationRecord:
    """Errors of a flight, once a second."""

    times_s: Array
    """(K,) times."""
    errors: Array
    """(K, 9) computed minus true: position east, north and up in m, velocity in m/s, misalignment in rad."""
    sigmas: Array
    """(K, 9) standard deviations from the filter's covariance."""
    position: Array
    """(K, 3) true latitude and longitude in rad, height in m."""


def exact_start(trajectory: Trajectory, sensors: InertialSensors) -> Start:
    """Return the true state at the start of a flight, with unknown biases."""
    return Start(trajectory.state(np.array(0.0)), np.zeros(6), bias_covariance(sensors))


def navigate(
    trajectory: Trajectory,
    start: Start,
    sensors: InertialSensors,
    aid: Aid | None,
    rate_hz: float,
    random: np.random.Generator,
) -> NavigationRecord:
    """Navigate along a trajectory, with sensors that give `rate_hz` increments a second, an even number per step.

    The trajectory must last a second or more.

    Raises:
        DivergedError: the computed height exceeds `FARTHEST_M`.
    """
    steps = math.floor(trajectory.duration_s / STEP_S + 1e-9)
    times_s = STEP_S * np.arange(1, steps + 1, dtype=np.float64)
    truth = trajectory.state(times_s)
    computer = _Computer(start, sensors, aid, random)
    rows: list[Array] = []
    for step, samples in enumerate(_samples(trajectory, sensors, steps, rate_hz, random)):
        now = NavigationState(*(part[step] for part in truth))
        computer.process(samples, 1.0 / rate_hz, now)
        if (step + 1) % EACH == 0:
            if abs(computer.height_m) > FARTHEST_M:
                raise DivergedError(float(times_s[step]), computer.height_m)
            rows.append(np.concatenate((computer.errors(now), computer.sigmas)))
    table, kept = np.array(rows).reshape(-1, 2, 9), slice(EACH - 1, None, EACH)
    position = np.stack((truth.lat_rad, truth.lon_rad, truth.height_m), axis=1)
    return NavigationRecord(times_s[kept], table[:, 0], table[:, 1], position[kept])


def _samples(
    trajectory: Trajectory, sensors: InertialSensors, steps: int, rate_hz: float, random: np.random.Generator
) -> Iterator[Increments]:
    """Yield each step's samples, computed in blocks to limit memory."""
    period_s, each = 1.0 / rate_hz, round(rate_hz * STEP_S)
    for first in range(0, steps, BLOCK_STEPS):
        end = min(first + BLOCK_STEPS, steps)
        block = measured(trajectory.increments(period_s, first * each, end * each), sensors, period_s, random)
        for step in range(end - first):
            yield block.part(step * each, (step + 1) * each)


class DivergedError(Exception):
    """The computed height diverged: inertial navigation is unstable in the vertical."""

    def __init__(self, time_s: float, height_m: float) -> None:
        super().__init__(
            f"by inertia the computed height diverges: {height_m:.3g} m after {time_s:.0f} s; "
            "allowed: a shorter flight, or aiding: baro or gnss"
        )


class _Computer:
    """A strap-down navigator with the filter of its errors."""

    def __init__(self, start: Start, sensors: InertialSensors, aid: Aid | None, random: np.random.Generator) -> None:
        self._navigator = Strapdown.at(start.state)
        self._navigator.set_biases(start.bias)
        self._bias = start.bias.copy()
        self._filter = ErrorFilter(start.covariance)
        self._density = noise_density(sensors)
        self._aid, self._random = aid, random
        self._steps = self._measurements = 0

    @property
    def height_m(self) -> float:
        return self._navigator.height_m

    @property
    def sigmas(self) -> Array:
        return np.sqrt(np.maximum(np.diag(self._filter.covariance)[:9], 0.0))

    def errors(self, true: NavigationState) -> Array:
        found = self._navigator.state()
        meridian_m, across_m = (radius + float(true.height_m) for radius in radii_m(float(true.lat_rad)))
        east = (found.lon_rad - true.lon_rad) * across_m * np.cos(true.lat_rad)
        position = np.stack((east, (found.lat_rad - true.lat_rad) * meridian_m, found.height_m - true.height_m))
        return np.concatenate(
            (position, found.velocity_mps - true.velocity_mps, misalignment(found.attitude, true.attitude))
        )

    def process(self, samples: Increments, period_s: float, true: NavigationState) -> None:
        """Process a step's samples, and the aid's measurement at its end if one is due."""
        navigator = self._navigator
        navigator.run(samples, period_s)
        state = navigator.state()
        force = state.attitude @ samples.velocity_mps.sum(axis=0) / STEP_S
        model = dynamics(navigator.lat_rad, navigator.height_m, state.velocity_mps, force, state.attitude)
        self._filter.predict(model, self._density, STEP_S)
        self._steps += 1
        if self._aid is not None and self._steps * STEP_S * self._aid.rate_hz >= self._measurements + 1 - 1e-9:
            self._measurements += 1
            self._measure(self._aid, true)

    def _measure(self, aid: Aid, true: NavigationState) -> None:
        errors = np.zeros(SIZE)
        errors[:9] = self.errors(true)
        noise = aid.sigmas * self._random.standard_normal(aid.sigmas.size)
        estimate, _ = self._filter.update(aid.seen, aid.seen @ errors - noise, aid.sigmas)
        self._navigator.correct(estimate[POSITION], estimate[VELOCITY], estimate[TILT])
        self._bias += np.concatenate((estimate[ACCEL_BIAS], estimate[GYRO_BIAS]))
        self._navigator.set_biases(self._bias)


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
        DivergedError: the computed height diverged, as in a long flight without aids.
    """
    keys = vehicle.navigation
    assert isinstance(keys, InertialNavigation)
    origin = scenario.origin.geodetic
    sensors = inertial_sensors(keys, scenario.seed, vehicle.vehicle_id)
    random = random_stream(scenario.seed, "inertial", *vehicle.vehicle_id)
    path, speed_mps = scenario.leader_path, scenario.path.begin_mps
    duration_s = max(MIN_S, min(scenario.duration_s, path.length_m / speed_mps))
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
    """Return summary.json; all errors are absolute values."""
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


def _angles(rad: Array) -> dict[str, float]:
    return dict(zip(ANGLES, np.abs(rad / UNITS).tolist(), strict=True))


def _figures(errors: Array, names: tuple[str, ...]) -> dict[str, dict[str, float]]:
    sizes = np.abs(errors)
    return {name: {"max": float(sizes[:, i].max()), "final": float(sizes[-1, i])} for i, name in enumerate(names)}
