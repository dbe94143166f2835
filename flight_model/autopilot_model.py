"""The autopilot and its aircraft, equation (7): its constants, and a vehicle's motion under held setpoints.

Airspeed and heading are first-order lags with limited rates; height has two real poles and a limited climb. The
velocity over ground is the velocity through the air plus the wind (errata item 17). Emulated vehicles fly by this model
and the station predicts by it, so a prediction is exact where the vehicle follows the model.

The functions take plain numbers, one vehicle at a time: a formation has few vehicles, for which arrays cost more than
they save. They are in one file with what they call, since the compiler doesn't inline across files.
"""

from __future__ import annotations

import math
from typing import Final

from flight_model.decay import EARLY, LATE, MIDDLE, Decay, GaussDecay
from flight_model.flight_state import FlightState

OUTER: Final = 0.2777777777777778
INNER: Final = 0.4444444444444444
"""Weights of a time interval's Gauss points: the first and the last, and the middle one."""
TRIM_RAD: Final = 0.02
"""Cosine and sine of an angle that differs by less are computed from the other's by series, exact to rounding."""
MIN_CRABBING_MPS: Final = 1.0
"""Lower bound of airspeeds that a crosswind is divided by."""
NO_LIMIT: Final = math.inf


class AutopilotModel:
    """Time constants (s) and limits of one autopilot."""

    __slots__ = (
        "_advances",
        "_held",
        "_held_for",
        "_responds",
        "accel_max_mps2",
        "climb_max_mps",
        "speed_max_mps",
        "speed_min_mps",
        "tau_ha_s",
        "tau_hb_s",
        "tau_psi_s",
        "tau_v_s",
        "turn_rate_max_rps",
    )

    def __init__(  # noqa: PLR0913, PLR0917 - the model's constants
        self,
        tau_v_s: float,
        tau_psi_s: float,
        tau_ha_s: float,
        tau_hb_s: float,
        speed_min_mps: float,
        speed_max_mps: float,
        accel_max_mps2: float,
        turn_rate_max_rps: float,
        climb_max_mps: float,
    ) -> None:
        """Take the time constants of airspeed and heading, both of height, and the limits."""
        self.tau_v_s = tau_v_s
        self.tau_psi_s = tau_psi_s
        self.tau_ha_s = tau_ha_s
        self.tau_hb_s = tau_hb_s
        self.speed_min_mps = speed_min_mps
        self.speed_max_mps = speed_max_mps
        self.accel_max_mps2 = accel_max_mps2
        self.turn_rate_max_rps = turn_rate_max_rps
        self.climb_max_mps = climb_max_mps
        self._advances: GaussDecay | None = None
        self._responds: Decay | None = None
        self._held: AutopilotModel | None = None
        self._held_for = (0.0, 0.0, 0.0, 0.0, 0.0)

    def decay(self, time_s: float) -> Decay:
        """Return the decay over a time, from the last call if that was for the same time and constants."""
        tau_v_s, tau_psi_s, tau_ha_s, tau_hb_s = self.tau_v_s, self.tau_psi_s, self.tau_ha_s, self.tau_hb_s
        kept = self._responds
        if kept is None:
            kept = self._responds = Decay()
        if not kept.holds(time_s, tau_v_s, tau_psi_s, tau_ha_s, tau_hb_s):
            kept.compute(time_s, tau_v_s, tau_psi_s, tau_ha_s, tau_hb_s)
        return kept

    def gauss_decay(self, time_s: float) -> GaussDecay:
        """Return the decay over a time and at its Gauss points, kept likewise."""
        tau_v_s, tau_psi_s, tau_ha_s, tau_hb_s = self.tau_v_s, self.tau_psi_s, self.tau_ha_s, self.tau_hb_s
        kept = self._advances
        if kept is None:
            kept = self._advances = GaussDecay()
        if not kept.holds(time_s, tau_v_s, tau_psi_s, tau_ha_s, tau_hb_s):
            kept.compute(time_s, tau_v_s, tau_psi_s, tau_ha_s, tau_hb_s)
        return kept

    @property
    def may_hover(self) -> bool:
        """Whether it may be commanded to hover: only multirotors may."""
        return self.speed_min_mps == 0.0

    def values(self) -> tuple[float, float, float, float, float, float, float, float, float]:
        """Return the constants in the order of the constructor's arguments."""
        return (
            self.tau_v_s,
            self.tau_psi_s,
            self.tau_ha_s,
            self.tau_hb_s,
            self.speed_min_mps,
            self.speed_max_mps,
            self.accel_max_mps2,
            self.turn_rate_max_rps,
            self.climb_max_mps,
        )

    def held(self, time_s: float) -> AutopilotModel:
        """Return the model whose (setpoint - initial value) / tau is the mean rate while a setpoint is held for a time.

        The initial rate is larger than that mean. Only the time constants of speed and heading differ, and the rate
        limits aren't considered. The result is read-only: it is kept until a time constant or the range of airspeeds
        changes.
        """
        taus_s = time_s, self.tau_v_s, self.tau_psi_s, self.tau_ha_s, self.tau_hb_s
        kept = self._held
        if kept is None or self._held_for != taus_s:
            kept, self._held_for = self._hold(time_s), taus_s
            self._held = kept
        return kept

    def reach(self, slowest_mps: float, fastest_mps: float) -> None:
        """Set the range of airspeeds."""
        if (slowest_mps, fastest_mps) == (self.speed_min_mps, self.speed_max_mps):
            return
        self.speed_min_mps, self.speed_max_mps, self._held = slowest_mps, fastest_mps, None

    def bound(self, accel_max_mps2: float, turn_rate_max_rps: float, climb_max_mps: float = math.inf) -> None:
        """Lower the limits of acceleration, turn rate and climb to these, if they are higher."""
        self.accel_max_mps2 = min(self.accel_max_mps2, accel_max_mps2)
        self.climb_max_mps = min(self.climb_max_mps, climb_max_mps)
        self.turn_rate_max_rps, self._held = min(self.turn_rate_max_rps, turn_rate_max_rps), None

    def _hold(self, time_s: float) -> AutopilotModel:
        return AutopilotModel(
            -time_s / math.expm1(-time_s / self.tau_v_s),
            -time_s / math.expm1(-time_s / self.tau_psi_s),
            self.tau_ha_s,
            self.tau_hb_s,
            self.speed_min_mps,
            self.speed_max_mps,
            self.accel_max_mps2,
            self.turn_rate_max_rps,
            self.climb_max_mps,
        )


def wrap(angle_rad: float) -> float:
    """Return an angle wrapped to [-pi, pi)."""
    turned_rad = angle_rad + math.pi
    if 0.0 <= turned_rad < math.tau:
        return turned_rad - math.pi
    return turned_rad % math.tau - math.pi


def signed(angle_rad: float) -> float:
    """Return `math.remainder(angle_rad, math.tau)`, mostly without that call, which isn't compiled."""
    if abs(angle_rad) <= math.pi:
        return angle_rad
    if math.pi < angle_rad <= math.tau:
        return angle_rad - math.tau  # exact
    return math.remainder(angle_rad, math.tau)


def rotated(axis_rad: float, north: float, east: float) -> tuple[float, float]:
    """Return the components of a horizontal vector forward and right along `axis_rad`."""
    cos, sin = math.cos(axis_rad), math.sin(axis_rad)
    return north * cos + east * sin, east * cos - north * sin


def crab_rad(state: FlightState, course_rad: float) -> float:
    """Return the crab angle: how far left of the course the heading must point to cancel the crosswind."""
    _, crosswind_mps = rotated(course_rad, state.wind_north_mps, state.wind_east_mps)
    return math.asin(within(crosswind_mps / max(state.airspeed_mps, MIN_CRABBING_MPS), -1.0, 1.0))


def squared(value: float) -> float:
    """Return `value ** 2`, which compiled code would call Python for."""
    return value * value


def finite(value: float) -> bool:
    """Return `math.isfinite(value)`, which compiled code would call Python for."""
    return not (math.isnan(value) or math.isinf(value))


def within(value: float, low: float, high: float) -> float:
    """Return a value clipped to two limits."""
    return low if value < low else min(value, high)


def rate(error: float, tau_s: float, rate_max: float) -> float:
    """Return the rate of a first-order lag with a limited rate that is `error` short of its setpoint; 0 for NaN."""
    return 0.0 if math.isnan(error) else within(error / tau_s, -rate_max, rate_max)


def remaining(error: float, time_s: float, tau_s: float, rate_max: float, left: float) -> float:
    """Return what a first-order lag with a limited rate leaves of `error` after `time_s`; `left`: the lag's decay."""
    size = abs(error)
    if size <= rate_max * tau_s:
        return error * left
    limited_s = min(size / rate_max - tau_s, time_s)
    size = (size - rate_max * limited_s) * math.exp((limited_s - time_s) / tau_s)
    return size if error > 0.0 else -size


def advance(
    state: FlightState,
    model: AutopilotModel,
    speed_mps: float,
    heading_rad: float,
    height_m: float,
    time_s: float,
    accel_max_mps2: float = NO_LIMIT,
    turn_rate_max_rps: float = NO_LIMIT,
) -> None:
    """Advance `state` by `time_s` under held setpoints in constant wind.

    Args:
        state: is changed.
        model: the vehicle's.
        speed_mps: airspeed setpoint, within the model's limits; NaN: the present airspeed.
        heading_rad: heading setpoint, NaN: the present heading.
        height_m: height setpoint above the origin, NaN: where the vehicle levels off.
        time_s: duration.
        accel_max_mps2: limit that comes with the setpoint, besides the model's.
        turn_rate_max_rps: likewise.
    """
    accel_max_mps2 = min(accel_max_mps2, model.accel_max_mps2)
    turn_rate_max_rps = min(turn_rate_max_rps, model.turn_rate_max_rps)
    faster_mps = turn_rad = 0.0
    if not math.isnan(speed_mps):
        faster_mps = speed_mps - state.airspeed_mps
    if not math.isnan(heading_rad):
        turn_rad = wrap(heading_rad - state.heading_rad)
    goal_mps, goal_rad = state.airspeed_mps + faster_mps, state.heading_rad + turn_rad
    tau_v_s, tau_psi_s, left = model.tau_v_s, model.tau_psi_s, model.gauss_decay(time_s)
    early_mps, middle_mps, late_mps, short_mps = _remaining(
        faster_mps, time_s, tau_v_s, accel_max_mps2, left.early_speed, left.middle_speed, left.late_speed, left.speed
    )
    early_mps, late_mps = OUTER * (goal_mps - early_mps), OUTER * (goal_mps - late_mps)
    middle_mps = INNER * (goal_mps - middle_mps)
    early_rad, middle_rad, late_rad, short_rad = _remaining(
        turn_rad,
        time_s,
        tau_psi_s,
        turn_rate_max_rps,
        left.early_heading,
        left.middle_heading,
        left.late_heading,
        left.heading,
    )
    early_rad, middle_rad, late_rad = goal_rad - early_rad, goal_rad - middle_rad, goal_rad - late_rad
    cos, sin = math.cos(middle_rad), math.sin(middle_rad)
    early_cos, early_sin = _cos_sin_of(cos, sin, middle_rad, early_rad)
    late_cos, late_sin = _cos_sin_of(cos, sin, middle_rad, late_rad)
    north_mps = early_mps * early_cos + middle_mps * cos + late_mps * late_cos
    east_mps = early_mps * early_sin + middle_mps * sin + late_mps * late_sin
    state.north_m += (north_mps + state.wind_north_mps) * time_s
    state.east_m += (east_mps + state.wind_east_mps) * time_s
    state.airspeed_mps = goal_mps - short_mps
    state.heading_rad = goal_rad - short_rad
    _climb(state, model, height_m, time_s, left)


def _remaining(
    error: float, time_s: float, tau_s: float, rate_max: float, early: float, middle: float, late: float, end: float
) -> tuple[float, float, float, float]:
    """Return `remaining` at the Gauss points of a time and at its end; `early` to `end` are the lag's decay there."""
    if abs(error) <= rate_max * tau_s:
        return error * early, error * middle, error * late, error * end
    return (
        remaining(error, EARLY * time_s, tau_s, rate_max, early),
        remaining(error, MIDDLE * time_s, tau_s, rate_max, middle),
        remaining(error, LATE * time_s, tau_s, rate_max, late),
        remaining(error, time_s, tau_s, rate_max, end),
    )


def _cos_sin_of(cos: float, sin: float, angle_rad: float, other_rad: float) -> tuple[float, float]:
    """Return cosine and sine of `other_rad`, given those of `angle_rad`."""
    difference = other_rad - angle_rad
    if abs(difference) > TRIM_RAD:
        return math.cos(other_rad), math.sin(other_rad)
    square = difference * difference
    along = 1.0 - square / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0))
    across = difference * (1.0 - square / 6.0 * (1.0 - square / 20.0))
    return cos * along - sin * across, sin * along + cos * across


def respond(
    state: FlightState, model: AutopilotModel, speed_mps: float, heading_rad: float, height_m: float, time_s: float
) -> None:
    """Advance airspeed, heading, height and climb rate as `advance` does, but not the position: a third of the cost."""
    left = model.decay(time_s)
    if not math.isnan(speed_mps):
        faster_mps = speed_mps - state.airspeed_mps
        left_mps = remaining(faster_mps, time_s, model.tau_v_s, model.accel_max_mps2, left.speed)
        state.airspeed_mps = state.airspeed_mps + faster_mps - left_mps
    if not math.isnan(heading_rad):
        turn_rad = wrap(heading_rad - state.heading_rad)
        left_rad = remaining(turn_rad, time_s, model.tau_psi_s, model.turn_rate_max_rps, left.heading)
        state.heading_rad = state.heading_rad + turn_rad - left_rad
    _climb(state, model, height_m, time_s, left)


def respond_hovering(
    state: FlightState, model: AutopilotModel, speed_mps: float, heading_rad: float, height_m: float, time_s: float
) -> None:
    """Do as `respond` for a multirotor, whose velocity over ground changes straight to the commanded one."""
    left = model.decay(time_s)
    _climb(state, model, height_m, time_s, left)
    if math.isnan(speed_mps) or math.isnan(heading_rad):
        return
    north_mps, east_mps = state.ground_mps()
    aim_north_mps, aim_east_mps = speed_mps * math.cos(heading_rad), speed_mps * math.sin(heading_rad)
    off_north_mps, off_east_mps = aim_north_mps - north_mps, aim_east_mps - east_mps
    size_mps = math.hypot(off_north_mps, off_east_mps)
    if size_mps > 0.0:
        share = remaining(size_mps, time_s, model.tau_v_s, model.accel_max_mps2, left.speed) / size_mps
        north_mps, east_mps = aim_north_mps - share * off_north_mps, aim_east_mps - share * off_east_mps
    state.airspeed_mps, state.heading_rad = math.hypot(north_mps, east_mps), math.atan2(east_mps, north_mps)
    state.wind_north_mps = state.wind_east_mps = 0.0


def _climb(state: FlightState, model: AutopilotModel, height_m: float, time_s: float, left: Decay) -> None:
    """Advance height and climb rate: in an updraught u, (7) holds for the climb rate less u."""
    height_m += (left.slow_s + left.fast_s) * state.updraught_mps
    state.height_m, state.climb_mps = climbed(
        state.height_m, state.climb_mps, model.climb_max_mps, height_m, time_s, left
    )


def climbed(
    now_m: float, now_mps: float, max_mps: float, height_m: float, time_s: float, left: Decay
) -> tuple[float, float]:
    """Return height and climb rate after a time; `left`: the decay over it."""
    slow_s, fast_s, slow_left, fast_left, climb_s = left.slow_s, left.fast_s, left.slow, left.fast, left.climb_s
    error_m = -(slow_s + fast_s) * now_mps if math.isnan(height_m) else now_m - height_m
    push_mps = now_mps + error_m / slow_s
    left_m = slow_left * error_m + climb_s * push_mps
    climb_mps = fast_left * push_mps - left_m / slow_s
    max_m = max_mps * time_s
    beyond_mps = abs(now_mps) - max_mps
    if beyond_mps > 0.0:
        max_mps += beyond_mps * fast_left
        max_m += beyond_mps * fast_s * (1.0 - fast_left)
    return now_m + within(left_m - error_m, -max_m, max_m), within(climb_mps, -max_mps, max_mps)
