"""The parts of a setpoint: a follower's errors and the linear mixer (13), the slot's own motion, lead and envelope.

Signs: actual minus commanded, leader minus follower (errata items 14 and 25). Slots are forward, right and up of the
leader, that is (-x_rc, -y_rc, -z_rc), in either frame that turns. Slots fixed to north and east are controlled as slots
that turn back in the leader's frame (`Slot.turned`): its speed acts along its heading, wherever its slot lies.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from mypy_extensions import mypyc_attr

from flight_model.autopilot_model import AutopilotModel, rotated, within, wrap
from flight_model.flight_state import FlightState
from flight_model.slot import Slot, Vector3, all_finite
from formation_scenario.fields import Frame
from formation_scenario.slot_frame import axis_rad

Replaced = tuple[bool, bool, bool]
"""For speed, heading and height: whether something else than the law's decision is commanded."""
AS_DECIDED: Final[Replaced] = (False, False, False)
TRAIL_S: Final = 1.36
"""Least distance behind the leader, divided by airspeed, that the heading gains are designed for in the follower's own
frame: 30 m at 22 m/s. Tuned: s; 0.9 to 2.5; shown by `pytest tests/gcs_formation/stability`."""
asin: Final = math.asin
atan2: Final = math.atan2
hypot: Final = math.hypot
CRAB_RADPS: Final = 0.65
"""Bandwidth with which a heading crabs against a gust: speed can still follow the swing of a slot 30 m to the side.
Tuned: rad/s; 0.4 to 0.9; shown by `python -m benchmarks.gust_swing`."""
SLOT_INTERCEPT_MAX_RAD: Final = math.radians(60.0)
"""Largest deviation of a heading setpoint from the slot's own heading, so that a follower far off doesn't circle.
Tuned: rad; 0.7 to 1.2; shown by `pytest tests/gcs_formation/control`."""
AWAY_RAD: Final = math.radians(120.0)
"""A follower whose heading differs from its slot's by more gets the slot's heading, so that it turns to one side.
Between `SLOT_INTERCEPT_MAX_RAD` and this angle, the allowed correction shrinks to zero. Without this limit, a follower
that flies away from the leader would be commanded left and right in alternation, and so fly straight on. Tuned: rad;
1.6 to 2.6; shown by `pytest tests/gcs_formation/control`."""


@dataclass(frozen=True)
class Mixer:
    """Coefficients of (13)."""

    k_v: float
    k_x: float
    k_psi: float
    k_y: float
    k_z: float


@mypyc_attr(acyclic=True, free_list_len=1)
class Target:
    """Airspeed and heading that keep a follower in its slot without error in a steady turn."""

    def __init__(self, speed_mps: float, heading_rad: float) -> None:
        """Take airspeed and heading."""
        self.speed_mps = speed_mps
        self.heading_rad = heading_rad


def formation_error(leader: FlightState, follower: FlightState, slot: Slot, axis_rad: float) -> Vector3:
    """Return x_c - x_rc, y_c - y_rc, z_c - z_rc in m; positive when the follower is behind, left, below.

    Both states are of the same instant; x and y are along and across `axis_rad`.
    """
    north_m, east_m = leader.north_m - follower.north_m, leader.east_m - follower.east_m
    x_m, y_m = rotated(axis_rad, north_m, east_m)
    return x_m + slot.forward_m, y_m + slot.right_m, leader.height_m - follower.height_m + slot.up_m


def error_rate(
    leader: FlightState, follower: FlightState, error_m: Vector3, slot: Slot, axis_rad: float, axis_turn_rps: float
) -> Vector3:
    """Return the rate of change of `formation_error`, m/s: (8), from velocities over ground and its axes' turn rate."""
    leader_north_mps, leader_east_mps = leader.ground_mps()
    north_mps, east_mps = follower.ground_mps()
    x_mps, y_mps = rotated(axis_rad, leader_north_mps - north_mps, leader_east_mps - east_mps)
    return (
        x_mps + axis_turn_rps * (error_m[1] - slot.right_m) + slot.forward_mps,
        y_mps - axis_turn_rps * (error_m[0] - slot.forward_m) + slot.right_mps,
        leader.climb_mps - follower.climb_mps + slot.up_mps,
    )


def slot_target(
    leader: FlightState, drift_x_mps: float, drift_y_mps: float, turn_rps: float, slot: Slot, frame: Frame
) -> Target:
    """Return the airspeed and heading that keep a follower in its slot while the slot's axes turn at `turn_rps`.

    They include the drift D of (8) along and across the axes, and the motion of a slot that changes its position.
    Source: (8) with x_c' and y_c' as commanded, solved for the follower's speed and heading.
    """
    v1, x_rc, y_rc = leader.airspeed_mps, -slot.forward_m, -slot.right_m
    if frame != "follower_heading":
        forward_mps = v1 + turn_rps * y_rc - drift_x_mps + slot.forward_mps
        right_mps = -turn_rps * x_rc - drift_y_mps + slot.right_mps
        return Target(hypot(forward_mps, right_mps), leader.heading_rad + atan2(right_mps, forward_mps))
    off_rad = asin(within((turn_rps * x_rc + drift_y_mps - slot.right_mps) / v1, -1.0, 1.0))
    speed_mps = v1 * math.cos(off_rad) + turn_rps * y_rc - drift_x_mps + slot.forward_mps
    return Target(speed_mps, leader.heading_rad - off_rad)


def centroid(
    followers: list[FlightState], slots: list[Slot], speed_mps: float, turn_rps: float, frame: Frame
) -> FlightState:
    """Return the leader's state for which the followers' slot errors are 0 on average.

    The leader flies at `speed_mps` and turns at `turn_rps`; each follower heads as its slot moves (errata item
    24).
    """
    count, still = len(followers), FlightState(0.0, 0.0, 0.0, 0.0, speed_mps, 0.0, 0.0, 0.0)
    seen = [slot.turned(0.0, turn_rps, 0.0) for slot in slots] if frame == "north" else slots
    swing_rad = [slot_target(still, 0.0, 0.0, turn_rps, slot, frame).heading_rad for slot in seen]
    headings_rad = [each.heading_rad - off_rad for each, off_rad in zip(followers, swing_rad, strict=True)]
    heading_rad = math.atan2(sum(map(math.sin, headings_rad)), sum(map(math.cos, headings_rad)))
    leader = FlightState(0.0, 0.0, 0.0, 0.0, speed_mps, heading_rad, 0.0, 0.0)
    for each, slot, off_rad in zip(followers, slots, swing_rad, strict=True):
        north_m, east_m = rotated(-axis_rad(frame, heading_rad, heading_rad + off_rad), slot.forward_m, slot.right_m)
        leader.north_m += (each.north_m - north_m) / count
        leader.east_m += (each.east_m - east_m) / count
        leader.height_m += (each.height_m - slot.up_m) / count
        leader.wind_north_mps += each.wind_north_mps / count
        leader.wind_east_mps += each.wind_east_mps / count
    return leader


def mix(mixer: Mixer, target: Target, follower: FlightState, error_m: Vector3) -> Vector3:
    """Return e_v in m/s, e_psi in rad and e_z in m of (13), v1 and psi1 replaced by the slot's target."""
    return (
        mixer.k_v * (target.speed_mps - follower.airspeed_mps) + mixer.k_x * error_m[0],
        mixer.k_psi * wrap(target.heading_rad - follower.heading_rad) + mixer.k_y * error_m[1],
        mixer.k_z * error_m[2],
    )


@mypyc_attr(acyclic=True, free_list_len=1)
class LeaderMotion:
    """The leader's state at the beginning of a tick, and how it changes during the tick."""

    def __init__(
        self,
        state: FlightState,
        turn_rps: float,
        bend_rps2: float,
        acceleration_mps2: float,
        climb_change_mps2: float,
        dt_s: float = 0.0,
    ) -> None:
        """Take its state, its heading's first two derivatives, and the rates of its airspeed and climb.

        All but the state are means over the tick, which takes `dt_s`; 0 where they are those of its beginning.
        """
        self.state = state
        self.turn_rps = turn_rps
        self.bend_rps2 = bend_rps2
        self.half_s = dt_s / 2.0
        """Half of the tick."""
        self.begun_rps = turn_rps - self.half_s * bend_rps2
        """Turn rate at the tick's beginning: it is the one that moves a slot alongside or behind."""
        self.acceleration_mps2 = acceleration_mps2
        self.climb_change_mps2 = climb_change_mps2


def feed_forward(
    target: Target,
    leader: LeaderMotion,
    axis_rad: float,
    turn_rps: float,
    bend_rps2: float,
    slot: Slot,
    model: AutopilotModel,
    updraught_mps: float,
) -> Vector3:
    """Return the speed, heading and height setpoints that hold `target` (errata item 29).

    The speed and heading that the slot needs change with three things: the leader's velocity; the axes' turn rate, in
    proportion to the slot's offset; and the slot's own acceleration (the derivative of a velocity in a turning frame).

    Args:
        target: how the slot moves through the air.
        leader: how the leader flies.
        axis_rad: heading of the axes along which the slot lies.
        turn_rps: rate of that heading, its mean over the tick.
        bend_rps2: rate of that rate.
        slot: offset from the leader along the axes.
        model: of the vehicle that is to hold it.
        updraught_mps: of the air at that vehicle.
    """
    off_rad = leader.state.heading_rad - axis_rad
    cos, sin = math.cos(off_rad), math.sin(off_rad)
    swing_mps2 = leader.state.airspeed_mps * (leader.turn_rps - turn_rps)
    along_mps2 = leader.acceleration_mps2 * cos - swing_mps2 * sin
    begun_rps = turn_rps - leader.half_s * bend_rps2
    along_mps2 += slot.forward_mps2 - bend_rps2 * slot.right_m - begun_rps * slot.right_mps
    across_mps2 = leader.acceleration_mps2 * sin + swing_mps2 * cos
    across_mps2 += slot.right_mps2 + bend_rps2 * slot.forward_m + begun_rps * slot.forward_mps
    speed_mps, heading_rad = lead_velocity(target, axis_rad, along_mps2, across_mps2, model)
    height_m = lead_height(leader, slot, model, updraught_mps)
    return target.speed_mps + speed_mps, target.heading_rad + model.tau_psi_s * turn_rps + heading_rad, height_m


def lead_height(leader: LeaderMotion, slot: Slot, model: AutopilotModel, updraught_mps: float) -> float:
    """Return the height setpoint that holds a slot: its height, plus the lead of (7) for the climb less updraught."""
    height_m = leader.state.height_m + slot.up_m
    height_m += (model.tau_ha_s + model.tau_hb_s) * (leader.state.climb_mps + slot.up_mps - updraught_mps)
    return height_m + model.tau_ha_s * model.tau_hb_s * (leader.climb_change_mps2 + slot.up_mps2)


def lead_velocity(
    target: Target, axis_rad: float, along_mps2: float, across_mps2: float, model: AutopilotModel
) -> tuple[float, float]:
    """Return the leads of the speed and heading setpoints for an acceleration along and across the axes."""
    angle_rad = target.heading_rad - axis_rad
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    return (
        model.tau_v_s * (cos * along_mps2 + sin * across_mps2),
        model.tau_psi_s * (cos * across_mps2 - sin * along_mps2) / target.speed_mps,
    )


TINY_RAD: Final = 1e-6
MIN_SLOPE: Final = 0.05
"""Lower bound of a sine's mean slope, at angles near a right one. Tuned: a number; 0.01 to 0.1; shown by `pytest
tests/gcs_formation/control`."""


class TrailingSlot:
    """The turning of a slot's axes in the follower's own frame, with its state between ticks.

    Equation (8) with the errors held at zero determines the follower's heading (the zero dynamics, errata item 23):
    x_rc psi_2' = v sin(psi_1 - psi_2) + the slot's velocity sideways. The slot's heading follows the leader's with a
    time constant of x_rc / v, which changes as the slot moves.
    """

    def __init__(self) -> None:
        """Start with a slot whose heading is steady."""
        self._off_rad = math.nan
        self._crab_rad = math.nan

    def turning(self, leader: LeaderMotion, slot: Slot, dt_s: float) -> tuple[float, float]:
        """Return the axes' turn rate until the next tick, `dt_s` later, and its rate of change."""
        speed, turn, x_rc = leader.state.airspeed_mps, leader.turn_rps, -slot.forward_m
        # Sine of the steady-state angle, and its rate.
        due = within((slot.right_mps - x_rc * turn) / speed, -1.0, 1.0)
        due_ps = (slot.right_mps2 - x_rc * leader.bend_rps2 + slot.forward_mps * turn) / speed
        due_rad = math.asin(due)
        off_rad = due_rad if math.isnan(self._off_rad) else self._off_rad
        # Effective time constant: at the rate it gives, a tick covers what an exact one of x_rc / v, a tick at least,
        # would. The sine's mean slope between both angles counts: for slots far to the side 0.01 rad is metres.
        tau_s, to_go_rad = max(x_rc / speed, dt_s), due_rad - off_rad
        slope = (due - math.sin(off_rad)) / to_go_rad if abs(to_go_rad) > TINY_RAD else math.cos(off_rad)
        rate_rps = -to_go_rad * math.expm1(-dt_s * max(slope, MIN_SLOPE) / tau_s) / dt_s
        self._off_rad = off_rad + dt_s * rate_rps
        held_s = -dt_s / math.expm1(-dt_s / tau_s)
        change_ps = due_ps - rate_rps * (math.cos(off_rad) - slot.forward_mps / speed)
        return turn + rate_rps, leader.bend_rps2 + change_ps / held_s

    def crab(self, drift_mps: float, gust_mps2: float, speed_mps: float, dt_s: float) -> Vector3:
        """Return the angle by which a follower crabs to the right, and its first two derivatives.

        `drift_mps` is the drift to the right, relative to the leader. The angle follows it with a time constant of
        1/`CRAB_RADPS`, so the swing of the slot is known and speed can be led by it.
        """
        due_rad, due_rps = -drift_mps / speed_mps, -gust_mps2 / speed_mps
        angle_rad = due_rad if math.isnan(self._crab_rad) else self._crab_rad
        rate_rps = CRAB_RADPS * (due_rad - angle_rad)
        self._crab_rad = angle_rad + dt_s * rate_rps
        return angle_rad, rate_rps, CRAB_RADPS * (due_rps - rate_rps)

    def reset(self) -> None:
        """Start again with a steady slot."""
        self._off_rad = self._crab_rad = math.nan


@mypyc_attr(acyclic=True, free_list_len=1)
class Envelope:
    """The limits of a vehicle's setpoints.

    Speed stays within the autopilot's limits, and heading within `SLOT_INTERCEPT_MAX_RAD` of the slot's own heading
    (less for a vehicle whose heading differs more). Height stays so near the present height that the model reaches it
    within its time constants without exceeding its climb limit.
    """

    def __init__(self, own_heading_rad: float, state: FlightState, model: AutopilotModel) -> None:
        """Compute the limits of a vehicle in `state` whose slot has the heading `own_heading_rad`."""
        off_rad = abs(wrap(state.heading_rad - own_heading_rad))
        self.intercept_max_rad = SLOT_INTERCEPT_MAX_RAD * within(
            (AWAY_RAD - off_rad) / (AWAY_RAD - SLOT_INTERCEPT_MAX_RAD), 0.0, 1.0
        )
        self.own_heading_rad = own_heading_rad
        self.height_m = state.height_m
        self.reach_m = model.climb_max_mps * (model.tau_ha_s + model.tau_hb_s)
        self.model = model

    def limit(self, speed_mps: float, heading_rad: float, height_m: float) -> Vector3:
        """Return the limited setpoints.

        The heading isn't wrapped: it is the slot's own heading plus a correction, whose sign is the side to turn to and
        which may exceed half a turn far from the slot.
        Values that aren't finite are returned as they are: a limit would hide an infinite one.
        """
        if not all_finite((speed_mps, heading_rad, height_m)):
            return speed_mps, heading_rad, height_m
        swing_rad = within(heading_rad - self.own_heading_rad, -self.intercept_max_rad, self.intercept_max_rad)
        return (
            within(speed_mps, self.model.speed_min_mps, self.model.speed_max_mps),
            self.own_heading_rad + swing_rad,
            within(height_m, self.height_m - self.reach_m, self.height_m + self.reach_m),
        )
