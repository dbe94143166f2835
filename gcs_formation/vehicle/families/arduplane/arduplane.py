# Compiled by mypyc: it runs every tick.

"""ArduPlane: how it is commanded, and the parameters on which a flight depends.

It flies in GUIDED by commands of airspeed, altitude and heading, and acknowledges each.

Sources: ArduPilot documentation, "Plane: GUIDED mode", "AUTOLAND Mode", "Plane Failsafe Function", "Get and set message
intervals" and "Complete Parameter List" (names since 4.6); what it accepts and refuses was observed in ArduPilot's
simulator.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar, Final

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from airlink.messages import Message
from airlink.messages.command import CommandInt
from airlink.messages.system import Heartbeat
from flight_model.flight_state import FlightState, Setpoint
from formation_scenario.path_plan import PathPlan
from formation_scenario.vehicles import VehicleModel
from gcs_formation.vehicle.ardupilot import CM, TIMEOUT_S, ArduPilot, heartbeat_timeout, our_heartbeats
from gcs_formation.vehicle.autopilot_family import KnownSetpoints
from gcs_formation.vehicle.checks import Check, climb_check, envelope_checks, only_read
from gcs_formation.vehicle.mode_names import PLANE, PLANE_TYPES
from gcs_formation.vehicle.own_failsafe import OwnFailsafe, Parameters
from gcs_formation.vehicle.own_fence import FENCE_NAMES, OwnFence, ardupilot_fence
from gcs_formation.vehicle.startup_step import Command, StartUpStep
from gcs_formation.vehicle.telemetry import Telemetry

MIN_TAKE_OFF_M = 50
FAILSAFE_BY_HEARTBEAT = (1, 2)
BEFORE_4_5: Final = {
    "AIRSPEED_MIN": ("ARSPD_FBW_MIN", 1.0),
    "AIRSPEED_MAX": ("ARSPD_FBW_MAX", 1.0),
    "AIRSPEED_CRUISE": ("TRIM_ARSPD_CM", CM),
    "ROLL_LIMIT_DEG": ("LIM_ROLL_CD", CM),
}
"""The parameters of ArduPlane's envelope, in the order of `envelope_checks`: their names and units before 4.5."""
PLANE_LEADS_AWAY = (1, 4, 5)
"""FS_LONG_ACTN: RTL, AUTO, AUTOLAND; 0 continues the flight, 2 glides, 3 releases a parachute."""
PLANE_UNARMABLE: Final = frozenset({m.PLANE_MODE_RTL, m.PLANE_MODE_QLAND, m.PLANE_MODE_QRTL})
"""Modes in which an ArduPlane can't be armed. Its failsafe leads to them on the ground too: 5 s after its boot, after
the last heartbeat of another station, or while the radio is off."""
PLANE_LEADS_TO: Final = {
    2: frozenset({m.PLANE_MODE_FLY_BY_WIRE_A}),
    4: frozenset({m.PLANE_MODE_AUTO, m.PLANE_MODE_RTL}),
    5: frozenset({m.PLANE_MODE_AUTOLAND, m.PLANE_MODE_RTL}),
}
"""FS_LONG_ACTN: the modes to which it may lead; others are RTL."""
AUTOPILOT: Final = m.MAV_COMP_ID_AUTOPILOT1
ABOVE_SEA: Final = m.MAV_FRAME_GLOBAL
SPEED: Final = m.MAV_CMD_GUIDED_CHANGE_SPEED
HEADING: Final = m.MAV_CMD_GUIDED_CHANGE_HEADING
ALTITUDE: Final = m.MAV_CMD_GUIDED_CHANGE_ALTITUDE
AIRSPEED: Final = m.SPEED_TYPE_AIRSPEED
RESOLUTION: Final = 0.005
"""In m: ArduPlane rounds heights to centimetres."""
OF_THE_NOSE: Final = m.HEADING_TYPE_HEADING
DEGREES: Final = 180.0 / math.pi
ALL_ROUND_DEG: Final = 360.0 - 2.0**-16
"""The least heading that rounds to 360 degrees as a 32-bit float."""
AUTOPILOTS = frozenset({m.MAV_AUTOPILOT_GENERIC, m.MAV_AUTOPILOT_ARDUPILOTMEGA})


@mypyc_attr(allow_interpreted_subclasses=True)
class ArduPlane(ArduPilot):
    """A fixed-wing ArduPilot, commanded in GUIDED by MAV_CMD_GUIDED_CHANGE_SPEED, _ALTITUDE and _HEADING."""

    family = "ArduPlane"
    loop_s = 0.02
    take_off_m = 45.0
    """Below TKOFF_ALT (50 m), which the climb approaches slowly."""
    guided_mode = m.PLANE_MODE_GUIDED
    setpoint_commands = (SPEED, HEADING, ALTITUDE)
    take_off_mode = m.PLANE_MODE_TAKEOFF
    loiter_mode = m.PLANE_MODE_LOITER
    circling_mode = m.PLANE_MODE_LOITER
    home_mode = m.PLANE_MODE_RTL
    approach_m = 55.0
    """Default of AUTOLAND_WP_ALT."""
    approach_parameter = "AUTOLAND_WP_ALT"
    lands_by_mission = True
    mode_names: ClassVar = PLANE
    failsafe_parameters = ("FS_GCS_ENABL", "FS_LONG_ACTN", "FS_LONG_TIMEOUT")
    unarmable_modes = PLANE_UNARMABLE

    def speaks(self, heartbeat: Heartbeat) -> bool:
        """Return whether a heartbeat is from an ArduPilot fixed wing or VTOL, or of generic type."""
        return heartbeat.autopilot in AUTOPILOTS and heartbeat.type in PLANE_TYPES

    def start_up(self, rates_hz: Mapping[int, float]) -> tuple[StartUpStep, ...]:
        """Return the steps: streams, ready, take-off, GUIDED. In the air, those already done are skipped."""
        return (
            *self._asked_and_ready(rates_hz),
            StartUpStep(
                "set mode TAKEOFF", self._is_taking_off, self._to_take_off, takes_off=True, lost=self._sent_home
            ),
            self._armable_step(),
            self._armed_step(),
            StartUpStep("waited for it to climb", self._has_climbed, timeout_s=90.0),
            self._guided_step(),
        )

    def checks(self, model: VehicleModel, path: PathPlan) -> tuple[Check, ...]:
        """Return the checks of failsafes, limits and the ground station's system id."""
        commanded_mps, (minimum, maximum, trim, bank) = self.commanded_airspeed(path.begin_mps), tuple(BEFORE_4_5)
        envelope = envelope_checks(model, path, commanded_mps, minimum, maximum, trim, bank, ("refused", "refused"))
        return (
            our_heartbeats(self.station.system),
            Check(
                ("FS_GCS_ENABL",),
                "1 or 2; without it a plane whose setpoints stop flies straight on for ever",
                lambda value: value in FAILSAFE_BY_HEARTBEAT,
            ),
            Check(
                ("FS_LONG_ACTN",),
                "1 (RTL), 4 (AUTO) or 5 (AUTOLAND) when our heartbeats stop",
                lambda value: value in PLANE_LEADS_AWAY,
            ),
            heartbeat_timeout("FS_LONG_TIMEOUT"),
            Check(
                ("TKOFF_ALT",),
                f"{MIN_TAKE_OFF_M} m or more; lower, the climb ends before the formation takes over",
                lambda value: value >= MIN_TAKE_OFF_M,
                lambda _: True,
                asks=float(MIN_TAKE_OFF_M),
            ),
            *(check.formerly(*BEFORE_4_5[check.names[0]]) for check in envelope),
            climb_check(("TECS_CLMB_MAX",), model),
            climb_check(("TECS_SINK_MAX",), model),
            *map(only_read, FENCE_NAMES),
            only_read(self.approach_parameter, may_lack=True),
        )

    def own_fence(self, values: Parameters) -> OwnFence | None:
        """Return its geofence, None if it is off."""
        return ardupilot_fence(values)

    def own_failsafe(self, values: Parameters) -> OwnFailsafe | None:
        """Return its long failsafe, None if it is off."""
        if values.get("FS_GCS_ENABL") not in FAILSAFE_BY_HEARTBEAT:
            return None
        modes = PLANE_LEADS_TO.get(int(values.get("FS_LONG_ACTN", 1)), frozenset({m.PLANE_MODE_RTL}))
        return OwnFailsafe(values.get("FS_LONG_TIMEOUT", TIMEOUT_S), modes)

    def setpoint(self, setpoint: Setpoint, where: FlightState) -> tuple[Message, ...]:
        """Return speed, altitude above sea level and heading, in this order.

        The rates of altitude and speed are left to the autopilot (0). The heading's lateral acceleration is what the
        model's turn rate needs at this speed; with 0 the plane would hardly turn.
        """
        return tuple(self.changed(setpoint, where, [None, None, None]))

    def changed(self, setpoint: Setpoint, where: FlightState, known: KnownSetpoints) -> list[Message]:  # noqa: ARG002 - none depends on it
        """Return the messages of `setpoint` that aren't `known`."""
        speed, heading, altitude = known
        above_sea_m = setpoint.height_m + self.origin.alt_m
        if abs(above_sea_m) < RESOLUTION or abs(above_sea_m + 1.0) < RESOLUTION:
            above_sea_m += 2.0 * RESOLUTION  # ArduPlane takes 0 and -1 to mean no altitude, and refuses them
        found = list[Message]()
        if speed is None:
            found.append(self._guided(SPEED, AIRSPEED, self.commanded_airspeed(setpoint.speed_mps), 0.0))
        if altitude is None:
            found.append(self._guided(ALTITUDE, 0.0, 0.0, 0.0, above_sea_m))
        if heading is None:
            lateral_mps2 = setpoint.speed_mps * self.turn_rate_max_rps
            found.append(self._guided(HEADING, OF_THE_NOSE, _compass(setpoint.heading_rad), lateral_mps2))
        return found

    def loiter(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:  # noqa: ARG002 - it circles where it is
        """Return LOITER, then the height, since a change of mode resets heights."""
        return (self.set_mode(self.loiter_mode), self._altitude(height_m))

    def go_home(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:  # noqa: ARG002 - it knows its home
        """Return RTL, which circles over home, then the height to replace RTL_ALTITUDE, which is the same for all.

        The height is also sent first, where it has no effect: a vehicle that refuses it isn't sent home.
        """
        altitude = self._altitude(height_m)
        return (altitude, self.set_mode(m.PLANE_MODE_RTL), altitude)

    def land(self) -> tuple[Command, ...]:
        """Return DO_LAND_START where its mission has a landing.

        Otherwise AUTOLAND, available from version 4.7: it lands at home, in the direction of the take-off.
        """
        return (self.set_mode(m.PLANE_MODE_AUTOLAND),) if self.landing is None else self.land_by_mission()

    def _altitude(self, height_m: float) -> Command:
        return self._command(m.MAV_CMD_DO_CHANGE_ALTITUDE, height_m + self.origin.alt_m, m.MAV_FRAME_GLOBAL)

    def _guided(self, command: int, param1: float, param2: float, param3: float, z: float = 0.0) -> CommandInt:
        return CommandInt(self.system, AUTOPILOT, ABOVE_SEA, command, 0, 0, param1, param2, param3, 0.0, 0, 0, z)

    def _to_take_off(self, _: Telemetry) -> tuple[Command, ...]:
        return (self.set_mode(m.PLANE_MODE_TAKEOFF),)

    def _sent_home(self, seen: Telemetry) -> bool:
        """Return whether its failsafe has changed its mode on the ground."""
        return not seen.armed and seen.custom_mode in self.unarmable_modes

    def _has_climbed(self, seen: Telemetry) -> bool:
        if seen.custom_mode != m.PLANE_MODE_TAKEOFF and self.is_airborne(seen):
            return True
        return seen.motion is not None and seen.motion.above_home_m > self.take_off_m


def _compass(heading_rad: float) -> float:
    """Return a heading in degrees, below 360 also as a 32-bit float: 360 is refused."""
    degrees = heading_rad * DEGREES % 360.0
    return degrees if degrees < ALL_ROUND_DEG else 0.0
