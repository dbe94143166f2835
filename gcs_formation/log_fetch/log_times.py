"""When a log's messages were written, by the autopilot's own clock: it tells whether that has restarted since.

Sources: ArduPilot's libraries/AP_Logger/LogStructure.h; PX4's ULog file format.
"""

from __future__ import annotations

import struct
from typing import Final

HEAD: Final = b"\xa3\x95"
FMT: Final = 0x80
FMT_BYTES: Final = 89
ULOG: Final = b"ULog\x01\x12\x35"
_TIME: Final = struct.Struct("<Q")
BY_TIME: Final = b"TimeUS"
MICROSECONDS: Final = 1e-6


def last_s(content: bytes) -> float | None:
    """Return the latest time in a log, s since boot: of an ArduPilot's its last one, of a PX4's its first.

    None if it has none.
    """
    if content.startswith(ULOG) and len(content) >= len(ULOG) + 1 + _TIME.size:
        return float(_TIME.unpack_from(content, len(ULOG) + 1)[0]) * MICROSECONDS
    lengths, timed, latest, at = {FMT: FMT_BYTES}, set[int](), -1, content.find(HEAD)
    while 0 <= at <= len(content) - 3:
        length = lengths.get(content[at + 2])
        if content[at : at + 2] != HEAD or length is None:
            at = content.find(HEAD, at + 1)
            continue
        body = content[at + 3 : at + length]
        if content[at + 2] == FMT and len(body) == FMT_BYTES - 3:
            lengths[body[0]] = max(body[1], 3)
            timed |= {body[0]} if body[22:].startswith(BY_TIME) and body[6:7] == b"Q" else set()
        elif content[at + 2] in timed and len(body) >= _TIME.size:
            latest = max(latest, _TIME.unpack_from(body)[0])
        at += length
    return latest * MICROSECONDS if latest >= 0 else None
