"""What ground stations read from and write to a vehicle: parameters, singly and as a file (FTP), and the mission.

Sources: MAVLink guide, "File Transfer Protocol (FTP)"; ArduPilot, AP_Filesystem's notes on @PARAM/param.pck.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from enum import IntEnum
from typing import NamedTuple

from airlink import mavlink as m
from airlink.clock import Instant
from airlink.messages import Message
from airlink.messages.mission import MissionMessage
from airlink.messages.parameter import FileTransferProtocol, ParamRequestList, ParamRequestRead, ParamSet
from sim_vehicles.autopilot.missions import Missions, Sender
from sim_vehicles.autopilot.parameters import ParameterServer

PARAMETERS_FILE = "@PARAM/param.pck"
NO_SESSION, END_OF_FILE, UNKNOWN_COMMAND, NOT_FOUND = 4, 6, 7, 10
"""Reasons of a NAK."""
MOST_SESSIONS = 16
MOST_DATA = 239
_HEADER = struct.Struct("<HBBBBBBI")
_PACK_HEADER = struct.Struct("<HHH")
PACK_MAGIC = 0x671B
PACKED: dict[int, tuple[int, str]] = {
    m.MAV_PARAM_TYPE_INT8: (1, "<b"),
    m.MAV_PARAM_TYPE_INT16: (2, "<h"),
    m.MAV_PARAM_TYPE_INT32: (3, "<i"),
    m.MAV_PARAM_TYPE_REAL32: (4, "<f"),
}
"""MAV_PARAM_TYPE -> the type's number in the file and its `struct` format."""


class Op(IntEnum):
    """Opcodes of requests and answers."""

    NONE = 0
    TERMINATE = 1
    RESET = 2
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
    """Serves the file; a session reads the values as they were when it opened the file."""

    def __init__(self, parameters: Callable[[], list[tuple[str, int, float]]]) -> None:
        """Serve `parameters`: name, MAV_PARAM_TYPE and value of each."""
        self._parameters = parameters
        self._open: dict[int, bytes] = {}
        """Content of each open session, by the session number that the ground station chose."""

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
            case Op.OPEN:
                yield self._begin(asked)
            case Op.READ | Op.BURST:
                yield from self._read(asked)
            case _:
                yield _nak(asked, UNKNOWN_COMMAND)

    def _begin(self, asked: Packet) -> bytes:
        name = asked.data[: asked.size].split(b"\0", 1)[0].decode("utf-8", "replace").partition("?")[0]
        if name != PARAMETERS_FILE:
            return _nak(asked, NOT_FOUND)
        content = packed(self._parameters())
        if len(self._open) >= MOST_SESSIONS:
            del self._open[next(iter(self._open))]
        self._open[asked.session] = content
        return self._ack(asked, struct.pack("<I", len(content)))

    def _read(self, asked: Packet) -> Iterator[bytes]:
        """Yield one part, or a burst of all parts from an offset on."""
        content = self._open.get(asked.session)
        if content is None:
            yield _nak(asked, NO_SESSION)
            return
        step = min(asked.size, MOST_DATA) or MOST_DATA
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


def packed(parameters: list[tuple[str, int, float]]) -> bytes:
    """Return the file: all parameters by name, each name without the prefix that it shares with the previous one."""
    content, last = _PACK_HEADER.pack(PACK_MAGIC, len(parameters), len(parameters)), ""
    for name, kind, value in sorted(parameters):
        common = next(
            (i for i, (a, b) in enumerate(zip(name, last, strict=False)) if a != b), min(len(name), len(last))
        )
        common = min(common, len(name) - 1)
        number, form = PACKED[kind]
        own = name[common:].encode()
        whole = value if kind == m.MAV_PARAM_TYPE_REAL32 else round(value)
        content += bytes([number, common | (len(own) - 1) << 4]) + own + struct.pack(form, whole)
        last = name
    return content


def _nak(asked: Packet, error: int) -> bytes:
    return Packet(_seq(asked), asked.session, Op.NAK, 0, asked.opcode, 0, asked.offset, bytes([error])).payload()


def _seq(asked: Packet, number: int = 0) -> int:
    return (asked.seq + 1 + number) % 2**16


class Storage:
    """Answers requests to read or write."""

    def __init__(self, parameters: ParameterServer, missions: Missions) -> None:
        """Serve both."""
        self._parameters = parameters
        self._missions = missions
        self._files = Files(parameters.entries)

    def answers(self, message: Message | None, sender: Sender, now: Instant) -> list[Message]:
        """Return the answers to a message, none if it is no such request; a list of parameters is sent later."""
        match message:
            case ParamRequestList():
                self._parameters.begin_list(sender.peer)
                return []
            case ParamRequestRead():
                value = self._parameters.read(message)
            case ParamSet():
                value = self._parameters.set(message)
            case FileTransferProtocol():
                payloads = self._files.answer(bytes(message.payload))
                return [FileTransferProtocol(0, sender.system, sender.component, tuple(each)) for each in payloads]
            case _ if isinstance(message, MissionMessage):
                return self._missions.take(message, sender, now)
            case _:
                return []
        return [] if value is None else [value]
