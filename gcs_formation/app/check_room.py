"""What `check` says about room: speed left to hold slots, drift of inertial navigation.

Vehicles that navigate by inertia drift. Growth of single errors from an exact start, flown straight (Titterton and
Weston, Strapdown Inertial Navigation Technology (2004), 12.3), with ws = sqrt(g/R) of Schuler's oscillation and k =
sqrt(2 g/R) of the height's divergence: a bias b of an accelerometer leaves b/ws^2 (1 - cos ws t) north or east and
b/k^2 (cosh kt - 1) up, a bias e of a gyroscope R e (t - sin(ws t)/ws) north or east. White noise leaves the integral of
the squared response to an impulse: sin(ws t)/ws and sinh(kt)/k of velocity, R (1 - cos ws t) of angle. After an
alignment errors are smaller, until the vehicle turns.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from flight_model.arrays import Array
from flight_model.earth import gravity_mps2, radii_m
from flight_model.path import PathPoints
from formation_scenario import Scenario, Vehicle
from formation_scenario.navigation import InertialNavigation, Navigation
from formation_scenario.orders import read_order
from formation_scenario.sampled_path import SampledPath
from formation_scenario.slot_assignment import SlotStep, columns, slot_schedule
from formation_scenario.slot_motion import LeaderFlight, SlotMotion, slot_needs
from formation_scenario.start_states_and_end_times import planned_end_s
from formation_scenario.surroundings import DrydenTurbulence, OwnDisturbance

GUST_SIGMAS = 2.0
"""Gusts along the path that the remaining speed must cover: standard deviations of two vehicles' difference."""
LIGHT_MPS = 3.0
"""Wind 6 m above ground in whose turbulence every formation should hold its slots."""
PLENTY = (math.inf, "")
DRIFT_SIGMAS = 3.0
"""Standard deviations of the drift that must fit into the room left."""
MICRO_G = 1e-6 * 9.80665
DEGREE_PER_HOUR = math.radians(1.0) / 3600.0
DEGREE_PER_ROOT_HOUR = math.radians(1.0) / 60.0


def little_left(scenario: Scenario) -> Iterator[str]:
    """Yield the speeds at which some fixed wing has too little speed left to hold its slot against gusts.

    Multirotors hold their velocity over ground by themselves.
    """
    if scenario.hovers:
        return
    sampled, steps = SampledPath.along(scenario.leader_path), slot_schedule(scenario)
    at_m, points = sampled.places_m, sampled.points
    wanted_mps = gusts_mps(scenario)
    orders = {f"orders.{i}": read_order(order.order).speed_mps for i, order in scenario.timed_orders}
    speeds = scenario.path.speed_mps
    legs = {f"path.speed_mps.{speeds.index(each)}": each for each in speeds} if isinstance(speeds, tuple) else {}
    legs = legs or {"path.speed_mps": scenario.path.begin_mps}
    for key, speed in {**legs, **orders}.items():
        if speed is None or not all(low <= speed <= high for low, high in map(scenario.speeds_mps, scenario.vehicles)):
            continue
        near = scenario.speeds.near(at_m, speed) if key in legs else np.ones(at_m.size, dtype=np.bool_)
        if not near.any():  # of a leg that is too short to reach its speed
            continue
        flown = points.only(near)
        sides = zip(*(_left(scenario, flown, step, speed) for step in steps), strict=True)
        for left_mps, found in (min((found for each in side for found in each), default=PLENTY) for side in sides):
            if left_mps < wanted_mps:
                left = f"{left_mps:.2g} m/s is left" if left_mps > 0.0 else "nothing is left"
                yield f"{key}: found {speed:g}; {found}: {left}, {wanted_mps:.2g} should be to hold it against gusts"


def gusts_mps(scenario: Scenario) -> float:
    """Return the difference of airspeed along the path that gusts ask for, m/s: the scenario's gusts, or light ones."""
    height_m = np.array([min(height_m for _, _, height_m in scenario.path.waypoints_m)])
    found = [_dryden_mps(DrydenTurbulence(at_s=0.0, kind="dryden", wind_6m_mps=LIGHT_MPS), height_m)]
    for each in scenario.disturbances:
        if isinstance(each, DrydenTurbulence):
            found.append(_dryden_mps(each, height_m))
        elif each.vehicles != "all" and not isinstance(each, OwnDisturbance):
            found.append(math.hypot(*each.velocity_mps[:2]))
    return max(found)


def _dryden_mps(keys: DrydenTurbulence, height_m: Array) -> float:
    return GUST_SIGMAS * math.sqrt(2.0) * float(keys.scales(height_m)[0][0, 0])


def _left(
    scenario: Scenario, points: PathPoints, step: SlotStep, speed_mps: float
) -> tuple[list[tuple[float, str]], list[tuple[float, str]]]:
    """Return each follower's speed left below its slot's slowest and above its slot's fastest, m/s, with words.

    A leader with the wind behind it turns faster than in still air.
    """
    flight, windy = LeaderFlight.along(points, speed_mps), 1.0 + scenario.wind.speed_mps / speed_mps
    flight = flight._replace(turn_rate_rps=windy * flight.turn_rate_rps)
    needs_mps = slot_needs(flight, SlotMotion.at_rest(step.places_m), scenario.formation.frame).speed_mps
    below, above = list[tuple[float, str]](), list[tuple[float, str]]()
    for column, vehicle in enumerate(columns(scenario)):
        if vehicle is None or column == step.arrangement.leader:
            continue
        whose = f"vehicle {vehicle.vehicle_id}'s slot in shape {step.shape} is flown at"
        min_mps, max_mps = float(needs_mps[:, column].min()), float(needs_mps[:, column].max())
        slowest_mps, fastest_mps = vehicle.model.soon_mps(speed_mps)
        below.append((min_mps - slowest_mps, f"{whose} {min_mps:.3g} m/s, and {slowest_mps:.3g} is its least"))
        above.append((fastest_mps - max_mps, f"{whose} {max_mps:.3g} m/s, and {fastest_mps:.3g} is its most"))
    return below, above


def level_drift(keys: InertialNavigation, lat_rad: float, after_s: float) -> tuple[float, float]:
    """Return the standard deviations of a vehicle's error north or east, m: by biases, and by noise."""
    gravity, radius_m = _earth(lat_rad)
    ws = math.sqrt(gravity / radius_m)
    turned = ws * after_s
    accel, gyro, velocity_walk, angle_walk = _sensors(keys)
    by_accel_m = accel / ws**2 * (1.0 - math.cos(min(turned, math.pi)))  # the most until then
    by_gyro_m = radius_m * gyro * (after_s - math.sin(turned) / ws)
    of_velocity_m = velocity_walk / ws * math.sqrt(max(after_s / 2 - math.sin(2 * turned) / (4 * ws), 0.0))
    of_angle = 1.5 * after_s - 2.0 * math.sin(turned) / ws + math.sin(2 * turned) / (4 * ws)
    of_angle_m = radius_m * angle_walk * math.sqrt(max(of_angle, 0.0))
    return math.hypot(by_accel_m, by_gyro_m), math.hypot(of_velocity_m, of_angle_m)


def height_drift(keys: InertialNavigation, lat_rad: float, after_s: float) -> tuple[float, float]:
    """Return the same for a height by inertia alone."""
    gravity, radius_m = _earth(lat_rad)
    k = math.sqrt(2.0 * gravity / radius_m)
    grown = k * after_s
    accel, _, velocity_walk, _ = _sensors(keys)
    of_velocity_m = velocity_walk / k * math.sqrt(max(math.sinh(2.0 * grown) / (4.0 * k) - after_s / 2.0, 0.0))
    return accel / k**2 * (math.cosh(grown) - 1.0), of_velocity_m


def drifts(scenario: Scenario) -> Iterator[str]:
    """Yield by how much positions drift apart and heights drift by the end of the flight, where it exceeds the room."""
    after_s, lat_rad = scenario.start.run_in_s + planned_end_s(scenario), math.radians(scenario.origin.lat_deg)
    each = [_navigation(vehicle) for vehicle in scenario.vehicles]
    adrift = [keys for keys in each if isinstance(keys, InertialNavigation) and keys.aiding != "gnss"]
    if not adrift:
        return
    level = [level_drift(keys, lat_rad, after_s) for keys in adrift]
    # Equal biases move all vehicles alike.
    alike = all(keys == each[0] and keys.biases == "keys" for keys in adrift) and len(adrift) == len(each)
    apart_m = math.hypot(*sorted(noise_m if alike else math.hypot(bias_m, noise_m) for bias_m, noise_m in level)[-2:])
    kept_m, words = _left_between_m(scenario), f"(1 sigma) within {after_s:.0f} s"
    if DRIFT_SIGMAS * apart_m > kept_m:
        yield (
            f"navigation: places drift apart by {apart_m:.1f} m north and east {words} by inertia without gnss, and "
            f"slots leave {kept_m:.3g} m beyond safety.separation_m; aiding: gnss holds them"
        )
    heights = [math.hypot(*height_drift(keys, lat_rad, after_s)) for keys in adrift if keys.aiding == "none"]
    if heights and DRIFT_SIGMAS * max(heights) > (over_m := _left_below_m(scenario)):
        yield (
            f"navigation: heights drift by {max(heights):.1f} m {words} by inertia alone, and {over_m:.3g} m are left "
            "above ground beyond safety.clearance_m; aiding: baro or gnss holds them"
        )


def _navigation(vehicle: Vehicle) -> Navigation:
    return vehicle.true_navigation or vehicle.navigation


def _left_between_m(scenario: Scenario) -> float:
    """Return by how much the distance of the nearest two slots exceeds the required separation, m."""
    first, nearest_m = 0 if scenario.leader else 1, math.inf
    for step in slot_schedule(scenario):
        places_m = step.places_m[first:]
        away_m = np.linalg.norm(places_m[:, None] - places_m, axis=2) + np.diag(np.full(len(places_m), np.inf))
        nearest_m = min(nearest_m, float(away_m.min(initial=math.inf)))
    return nearest_m - scenario.safety.separation_m


def _left_below_m(scenario: Scenario) -> float:
    """Return by how much the path's height above ground exceeds the required clearance where it is lowest, m."""
    points = SampledPath.along(scenario.leader_path).points
    over_m = points.height_m - scenario.ground.height(points.north_m, points.east_m)
    return float(over_m.min()) - scenario.safety.clearance_m


def _earth(lat_rad: float) -> tuple[float, float]:
    """Return gravity, m/s2, and the mean radius of curvature, m."""
    return gravity_mps2(lat_rad, 0.0), math.sqrt(math.prod(radii_m(lat_rad)))


def _sensors(keys: InertialNavigation) -> tuple[float, float, float, float]:
    """Return the root mean square over the axes of biases (m/s2, rad/s) and of noise (m/s, rad per root second)."""
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
