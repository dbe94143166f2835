"""What all multirotors are commanded, whoever flies them: velocities over ground, and where the nose points.

What the law calls airspeed and heading are ground speed and course here. Heights are held by the station: the vertical
velocity is the error of height by `HEIGHT_S`, for in the stream of velocities a height is taken only with a place.

Source: MAVLink guide, "SET_POSITION_TARGET_LOCAL_NED"; acceptance as the simulators of ArduCopter and PX4 showed it.

A lead makes up for an autopilot's slow integrator: it tells more than is wanted, so that the speed flown lags as (7)
says. Of a speed w told it flies prompt_share w + (1 - prompt_share) m with its lag, and m follows w with the time
constant rest_s; so it flies u with that lag when it is told w = (u - (1 - prompt_share) m) / prompt_share.
"""

from __future__ import annotations

import math
from typing import Final

from airlink import mavlink as m
from airlink.messages.command import SetPositionTargetLocalNed
from flight_model.autopilot_model import FlightState, Setpoint, within
from flight_model.slot import hovering_course, slot_axis

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
"""Time in which an error of height would be flown off: (7)'s two lags of height add up to it."""
TURNS_FROM_MPS: Final = 1.0
"""Ground speed from which the nose turns to where it flies; slower, and standing, it keeps its heading."""
NO_POSITION: Final = (
    m.POSITION_TARGET_TYPEMASK_X_IGNORE | m.POSITION_TARGET_TYPEMASK_Y_IGNORE | m.POSITION_TARGET_TYPEMASK_Z_IGNORE
)
NO_ACCELERATION: Final = (
    m.POSITION_TARGET_TYPEMASK_AX_IGNORE | m.POSITION_TARGET_TYPEMASK_AY_IGNORE | m.POSITION_TARGET_TYPEMASK_AZ_IGNORE
)
VELOCITY_AND_YAW: Final = NO_POSITION | NO_ACCELERATION | m.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
VELOCITY_ALONE: Final = NO_POSITION | NO_ACCELERATION | m.POSITION_TARGET_TYPEMASK_YAW_IGNORE
"""With a yaw rate of 0: where both are to be ignored, ArduCopter's nose turns by WP_YAW_BEHAVIOR."""


class _Rest:
    """What an autopilot's integrator has come to, of one component of a speed."""

    def __init__(self, prompt_share: float, rest_s: float, period_s: float) -> None:
        """Begin at rest; a speed is told every `period_s`."""
        self._prompt = prompt_share
        self._filled = -math.expm1(-period_s / rest_s)
        self.integrated_mps: float = 0.0

    def led(self, speed_mps: float) -> float:
        """Return what to tell for a speed to be flown."""
        return (speed_mps - (1.0 - self._prompt) * self.integrated_mps) / self._prompt

    def flown(self, told_mps: float) -> float:
        """Return the speed that is flown for one that is told: `led` the other way round."""
        return self._prompt * told_mps + (1.0 - self._prompt) * self.integrated_mps

    def take(self, told_mps: float) -> None:
        """Take note of what is told for a period."""
        self.integrated_mps += self._filled * (told_mps - self.integrated_mps)


class SpeedLead:
    """Leads the airspeeds that a fixed wing is told."""

    def __init__(self, prompt_share: float, rest_s: float, limits_mps: tuple[float, float], period_s: float) -> None:
        """Begin with the airspeed that it has; one between the limits is told every `period_s`."""
        self._rest, self._limits_mps, self._begun = _Rest(prompt_share, rest_s, period_s), limits_mps, False

    @property
    def within_reach_mps(self) -> tuple[float, float]:
        """The least and the highest airspeed that it can be had to fly now; its integrator does the rest in time."""
        if not self._begun:
            return self._limits_mps
        return self._rest.flown(self._limits_mps[0]), self._rest.flown(self._limits_mps[1])

    def forget(self) -> None:
        """Begin again with the airspeed that it then has: something else was told meanwhile."""
        self._begun = False

    def lead(self, speed_mps: float, airspeed_mps: float) -> float:
        """Return the airspeed to tell now for one to be flown; `airspeed_mps` is what it flies."""
        if not self._begun:
            self._rest.integrated_mps, self._begun = airspeed_mps, True
        told_mps = within(self._rest.led(speed_mps), self._limits_mps[0], self._limits_mps[1])
        self._rest.take(told_mps)
        return told_mps


class VelocityLead:
    """Leads and limits the velocities over ground that a multirotor is told; by default it does neither."""

    def __init__(
        self,
        prompt_share: float = 1.0,
        rest_s: float = 1.0,
        most_mps: float = math.inf,
        period_s: float = 1.0,
        climb_max_mps: float = math.inf,
    ) -> None:
        """Begin with the velocity that it has; one is told every `period_s`, none faster than the limits."""
        self._north, self._east = (_Rest(prompt_share, rest_s, period_s) for _ in range(2))
        self._most_mps, self._begun = most_mps, False
        self.climb_max_mps = climb_max_mps

    def forget(self) -> None:
        """Begin again with the velocity that it then has: something else was told meanwhile."""
        self._begun = False

    def lead(self, velocity_mps: tuple[float, float], flown_mps: tuple[float, float]) -> tuple[float, float]:
        """Return the velocity to tell now, north and east, for one to be flown; `flown_mps` is what it flies."""
        if not self._begun:
            (self._north.integrated_mps, self._east.integrated_mps), self._begun = flown_mps, True
        north, east = self._north.led(velocity_mps[0]), self._east.led(velocity_mps[1])
        share = min(1.0, self._most_mps / max(math.hypot(north, east), 1e-9))
        told = share * north, share * east
        self._north.take(told[0])
        self._east.take(told[1])
        return told


def stands(setpoint: Setpoint) -> bool:
    """Return whether it is to stand: a leader, whose heading is then its nose's."""
    return setpoint.speed_mps == 0.0


def velocity_setpoint(
    system: int,
    setpoint: Setpoint,
    where: FlightState,
    lead: VelocityLead,
    nose_rad: float,
) -> SetPositionTargetLocalNed:
    """Return a setpoint of the law as a velocity over ground, and the course as yaw where it moves.

    Where it stands its nose is told to be at `nose_rad`, NaN: to turn no further.
    """
    yaw_rad = setpoint.heading_rad if setpoint.speed_mps >= TURNS_FROM_MPS else nose_rad
    turns = math.isfinite(yaw_rad)
    velocity_mps = (
        setpoint.speed_mps * math.cos(setpoint.heading_rad),
        setpoint.speed_mps * math.sin(setpoint.heading_rad),
    )
    north_mps, east_mps = lead.lead(velocity_mps, where.ground_mps())
    sink_mps = (where.height_m - setpoint.height_m) / HEIGHT_S
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


def ground_motion(yaw_rad: float, north_mps: float, east_mps: float, *, leads: bool) -> tuple[float, float]:
    """Return ground speed and course; of a leader, its slots' axis and its speed along that, backwards negative."""
    if not leads:
        return math.hypot(north_mps, east_mps), hovering_course(yaw_rad, north_mps, east_mps)
    axis_rad = slot_axis(yaw_rad, north_mps, east_mps)
    return north_mps * math.cos(axis_rad) + east_mps * math.sin(axis_rad), axis_rad
