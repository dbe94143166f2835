"""The newest telemetry of one vehicle."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

from airlink import mavlink as m
from airlink.messages import Message
from airlink.messages.system import Heartbeat, Statustext
from airlink.messages.telemetry import (
    Attitude,
    EkfStatusReport,
    ExtendedSysState,
    GlobalPositionInt,
    HomePosition,
    SysStatus,
    VfrHud,
)
from flight_model.earth import GeodeticOrigin

KEPT_TEXTS = 8
TEXT_BYTES = 50
"""Length of STATUSTEXT's field: a text that fills it goes on in another message with its id."""
SPEED_LIMIT_MPS = 400.0
ANGLE_LIMIT_RAD = 2 * math.pi
TURN_LIMIT_RPS = 50.0
ALTITUDE_LIMIT_M = 100e3
"""Limits beyond which a state isn't an aircraft's, even if it is finite."""
WITHOUT_HEADING = GlobalPositionInt._fields.index("hdg_rad")


class Motion(NamedTuple):
    """Position and motion at one stamp of the vehicle's clock: NED from the origin, height upwards."""

    stamp_s: float
    north_m: float
    east_m: float
    height_m: float
    north_mps: float
    east_mps: float
    climb_mps: float
    above_home_m: float


@dataclass
class Telemetry:
    """The newest of each message; `updates` counts positions, so that a reader notices a new one."""

    origin: GeodeticOrigin
    motion: Motion | None = None
    attitude: Attitude | None = None
    airspeed_mps: float = math.nan
    airspeed_stamp_s: float = math.nan
    """Stamp of the newest position when the airspeed came: its own message has none."""
    heartbeat: Heartbeat | None = None
    heartbeats: int = 0
    ekf_flags: int = 0
    sensors_healthy: int = 0
    landed_state: int = m.MAV_LANDED_STATE_UNDEFINED
    home_m: tuple[float, float] | None = None
    """Its home, north and east of the origin, if it has told."""
    updates: int = 0
    implausible: int = 0
    """Messages that were dropped because they can't be an aircraft's."""
    texts: deque[str] = field(default_factory=lambda: deque[str](maxlen=KEPT_TEXTS))
    texts_told: int = 0
    """Counts the texts that have come to their end."""
    _chunks: tuple[int, str] = (0, "")
    """Id and beginning of a text whose end is still to come."""

    def take(self, message: Message) -> None:
        """Store the state in `message`; values that aren't finite or plausible are dropped and counted."""
        match message:
            case GlobalPositionInt() if message.lat_rad == message.lon_rad == 0.0:
                pass  # what an autopilot says that has no fix
            case GlobalPositionInt() if _is_position(message):
                self._take_position(message)
            case Attitude() if _is_attitude(message):
                self.attitude = message
            case VfrHud() if 0.0 <= message.airspeed_mps <= SPEED_LIMIT_MPS:
                self.airspeed_mps = message.airspeed_mps
                self.airspeed_stamp_s = self.motion.stamp_s if self.motion else math.nan
            case Heartbeat():
                self.heartbeat = message
                self.heartbeats += 1
            case EkfStatusReport():
                self.ekf_flags = message.flags
            case SysStatus():
                self.sensors_healthy = message.onboard_control_sensors_health
            case ExtendedSysState():
                self.landed_state = message.landed_state
            case HomePosition():
                self.home_m = self.origin.to_ned(message.latitude_rad, message.longitude_rad, message.altitude_m)[:2]
            case Statustext():
                self._take_text(message)
            case GlobalPositionInt() | Attitude() | VfrHud():
                self.implausible += 1
            case _:
                pass

    def _take_position(self, message: GlobalPositionInt) -> None:
        north_m, east_m, down_m = self.origin.to_ned(message.lat_rad, message.lon_rad, message.alt_m)
        self.motion = Motion(
            message.time_boot_s,
            float(north_m),
            float(east_m),
            -float(down_m),
            message.vx_mps,
            message.vy_mps,
            -message.vz_mps,
            message.relative_alt_m,
        )
        if math.isnan(self.airspeed_stamp_s):
            self.airspeed_stamp_s = message.time_boot_s
        self.updates += 1

    def _take_text(self, message: Statustext) -> None:
        """Store a text once its last chunk has come: the one that doesn't fill its field."""
        number, begun = self._chunks
        text = (begun if message.id and message.id == number else "") + message.text
        if message.id and len(message.text.encode()) >= TEXT_BYTES:
            self._chunks = message.id, text
            return
        self._chunks = 0, ""
        self.texts.append(_printable(text.strip()))
        self.texts_told += 1

    def forget(self) -> None:
        """Forget everything that a restart makes untrue."""
        self.motion = self.attitude = self.heartbeat = None
        self.airspeed_mps = self.airspeed_stamp_s = math.nan
        self.ekf_flags = self.sensors_healthy = 0
        self.landed_state, self.home_m = m.MAV_LANDED_STATE_UNDEFINED, None

    @property
    def complete(self) -> bool:
        """Whether all that the law needs has come."""
        return self.motion is not None and self.attitude is not None and math.isfinite(self.airspeed_mps)

    @property
    def armed(self) -> bool:
        """Whether the motors are armed."""
        return self.heartbeat is not None and bool(self.heartbeat.base_mode & m.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def custom_mode(self) -> int | None:
        """The autopilot's own mode number, None before the first heartbeat."""
        return self.heartbeat.custom_mode if self.heartbeat else None


def _is_position(message: GlobalPositionInt) -> bool:
    """Whether it's a place on Earth, or in its air."""
    on_earth = abs(message.lat_rad) < math.pi / 2 and abs(message.lon_rad) <= math.pi
    in_air = abs(message.alt_m) <= ALTITUDE_LIMIT_M and abs(message.relative_alt_m) <= ALTITUDE_LIMIT_M
    return on_earth and in_air and all(map(math.isfinite, message[:WITHOUT_HEADING]))


def _is_attitude(message: Attitude) -> bool:
    angles, rates = message[1:4], message[4:]
    within = all(abs(angle) <= ANGLE_LIMIT_RAD for angle in angles) and all(
        abs(rate) <= TURN_LIMIT_RPS for rate in rates
    )
    return math.isfinite(message.time_boot_s) and within


def _printable(text: str) -> str:
    """Return the text with control characters replaced."""
    return "".join(letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in text)
