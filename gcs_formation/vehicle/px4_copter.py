"""PX4, multirotor, and its parameters on which a flight in formation depends.

It is commanded in OFFBOARD by a stream of SET_POSITION_TARGET_LOCAL_NED with velocity and yaw, which must come before
the mode is set and never stop for longer than COM_OF_LOSS_T.

Sources: PX4 user guide, "Offboard Mode", "Return Mode", "Parameter Reference" and "Safety Configuration (Failsafes)";
its acceptance and refusals as its simulator (SIH) showed them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from airlink import mavlink as m
from airlink.messages import Message
from airlink.messages.system import Heartbeat
from flight_model.autopilot import FlightState
from flight_model.earth import GeodeticOrigin
from gcs_formation.estimation.flight_state import Setpoint
from gcs_formation.vehicle.autopilot import Command, Step
from gcs_formation.vehicle.checks import Check, Demands
from gcs_formation.vehicle.hovering import (
    TURNS_FROM_MPS,
    TYPES,
    VelocityLead,
    ground_motion,
    stands,
    velocity_setpoint,
)
from gcs_formation.vehicle.px4 import LOITER, OFFBOARD, RTL, Px4, heartbeats_lost
from gcs_formation.vehicle.telemetry import Telemetry

PATIENCE_S = 0.5
"""A shorter time-out takes a few lost setpoints for their end."""
CUTS_MOTORS = (6, 7)
"""COM_OBL_RC_ACT: terminate, disarm."""
WITHOUT_STICKS = (0, 3, 4, 5)
"""COM_OBL_RC_ACT: position (return, where no transmitter is heard), return, land, hold."""
STAND = Setpoint(0.0, 0.0, 0.0)
ANYWHERE = FlightState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def px4_copter_checks(asked: Demands) -> tuple[Check, ...]:
    """Return what to read from a PX4 multirotor of which a scenario asks this much."""
    fastest, speed = asked.speed_max_mps, asked.speed_mps
    return (
        heartbeats_lost("flies on as long as setpoints come"),
        Check(
            ("COM_OF_LOSS_T",),
            f"{PATIENCE_S:g} s or more; setpoints come with every tick, and some are lost",
            lambda value: value >= PATIENCE_S,
        ),
        Check(
            ("COM_OBL_RC_ACT",),
            "0 or 3 (return), 4 (land) or 5 (hold) when setpoints stop; 1 and 2 need a pilot, 6 and 7 stop the motors",
            lambda value: value in WITHOUT_STICKS,
            lambda value: value in CUTS_MOTORS,
        ),
        Check(
            ("MPC_XY_VEL_MAX",),
            f"{fastest:g} m/s or more, its model's speed_max_mps; it flies no faster",
            lambda value: value >= fastest,
            lambda value: value < speed,
        ),
        Check(
            ("RTL_RETURN_ALT",),
            "at most the lowest height of the path: lower than that, nobody climbs into others on the way home",
            lambda value: value <= asked.lowest_m,
        ),
    )


class Px4Copter(Px4):
    """A PX4 multirotor or helicopter, commanded in OFFBOARD by velocities."""

    family = "PX4 multirotor"
    take_off_m = 18.0
    take_off_to_m = 20.0
    guided_mode = OFFBOARD
    setpoint_commands = ()
    stands = True
    acknowledges_early = True
    """DO_SET_MODE is acknowledged twice, the first time always with ACCEPTED."""
    velocity_lead: VelocityLead | None = None
    """For one whose model leaves part of a change of velocity to its integrator."""

    def __init__(self, system: int, origin: GeodeticOrigin, turn_rate_max_rps: float) -> None:
        """Address `system`."""
        super().__init__(system, origin, turn_rate_max_rps)
        self._nose_rad = math.nan

    @property
    def stand_in(self) -> tuple[Message, ...]:
        """A setpoint that has it stand."""
        return (velocity_setpoint(self.system, STAND, ANYWHERE, self._nose_rad, self.velocity_lead),)

    def speaks(self, heartbeat: Heartbeat) -> bool:
        """Return whether a heartbeat is that of a multirotor or helicopter of PX4's."""
        return heartbeat.autopilot == m.MAV_AUTOPILOT_PX4 and heartbeat.type in TYPES

    def start_up(self, rates_hz: Mapping[int, float]) -> tuple[Step, ...]:
        """Return the steps: streams, ready, take-off, which ends in HOLD, OFFBOARD; what is done is left out."""
        return (
            Step("asked for telemetry", lambda seen: seen.complete, lambda _: self._questions(rates_hz), 20.0, True),
            Step("waited for it to be ready to arm", self._is_ready, timeout_s=90.0),
            Step("told it to take off", self._is_taking_off, self._to_take_off, takes_off=True),
            Step("armed", lambda seen: seen.armed, self._to_arm, 30.0, takes_off=True),
            Step("waited for it to climb", self._has_climbed, timeout_s=120.0),
            Step("set mode OFFBOARD", self.takes_setpoints, lambda _: (self.set_mode(OFFBOARD),)),
        )

    def checks(self, asked: Demands) -> tuple[Check, ...]:
        """Return failsafes and limits."""
        return px4_copter_checks(asked)

    def climbs_out(self, telemetry: Telemetry) -> bool:  # noqa: ARG002 - it may be stopped at any height
        """Return False."""
        return False

    def air_motion(
        self,
        airspeed_mps: float,  # noqa: ARG002 - it says nothing of what it obeys
        yaw_rad: float,
        north_mps: float,
        east_mps: float,
        *,
        leads: bool,
    ) -> tuple[float, float]:
        """Return ground speed and course."""
        return ground_motion(yaw_rad, north_mps, east_mps, leads=leads)

    def setpoint(self, setpoint: Setpoint, where: FlightState) -> tuple[Message, ...]:
        """Return one message: velocity over ground, and the course as yaw where it moves.

        Standing it is told where its nose was told to be last: with a yaw rate of 0 alone it drifts by tens of degrees.
        A setpoint is repeated at every tick: COM_OF_LOSS_T after the last one PX4 leaves OFFBOARD by its failsafe; when
        they come again, it returns by itself.
        """
        if setpoint.speed_mps >= TURNS_FROM_MPS or stands(setpoint):
            self._nose_rad = setpoint.heading_rad
        return (velocity_setpoint(self.system, setpoint, where, self._nose_rad, self.velocity_lead),)

    def loiter(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:  # noqa: ARG002 - it stands where it is
        """Return HOLD."""
        return (self.set_mode(LOITER),)

    def go_home(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:  # noqa: ARG002 - at the height it has
        """Return RTL: it flies home at its height, or at RTL_RETURN_ALT if that is higher, and lands there."""
        return (self.set_mode(RTL),)
