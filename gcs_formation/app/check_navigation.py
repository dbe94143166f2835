"""What `check` says of vehicles that navigate by inertia: by how much they drift in a flight, against what there is.

Growth of single errors from an exact start, flown straight (Titterton and Weston, Strapdown Inertial Navigation
Technology (2004), 12.3), with ws = sqrt(g/R) of Schuler's oscillation and k = sqrt(2 g/R) of the height's divergence:
a bias b of an accelerometer leaves b/ws^2 (1 - cos ws t) north or east and b/k^2 (cosh kt - 1) up, a bias e of a
gyroscope R e (t - sin(ws t)/ws) north or east. White noise leaves the integral of the squared response to an impulse:
sin(ws t)/ws and sinh(kt)/k of velocity, R (1 - cos ws t) of angle. An aligned start errs less, until it turns.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flight_model.earth import gravity_mps2, radii_m
from formation_scenario import Scenario, Vehicle
from formation_scenario.begin_and_end import planned_end_s
from formation_scenario.navigation import InertialNavigation, Navigation
from formation_scenario.path_limits import SampledPath
from formation_scenario.slot_assignment import slot_schedule

SIGMAS = 3.0
"""Standard deviations that what is left must hold."""
MICRO_G = 1e-6 * 9.80665
DEGREE_PER_HOUR = math.radians(1.0) / 3600.0
DEGREE_PER_ROOT_HOUR = math.radians(1.0) / 60.0


class Drift(NamedTuple):
    """Standard deviations of one vehicle's error after a time, m: what biases leave, and what noise does."""

    by_bias_m: float = 0.0
    by_noise_m: float = 0.0

    @property
    def total_m(self) -> float:
        """Of both."""
        return math.hypot(self.by_bias_m, self.by_noise_m)


def level_drift(keys: InertialNavigation, lat_rad: float, after_s: float) -> Drift:
    """Return the drift north or east, either."""
    gravity, radius_m = _earth(lat_rad)
    ws = math.sqrt(gravity / radius_m)
    turned = ws * after_s
    accel, gyro, velocity_walk, angle_walk = _sensors(keys)
    by_accel_m = accel / ws**2 * (1.0 - math.cos(min(turned, math.pi)))  # the most until then
    by_gyro_m = radius_m * gyro * (after_s - math.sin(turned) / ws)
    of_velocity_m = velocity_walk / ws * math.sqrt(max(after_s / 2 - math.sin(2 * turned) / (4 * ws), 0.0))
    of_angle = 1.5 * after_s - 2.0 * math.sin(turned) / ws + math.sin(2 * turned) / (4 * ws)
    of_angle_m = radius_m * angle_walk * math.sqrt(max(of_angle, 0.0))
    return Drift(math.hypot(by_accel_m, by_gyro_m), math.hypot(of_velocity_m, of_angle_m))


def height_drift(keys: InertialNavigation, lat_rad: float, after_s: float) -> Drift:
    """Return the drift of a height by inertia alone."""
    gravity, radius_m = _earth(lat_rad)
    k = math.sqrt(2.0 * gravity / radius_m)
    grown = k * after_s
    accel, _, velocity_walk, _ = _sensors(keys)
    of_velocity_m = velocity_walk / k * math.sqrt(max(math.sinh(2.0 * grown) / (4.0 * k) - after_s / 2.0, 0.0))
    return Drift(accel / k**2 * (math.cosh(grown) - 1.0), of_velocity_m)


def drifts(scenario: Scenario) -> Iterator[str]:
    """Yield how far places drift apart, and heights off, by the flight's end, where there isn't that much room."""
    after_s, lat_rad = scenario.start.run_in_s + planned_end_s(scenario), math.radians(scenario.origin.lat_deg)
    each = [_navigation(vehicle) for vehicle in scenario.vehicles]
    adrift = [keys for keys in each if isinstance(keys, InertialNavigation) and keys.aiding != "gnss"]
    if not adrift:
        return
    level = [level_drift(keys, lat_rad, after_s) for keys in adrift]
    # Biases that all have alike move everybody alike.
    alike = all(keys == each[0] and keys.biases == "keys" for keys in adrift) and len(adrift) == len(each)
    apart_m = math.hypot(*sorted(drift.by_noise_m if alike else drift.total_m for drift in level)[-2:])
    kept_m, words = _left_between_m(scenario), f"(1 sigma) within {after_s:.0f} s"
    if SIGMAS * apart_m > kept_m:
        yield (
            f"navigation: places drift apart by {apart_m:.1f} m north and east {words} by inertia without gnss, and "
            f"slots leave {kept_m:.3g} m beyond safety.separation_m; aiding: gnss holds them"
        )
    heights = [height_drift(keys, lat_rad, after_s).total_m for keys in adrift if keys.aiding == "none"]
    if heights and SIGMAS * max(heights) > (over_m := _left_below_m(scenario)):
        yield (
            f"navigation: heights drift by {max(heights):.1f} m {words} by inertia alone, and {over_m:.3g} m are left "
            "above ground beyond safety.clearance_m; aiding: baro or gnss holds them"
        )


def _navigation(vehicle: Vehicle) -> Navigation:
    return vehicle.true_navigation or vehicle.navigation


def _left_between_m(scenario: Scenario) -> float:
    """Return by how much the nearest two slots are farther apart than the separation, m."""
    first, nearest_m = 0 if scenario.leader else 1, math.inf
    for step in slot_schedule(scenario):
        places_m = step.places_m[first:]
        away_m = np.linalg.norm(places_m[:, None] - places_m, axis=2) + np.diag(np.full(len(places_m), np.inf))
        nearest_m = min(nearest_m, float(away_m.min(initial=math.inf)))
    return nearest_m - scenario.safety.separation_m


def _left_below_m(scenario: Scenario) -> float:
    """Return by how much the path is higher above ground than the clearance, where it is lowest, m."""
    points = SampledPath.along(scenario.leader_path).points
    over_m = points.height_m - scenario.ground.height(points.north_m, points.east_m)
    return float(over_m.min()) - scenario.safety.clearance_m


def _earth(lat_rad: float) -> tuple[float, float]:
    """Return gravity, m/s2, and the mean radius of curvature, m."""
    return gravity_mps2(lat_rad, 0.0), math.sqrt(math.prod(radii_m(lat_rad)))


def _sensors(keys: InertialNavigation) -> tuple[float, float, float, float]:
    """Return biases, m/s2 and rad/s, root mean squares of the axes; and noise, m/s and rad per root of a second."""
    sensors = keys.sensors
    return (
        MICRO_G * _root_mean_square(sensors.accel_bias_ug),
        DEGREE_PER_HOUR * _root_mean_square(sensors.gyro_bias_deg_per_h),
        MICRO_G * (sensors.accel_noise_ug_per_rthz or 0.0),
        DEGREE_PER_ROOT_HOUR * (sensors.gyro_noise_deg_per_rth or 0.0),
    )


def _root_mean_square(of_axes: float | tuple[float, float, float] | None) -> float:
    each = of_axes if isinstance(of_axes, tuple) else (of_axes or 0.0,)
    return math.sqrt(sum(bias**2 for bias in each) / len(each))
