"""An emulated vehicle's conditions and modes with a table of all transitions.

Source: ArduPilot documentation, "Flight Modes" of Plane and Copter.
"""

from __future__ import annotations

from enum import Enum, IntEnum
from typing import Final

from airlink import mavlink as m


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
    {
        CopterMode.AUTO,
        CopterMode.RTL,
        CopterMode.CIRCLE,
        CopterMode.LAND,
        CopterMode.BRAKE,
        CopterMode.SMART_RTL,
    }
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
