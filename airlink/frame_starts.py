"""Where in arbitrary bytes a frame of a known message may begin, by its header alone.

A parser that tries every marker byte by its checksum does much work for bytes that are no frames: in a flood of markers
a candidate begins at each byte. Nearly all of these are excluded by their headers, for all bytes at once.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from airlink.mavlink import base_lengths

MARKER_V1: Final = 0xFE
MARKER_V2: Final = 0xFD
HEADER_V1: Final = 6
HEADER_V2: Final = 10
KNOWN_FLAGS: Final = 0x01
"""The only incompatibility flag that there is: a signature."""
EXTENDED: Final = 64
"""Most bytes by which a frame of MAVLink 1 is longer than its message there: pymavlink sends extension fields too."""
IDS: Final = 0x10000
"""Message ids from here on are none of the dialect's."""


def _lengths_and_ids() -> tuple[np.ndarray, np.ndarray]:
    """Return whether a frame of MAVLink 1 may have a length (row) and an id (column); and which ids are known."""
    of_v1, known = np.zeros((256, 256), bool), np.zeros(IDS, bool)
    for message_id, length in base_lengths().items():
        known[message_id] = True
        if message_id < len(of_v1):
            of_v1[length : length + EXTENDED, message_id] = True
    return of_v1, known


_OF_V1, _KNOWN = _lengths_and_ids()


def frame_starts(data: bytes) -> list[int]:
    """Return the positions at which a frame may begin, in order; a marker whose header isn't complete is one.

    A frame of MAVLink 1 has its message's length, or a few bytes more. One of MAVLink 2 may be truncated or have newer
    extension fields, so only its flags and its id are compared. Source: MAVLink guide, "Packet Serialization".
    """
    raw = np.frombuffer(data, np.uint8)
    first, second = np.flatnonzero(raw == MARKER_V1), np.flatnonzero(raw == MARKER_V2)
    known_to = len(raw) - HEADER_V1
    whole, cut = first[first <= known_to], first[first > known_to]
    found = [cut, whole[_OF_V1[raw[whole + 1], raw[whole + 5]]]]
    known_to = len(raw) - HEADER_V2
    whole, cut = second[second <= known_to], second[second > known_to]
    whole = whole[(raw[whole + 2] <= KNOWN_FLAGS) & (raw[whole + 9] == 0)]
    found += [cut, whole[_KNOWN[raw[whole + 7] | raw[whole + 8].astype(np.uint16) << 8]]]
    starts: list[int] = np.sort(np.concatenate(found)).tolist()
    return starts
