"""The log that an emulated ArduPilot writes while it is armed, in DataFlash format, and how it is sent.

Messages are a part of the real one's: FMT, MSG, MODE, ATT, POS, ARSP, and in GUIDED OFG (ArduPlane's setpoints as
received). Source: ArduPilot's libraries/AP_Logger/LogStructure.h and ArduPlane/Log.cpp; MAVLink's common message set
(LOG_REQUEST_LIST, LOG_REQUEST_DATA).
"""

from __future__ import annotations

import math
import struct
from typing import Final

from airlink.clock import Instant, after
from airlink.endpoint import Address
from airlink.messages.command import LogData, LogEntry, LogRequestData
from airlink.messages.payload import DEG

LOG_FILE: Final = "APM/LOGS/00000001.BIN"
"""Where it is, for MAVLink FTP."""
HEAD: Final = b"\xa3\x95"
FMT: Final = 128
EVERY_S: Final = 0.1
BLOCK: Final = 90
BLOCKS_A_CYCLE: Final = 5
"""LOG_DATA sent in a cycle of the main loop: 22 kB/s."""
FIELD: Final = {"Q": "Q", "B": "B", "f": "f", "L": "i", "N": "16s", "Z": "64s", "M": "B"}
"""DataFlash's letters and those of `struct`; L is a latitude or longitude in 1e-7 degrees."""
KINDS: Final[dict[str, tuple[int, str, str]]] = {
    "MSG": (1, "QZ", "TimeUS,Message"),
    "MODE": (2, "QMBB", "TimeUS,Mode,ModeNum,Rsn"),
    "ATT": (3, "Qfff", "TimeUS,Roll,Pitch,Yaw"),
    "POS": (4, "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt"),
    "ARSP": (5, "QBf", "TimeUS,I,Airspeed"),
    "OFG": (6, "Qfff", "TimeUS,Arsp,Hdg,Alt"),
}
"""Type, letters and columns of each kind."""


def _packed(number: int, form: str, values: tuple[object, ...]) -> bytes:
    return HEAD + bytes([number]) + struct.pack("<" + form, *values)


def _format(number: int, name: str, letters: str, columns: str) -> bytes:
    size = 3 + struct.calcsize("<" + "".join(FIELD.get(each, "16s") for each in letters))
    values = number, size, name.encode(), letters.encode(), columns.encode()
    return _packed(FMT, "BB4s16s64s", values)


class OnboardLog:
    """One log: the vehicle's first since it was switched on."""

    number: Final = 1

    def __init__(self, firmware: str) -> None:
        """Begin with what describes it."""
        self.content = bytearray(
            _packed(FMT, "BB4s16s64s", (FMT, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns"))
        )
        for name, (number, letters, columns) in KINDS.items():
            self.content += _format(number, name, letters, columns)
        self.put("MSG", 0, f"{firmware} V4.7.0 (emulated)".encode())
        self.next = Instant(0)
        """When it is written to again."""
        self._mode = -1
        self._to_send = list[tuple[Address, int, int]]()
        """To whom, from where and to where it is to be sent."""

    def put(self, kind: str, time_us: int, *values: object) -> None:
        """Write a message."""
        number, letters, _ = KINDS[kind]
        self.content += _packed(number, "".join(FIELD[each] for each in letters), (time_us, *values))

    def due(self, now: Instant) -> bool:
        """Return whether the vehicle's state is to be written; if so, it is due again later."""
        if now < self.next:
            return False
        self.next = after(now, EVERY_S)
        return True

    def write_mode(self, time_us: int, mode: int) -> None:
        """Write a mode if it has changed."""
        if mode != self._mode:
            self._mode = mode
            self.put("MODE", time_us, mode, mode, 0)

    def write_motion(
        self,
        time_us: int,
        attitude_rad: tuple[float, float, float],
        position: tuple[float, float, float, float],
        airspeed_mps: float,
    ) -> None:
        """Write bank, pitch and yaw, latitude and longitude, rad, heights above sea level and home, m, and airspeed."""
        bank, pitch, yaw = (each / DEG for each in attitude_rad)
        self.put("ATT", time_us, bank, pitch, yaw % 360.0)
        lat, lon, alt_m, above_m = position
        self.put("POS", time_us, round(lat / DEG * 1e7), round(lon / DEG * 1e7), alt_m, above_m)
        self.put("ARSP", time_us, 0, airspeed_mps)

    def write_setpoint(self, time_us: int, speed_mps: float, heading_rad: float, alt_m: float) -> None:
        """Write what ArduPlane was commanded in GUIDED."""
        self.put("OFG", time_us, speed_mps, math.degrees(heading_rad) % 360.0, alt_m)

    # How it is sent.

    def copy(self) -> bytes:
        """Return what has been written."""
        return bytes(self.content)

    @property
    def entry(self) -> LogEntry:
        """The list's one entry."""
        return LogEntry(self.number, 1, self.number, 0, len(self.content))

    def ask(self, peer: Address, request: LogRequestData) -> None:
        """Begin to send a part; another request of the same peer ends the one before."""
        self.stop(peer)
        until = min(request.ofs + request.count, len(self.content))
        if request.id == self.number:
            self._to_send.append((peer, request.ofs, until))

    def stop(self, peer: Address) -> None:
        """Send no more."""
        self._to_send = [each for each in self._to_send if each[0] != peer]

    @property
    def sending(self) -> bool:
        """Whether a part is being sent."""
        return bool(self._to_send)

    def next_blocks(self) -> list[tuple[Address, LogData]]:
        """Return the messages of one cycle of the main loop; a part's end is a block that isn't full."""
        found = list[tuple[Address, LogData]]()
        while self._to_send and len(found) < BLOCKS_A_CYCLE:
            peer, begin, until = self._to_send.pop(0)
            data = bytes(self.content[begin : min(begin + BLOCK, until)])
            found.append((peer, LogData(self.number, begin, len(data), tuple(data))))
            if len(data) == BLOCK:
                self._to_send.insert(0, (peer, begin + BLOCK, until))
        return found
