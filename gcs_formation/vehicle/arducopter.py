"""ArduCopter, and its parameters on which a flight in formation depends.

It is commanded in GUIDED by a stream of SET_POSITION_TARGET_LOCAL_NED with velocity and yaw. It flies the velocity over
ground that it is told, whatever the wind: the wind that the station estimates is none.

Sources: ArduPilot documentation, "Copter Commands in Guided Mode", "Complete Parameter List" and "GCS Failsafe"; its
acceptance and refusals as its simulator showed them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

from airlink import mavlink as m
from airlink.messages import Message
from airlink.messages.command import CommandLong
from airlink.messages.system import Heartbeat
from flight_model.autopilot import FlightState
from gcs_formation.estimation.flight_state import Setpoint
from gcs_formation.vehicle.ardupilot import OUR_HEARTBEATS, ArduPilot, patience
from gcs_formation.vehicle.autopilot import Command, Step
from gcs_formation.vehicle.checks import Check, Demands
from gcs_formation.vehicle.hovering import TYPES, VelocityLead, ground_motion, stands, velocity_setpoint
from gcs_formation.vehicle.telemetry import Telemetry

LEADS_AWAY = (1, 2, 3, 4, 5, 6, 7)
"""FS_GCS_ENABLE: RTL, RTL or AUTO, SmartRTL, LAND, AUTO, BRAKE; 0 stands where setpoints stopped."""
TAKE_OFF_TO_M = 20.0
CM = 0.01


def arducopter_checks(asked: Demands) -> tuple[Check, ...]:
    """Return what to read from an ArduCopter of which a scenario asks this much."""
    fastest, speed = asked.speed_max_mps, asked.speed_mps
    return (
        OUR_HEARTBEATS,
        Check(
            ("FS_GCS_ENABLE",),
            "1 (RTL) to 7; without it a copter whose setpoints stop stands where it is until its battery fails",
            lambda value: value in LEADS_AWAY,
        ),
        patience("FS_GCS_TIMEOUT"),
        Check(
            ("WPNAV_SPEED",),
            f"{fastest / CM:g} cm/s or more, its model's speed_max_mps; it flies no faster",
            lambda value: value * CM >= fastest,
            lambda value: value * CM < speed,
        ),
        Check(
            ("WPNAV_ACCEL",),
            f"{asked.accel_max_mps2 / CM:g} cm/s² or more, its model's accel_max_mps2",
            lambda value: value * CM >= asked.accel_max_mps2,
        ),
        Check(
            ("RTL_ALT",),
            "at most the lowest height of the path, in cm: lower than that, nobody climbs into others on the way home",
            lambda value: value * CM <= asked.lowest_m,
        ),
    )


class ArduCopter(ArduPilot):
    """A multirotor or helicopter of ArduPilot's, commanded in GUIDED by velocities."""

    family = "ArduCopter"
    loop_s = 0.0025
    take_off_m = 18.0
    """`TAKE_OFF_TO_M`, whose climb ends softly."""
    guided_mode = m.COPTER_MODE_GUIDED
    loiter_mode = m.COPTER_MODE_BRAKE
    """It stands there; in LOITER a transmitter's throttle, or the lack of one, moves it."""
    home_mode = m.COPTER_MODE_RTL
    setpoint_commands = ()
    stands = True
    velocity_lead: VelocityLead | None = None
    """For one whose model leaves part of a change of velocity to its integrator."""
    mode_names: ClassVar = {
        m.COPTER_MODE_STABILIZE: "STABILIZE",
        m.COPTER_MODE_ALT_HOLD: "ALT_HOLD",
        m.COPTER_MODE_AUTO: "AUTO",
        m.COPTER_MODE_GUIDED: "GUIDED",
        m.COPTER_MODE_LOITER: "LOITER",
        m.COPTER_MODE_RTL: "RTL",
        m.COPTER_MODE_LAND: "LAND",
        m.COPTER_MODE_POSHOLD: "POSHOLD",
        m.COPTER_MODE_BRAKE: "BRAKE",
    }

    def speaks(self, heartbeat: Heartbeat) -> bool:
        """Return whether a heartbeat is that of a multirotor or helicopter of ArduPilot's."""
        return heartbeat.autopilot == m.MAV_AUTOPILOT_ARDUPILOTMEGA and heartbeat.type in TYPES

    def start_up(self, rates_hz: Mapping[int, float]) -> tuple[Step, ...]:
        """Return the steps: streams, ready, GUIDED, take-off. In the air, unnecessary ones are done at once."""
        return (
            *self._asked_and_ready(rates_hz),
            Step("set mode GUIDED", self._is_guided, lambda _: (self.set_mode(self.guided_mode),)),
            Step("armed", lambda seen: seen.armed, self._to_arm, 30.0, takes_off=True),
            Step("told it to take off", self.is_airborne, self._to_take_off, takes_off=True),
            Step("waited for it to climb", self._has_climbed, timeout_s=60.0),
        )

    def checks(self, asked: Demands) -> tuple[Check, ...]:
        """Return failsafe, limits and whose heartbeats count."""
        return arducopter_checks(asked)

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

        It is repeated at every tick: ArduCopter stands 3 s (GUID_TIMEOUT) after the last one.
        """
        nose_rad = setpoint.heading_rad if stands(setpoint) else math.nan
        return (velocity_setpoint(self.system, setpoint, where, nose_rad, self.velocity_lead),)

    def loiter(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:  # noqa: ARG002 - it stands where it is
        """Return BRAKE."""
        return (self.set_mode(self.loiter_mode),)

    def go_home(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:  # noqa: ARG002 - at the height it has
        """Return RTL: it flies home at its height, or at RTL_ALT if that is higher, and lands there."""
        return (self.set_mode(self.home_mode),)

    def _is_guided(self, seen: Telemetry) -> bool:
        return seen.custom_mode == self.guided_mode

    def _to_take_off(self, _: Telemetry) -> tuple[Command, ...]:
        return (CommandLong(self.system, m.MAV_COMP_ID_AUTOPILOT1, m.MAV_CMD_NAV_TAKEOFF, param7=TAKE_OFF_TO_M),)

    def _has_climbed(self, seen: Telemetry) -> bool:
        return seen.motion is not None and seen.motion.above_home_m > self.take_off_m
