"""An aircraft under total-energy control, as ArduPlane flies one: pure functions on tables, a column a vehicle.

Throttle governs the sum of kinetic and potential energy, pitch their balance, so speed and height are coupled; a bank
turns. Sources: A. A. Lambregts, "Vertical Flight Path and Speed Control Autopilot Design Using Total Energy
Principles", AIAA 83-2239; ArduPilot documentation, "Total Energy Control System for Speed and Height" and the
parameters that `AirframeParameters` names.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flight_model.airframe import GRAVITY_MPS2, REFERENCE_MPS, AirframeParameters
from flight_model.arrays import Array, wrap

CYCLE_S = 0.02
"""Period of attitude and motion."""
CYCLES = 5
"""Cycles to one of the energy controller."""
ENERGY_S = CYCLE_S * CYCLES
ACCELERATION_LAG_S = 0.04
"""Lag of the measured acceleration: half of a moving average over five cycles."""
THROTTLE_LAG_S = 0.5
"""Of the error of the energy's rate, which damps the throttle."""
GAIN_SHARE, LOSS_SHARE = 0.5, 0.9
"""Shares of the energy's greatest rates that a change of airspeed may take."""
OVERSHOOT = 0.1
"""By how much of its range the throttle's integral may go beyond the limits."""
PITCH_OVERSHOOT_RAD = np.radians(5.0)
LEAST_MPS = 5.0
"""Lower bound of airspeeds in divisions."""

Motion = Array
"""(4, N) height, climb, airspeed, heading."""
HEIGHT, CLIMB, SPEED, HEADING = range(4)

ROWS = (
    "bank", "bank_rate", "pitch", "pitch_rate", "throttle", "sensed", "estimate", "estimate_trend",
    "acceleration", "slow_acceleration", "speed_told", "slow_speed_rate", "height_before", "height_limited",
    "height_told", "power_error", "throttle_integral", "throttle_before", "balance_integral", "kinetic_integral",
    "pitch_before", "pitch_wanted", "throttle_wanted", "speed_max", "climb_share", "sink_share", "pitch_free",
    "throttle_clip", "balance_clip",
)  # fmt: skip
"""What an airframe remembers beside its motion: the rows of the inner table, (R, N)."""
R = {name: row for row, name in enumerate(ROWS)}


class Told(NamedTuple):
    """Commands of N vehicles, (N,) each: airspeed, its rate's limit, heading, the bank's limit, height."""

    speed_mps: Array
    accel_mps2: Array
    heading_rad: Array
    bank_max_rad: Array
    height_m: Array


def trimmed(motion: Motion, p: AirframeParameters) -> Array:
    """Return the inner table (R, N) of aircraft that have flown straight and level at this height and speed."""
    speed = np.maximum(motion[SPEED], LEAST_MPS)
    inner = np.zeros((len(ROWS), speed.size))
    throttle = _drag(speed, 1.0, p) / p.thrust_mps2
    pitch = _incidence(speed, 1.0, p)
    for name, value in (
        ("pitch", pitch), ("throttle", throttle), ("sensed", speed), ("estimate", speed), ("speed_told", speed),
        ("height_before", motion[HEIGHT]), ("height_limited", motion[HEIGHT]), ("height_told", motion[HEIGHT]),
        ("throttle_integral", throttle - p.throttle_cruise), ("throttle_before", p.throttle_cruise),
        ("balance_integral", pitch * speed * GRAVITY_MPS2), ("pitch_before", pitch), ("pitch_wanted", pitch),
        ("throttle_wanted", throttle), ("speed_max", p.airspeed_max_mps), ("climb_share", 1.0), ("sink_share", 1.0),
        ("pitch_free", pitch),
    ):  # fmt: skip
        inner[R[name]] = value
    return inner


def cycle(motion: Motion, inner: Array, told: Told, p: AirframeParameters, gust_mps: Array | float = 0.0) -> None:
    """Fly a cycle of `CYCLE_S`, in place: attitude, then motion, then what is measured of it.

    `gust_mps` (N,) is the sensors' noise in airspeed.
    """
    _attitude(motion, inner, told, p)
    speed = np.maximum(motion[SPEED], LEAST_MPS)
    load = 1.0 / np.cos(inner[R["bank"]])
    path_rad = inner[R["pitch"]] - _incidence(speed, load, p)
    sin_path = np.sin(path_rad)
    push = inner[R["throttle"]] * p.thrust_mps2 - _drag(speed, load, p) - GRAVITY_MPS2 * sin_path
    motion[SPEED] += push * CYCLE_S
    motion[CLIMB] = motion[SPEED] * sin_path
    motion[HEIGHT] += motion[CLIMB] * CYCLE_S
    motion[HEADING] += GRAVITY_MPS2 * np.tan(inner[R["bank"]]) / speed * CYCLE_S
    inner[R["acceleration"]] += (push - inner[R["acceleration"]]) * (CYCLE_S / ACCELERATION_LAG_S)
    _estimate_speed(motion[SPEED] + gust_mps, inner, p)


def _attitude(motion: Motion, inner: Array, told: Told, p: AirframeParameters) -> None:
    """Turn towards the heading by a bank in proportion to the error, and towards the pitch that is wanted."""
    off = wrap(told.heading_rad - motion[HEADING])
    most = np.minimum(told.bank_max_rad, p.bank_max_rad)
    wanted = np.clip(p.heading_gain * off, -most, most)
    for angle, rate, target, lag_s in (
        ("bank", "bank_rate", wanted, p.bank_lag_s),
        ("pitch", "pitch_rate", inner[R["pitch_wanted"]], p.pitch_lag_s),
    ):
        pull = (target - inner[R[angle]]) / lag_s
        inner[R[rate]] += (pull - inner[R[rate]]) * (CYCLE_S / p.rate_lag_s)
        inner[R[angle]] += inner[R[rate]] * CYCLE_S
    most_step = p.throttle_slew_per_s * CYCLE_S
    inner[R["throttle"]] += np.clip(inner[R["throttle_wanted"]] - inner[R["throttle"]], -most_step, most_step)


def _estimate_speed(measured: Array, inner: Array, p: AirframeParameters) -> None:
    """Combine airspeed and acceleration by a second-order complementary filter; `sensed` is the sensor's own lag."""
    share = CYCLE_S / np.maximum(p.airspeed_lag_s, CYCLE_S)
    inner[R["sensed"]] += (measured - inner[R["sensed"]]) * share
    error, omega = inner[R["sensed"]] - inner[R["estimate"]], p.speed_filter_radps
    inner[R["estimate_trend"]] += error * omega**2 * CYCLE_S
    rate = inner[R["estimate_trend"]] + inner[R["acceleration"]] + np.sqrt(2.0) * omega * error
    inner[R["estimate"]] = np.maximum(inner[R["estimate"]] + rate * CYCLE_S, LEAST_MPS)
    slow = CYCLE_S / (CYCLE_S + p.time_constant_s)
    inner[R["slow_acceleration"]] += (inner[R["acceleration"]] - inner[R["slow_acceleration"]]) * slow


class _Demand(NamedTuple):
    """Specific energies and their rates as demanded, less as they are, m²/s² and m²/s³."""

    kinetic: Array
    kinetic_error: Array
    potential_error: Array
    kinetic_rate: Array
    kinetic_rate_told: Array
    climb_told_mps: Array


def control(motion: Motion, inner: Array, told: Told, p: AirframeParameters) -> None:
    """Run the energy controller for `ENERGY_S`, in place: demands, pitch by their balance, throttle by their sum."""
    speed_min = p.airspeed_min_mps / np.sqrt(np.cos(inner[R["bank"]]))
    rate_told = _speed_demand(inner, told, p, speed_min)
    climb_told = _height_demand(inner, told, p)
    speed = inner[R["estimate"]]
    demand = _Demand(
        kinetic=0.5 * speed**2,
        kinetic_error=0.5 * (inner[R["speed_told"]] ** 2 - speed**2),
        potential_error=GRAVITY_MPS2 * (inner[R["height_told"]] - motion[HEIGHT]),
        kinetic_rate=speed * (inner[R["acceleration"]] - inner[R["slow_acceleration"]]),
        kinetic_rate_told=speed * (rate_told - inner[R["slow_speed_rate"]]),
        climb_told_mps=climb_told,
    )
    _pitch(motion, inner, demand, p)
    _throttle(motion, inner, demand, p, speed_min)


def _speed_demand(inner: Array, told: Told, p: AirframeParameters, speed_min: Array) -> Array:
    """Let the airspeed demand follow as fast as energy can; return its rate, which is passed on to the throttle."""
    speed = inner[R["estimate"]]
    full_mps2 = GRAVITY_MPS2 * p.climb_max_mps * inner[R["climb_share"]] / np.maximum(speed, p.airspeed_min_mps)
    clipped = inner[R["throttle_clip"]] > 0
    most = inner[R["speed_max"]]
    wound = np.where(
        clipped,
        np.maximum(most - ENERGY_S * GAIN_SHARE * GRAVITY_MPS2 * p.sink_min_mps / speed, p.airspeed_cruise_mps),
        most + ENERGY_S * GAIN_SHARE * full_mps2,
    )
    inner[R["speed_max"]] = most = np.maximum(np.minimum(wound, p.airspeed_max_mps), speed_min)
    share = np.clip((most - speed) / np.maximum(most - p.airspeed_cruise_mps, 0.1), 0.0, 1.0)
    sink = p.sink_max_mps / most + share * (p.sink_min_mps / p.airspeed_cruise_mps - p.sink_max_mps / most)
    up = np.minimum(GAIN_SHARE * full_mps2, told.accel_mps2)
    down = np.minimum(LOSS_SHARE * GRAVITY_MPS2 * sink, told.accel_mps2)
    before = inner[R["speed_told"]]
    rate = np.clip((np.clip(told.speed_mps, speed_min, most) - before) / ENERGY_S, -down, up)
    inner[R["speed_told"]] = np.clip(before + rate * ENERGY_S, speed_min, most)
    slow = ENERGY_S / (ENERGY_S + p.time_constant_s)
    inner[R["slow_speed_rate"]] += (rate - inner[R["slow_speed_rate"]]) * slow
    return rate


def _height_demand(inner: Array, told: Told, p: AirframeParameters) -> Array:
    """Let the height demand follow by its lag, no faster than it may climb and sink; return the climb demanded."""
    before = inner[R["height_before"]]
    up_full = (inner[R["pitch_free"]] > p.pitch_max_rad) | (inner[R["throttle_clip"]] > 0)
    down_full = (inner[R["pitch_free"]] < p.pitch_min_rad) | (inner[R["throttle_clip"]] < 0)
    held = (up_full & (told.height_m > before)) | (down_full & (told.height_m < before))
    wanted = np.where(held, before, told.height_m)
    climb, sink = p.climb_max_mps * inner[R["climb_share"]], p.sink_max_mps * inner[R["sink_share"]]
    step = np.clip((wanted + before) / 2 - inner[R["height_limited"]], -sink * ENERGY_S, climb * ENERGY_S)
    inner[R["height_before"]] = wanted
    inner[R["height_limited"]] += step
    last = inner[R["height_told"]].copy()
    climb_told = (inner[R["height_limited"]] - last) / p.height_lag_s
    share = ENERGY_S / (ENERGY_S + p.height_lag_s)
    inner[R["height_told"]] += (inner[R["height_limited"]] - last) * share
    rises = inner[R["height_told"]] > last
    up_full |= inner[R["balance_clip"]] > 0
    down_full |= inner[R["balance_clip"]] < 0
    for name, limited in (("climb_share", up_full & rises), ("sink_share", down_full & ~rises)):
        scale = inner[R[name]]
        inner[R[name]] = np.where(limited, scale * (1.0 - share), scale + (1.0 - scale) * share)
    return climb_told


def _pitch(motion: Motion, inner: Array, demand: _Demand, p: AirframeParameters) -> None:
    weight, gain = p.speed_weight, inner[R["estimate"]] * GRAVITY_MPS2
    of_height = np.minimum(2.0 - weight, 1.0)
    of_speed = np.minimum(weight, 1.0)
    error = of_height * demand.potential_error - of_speed * demand.kinetic_error
    wanted = demand.climb_told_mps * GRAVITY_MPS2 * of_height + error / p.time_constant_s
    low, high = -p.sink_max_mps * GRAVITY_MPS2, p.climb_max_mps * GRAVITY_MPS2
    inner[R["balance_clip"]] = (wanted > high).astype(np.float64) - (wanted < low)
    wanted = np.clip(wanted, low, high)
    rate = motion[CLIMB] * GRAVITY_MPS2 * of_height - demand.kinetic_rate * of_speed
    total = wanted + (wanted - rate) * p.pitch_damping
    grown = (wanted - rate) * p.integral_gain * ENERGY_S
    balance: Array = inner[R["balance_integral"]]
    kinetic: Array = inner[R["kinetic_integral"]]
    free = (total + balance + grown + kinetic) / gain
    stuck = ((free > p.pitch_max_rad) & (grown > 0)) | ((free < p.pitch_min_rad) & (grown < 0))
    left = 1.0 - ENERGY_S / (ENERGY_S + p.time_constant_s)
    balance = np.where(stuck, balance * left, balance + grown)
    kinetic = np.where(stuck, kinetic * left, kinetic - demand.kinetic_error * of_speed * ENERGY_S / p.time_constant_s)
    bounds = (
        gain * (each + sign * PITCH_OVERSHOOT_RAD) - total
        for each, sign in ((p.pitch_min_rad, -1.0), (p.pitch_max_rad, 1.0))
    )
    most = 0.25 * (p.pitch_max_rad - p.pitch_min_rad) * gain
    low_bound, high_bound = bounds
    inner[R["balance_integral"]] = balance = np.clip(balance, low_bound, high_bound)
    inner[R["kinetic_integral"]] = kinetic = np.clip(kinetic, -most, most)
    inner[R["pitch_free"]] = free = (total + balance + kinetic) / gain
    step = ENERGY_S * p.vertical_accel_max_mps2 / inner[R["estimate"]]
    before = inner[R["pitch_before"]]
    limited = before + np.clip(np.clip(free, p.pitch_min_rad, p.pitch_max_rad) - before, -step, step)
    inner[R["pitch_before"]] = inner[R["pitch_wanted"]] = limited


def _throttle(motion: Motion, inner: Array, demand: _Demand, p: AirframeParameters, speed_min: Array) -> None:
    kinetic = demand.kinetic
    spare = kinetic - 0.5 * speed_min**2, kinetic - 0.5 * inner[R["speed_max"]] ** 2
    potential = np.clip(demand.potential_error, np.minimum(spare[1], 0.0), np.maximum(spare[0], 0.0))
    error = potential + demand.kinetic_error
    high, low = GRAVITY_MPS2 * p.climb_max_mps * inner[R["climb_share"]], -GRAVITY_MPS2 * p.sink_min_mps
    power = np.clip(demand.potential_error / p.time_constant_s + demand.kinetic_rate_told, low, high)
    power_error = power - motion[CLIMB] * GRAVITY_MPS2 - demand.kinetic_rate
    inner[R["power_error"]] += (power_error - inner[R["power_error"]]) * (ENERGY_S / THROTTLE_LAG_S)
    per_throttle = high - low
    gain = 1.0 / (p.time_constant_s * per_throttle)
    turning = p.bank_to_throttle * (1.0 / np.maximum(np.cos(inner[R["bank"]]) ** 2, 0.1) - 1.0)
    ahead = p.throttle_cruise + (power + turning) / per_throttle
    wanted = (error + p.throttle_damping * inner[R["power_error"]]) * gain + ahead
    integral = inner[R["throttle_integral"]] + error * p.integral_gain * ENERGY_S * gain
    bounds = (np.clip(each - wanted, -0.5, 0.5) for each in (-OVERSHOOT, 1.0 + OVERSHOOT))
    least, most = bounds
    integral = np.clip(integral, least, most)
    step = p.throttle_slew_per_s * ENERGY_S
    before = inner[R["throttle_before"]]
    wanted = before + np.clip(wanted - before, -step, step)
    inner[R["throttle_integral"]], inner[R["throttle_before"]] = integral, wanted
    total = wanted + integral
    inner[R["throttle_clip"]] = (total >= 1.0).astype(np.float64) - (total <= 0.0)
    inner[R["throttle_wanted"]] = np.clip(total, 0.0, 1.0)


def _drag(speed: Array, load: Array | float, p: AirframeParameters) -> Array:
    """Return the deceleration by drag, m/s²: parasitic by the square of the speed, induced by lift's."""
    square = (speed / REFERENCE_MPS) ** 2
    return p.drag_mps2 * square + p.induced_drag_mps2 * load**2 / square


def _incidence(speed: Array, load: Array | float, p: AirframeParameters) -> Array:
    """Return the angle of attack, rad, from that of no lift, which carries `load` times the weight."""
    return load * GRAVITY_MPS2 * (REFERENCE_MPS / speed) ** 2 / p.lift_mps2_per_rad
