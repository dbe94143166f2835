"""An emulated vehicle's conditions and modes with a table of all transitions, and the failsafe that changes them.

Source: ArduPilot documentation, "Flight Modes" of Plane and Copter, "Plane Failsafe Function" and "GCS Failsafe".
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum, IntEnum
from typing import Final, NamedTuple

from airlink import mavlink as m
from airlink.clock import NEVER, Instant, after
from sim_vehicles.autopilot.parameters import ParameterServer


class Mode(IntEnum):
    """The ArduPlane modes that are emulated, by ArduPlane's numbers."""

    MANUAL = 0
    STABILIZE = 2
    FBWA = 5
    FBWB = 6
    CRUISE = 7
    AUTO = 10
    RTL = 11
    LOITER = 12
    TAKEOFF = 13
    GUIDED = 15
    INITIALISING = 16
    AUTOLAND = 26


class CopterMode(IntEnum):
    """The ArduCopter modes that are emulated, by ArduCopter's numbers."""

    STABILIZE = 0
    ACRO = 1
    ALT_HOLD = 2
    AUTO = 3
    GUIDED = 4
    LOITER = 5
    RTL = 6
    CIRCLE = 7
    LAND = 9
    DRIFT = 11
    POSHOLD = 16
    BRAKE = 17
    GUIDED_NOGPS = 20
    SMART_RTL = 21
    ZIGZAG = 24


class Px4Mode(IntEnum):
    """The PX4 modes that are emulated, by HEARTBEAT's custom_mode: the main mode's number, above it the sub mode's."""

    MANUAL = 0x00010000
    ALTITUDE = 0x00020000
    POSITION = 0x00030000
    ACRO = 0x00050000
    OFFBOARD = 0x00060000
    STABILIZED = 0x00070000
    ORBIT = 0x01030000
    TAKEOFF = 0x02040000
    HOLD = 0x03040000
    RTL = 0x05040000
    LAND = 0x06040000


FlightMode = Mode | CopterMode | Px4Mode


class Condition(Enum):
    """The vehicle's condition, independent of its mode."""

    BOOTING = "booting"
    BOOTING_IN_AIR = "booting in the air"
    DISARMED = "disarmed on the ground"
    ARMED = "armed on the ground"
    FLYING = "flying"
    CRASHED = "crashed"

    @property
    def armed(self) -> bool:
        """Whether the motor may turn."""
        return self in (Condition.ARMED, Condition.FLYING)

    @property
    def booting(self) -> bool:
        """Whether the autopilot isn't up yet."""
        return self in (Condition.BOOTING, Condition.BOOTING_IN_AIR)


class Request(Enum):
    """A request to the vehicle, or an event that happens to it."""

    BOOTED = "booted"
    ARM = "arm"
    DISARM = "disarm"
    FORCE_DISARM = "disarm by force"
    LIFT_OFF = "lift off"
    TOUCH_DOWN = "touch down"
    RESTART = "restart"
    CRASH = "crash"


TRANSITIONS: dict[tuple[Condition, Request], Condition] = {
    (Condition.BOOTING, Request.BOOTED): Condition.DISARMED,
    (Condition.BOOTING_IN_AIR, Request.BOOTED): Condition.FLYING,
    (Condition.DISARMED, Request.ARM): Condition.ARMED,
    (Condition.DISARMED, Request.DISARM): Condition.DISARMED,
    (Condition.DISARMED, Request.FORCE_DISARM): Condition.DISARMED,
    (Condition.DISARMED, Request.RESTART): Condition.BOOTING,
    (Condition.ARMED, Request.ARM): Condition.ARMED,
    (Condition.ARMED, Request.DISARM): Condition.DISARMED,
    (Condition.ARMED, Request.FORCE_DISARM): Condition.DISARMED,
    (Condition.ARMED, Request.LIFT_OFF): Condition.FLYING,
    (Condition.ARMED, Request.RESTART): Condition.BOOTING,
    (Condition.FLYING, Request.ARM): Condition.FLYING,
    (Condition.FLYING, Request.TOUCH_DOWN): Condition.ARMED,
    (Condition.FLYING, Request.FORCE_DISARM): Condition.CRASHED,
    (Condition.FLYING, Request.RESTART): Condition.BOOTING_IN_AIR,
    (Condition.DISARMED, Request.CRASH): Condition.CRASHED,
    (Condition.ARMED, Request.CRASH): Condition.CRASHED,
    (Condition.FLYING, Request.CRASH): Condition.CRASHED,
}
"""All other requests are refused. An autopilot that restarts in flight is armed, as after a watchdog reset."""

SELECTABLE = frozenset(Mode) - {Mode.INITIALISING}
"""Modes that can be selected, in any condition but booting."""

STRAIGHT_ON = frozenset({Mode.MANUAL, Mode.STABILIZE, Mode.FBWA, Mode.FBWB, Mode.CRUISE})
"""Modes flown by a pilot's sticks, which nobody touches: the vehicle flies straight and level."""


def select(condition: Condition, mode: float, selectable: frozenset[int] = SELECTABLE) -> int | None:
    """Return the number of the mode that asking for one leads to, None when it's refused."""
    return None if condition.booting or mode not in selectable else int(mode)


CALIBRATING: Final = m.MAV_STATE_CALIBRATING
ACTIVE: Final = m.MAV_STATE_ACTIVE
STANDBY: Final = m.MAV_STATE_STANDBY


def system_status(condition: Condition) -> int:
    """Return the MAV_STATE that a condition is told as."""
    if condition.booting:
        return CALIBRATING
    return ACTIVE if condition is Condition.FLYING else STANDBY


BY_THROTTLE = frozenset(
    {
        CopterMode.STABILIZE,
        CopterMode.ACRO,
        CopterMode.ALT_HOLD,
        CopterMode.LOITER,
        CopterMode.CIRCLE,
        CopterMode.DRIFT,
        CopterMode.POSHOLD,
        CopterMode.ZIGZAG,
    }
)
"""ArduCopter's modes in which a transmitter's throttle sets the climb; there is none, and without it they sink."""
NOT_ARMABLE = frozenset(
    {CopterMode.AUTO, CopterMode.RTL, CopterMode.CIRCLE, CopterMode.LAND, CopterMode.BRAKE, CopterMode.SMART_RTL}
)
PX4_AS_PLANE: Final[dict[Px4Mode, FlightMode]] = {
    Px4Mode.MANUAL: Mode.MANUAL,
    Px4Mode.ALTITUDE: Mode.FBWB,
    Px4Mode.POSITION: Mode.CRUISE,
    Px4Mode.ACRO: Mode.MANUAL,
    Px4Mode.STABILIZED: Mode.STABILIZE,
    Px4Mode.OFFBOARD: Mode.GUIDED,
    Px4Mode.TAKEOFF: Mode.TAKEOFF,
    Px4Mode.HOLD: Mode.LOITER,
    Px4Mode.RTL: Mode.RTL,
}
"""A fixed wing's modes, and ArduPlane's that are flown alike. Its landings aren't emulated."""
PX4_BY_STICKS: Final = frozenset({Px4Mode.MANUAL, Px4Mode.ALTITUDE, Px4Mode.POSITION, Px4Mode.ACRO, Px4Mode.STABILIZED})
"""Modes that need a transmitter, once it is armed."""
PX4_AS_COPTER: Final[dict[Px4Mode, FlightMode]] = {
    **dict.fromkeys(PX4_BY_STICKS, CopterMode.BRAKE),
    Px4Mode.ORBIT: CopterMode.BRAKE,
    Px4Mode.OFFBOARD: CopterMode.GUIDED,
    Px4Mode.TAKEOFF: CopterMode.GUIDED,
    Px4Mode.HOLD: CopterMode.BRAKE,
    Px4Mode.RTL: CopterMode.RTL,
    Px4Mode.LAND: CopterMode.LAND,
}
"""A multirotor's modes, and ArduCopter's: sticks that nobody touches have it stand."""
PX4_NOT_ARMABLE: Final = frozenset({Px4Mode.RTL, Px4Mode.LAND, Px4Mode.ORBIT})


ACTIONS = {1: Mode.RTL, 2: Mode.FBWA, 4: Mode.AUTO, 5: Mode.AUTOLAND}
"""FS_LONG_ACTN: return, glide, AUTO, land; all others fly on."""


class FailsafeKeys(NamedTuple):
    """Names of a family's parameters for the failsafe, and the modes that its actions are."""

    enabled: str
    timeout_s: str
    action: str
    actions: Mapping[int, FlightMode]


LONG_FAILSAFE = FailsafeKeys("FS_GCS_ENABL", "FS_LONG_TIMEOUT", "FS_LONG_ACTN", ACTIONS)
COPTER_ACTIONS = dict.fromkeys((1, 2, 3, 4, 6), CopterMode.RTL) | {5: CopterMode.LAND, 7: CopterMode.BRAKE}
"""FS_GCS_ENABLE: RTL, also for SmartRTL and AUTO, which have nothing to go by; LAND; BRAKE."""
COPTER_FAILSAFE = FailsafeKeys("FS_GCS_ENABLE", "FS_GCS_TIMEOUT", "FS_GCS_ENABLE", COPTER_ACTIONS)
STALE: Final = -1
"""Number of changed parameters for which nothing is known yet."""


class GroundStationFailsafe:
    """Triggers once when heartbeats of MAV_GCS_SYSID stop. New heartbeats clear it, but don't restore the mode."""

    def __init__(self, parameters: ParameterServer, keys: FailsafeKeys) -> None:
        """Wait for a first heartbeat."""
        self._parameters, self._keys = parameters, keys
        self._heard: Instant | None = None
        self.active = False
        self._deadline, self._known = NEVER, STALE
        """When it triggers, as found when so many of the parameters had been set."""

    def heartbeat(self, system: int, now: Instant) -> None:
        """Take a heartbeat."""
        if system == self._parameters["MAV_GCS_SYSID"]:
            self._heard, self._known = now, STALE
            self.active = False

    def deadline(self) -> Instant:
        """Return when it triggers, `NEVER` while it can't."""
        if self._known != self._parameters.changes:
            self._deadline, self._known = self._found(), self._parameters.changes
        return self._deadline

    def _found(self) -> Instant:
        if self._heard is None or self.active or not self._parameters[self._keys.enabled]:
            return NEVER
        return after(self._heard, self._parameters[self._keys.timeout_s])

    def due_mode(self, now: Instant) -> FlightMode | None:
        """Return the mode to change to if it triggers now."""
        if now < self.deadline():
            return None
        self.active, self._known = True, STALE
        return self._keys.actions.get(int(self._parameters[self._keys.action]))
