"""Files that an emulated autopilot serves by MAVLink FTP.

Source: MAVLink guide, "File Transfer Protocol (FTP)".
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from enum import IntEnum
from typing import NamedTuple

NO_SESSION, END_OF_FILE, UNKNOWN_COMMAND, NOT_FOUND = 4, 6, 7, 10
"""Reasons of a NAK."""
MAX_SESSIONS = 16
MAX_DATA = 239
_HEADER = struct.Struct("<HBBBBBBI")


class Op(IntEnum):
    """Opcodes of requests and answers."""

    NONE = 0
    TERMINATE = 1
    RESET = 2
    LIST = 3
    OPEN = 4
    READ = 5
    BURST = 15
    ACK = 128
    NAK = 129


class Packet(NamedTuple):
    """One packet, a request or an answer."""

    seq: int
    session: int
    opcode: int
    size: int
    req_opcode: int
    burst_complete: int
    offset: int
    data: bytes

    @classmethod
    def parse(cls, payload: bytes) -> Packet:
        """Return the packet of a message's payload."""
        seq, session, opcode, size, req_opcode, complete, _, offset = _HEADER.unpack_from(payload)
        return cls(seq, session, opcode, size, req_opcode, complete, offset, payload[_HEADER.size :])

    def payload(self) -> bytes:
        """Return the payload of a message."""
        fields = self.seq, self.session, self.opcode, len(self.data), self.req_opcode, self.burst_complete, 0
        return _HEADER.pack(*fields, self.offset) + self.data


class Files:
    """Serves files; a session reads one as it was when it was opened."""

    def __init__(self) -> None:
        """Serve none yet."""
        self._served = dict[str, Callable[[], bytes]]()
        self._open: dict[int, bytes] = {}
        """Content of each open session, by the session number that the ground station chose."""

    def serve(self, name: str, content: Callable[[], bytes]) -> None:
        """Serve a file by its name, with its folder."""
        self._served[name] = content

    def answer(self, payload: bytes) -> Iterator[bytes]:
        """Yield the payloads of the answers to a request's payload."""
        asked = Packet.parse(payload)
        match asked.opcode:
            case Op.NONE:
                yield self._ack(asked)
            case Op.TERMINATE:
                self._open.pop(asked.session, None)
                yield self._ack(asked)
            case Op.RESET:
                self._open.clear()
                yield self._ack(asked)
            case Op.LIST:
                yield self._listed(asked)
            case Op.OPEN:
                yield self._begin(asked)
            case Op.READ | Op.BURST:
                yield from self._read(asked)
            case _:
                yield _nak(asked, UNKNOWN_COMMAND)

    def _listed(self, asked: Packet) -> bytes:
        """Return a folder's entries from an offset on, each as F, name, tab, size; EOF behind the last."""
        folder = _text(asked).rstrip("/") + "/"
        found = [name for name in self._served if name.startswith(folder) and "/" not in name.removeprefix(folder)]
        if not found:
            return _nak(asked, NOT_FOUND)
        entries = [f"F{each.removeprefix(folder)}\t{len(self._served[each]())}\0" for each in sorted(found)]
        listing = "".join(entries[asked.offset :]).encode()[:MAX_DATA]
        return self._ack(asked, listing) if listing else _nak(asked, END_OF_FILE)

    def _begin(self, asked: Packet) -> bytes:
        name = _text(asked).partition("?")[0]
        if name not in self._served:
            return _nak(asked, NOT_FOUND)
        content = self._served[name]()
        if len(self._open) >= MAX_SESSIONS:
            del self._open[next(iter(self._open))]
        self._open[asked.session] = content
        return self._ack(asked, struct.pack("<I", len(content)))

    def _read(self, asked: Packet) -> Iterator[bytes]:
        """Yield one part, or a burst of all parts from an offset on."""
        content = self._open.get(asked.session)
        if content is None:
            yield _nak(asked, NO_SESSION)
            return
        step = min(asked.size, MAX_DATA) or MAX_DATA
        until = len(content) if asked.opcode == Op.BURST else asked.offset + 1
        parts = range(asked.offset, min(until, len(content)), step)
        for number, offset in enumerate(parts):
            ends = int(asked.opcode == Op.BURST and number + 1 == len(parts))
            part = content[offset : offset + step]
            yield Packet(_seq(asked, number), asked.session, Op.ACK, 0, asked.opcode, ends, offset, part).payload()
        if not parts:
            yield _nak(asked, END_OF_FILE)

    def _ack(self, asked: Packet, data: bytes = b"") -> bytes:
        return Packet(_seq(asked), asked.session, Op.ACK, 0, asked.opcode, 0, 0, data).payload()


def _text(asked: Packet) -> str:
    return asked.data[: asked.size].split(b"\0", 1)[0].decode("utf-8", "replace")


def _nak(asked: Packet, error: int) -> bytes:
    return Packet(_seq(asked), asked.session, Op.NAK, 0, asked.opcode, 0, asked.offset, bytes([error])).payload()


def _seq(asked: Packet, number: int = 0) -> int:
    return (asked.seq + 1 + number) % 2**16
