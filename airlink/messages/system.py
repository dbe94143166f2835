"""Messages by which systems show that they are there, compare their clocks and exchange text."""

from typing import NamedTuple

MISSION_TIME = "MISSION_T"
"""Name of the NAMED_VALUE_FLOAT in which the ground station tells vehicles the mission time, s."""


class Heartbeat(NamedTuple):
    """HEARTBEAT (0): the presence of a system, with its type and mode."""

    type: int
    autopilot: int
    base_mode: int = 0
    custom_mode: int = 0
    system_status: int = 0
    mavlink_version: int = 3


class SystemTime(NamedTuple):
    """SYSTEM_TIME (2): the system's wall clock and its time since boot."""

    time_unix_usec: int
    time_boot_s: float


class Timesync(NamedTuple):
    """TIMESYNC (111): a request has tc1 = 0; the answer echoes ts1 and has the answering system's time in tc1."""

    tc1_ns: int
    ts1_ns: int


class AutopilotVersion(NamedTuple):
    """AUTOPILOT_VERSION (148): capabilities (bits of MAV_PROTOCOL_CAPABILITY) and firmware version."""

    capabilities: int
    flight_sw_version: int
    middleware_sw_version: int = 0
    os_sw_version: int = 0
    board_version: int = 0


class NamedValueFloat(NamedTuple):
    """NAMED_VALUE_FLOAT (251): a named value, which autopilots write to their logs."""

    time_boot_s: float
    name: str
    value: float


class Statustext(NamedTuple):
    """STATUSTEXT (253): a text for the operator; the chunks of a longer one share a non-zero id."""

    severity: int
    text: str
    id: int = 0
    chunk_seq: int = 0


class CurrentMode(NamedTuple):
    """CURRENT_MODE (436): the mode, told when it changes, and the one that was asked for."""

    standard_mode: int
    custom_mode: int
    intended_custom_mode: int = 0


SystemMessage = Heartbeat | SystemTime | Timesync | AutopilotVersion | NamedValueFloat | Statustext | CurrentMode
