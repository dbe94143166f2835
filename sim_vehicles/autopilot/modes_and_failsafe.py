"""An emulated vehicle's conditions and modes with a table of all transitions, and the failsafe that changes modes.

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
    """The emulated ArduPlane modes, with ArduPlane's numbers."""

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
    """The emulated ArduCopter modes, with ArduCopter's numbers."""

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
    """The emulated PX4 modes, as HEARTBEAT's custom_mode: the main mode's number, above it the sub mode's."""

    MANUAL = 0x00010000
    ALTITUDE = 0x00020000
    POSITION = 0x00030000
    ACRO = 0x00050000
    OFFBOARD = 0x00060000
    STABILIZED = 0x00070000
    ORBIT = 0x01030000
    TAKEOFF = 0x02040000
    HOLD = 0x03040000
    MISSION = 0x04040000
    RTL = 0x05040000
    LAND = 0x06040000
    GUIDED_COURSE = 0x13040000


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
        """Whether the autopilot is still booting."""
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
"""Modes flown by sticks; as no one moves these, the vehicle flies straight and level."""


def select(condition: Condition, mode: float, selectable: frozenset[int] = SELECTABLE) -> int | None:
    """Return the number of the mode to which a request leads, None if it's refused."""
    return None if condition.booting or mode not in selectable else int(mode)


CALIBRATING: Final = m.MAV_STATE_CALIBRATING
ACTIVE: Final = m.MAV_STATE_ACTIVE
STANDBY: Final = m.MAV_STATE_STANDBY


def system_status(condition: Condition) -> int:
    """Return the MAV_STATE of a condition."""
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
"""ArduCopter's modes in which a transmitter's throttle sets the climb; as there is no transmitter, they descend."""
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
    Px4Mode.MISSION: Mode.AUTO,
    Px4Mode.RTL: Mode.RTL,
}
"""A fixed wing's modes, and ArduPlane's that fly alike. PX4's mode LAND isn't emulated; it lands by its mission."""
PX4_BY_STICKS: Final = frozenset({Px4Mode.MANUAL, Px4Mode.ALTITUDE, Px4Mode.POSITION, Px4Mode.ACRO, Px4Mode.STABILIZED})
"""Modes that need a transmitter once the vehicle is armed."""
PX4_AS_COPTER: Final[dict[Px4Mode, FlightMode]] = {
    **dict.fromkeys(PX4_BY_STICKS, CopterMode.BRAKE),
    Px4Mode.ORBIT: CopterMode.BRAKE,
    Px4Mode.OFFBOARD: CopterMode.GUIDED,
    Px4Mode.TAKEOFF: CopterMode.GUIDED,
    Px4Mode.HOLD: CopterMode.BRAKE,
    Px4Mode.RTL: CopterMode.RTL,
    Px4Mode.LAND: CopterMode.LAND,
}
"""A multirotor's modes, and ArduCopter's that fly alike: with sticks untouched it hovers."""
PX4_NOT_ARMABLE: Final = frozenset({Px4Mode.RTL, Px4Mode.LAND, Px4Mode.ORBIT, Px4Mode.MISSION})


PLANE_NOT_ARMABLE = frozenset({Mode.RTL, Mode.INITIALISING})
"""ArduPlane's modes in which it can't be armed (`Mode::_pre_arm_checks`)."""
ACTIONS = {1: Mode.RTL, 2: Mode.FBWA, 4: Mode.AUTO, 5: Mode.AUTOLAND}
"""FS_LONG_ACTN: RTL, glide, AUTO, land."""
GOES_ON = frozenset({Mode.GUIDED, Mode.AUTO})
"""Modes that other values of FS_LONG_ACTN continue; from all others than RTL they lead to RTL too."""


def long_action(mode: FlightMode, action: int) -> FlightMode | None:
    """Return the mode to which ArduPlane's long failsafe leads from a mode, on the ground as in the air, or None.

    Source: ArduPlane, `failsafe_long_on_event`.
    """
    if mode is Mode.INITIALISING or mode is Mode.AUTOLAND:
        return None
    if mode is Mode.RTL:
        return ACTIONS[action] if action in (4, 5) else None
    return ACTIONS.get(action, None if mode in GOES_ON else Mode.RTL)


class FailsafeKeys(NamedTuple):
    """Names of a family's failsafe parameters, and the modes of its actions."""

    enabled: str
    timeout_s: str
    action: str
    actions: Mapping[int, FlightMode]


LONG_FAILSAFE = FailsafeKeys("FS_GCS_ENABL", "FS_LONG_TIMEOUT", "FS_LONG_ACTN", ACTIONS)
COPTER_ACTIONS = dict.fromkeys((1, 2, 3, 4, 6), CopterMode.RTL) | {5: CopterMode.LAND, 7: CopterMode.BRAKE}
"""FS_GCS_ENABLE: RTL, also in place of SmartRTL and AUTO, which lack a recorded path or mission; LAND; BRAKE."""
COPTER_FAILSAFE = FailsafeKeys("FS_GCS_ENABLE", "FS_GCS_TIMEOUT", "FS_GCS_ENABLE", COPTER_ACTIONS)
STALE: Final = -1
"""Change count for which the deadline hasn't been computed."""


class GroundStationFailsafe:
    """Triggers once when heartbeats of MAV_GCS_SYSID stop. New heartbeats clear it, but don't restore the mode."""

    def __init__(self, parameters: ParameterServer, keys: FailsafeKeys, since: Instant | None = None) -> None:
        """Start waiting: from `since`, as an ArduPlane from its boot on, or only after a first heartbeat."""
        self._parameters, self._keys = parameters, keys
        self._heartbeat_at = since
        self.active = False
        self._deadline, self._known = NEVER, STALE
        """When it triggers, and the parameters' change count for which this was computed."""

    def heartbeat(self, system: int, now: Instant) -> None:
        """Take a heartbeat."""
        if system == self._parameters["MAV_GCS_SYSID"]:
            self._heartbeat_at, self._known = now, STALE
            self.active = False

    def deadline(self) -> Instant:
        """Return when it triggers, `NEVER` while it can't."""
        if self._known != self._parameters.changes:
            self._deadline, self._known = self._found(), self._parameters.changes
        return self._deadline

    def _found(self) -> Instant:
        if self._heartbeat_at is None or self.active or not self._parameters[self._keys.enabled]:
            return NEVER
        return after(self._heartbeat_at, self._parameters[self._keys.timeout_s])

    @property
    def action(self) -> int:
        """The parameter's value that says what it does."""
        return int(self._parameters[self._keys.action])

    def trigger(self) -> FlightMode | None:
        """Trigger, once `deadline` has come; return the mode of its action, None if that is none."""
        self.active, self._known = True, STALE
        return self._keys.actions.get(self.action)
