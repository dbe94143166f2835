"""Setpoints of all multirotors: velocity over ground and yaw.

For them the law's airspeed and heading are ground speed and course. The station holds their heights: the vertical
velocity is the height error divided by `height_s`, because a height setpoint in this message requires a position too.

Source: MAVLink guide, "SET_POSITION_TARGET_LOCAL_NED"; acceptance as observed in ArduCopter's and PX4's simulators.

A lead compensates an autopilot's slow integrator, so that the speed flown follows as in (7). Commanded w, the autopilot
flies prompt_share w + (1 - prompt_share) m with its time constant, where m follows w with the time constant rest_s. So
it flies u with its time constant if it is commanded w = (u - (1 - prompt_share) m) / prompt_share.
"""

from __future__ import annotations

import math
from typing import Final

from airlink import mavlink as m
from airlink.messages import Message
from airlink.messages.command import SetPositionTargetLocalNed
from flight_model.autopilot_model import within
from flight_model.flight_state import FlightState, Setpoint
from flight_model.slot import hovering_course, slot_axis
from formation_scenario.vehicles import VehicleModel

MULTIROTOR_TYPES: Final = frozenset(
    {
        m.MAV_TYPE_QUADROTOR,
        m.MAV_TYPE_COAXIAL,
        m.MAV_TYPE_HELICOPTER,
        m.MAV_TYPE_HEXAROTOR,
        m.MAV_TYPE_OCTOROTOR,
        m.MAV_TYPE_TRICOPTER,
        m.MAV_TYPE_DODECAROTOR,
        m.MAV_TYPE_DECAROTOR,
    }
)
HEIGHT_S: Final = 1.5
"""Least time constant of height errors: the sum of the two height time constants of (7), in models of multirotors."""
TURNS_FROM_MPS: Final = 1.0
"""Ground speed from which the nose turns to the course; below it, and in hover, the heading is kept."""
NO_POSITION: Final = (
    m.POSITION_TARGET_TYPEMASK_X_IGNORE | m.POSITION_TARGET_TYPEMASK_Y_IGNORE | m.POSITION_TARGET_TYPEMASK_Z_IGNORE
)
NO_ACCELERATION: Final = (
    m.POSITION_TARGET_TYPEMASK_AX_IGNORE | m.POSITION_TARGET_TYPEMASK_AY_IGNORE | m.POSITION_TARGET_TYPEMASK_AZ_IGNORE
)
VELOCITY_AND_YAW: Final = NO_POSITION | NO_ACCELERATION | m.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
SAME_MPS: Final = 0.003
SAME_CLIMB_MPS: Final = 0.001
SAME_RAD: Final = 0.001
"""Differences of velocity, climb rate and yaw that are no news. The station holds heights itself, by climb rates: one
that is off by 1 mm/s is a height that is off by 1.5 mm (`HEIGHT_S`)."""
VELOCITY_ALONE: Final = NO_POSITION | NO_ACCELERATION | m.POSITION_TARGET_TYPEMASK_YAW_IGNORE
"""With a yaw rate of 0: if both were ignored, ArduCopter would turn its nose by WP_YAW_BEHAVIOR."""


class _Integrator:
    """State of an autopilot's integrator for one component of velocity."""

    def __init__(self, prompt_share: float, rest_s: float, period_s: float) -> None:
        """Start at 0; a speed is commanded every `period_s`."""
        self._prompt = prompt_share
        self._filled = -math.expm1(-period_s / rest_s)
        self.integrated_mps: float = 0.0

    def command_for(self, speed_mps: float) -> float:
        """Return the command that makes the vehicle fly a speed."""
        return (speed_mps - (1.0 - self._prompt) * self.integrated_mps) / self._prompt

    def response_to(self, commanded_mps: float) -> float:
        """Return the speed flown on a command: the inverse of `command_for`."""
        return self._prompt * commanded_mps + (1.0 - self._prompt) * self.integrated_mps

    def integrate(self, commanded_mps: float) -> None:
        """Update the integrator with a command held for one period."""
        self.integrated_mps += self._filled * (commanded_mps - self.integrated_mps)


class SpeedLead:
    """Lead compensation of a fixed wing's airspeed commands."""

    def __init__(self, prompt_share: float, rest_s: float, limits_mps: tuple[float, float], period_s: float) -> None:
        """Start at the present airspeed; an airspeed within the limits is commanded every `period_s`."""
        self._integrator, self._limits_mps, self._begun = _Integrator(prompt_share, rest_s, period_s), limits_mps, False
        self._commanded_mps = 0.0
        self.prompt_share = prompt_share
        """Share of a change of the command that is flown at once."""

    @property
    def within_reach_mps(self) -> tuple[float, float]:
        """Lowest and highest airspeed within immediate reach; the integrator reaches the rest in time."""
        if not self._begun:
            return self._limits_mps
        return self._integrator.response_to(self._limits_mps[0]), self._integrator.response_to(self._limits_mps[1])

    def reinitialise(self) -> None:
        """Restart from the present airspeed: others have commanded the vehicle meanwhile."""
        self._begun = False

    def led(self, speed_mps: float, airspeed_mps: float) -> float:
        """Return the airspeed to command in order to fly `speed_mps`; `airspeed_mps` is the present one.

        One beyond the limits, as of a take-off at full throttle, has never been commanded: no integrator is there.
        """
        if not self._begun:
            steady = self._limits_mps[0] <= airspeed_mps <= self._limits_mps[1]
            self._integrator.integrated_mps, self._begun = airspeed_mps if steady else speed_mps, True
        return within(self._integrator.command_for(speed_mps), self._limits_mps[0], self._limits_mps[1])

    def lead(self, speed_mps: float, airspeed_mps: float) -> float:
        """Return the same, and take that it is commanded from now on."""
        self._commanded_mps = self.led(speed_mps, airspeed_mps)
        self.keep()
        return self._commanded_mps

    def keep(self) -> None:
        """Take that what was commanded last is held for another period."""
        if self._begun:
            self._integrator.integrate(self._commanded_mps)


class VelocityLead:
    """Lead compensation and limits of a multirotor's ground velocity commands; by default it does neither."""

    def __init__(
        self,
        prompt_share: float = 1.0,
        rest_s: float = 1.0,
        max_mps: float = math.inf,
        period_s: float = 1.0,
        climb_max_mps: float = math.inf,
        height_s: float = HEIGHT_S,
    ) -> None:
        """Start at the present velocity; one within the limits is commanded every `period_s`.

        `height_s`: time constant of height errors, by which the vehicle has the model's height's time constants.
        """
        self._north, self._east = (_Integrator(prompt_share, rest_s, period_s) for _ in range(2))
        self._max_mps, self._begun = max_mps, False
        self.climb_max_mps = climb_max_mps
        self.height_s = height_s

    def reinitialise(self) -> None:
        """Restart from the present velocity: others have commanded the vehicle meanwhile."""
        self._begun = False

    def lead(self, velocity_mps: tuple[float, float], flown_mps: tuple[float, float]) -> tuple[float, float]:
        """Return the velocity to command, north and east, to fly `velocity_mps`; `flown_mps` is the present one."""
        if not self._begun:
            (self._north.integrated_mps, self._east.integrated_mps), self._begun = flown_mps, True
        north, east = self._north.command_for(velocity_mps[0]), self._east.command_for(velocity_mps[1])
        share = min(1.0, self._max_mps / max(math.hypot(north, east), 1e-9))
        commanded = share * north, share * east
        self._north.integrate(commanded[0])
        self._east.integrate(commanded[1])
        return commanded


def hovers(setpoint: Setpoint) -> bool:
    """Return whether the setpoint is to hover, as of a leader; its heading is then the yaw."""
    return setpoint.speed_mps == 0.0


def velocity_setpoint(
    system: int,
    setpoint: Setpoint,
    where: FlightState,
    lead: VelocityLead,
    nose_rad: float,
) -> SetPositionTargetLocalNed:
    """Return a setpoint of the law as a velocity over ground, with the course as yaw while it moves.

    In hover the yaw is `nose_rad`; NaN commands a yaw rate of 0.
    """
    yaw_rad = setpoint.heading_rad if setpoint.speed_mps >= TURNS_FROM_MPS else nose_rad
    turns = math.isfinite(yaw_rad)
    velocity_mps = (
        setpoint.speed_mps * math.cos(setpoint.heading_rad),
        setpoint.speed_mps * math.sin(setpoint.heading_rad),
    )
    north_mps, east_mps = lead.lead(velocity_mps, where.ground_mps())
    sink_mps = (where.height_m - setpoint.height_m) / lead.height_s
    return SetPositionTargetLocalNed(
        0.0,
        system,
        m.MAV_COMP_ID_AUTOPILOT1,
        m.MAV_FRAME_LOCAL_NED,
        VELOCITY_AND_YAW if turns else VELOCITY_ALONE,
        vx_mps=north_mps,
        vy_mps=east_mps,
        vz_mps=within(sink_mps, -lead.climb_max_mps, lead.climb_max_mps),
        yaw_rad=math.remainder(yaw_rad, math.tau) if turns else 0.0,
    )


def is_same(message: Message, other: Message, tolerance: float = 1.0) -> bool:
    """Return whether a velocity setpoint commands the same as another, within this multiple of what is no news."""
    if not isinstance(message, SetPositionTargetLocalNed) or not isinstance(other, SetPositionTargetLocalNed):
        return False
    off_mps = max(abs(message.vx_mps - other.vx_mps), abs(message.vy_mps - other.vy_mps))
    turned_rad = abs(math.remainder(message.yaw_rad - other.yaw_rad, math.tau))
    same = (
        message.type_mask == other.type_mask and turned_rad <= tolerance * SAME_RAD and off_mps <= tolerance * SAME_MPS
    )
    return same and abs(message.vz_mps - other.vz_mps) <= tolerance * SAME_CLIMB_MPS


def ground_motion(yaw_rad: float, north_mps: float, east_mps: float, *, leads: bool) -> tuple[float, float]:
    """Return ground speed and course; for a leader, the speed along its slots' axis (signed) and that axis."""
    if not leads:
        return math.hypot(north_mps, east_mps), hovering_course(yaw_rad, north_mps, east_mps)
    axis_rad = slot_axis(yaw_rad, north_mps, east_mps)
    return north_mps * math.cos(axis_rad) + east_mps * math.sin(axis_rad), axis_rad


def velocity_lead(model: VehicleModel, period_s: float) -> VelocityLead:
    """Return the lead compensation of a multirotor's velocity commands, one every `period_s`."""
    max_mps = model.speed_max_mps if model.prompt_share < 1.0 else math.inf
    height_s = max(HEIGHT_S, model.tau_ha_s + model.tau_hb_s)
    return VelocityLead(model.prompt_share, model.rest_s, max_mps, period_s, model.climb_max_mps, height_s)


def speed_lead(model: VehicleModel, period_s: float) -> SpeedLead | None:
    """Return the lead compensation of a fixed wing's airspeed commands; None without a slow integrator."""
    if model.prompt_share >= 1.0:
        return None
    return SpeedLead(model.prompt_share, model.rest_s, (model.speed_min_mps, model.speed_max_mps), period_s)
