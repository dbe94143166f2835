# Compiled by mypyc: it runs every tick.

"""ArduCopter: how it is commanded, and the parameters on which a flight depends.

It flies in GUIDED by a stream of SET_POSITION_TARGET_LOCAL_NED with velocity and yaw. It holds the commanded ground
velocity in any wind, so the station's wind estimate for it is zero.

Sources: ArduPilot documentation, "Copter Commands in Guided Mode", "GCS Failsafe", "Get and set message intervals" and
"Complete Parameter List" (names since 4.6); what it accepts and refuses was observed in ArduPilot's simulator.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import ClassVar, Final

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from airlink.messages import Message
from airlink.messages.command import CommandLong
from airlink.messages.system import Heartbeat
from flight_model.earth import GeodeticOrigin
from flight_model.flight_state import FlightState, Setpoint
from formation_scenario.path_plan import PathPlan
from formation_scenario.vehicles import VehicleModel
from gcs_formation.vehicle.ardupilot import CM, TIMEOUT_S, ArduPilot, heartbeat_timeout, our_heartbeats
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.checks import Check, climb_check, lowest_m, only_read
from gcs_formation.vehicle.craft import Craft
from gcs_formation.vehicle.mode_names import COPTER
from gcs_formation.vehicle.own_failsafe import OwnFailsafe, Parameters
from gcs_formation.vehicle.own_fence import FENCE_NAMES, OwnFence, ardupilot_fence
from gcs_formation.vehicle.reposition import fly_to_home
from gcs_formation.vehicle.startup_step import Command, StartUpStep
from gcs_formation.vehicle.telemetry import Telemetry
from gcs_formation.vehicle.velocity_setpoint import (
    MULTIROTOR_TYPES,
    VelocityLead,
    hovers,
    velocity_lead,
    velocity_setpoint,
)

CLIMBS: Final = (("WP_SPD_UP", "WPNAV_SPEED_UP"), ("WP_SPD_DN", "WPNAV_SPEED_DN"))
"""Parameters of climb and descent, in 4.7.0 and before."""
COPTER_LEADS_TO: Final = {
    5: frozenset({m.COPTER_MODE_LAND}),
    7: frozenset({m.COPTER_MODE_BRAKE, m.COPTER_MODE_LAND}),
}
"""FS_GCS_ENABLE: the same; others are ways home."""
COPTER_HOMEWARD: Final = frozenset(
    {m.COPTER_MODE_RTL, m.COPTER_MODE_SMART_RTL, m.COPTER_MODE_AUTO_RTL, m.COPTER_MODE_LAND}
)
COPTER_LEADS_AWAY = (1, 2, 3, 4, 5, 6, 7)
"""FS_GCS_ENABLE: RTL, RTL or AUTO, SmartRTL, LAND, AUTO, BRAKE; 0 hovers where setpoints stopped."""
TAKE_OFF_TO_M = 20.0


def _renamed(
    names: tuple[str, str],
    unit: str,
    allowed: Callable[[str, float], str],
    holds: Callable[[float], bool],
    refuses: Callable[[float], bool] = lambda _: False,
    bounds: str = "",
    asks: float | None = None,
) -> Check:
    """Return the check of a parameter that 4.7.0 renamed and converted from centimetres to metres.

    Args:
        names: in 4.7.0 and before.
        unit: in 4.7.0.
        allowed: the allowed values in words, from a unit and its length in metres.
        holds: whether a value in metres is allowed.
        refuses: whether it prevents the take-off of all vehicles.
        bounds: the key of the model that it bounds, if any.
        asks: the nearest allowed value in metres, if it may be set.
    """
    older = Check(
        names[1:],
        allowed(f"c{unit}", CM),
        lambda value: holds(value * CM),
        lambda value: refuses(value * CM),
        bounds=(lambda value: (bounds, value * CM)) if bounds else None,
        asks=None if asks is None else asks / CM,
    )
    return Check(
        names[:1],
        allowed(unit, 1.0),
        holds,
        refuses,
        older,
        bounds=(lambda value: (bounds, value)) if bounds else None,
        asks=asks,
    )


@mypyc_attr(allow_interpreted_subclasses=True)
class ArduCopter(ArduPilot):
    """An ArduPilot multirotor or helicopter, commanded in GUIDED by velocity setpoints."""

    family = "ArduCopter"
    loop_s = 0.0025
    take_off_m = 18.0
    """Below `TAKE_OFF_TO_M`, which the climb approaches slowly."""
    guided_mode = m.COPTER_MODE_GUIDED
    loiter_mode = m.COPTER_MODE_BRAKE
    """BRAKE holds position; in LOITER a transmitter's throttle, or the lack of a transmitter, would move it."""
    home_mode = m.COPTER_MODE_RTL
    setpoint_commands = ()
    hovers_after_s = 3.0
    """GUID_TIMEOUT."""
    hovers = True
    mode_names: ClassVar = COPTER
    failsafe_parameters = ("FS_GCS_ENABLE", "FS_GCS_TIMEOUT")

    def __init__(
        self, system: int, origin: GeodeticOrigin, turn_rate_max_rps: float, lead: VelocityLead | None = None
    ) -> None:
        """Address `system`; `lead` compensates the slow integrator of its model."""
        super().__init__(system, origin, turn_rate_max_rps)
        self._lead = lead or VelocityLead()

    @classmethod
    def of(cls, craft: Craft) -> Autopilot:
        """Return the interface to a vehicle's autopilot."""
        return cls(craft.system, craft.origin, craft.model.turn_rate_max_rps, velocity_lead(craft.model, craft.tick_s))

    def forget_setpoints(self) -> None:
        """Restart the lead compensation."""
        self._lead.reinitialise()

    def speaks(self, heartbeat: Heartbeat) -> bool:
        """Return whether a heartbeat is from an ArduPilot multirotor or helicopter."""
        return heartbeat.autopilot == m.MAV_AUTOPILOT_ARDUPILOTMEGA and heartbeat.type in MULTIROTOR_TYPES

    def start_up(self, rates_hz: Mapping[int, float]) -> tuple[StartUpStep, ...]:
        """Return the steps: streams, ready, GUIDED, take-off. In the air, those already done are skipped."""
        return (
            *self._asked_and_ready(rates_hz),
            self._guided_step(),
            self._armed_step(),
            StartUpStep("commanded it to take off", self.is_airborne, self._to_take_off, takes_off=True),
            StartUpStep("waited for it to climb", self._has_climbed, timeout_s=60.0),
        )

    def checks(self, model: VehicleModel, path: PathPlan) -> tuple[Check, ...]:
        """Return the checks of failsafe, limits and the ground station's system id."""
        fastest, speed = model.speed_max_mps, path.begin_mps
        return (
            our_heartbeats(self.station.system),
            Check(
                ("FS_GCS_ENABLE",),
                "1 (RTL) to 7; without it a copter whose setpoints stop hovers where it is until its battery fails",
                lambda value: value in COPTER_LEADS_AWAY,
            ),
            heartbeat_timeout("FS_GCS_TIMEOUT"),
            _renamed(
                ("WP_SPD", "WPNAV_SPEED"),
                "m/s",
                lambda unit, size_m: (
                    f"{fastest / size_m:g} {unit} or more, its model's speed_max_mps; it flies no faster"
                ),
                lambda value: value >= fastest,
                lambda value: value < speed,
                "speed_max_mps",
                fastest,
            ),
            _renamed(
                ("WP_ACC", "WPNAV_ACCEL"),
                "m/s²",
                lambda unit, size_m: f"{model.accel_max_mps2 / size_m:g} {unit} or more, its model's accel_max_mps2",
                lambda value: value >= model.accel_max_mps2,
                bounds="accel_max_mps2",
                asks=model.accel_max_mps2,
            ),
            _renamed(
                ("RTL_ALT_M", "RTL_ALT"),
                "m",
                lambda unit, size_m: (
                    f"{lowest_m(path) / size_m:g} {unit} at most, the lowest height of the path: lower "
                    "than that, none climbs into others on the way home"
                ),
                lambda value: value <= lowest_m(path),
            ),
            *(
                replace(climb_check((now,), model), older=climb_check((before,), model, "cm/s", CM))
                for now, before in CLIMBS
            ),
            *map(only_read, FENCE_NAMES),
        )

    def own_fence(self, values: Parameters) -> OwnFence | None:
        """Return its geofence, None if it is off."""
        return ardupilot_fence(values)

    def own_failsafe(self, values: Parameters) -> OwnFailsafe | None:
        """Return its failsafe, None if it is off."""
        action = int(values.get("FS_GCS_ENABLE", 0))
        if not action:
            return None
        return OwnFailsafe(values.get("FS_GCS_TIMEOUT", TIMEOUT_S), COPTER_LEADS_TO.get(action, COPTER_HOMEWARD))

    def wait_over_home(self, height_m: float, seen: Telemetry) -> tuple[Command, ...]:
        """Return DO_REPOSITION to its home in GUIDED: unlike RTL it flies there at its own height, and stays."""
        return fly_to_home(self, height_m, seen) or self.go_home(height_m, seen)

    def land(self) -> tuple[Command, ...]:
        """Return LAND, which comes down where it hovers, and disarms."""
        return (self.set_mode(m.COPTER_MODE_LAND),)

    def setpoint(self, setpoint: Setpoint, where: FlightState) -> tuple[Message, ...]:
        """Return one message: velocity over ground, and the course as yaw while it moves.

        It is repeated at every tick: ArduCopter stops 3 s (GUID_TIMEOUT) after the last one.
        """
        nose_rad = setpoint.heading_rad if hovers(setpoint) else math.nan
        return (velocity_setpoint(self.system, setpoint, where, self._lead, nose_rad),)

    def _to_take_off(self, _: Telemetry) -> tuple[Command, ...]:
        return (CommandLong(self.system, m.MAV_COMP_ID_AUTOPILOT1, m.MAV_CMD_NAV_TAKEOFF, param7=TAKE_OFF_TO_M),)

    def _has_climbed(self, seen: Telemetry) -> bool:
        return seen.motion is not None and seen.motion.above_home_m > self.take_off_m
