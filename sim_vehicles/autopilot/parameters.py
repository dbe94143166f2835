"""Parameters, and the protocols with which ground stations read and write them.

Source: MAVLink guide, "Parameter Protocol" and "File Transfer Protocol (FTP)"; ArduPilot documentation, "Complete
Parameter List"; AP_Filesystem's notes on @PARAM/param.pck.
"""

from __future__ import annotations

import math
import struct
from collections import deque
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from airlink import mavlink as m
from airlink.endpoint import Address
from airlink.messages import Message
from airlink.messages.command import FileTransferProtocol, ParamRequestList, ParamRequestRead, ParamSet, ParamValue
from sim_vehicles.autopilot.files import Files
from sim_vehicles.autopilot.missions import Sender

if TYPE_CHECKING:
    from formation_scenario.parameter_files import Parameter

UNINDEXED = 65535
"""Index in the answer to a request by name."""
LOITER_RADIUS_M = 60.0
MAX_VALUE = 3.4e38
MAX_LISTS = 16
"""Lists sent at the same time; a further request gets no answer, as from a busy autopilot."""
SYSTEM_NAMES = ("MAV_SYSID", "SYSID_THISMAV")
"""ArduPilot's parameters of a vehicle's system id, which is the vehicle's own whatever a file says."""
FIXED = frozenset(SYSTEM_NAMES)
"""Parameters that can't be changed without a reboot."""
PARAMETERS_FILE = "@PARAM/param.pck"
_PACK_HEADER = struct.Struct("<HHH")
PACK_MAGIC = 0x671B
PACKED: dict[int, tuple[int, str]] = {
    m.MAV_PARAM_TYPE_INT8: (1, "<b"),
    m.MAV_PARAM_TYPE_INT16: (2, "<h"),
    m.MAV_PARAM_TYPE_INT32: (3, "<i"),
    m.MAV_PARAM_TYPE_REAL32: (4, "<f"),
}
"""MAV_PARAM_TYPE -> the type's number in the file and its `struct` format."""
BITS = {m.MAV_PARAM_TYPE_INT8: 8, m.MAV_PARAM_TYPE_INT16: 16, m.MAV_PARAM_TYPE_INT32: 32}
"""Widths of the integer types."""


class ParameterKind(NamedTuple):
    """A parameter's type, range and initial value.

    A value outside the range is stored and reported as sent, but the nearest bound is used.
    """

    type: int
    minimum: float
    maximum: float
    initial: float


def floating(minimum: float, maximum: float, initial: float) -> ParameterKind:
    """Return a parameter of type float."""
    return ParameterKind(m.MAV_PARAM_TYPE_REAL32, minimum, maximum, initial)


def fence_parameters(kinds: int) -> dict[str, ParameterKind]:
    """Return an ArduPilot's geofence, off at first, with a default of FENCE_TYPE; the emulators don't act on it."""
    return {
        "FENCE_ACTION": ParameterKind(m.MAV_PARAM_TYPE_INT8, 0, 16, 1),
        "FENCE_ALT_MAX": floating(10, 1000, 100),
        "FENCE_ALT_MIN": floating(-100, 100, -10),
        "FENCE_ENABLE": ParameterKind(m.MAV_PARAM_TYPE_INT8, 0, 2, 0),
        "FENCE_RADIUS": floating(30, 10000, 300),
        "FENCE_TYPE": ParameterKind(m.MAV_PARAM_TYPE_INT8, 0, 15, kinds),
    }


def as_in_file(
    kinds: Mapping[str, ParameterKind], file: Mapping[str, Parameter], identity: Sequence[str] = ()
) -> dict[str, ParameterKind]:
    """Return parameters with the initial values of a parameter file, and those that only the file has.

    `identity` names those that a vehicle has of its own, whatever the file says.
    """
    found = dict(kinds)
    for name, given in file.items():
        kind = found.get(name)
        if name in identity:
            continue
        if kind is None:
            type_ = given.type if given.type in PACKED else m.MAV_PARAM_TYPE_REAL32
            found[name] = ParameterKind(int(type_ or m.MAV_PARAM_TYPE_REAL32), -MAX_VALUE, MAX_VALUE, given.value)
        else:
            whole = given.value == int(given.value)
            found[name] = ParameterKind(
                kind.type if whole else m.MAV_PARAM_TYPE_REAL32, kind.minimum, kind.maximum, given.value
            )
    return found


def _stored(kind: int, value: float) -> float:
    """Return a value as stored for a type: integers are truncated, and limited only by their width."""
    if kind not in BITS:
        return value
    beyond = 1 << (BITS[kind] - 1)
    return int(min(max(value, -beyond), beyond - 1))


def _within(kind: ParameterKind, value: float) -> float:
    """Return the value in use: limited to the range of a kind."""
    return min(max(value, kind.minimum), kind.maximum)


class ParameterServer:
    """One vehicle's parameters, and the answers to requests for them."""

    def __init__(
        self, kinds: Mapping[str, ParameterKind], also_named: Mapping[str, tuple[str, float]] | None = None
    ) -> None:
        """Start with initial values; their order is that of their indices in messages.

        `also_named`: names by which pilots ask for parameters that this version has under other ones, in other units.
        """
        self._kinds, self._names = kinds, tuple(kinds)
        self._also_named = also_named or {}
        self._values = {name: kind.initial for name, kind in kinds.items()}
        self._used = {name: _within(kind, kind.initial) for name, kind in kinds.items()}
        self.changes = 0
        """Number of times that a value has been set."""
        self._to_list: deque[tuple[Address, int]] = deque()
        self.files = Files()
        """What it serves by MAVLink FTP."""
        self.files.serve(PARAMETERS_FILE, lambda: packed(self.entries()))

    def prepare(self, values: Mapping[str, float]) -> None:
        """Set those of `values` that this vehicle has, as its owner did before it was first switched on."""
        for name, value in values.items():
            if name in self._kinds:
                self._change(name, value)

    def answers(self, message: Message, sender: Sender) -> list[Message]:
        """Return the answers to a message, if it concerns parameters; a list is sent later."""
        match message:
            case ParamRequestList():
                self.begin_list(sender.peer)
                return []
            case ParamRequestRead():
                value = self.read(message)
            case ParamSet():
                value = self.set(message)
            case FileTransferProtocol():
                payloads = self.files.answer(bytes(message.payload))
                return [FileTransferProtocol(0, sender.system, sender.component, tuple(each)) for each in payloads]
            case _:
                return []
        return [] if value is None else [value]

    def __getitem__(self, name: str) -> float:
        """Return the value in use."""
        own = self._also_named.get(name)
        return self._used[name] if own is None else own[1] * self._used[own[0]]

    def entries(self) -> list[tuple[str, int, float]]:
        """Return the name, MAV_PARAM_TYPE and value of each."""
        return [(name, kind.type, self._values[name]) for name, kind in self._kinds.items()]

    def is_airspeed(self, speed_mps: float) -> bool:
        """Return whether an airspeed is within the limits."""
        return self["AIRSPEED_MIN"] <= speed_mps <= self["AIRSPEED_MAX"]

    @property
    def listing(self) -> bool:
        """Whether a list is being sent."""
        return bool(self._to_list)

    def begin_list(self, peer: Address) -> None:
        """Start sending the list to a peer, from its beginning."""
        self._to_list = deque(entry for entry in self._to_list if entry[0] != peer)
        if len(self._to_list) <= (MAX_LISTS - 1) * len(self._names):
            self._to_list.extend((peer, index) for index in range(len(self._names)))

    def next_of_list(self) -> tuple[Address, ParamValue] | None:
        """Return the next value of a list and its receiver: one per cycle, so that no peer is flooded."""
        if not self._to_list:
            return None
        peer, index = self._to_list.popleft()
        return peer, self._reported(self._names[index], index)

    def read(self, request: ParamRequestRead) -> ParamValue | None:
        """Return the answer to a request by index, or by name if the index is negative; None if there is none."""
        if request.param_index >= 0:
            known = request.param_index < len(self._names)
            return self._reported(self._names[request.param_index], request.param_index) if known else None
        return self._reported(request.param_id, UNINDEXED) if request.param_id in self._kinds else None

    def set(self, request: ParamSet) -> ParamValue | None:
        """Change a value, sent as any type, and return the new one; None if there is no such parameter."""
        name, value = request.param_id, request.param_value
        kind = self._kinds.get(name)
        if kind is None or not math.isfinite(value):
            return None
        if name not in FIXED:
            self._change(name, _stored(kind.type, value))
        return self._reported(name, UNINDEXED)

    def _change(self, name: str, value: float) -> None:
        self._values[name], self._used[name] = value, _within(self._kinds[name], value)
        self.changes += 1

    def _reported(self, name: str, index: int) -> ParamValue:
        kind, value = self._kinds[name].type, self._values[name]
        return ParamValue(
            name, value if kind == m.MAV_PARAM_TYPE_REAL32 else round(value), kind, len(self._names), index
        )


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
