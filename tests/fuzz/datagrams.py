"""Datagrams that nobody should send, from one seed: noise, damaged frames, strangers' frames, forged ones."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import NamedTuple

from airlink.mavlink import base_lengths
from tests.airlink.layouts import Layout
from tests.fuzz.frames import EXTRAS, LAYOUTS, Header, extremes, framed, packed

FOREIGN_SYSTEMS = (0, 42, 77, 200, 253, 254, 255)
FOREIGN_TARGET = 77
LONGEST_NOISE = 300
LONGEST_PAYLOAD = 255
MARKERS = (b"\xfd", b"\xfe")
BEGINNINGS = (b"\xfe", b"\xfe\xff\x00\xc8\x01\x1e", b"\xfd\xff\x00\x00\x00\xc8\x01\x1e\x00\x00")
"""Beginnings of strangers' longest frames; in a row, each begins inside many others."""
MOST_BEGINNINGS = 600
"""Their length in bytes."""
POOL = 4096
"""Number of valid frames that are kept to be damaged; each use replaces one."""


class Names(NamedTuple):
    """Names of senders and targets of frames."""

    systems: tuple[int, ...]
    target: int


FOREIGN = Names(FOREIGN_SYSTEMS, FOREIGN_TARGET)


class Hostile:
    """A source of datagrams.

    They don't concern the formation: a frame with a valid checksum is from a system outside it, to one outside it. With
    `forged`, a share of them are valid frames in others' names, of every message, with any values.
    """

    def __init__(self, seed: int, forged: Names | None = None, share: float = 0.5) -> None:
        """Draw from a random stream of its own."""
        self._random = random.Random(seed)
        self._forged, self._share = forged, share
        self._pool = [self._sound(FOREIGN) for _ in range(POOL)]
        self._damages: tuple[Callable[[bytes], bytes], ...] = (
            self._flipped,
            self._cut,
            self._joined,
            self._wrong_checksum,
            self._wrong_length,
            self._unknown,
            self._incompatible,
            self._overlapped,
        )

    def datagram(self) -> bytes:
        """Return the next one."""
        draw = self._random.random()
        if self._forged is not None and draw < self._share:
            return self._sound(self._forged)
        kind = self._random.randrange(10)
        if kind == 0:
            return self._noise()
        place = self._random.randrange(POOL)
        frame, self._pool[place] = self._pool[place], self._sound(FOREIGN)
        return frame if kind < 3 else self._random.choice(self._damages)(frame)

    def _sound(self, names: Names) -> bytes:
        """Return a frame with a valid checksum: of a message that we have a class for, or of any other."""
        draw = self._random
        version = 1 if draw.random() < 0.25 else 2
        component, sequence = draw.choice((1, 1, 1, 0, 190, 255)), draw.randrange(256)
        header = Header(draw.choice(names.systems), component, sequence, version, draw.random() < 0.2)
        if draw.random() < 0.1:
            message_id = draw.choice(_OTHERS_OF_VERSION_1 if version == 1 else _OTHERS)
            length = base_lengths()[message_id] if version == 1 else draw.randrange(256)
            return framed(message_id, draw.randbytes(length), header)
        layout = draw.choice(LAYOUTS)
        payload = self._payload(layout)
        if version == 2 and draw.random() < 0.3:
            cut = payload[: draw.randrange(len(payload) + 1)]
            payload = (cut + draw.randbytes(draw.choice((0, 0, 9))))[:LONGEST_PAYLOAD]
        return framed(layout.message_id, _retargeted(layout, payload, names.target), header)

    def _payload(self, layout: Layout) -> bytes:
        draw = self._random
        if draw.random() < 0.5:
            return draw.randbytes(layout.packer.size)
        kinds = zip(layout.fields, layout.types, strict=True)
        return packed(layout, {field: draw.choice(extremes(kind)) for field, kind in kinds})

    # Damage.

    def _noise(self) -> bytes:
        draw = self._random
        return draw.choice((b"", *MARKERS)) + draw.randbytes(draw.randrange(LONGEST_NOISE))

    def _flipped(self, frame: bytes) -> bytes:
        """Return the frame with up to three bits flipped; a CRC-16 detects them all, so it's never valid."""
        damaged = bytearray(frame)
        for place in self._random.sample(range(8 * len(frame)), self._random.randint(1, 3)):
            damaged[place // 8] ^= 1 << place % 8
        return bytes(damaged)

    def _cut(self, frame: bytes) -> bytes:
        return frame[: self._random.randrange(len(frame))]

    def _joined(self, frame: bytes) -> bytes:
        others = [self._random.choice(self._pool) for _ in range(self._random.randint(1, 4))]
        return self._noise().join([frame, *others])

    def _wrong_checksum(self, frame: bytes) -> bytes:
        end = len(frame) - (13 if frame[0] == 0xFD and frame[2] & 1 else 0)
        return frame[: end - 2] + bytes([frame[end - 2] ^ self._random.randint(1, 255)]) + frame[end - 1 :]

    def _wrong_length(self, frame: bytes) -> bytes:
        return frame[:1] + bytes([self._random.randrange(256)]) + frame[2:]

    def _unknown(self, frame: bytes) -> bytes:
        payload = self._random.randbytes(self._random.randrange(LONGEST_PAYLOAD))
        return framed(self._random.randrange(2**24) | 2**23, payload, Header(frame[3]))

    def _incompatible(self, frame: bytes) -> bytes:
        return frame[:2] + bytes([self._random.randrange(2, 256)]) + frame[3:]

    def _overlapped(self, frame: bytes) -> bytes:
        beginning = self._random.choice(BEGINNINGS)
        return beginning * (self._random.randrange(MOST_BEGINNINGS) // len(beginning)) + frame


_OTHERS = sorted(EXTRAS.keys() - {layout.message_id for layout in LAYOUTS})
_OTHERS_OF_VERSION_1 = [message_id for message_id in _OTHERS if message_id <= 0xFF]
"""Ids that fit into the one byte of version 1: cut to a byte, a longer one might be that of a command."""


def _retargeted(layout: Layout, payload: bytes, target: int) -> bytes:
    """Return the payload with the target system set, as far as the payload reaches."""
    offset = _TARGET_OFFSETS[layout.message_id]
    if offset is None:
        return payload
    return payload[:offset].ljust(offset, b"\0") + bytes([target]) + payload[offset + 1 :]


def _target_offset(layout: Layout) -> int | None:
    """Return the offset of a payload's target system: the one byte that changes with it."""
    if "target_system" not in layout.fields:
        return None
    zero, other = packed(layout, {}), packed(layout, {"target_system": 255})
    return next(place for place in range(len(zero)) if zero[place] != other[place])


_TARGET_OFFSETS = {layout.message_id: _target_offset(layout) for layout in LAYOUTS}
