"""An aircraft under total-energy control, as ArduPlane flies one: its parameters, its state, its motion.

Throttle controls the sum of kinetic and potential energy, pitch their balance, so speed and height are coupled; bank
turns it. Sources: A. A. Lambregts, "Vertical Flight Path and Speed Control Autopilot Design Using Total Energy
Principles", AIAA 83-2239; ArduPilot documentation, "Total Energy Control System for Speed and Height" and the
parameters that `AirframeParameters` names.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Final, NamedTuple

from flight_model.autopilot_model import within, wrap

GRAVITY_MPS2: Final = 9.80665
REFERENCE_MPS: Final = 22.0
"""Airspeed for which drag and lift are given."""
PHYSICAL = (
    "thrust_mps2", "drag_mps2", "induced_drag_mps2", "lift_mps2_per_rad", "bank_lag_s", "pitch_lag_s", "rate_lag_s",
    "airspeed_lag_s",
)  # fmt: skip
"""Parameters that differ between aircraft of one type; the rest are settings of their autopilots."""
CYCLE_S: Final = 0.02
"""Period of attitude and motion."""
CYCLES: Final = 5
"""Cycles in one period of the energy controller."""
ENERGY_S: Final = CYCLE_S * CYCLES
ACCELERATION_TAU_S: Final = 0.04
"""Delay of the measured acceleration: half of a moving average over five cycles."""
THROTTLE_TAU_S: Final = 0.5
"""Time constant of the energy rate's error, which damps the throttle."""
GAIN_SHARE: Final = 0.5
LOSS_SHARE: Final = 0.9
"""Shares of the largest energy rates, up and down, that a change of airspeed may use."""
OVERSHOOT: Final = 0.1
"""How far the throttle's integral may take it beyond its limits, as a share of the range."""
PITCH_OVERSHOOT_RAD: Final = math.radians(5.0)
MIN_MPS: Final = 5.0
"""Lower bound of airspeeds in divisions."""
ROLLING_PER_S: Final = 0.3
"""Deceleration on the ground per airspeed, as in ArduPilot's simulator."""
ROLLING_SHARE: Final = 0.7
"""Largest share of thrust minus drag that rolling friction takes."""
STEEPEST: Final = 0.95
"""Largest sine of the angle of climb."""
CLIMB_OUT_SHARE: Final = 1.25
CLIMB_OUT_S: Final = 9.0
"""During a take-off's climb, airspeed approaches this multiple of the cruising one, with this time constant."""
LEVEL_SHARE: Final = 0.6
"""Share of the pitch that the balance's integral holds when that climb ends."""
INTEGRAL_MAX: Final = 0.5
"""Limit of the throttle's integral, as a share of full throttle."""


@dataclass(frozen=True)
class AirframeParameters:
    """One aircraft's parameters, SI; `formation_scenario.vehicles.EnergyAirframe` describes them."""

    thrust_mps2: float
    drag_mps2: float
    induced_drag_mps2: float
    lift_mps2_per_rad: float
    throttle_slew_per_s: float
    bank_lag_s: float
    pitch_lag_s: float
    rate_lag_s: float
    bank_max_rad: float
    heading_gain: float
    pitch_max_rad: float
    pitch_min_rad: float
    throttle_cruise: float
    airspeed_min_mps: float
    airspeed_cruise_mps: float
    airspeed_max_mps: float
    climb_max_mps: float
    sink_min_mps: float
    sink_max_mps: float
    time_constant_s: float
    height_lag_s: float
    throttle_damping: float
    pitch_damping: float
    integral_gain: float
    speed_weight: float
    bank_to_throttle: float
    vertical_accel_max_mps2: float
    speed_filter_radps: float
    airspeed_lag_s: float
    dead_time_s: float


class Commanded(NamedTuple):
    """Commands: airspeed, limit of its rate, heading, limit of bank, height."""

    speed_mps: float
    accel_mps2: float
    heading_rad: float
    bank_max_rad: float
    height_m: float


@dataclass
class Aircraft:
    """An aircraft's motion, and its further state: attitude, measurements, energy controller."""

    height_m: float
    climb_mps: float
    speed_mps: float
    heading_rad: float
    bank: float = 0.0
    bank_rate: float = 0.0
    pitch: float = 0.0
    pitch_rate: float = 0.0
    throttle: float = 0.0
    sensed: float = 0.0
    estimate: float = 0.0
    estimate_trend: float = 0.0
    acceleration: float = 0.0
    slow_acceleration: float = 0.0
    speed_demand: float = 0.0
    slow_speed_rate: float = 0.0
    height_before: float = 0.0
    height_limited: float = 0.0
    height_demand: float = 0.0
    power_error: float = 0.0
    throttle_integral: float = 0.0
    throttle_before: float = 0.0
    balance_integral: float = 0.0
    kinetic_integral: float = 0.0
    pitch_before: float = 0.0
    pitch_wanted: float = 0.0
    throttle_wanted: float = 0.0
    speed_max: float = 0.0
    climb_share: float = 1.0
    sink_share: float = 1.0
    pitch_free: float = 0.0
    throttle_clip: float = 0.0
    balance_clip: float = 0.0

    def values(self) -> list[float]:
        """Return the quantities in the order of the constructor's arguments."""
        return [getattr(self, name) for name in QUANTITIES]


QUANTITIES: Final = tuple(each.name for each in fields(Aircraft))


def trim(a: Aircraft, p: AirframeParameters) -> None:
    """Set the state of steady straight and level flight at the present height and speed."""
    speed = max(a.speed_mps, MIN_MPS)
    a.bank = a.bank_rate = a.pitch_rate = a.estimate_trend = a.acceleration = a.slow_acceleration = 0.0
    a.slow_speed_rate = a.power_error = a.kinetic_integral = a.throttle_clip = a.balance_clip = 0.0
    a.throttle = a.throttle_wanted = _drag(speed, 1.0, p) / p.thrust_mps2
    a.pitch = a.pitch_before = a.pitch_wanted = a.pitch_free = _incidence(speed, 1.0, p)
    a.sensed = a.estimate = a.speed_demand = speed
    a.height_before = a.height_limited = a.height_demand = a.height_m
    a.throttle_integral, a.throttle_before = a.throttle - p.throttle_cruise, p.throttle_cruise
    a.balance_integral = a.pitch * speed * GRAVITY_MPS2
    a.speed_max, a.climb_share, a.sink_share = p.airspeed_max_mps, 1.0, 1.0


def cycle(a: Aircraft, commanded: Commanded, p: AirframeParameters, gust_mps: float = 0.0) -> None:
    """Fly a cycle of `CYCLE_S`: attitude, then motion, then measurements.

    `gust_mps` is the noise of the airspeed sensor.
    """
    _attitude(a, commanded, p)
    speed = max(a.speed_mps, MIN_MPS)
    load = 1.0 / math.cos(a.bank)
    sin_path = math.sin(a.pitch - _incidence(speed, load, p))
    push = a.throttle * p.thrust_mps2 - _drag(speed, load, p) - GRAVITY_MPS2 * sin_path
    a.speed_mps += push * CYCLE_S
    a.climb_mps = a.speed_mps * sin_path
    a.height_m += a.climb_mps * CYCLE_S
    a.heading_rad += GRAVITY_MPS2 * math.tan(a.bank) / speed * CYCLE_S
    a.acceleration += (push - a.acceleration) * (CYCLE_S / ACCELERATION_TAU_S)
    _estimate_speed(a, a.speed_mps + gust_mps, p)


def full_throttle(p: AirframeParameters) -> float:
    """Return the model's throttle for the autopilot's full throttle, scaled so that cruise throttle flies level.

    Thrust and drag of an airframe are fitted to small changes; all of that thrust would climb at 20 m/s, not at 13. But
    however high its cruise throttle is, an aircraft climbs as its autopilot assumes, if the thrust is enough for that.
    """
    cruise = _drag(p.airspeed_cruise_mps, 1.0, p) / p.thrust_mps2
    climbs = cruise + GRAVITY_MPS2 * p.climb_max_mps / (p.airspeed_cruise_mps * p.thrust_mps2)
    return min(1.0, max(cruise / max(p.throttle_cruise, cruise), climbs))


def steepest_climb_mps(p: AirframeParameters) -> float:
    """Return the climb rate at the cruising airspeed by all the thrust that an airframe has; below 0 it can't climb."""
    return p.airspeed_cruise_mps * (p.thrust_mps2 - _drag(p.airspeed_cruise_mps, 1.0, p)) / GRAVITY_MPS2


def run(a: Aircraft, throttle: float, p: AirframeParameters) -> None:
    """Roll on the ground for `CYCLE_S`, straight and level."""
    speed, sensed = a.speed_mps, a.sensed
    excess = throttle * p.thrust_mps2 - p.drag_mps2 * (speed / REFERENCE_MPS) ** 2
    a.speed_mps = speed + (excess - min(ROLLING_PER_S * speed, ROLLING_SHARE * excess)) * CYCLE_S
    trim(a, p)
    a.throttle = a.throttle_wanted = throttle
    a.sensed = sensed + (a.speed_mps - sensed) * (CYCLE_S / max(p.airspeed_lag_s, CYCLE_S))


def climb_out(a: Aircraft, throttle: float, p: AirframeParameters) -> None:
    """Set the pitch of a take-off's climb at a throttle: excess thrust climbs, except for a share that accelerates.

    It accelerates by no more than what is left of a climb as the autopilot assumes it.

    Source: take-offs of ArduPlane 4.7's simulated plane, which pitches up to 48 degrees and later down to 27.
    """
    speed = max(a.speed_mps, MIN_MPS)
    gained = (CLIMB_OUT_SHARE * p.airspeed_cruise_mps - speed) / CLIMB_OUT_S
    excess = throttle * p.thrust_mps2 - _drag(speed, 1.0, p)
    gained = min(gained, max(excess - GRAVITY_MPS2 * p.climb_max_mps / speed, 0.0))
    sine = within((excess - gained) / GRAVITY_MPS2, 0.0, STEEPEST)
    a.pitch_wanted = math.asin(sine) + _incidence(speed, 1.0, p)
    a.throttle_wanted = throttle


def level_out(a: Aircraft) -> None:
    """Hand over from a take-off's climb to the energy controller; as in ArduPlane, the throttle's integral is full."""
    a.pitch_before = a.pitch_free = a.pitch_wanted
    a.height_before = a.height_limited = a.height_demand = a.height_m
    a.speed_demand = a.estimate
    a.balance_integral = LEVEL_SHARE * a.pitch * a.estimate * GRAVITY_MPS2
    a.throttle_before, a.throttle_integral = a.throttle, INTEGRAL_MAX


def _attitude(a: Aircraft, commanded: Commanded, p: AirframeParameters) -> None:
    """Bank in proportion to the heading error, and follow the wanted pitch and throttle."""
    maximum = min(commanded.bank_max_rad, p.bank_max_rad)
    bank = within(p.heading_gain * wrap(commanded.heading_rad - a.heading_rad), -maximum, maximum)
    a.bank_rate += ((bank - a.bank) / p.bank_lag_s - a.bank_rate) * (CYCLE_S / p.rate_lag_s)
    a.bank += a.bank_rate * CYCLE_S
    a.pitch_rate += ((a.pitch_wanted - a.pitch) / p.pitch_lag_s - a.pitch_rate) * (CYCLE_S / p.rate_lag_s)
    a.pitch += a.pitch_rate * CYCLE_S
    max_step = p.throttle_slew_per_s * CYCLE_S
    a.throttle += within(a.throttle_wanted - a.throttle, -max_step, max_step)


def _estimate_speed(a: Aircraft, measured_mps: float, p: AirframeParameters) -> None:
    """Combine airspeed and acceleration by a second-order complementary filter; `sensed` is the sensor's own lag."""
    a.sensed += (measured_mps - a.sensed) * (CYCLE_S / max(p.airspeed_lag_s, CYCLE_S))
    error, omega = a.sensed - a.estimate, p.speed_filter_radps
    a.estimate_trend += error * omega * omega * CYCLE_S
    rate = a.estimate_trend + a.acceleration + math.sqrt(2.0) * omega * error
    a.estimate = max(a.estimate + rate * CYCLE_S, MIN_MPS)
    a.slow_acceleration += (a.acceleration - a.slow_acceleration) * (CYCLE_S / (CYCLE_S + p.time_constant_s))


class _Demand(NamedTuple):
    """Specific energies and their rates, and errors as demanded minus actual, m²/s² and m²/s³."""

    kinetic: float
    kinetic_error: float
    potential_error: float
    kinetic_rate: float
    kinetic_rate_demand: float
    climb_demand_mps: float


def control(a: Aircraft, commanded: Commanded, p: AirframeParameters) -> None:
    """Run the energy controller for `ENERGY_S`: demands, pitch by their balance, throttle by their sum."""
    speed_min = p.airspeed_min_mps / math.sqrt(math.cos(a.bank))
    rate_demand = _speed_demand(a, commanded, p, speed_min)
    climb_demand = _height_demand(a, commanded, p)
    speed = a.estimate
    demand = _Demand(
        kinetic=0.5 * speed * speed,
        kinetic_error=0.5 * (a.speed_demand * a.speed_demand - speed * speed),
        potential_error=GRAVITY_MPS2 * (a.height_demand - a.height_m),
        kinetic_rate=speed * (a.acceleration - a.slow_acceleration),
        kinetic_rate_demand=speed * (rate_demand - a.slow_speed_rate),
        climb_demand_mps=climb_demand,
    )
    _pitch(a, demand, p)
    _throttle(a, demand, p, speed_min)


def _speed_demand(a: Aircraft, commanded: Commanded, p: AirframeParameters, speed_min: float) -> float:
    """Move the airspeed demand as fast as the energy rates allow; return its rate, which is fed to the throttle."""
    speed, maximum = a.estimate, a.speed_max
    full_mps2 = GRAVITY_MPS2 * p.climb_max_mps * a.climb_share / max(speed, p.airspeed_min_mps)
    if a.throttle_clip > 0.0:
        maximum -= ENERGY_S * GAIN_SHARE * GRAVITY_MPS2 * p.sink_min_mps / speed
        maximum = max(maximum, p.airspeed_cruise_mps)
    else:
        maximum += ENERGY_S * GAIN_SHARE * full_mps2
    a.speed_max = maximum = max(min(maximum, p.airspeed_max_mps), speed_min)
    share = within((maximum - speed) / max(maximum - p.airspeed_cruise_mps, 0.1), 0.0, 1.0)
    sink = p.sink_max_mps / maximum + share * (p.sink_min_mps / p.airspeed_cruise_mps - p.sink_max_mps / maximum)
    up = min(GAIN_SHARE * full_mps2, commanded.accel_mps2)
    down = min(LOSS_SHARE * GRAVITY_MPS2 * sink, commanded.accel_mps2)
    rate = within((within(commanded.speed_mps, speed_min, maximum) - a.speed_demand) / ENERGY_S, -down, up)
    a.speed_demand = within(a.speed_demand + rate * ENERGY_S, speed_min, maximum)
    a.slow_speed_rate += (rate - a.slow_speed_rate) * (ENERGY_S / (ENERGY_S + p.time_constant_s))
    return rate


def _height_demand(a: Aircraft, commanded: Commanded, p: AirframeParameters) -> float:
    """Move the height demand by its time constant, within the limits of climb and sink; return the climb demanded."""
    before, wanted = a.height_before, commanded.height_m
    up_full = a.pitch_free > p.pitch_max_rad or a.throttle_clip > 0.0
    down_full = a.pitch_free < p.pitch_min_rad or a.throttle_clip < 0.0
    if (up_full and wanted > before) or (down_full and wanted < before):
        wanted = before
    climb, sink = p.climb_max_mps * a.climb_share, p.sink_max_mps * a.sink_share
    a.height_limited += within((wanted + before) / 2.0 - a.height_limited, -sink * ENERGY_S, climb * ENERGY_S)
    a.height_before, last = wanted, a.height_demand
    share = ENERGY_S / (ENERGY_S + p.height_lag_s)
    a.height_demand += (a.height_limited - last) * share
    rises = a.height_demand > last
    up_full = rises and (up_full or a.balance_clip > 0.0)
    down_full = not rises and (down_full or a.balance_clip < 0.0)
    a.climb_share = a.climb_share * (1.0 - share) if up_full else a.climb_share + (1.0 - a.climb_share) * share
    a.sink_share = a.sink_share * (1.0 - share) if down_full else a.sink_share + (1.0 - a.sink_share) * share
    return (a.height_limited - last) / p.height_lag_s


def _pitch(a: Aircraft, demand: _Demand, p: AirframeParameters) -> None:
    gain = a.estimate * GRAVITY_MPS2
    of_height, of_speed = min(2.0 - p.speed_weight, 1.0), min(p.speed_weight, 1.0)
    error = of_height * demand.potential_error - of_speed * demand.kinetic_error
    wanted = demand.climb_demand_mps * GRAVITY_MPS2 * of_height + error / p.time_constant_s
    low, high = -p.sink_max_mps * GRAVITY_MPS2, p.climb_max_mps * GRAVITY_MPS2
    a.balance_clip = _side(wanted, low, high)
    wanted = within(wanted, low, high)
    rate = a.climb_mps * GRAVITY_MPS2 * of_height - demand.kinetic_rate * of_speed
    total = wanted + (wanted - rate) * p.pitch_damping
    grown = (wanted - rate) * p.integral_gain * ENERGY_S
    free = (total + a.balance_integral + grown + a.kinetic_integral) / gain
    if (free > p.pitch_max_rad and grown > 0.0) or (free < p.pitch_min_rad and grown < 0.0):
        left = 1.0 - ENERGY_S / (ENERGY_S + p.time_constant_s)
        balance, kinetic = a.balance_integral * left, a.kinetic_integral * left
    else:
        balance = a.balance_integral + grown
        kinetic = a.kinetic_integral - demand.kinetic_error * of_speed * ENERGY_S / p.time_constant_s
    min_rad, max_rad = p.pitch_min_rad - PITCH_OVERSHOOT_RAD, p.pitch_max_rad + PITCH_OVERSHOOT_RAD
    maximum = 0.25 * (p.pitch_max_rad - p.pitch_min_rad) * gain
    a.balance_integral = within(balance, gain * min_rad - total, gain * max_rad - total)
    a.kinetic_integral = within(kinetic, -maximum, maximum)
    a.pitch_free = (total + a.balance_integral + a.kinetic_integral) / gain
    step = ENERGY_S * p.vertical_accel_max_mps2 / a.estimate
    before = a.pitch_before
    limited = before + within(within(a.pitch_free, p.pitch_min_rad, p.pitch_max_rad) - before, -step, step)
    a.pitch_before = a.pitch_wanted = limited


def _throttle(a: Aircraft, demand: _Demand, p: AirframeParameters, speed_min: float) -> None:
    maximum = max(demand.kinetic - 0.5 * speed_min * speed_min, 0.0)
    minimum = min(demand.kinetic - 0.5 * a.speed_max * a.speed_max, 0.0)
    error = within(demand.potential_error, minimum, maximum) + demand.kinetic_error
    high, low = GRAVITY_MPS2 * p.climb_max_mps * a.climb_share, -GRAVITY_MPS2 * p.sink_min_mps
    power = within(demand.potential_error / p.time_constant_s + demand.kinetic_rate_demand, low, high)
    power_error = power - a.climb_mps * GRAVITY_MPS2 - demand.kinetic_rate
    a.power_error += (power_error - a.power_error) * (ENERGY_S / THROTTLE_TAU_S)
    per_throttle = high - low
    gain = 1.0 / (p.time_constant_s * per_throttle)
    cos_bank = math.cos(a.bank)
    turning = p.bank_to_throttle * (1.0 / max(cos_bank * cos_bank, 0.1) - 1.0)
    ahead = p.throttle_cruise + (power + turning) / per_throttle
    wanted = (error + p.throttle_damping * a.power_error) * gain + ahead
    integral = a.throttle_integral + error * p.integral_gain * ENERGY_S * gain
    minimum = within(-OVERSHOOT - wanted, -INTEGRAL_MAX, INTEGRAL_MAX)
    maximum = within(1.0 + OVERSHOOT - wanted, -INTEGRAL_MAX, INTEGRAL_MAX)
    a.throttle_integral = within(integral, minimum, maximum)
    step = p.throttle_slew_per_s * ENERGY_S
    a.throttle_before += within(wanted - a.throttle_before, -step, step)
    total = a.throttle_before + a.throttle_integral
    a.throttle_clip = 1.0 if total >= 1.0 else -1.0 if total <= 0.0 else 0.0
    a.throttle_wanted = within(total, 0.0, 1.0)


def _side(value: float, low: float, high: float) -> float:
    """Return 1 above a range, -1 below it, 0 inside."""
    return 1.0 if value > high else -1.0 if value < low else 0.0


def _drag(speed: float, load: float, p: AirframeParameters) -> float:
    """Return the deceleration by drag, m/s²: parasitic drag goes with speed squared, induced drag with lift squared."""
    square = (speed / REFERENCE_MPS) ** 2
    return p.drag_mps2 * square + p.induced_drag_mps2 * load * load / square


def _incidence(speed: float, load: float, p: AirframeParameters) -> float:
    """Return the angle of attack, rad, from that of zero lift, at which lift is `load` times the weight."""
    return load * GRAVITY_MPS2 * (REFERENCE_MPS / speed) ** 2 / p.lift_mps2_per_rad
