"""Write the modules of `airlink.messages`: a class for each message below, with its fields in SI units.

    python -m tests.airlink.generate_messages

Names, types, units and offsets of the fields are the dialect's (`layouts.json`).
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import airlink
from tests.airlink.layouts import Layout, layout

HERE = Path(airlink.__file__).parent / "messages"
WRITE = "python -m tests.airlink.generate_messages"


@dataclass(frozen=True)
class Declared:
    """A message that we use."""

    name: str
    text: str
    """Its docstring."""
    last: str = ""
    """The last field that anything here needs; later ones are sent as 0."""
    optional: str = ""
    """The first field with a default; all after it have one too: 0, unless `defaults` gives another."""
    defaults: Mapping[str, str] = field(default_factory=dict[str, str])


@dataclass(frozen=True)
class Module:
    """One of MAVLink's services, or a group of them."""

    text: str
    messages: tuple[Declared, ...]


MODULES = {
    "system": Module(
        "Messages by which systems show that they are there, compare their clocks and exchange text.",
        (
            Declared(
                "HEARTBEAT",
                "the presence of a system, with its type and mode.",
                optional="base_mode",
                defaults={"mavlink_version": "3"},
            ),
            Declared("SYSTEM_TIME", "the system's wall clock and its time since boot."),
            Declared(
                "TIMESYNC",
                "a request has tc1 = 0; the answer echoes ts1 and has the answering system's time in tc1.",
                optional="target_system",
            ),
            Declared("PING", "a request has target 0; the answer echoes it to its sender."),
            Declared(
                "AUTOPILOT_VERSION",
                "capabilities (bits of MAV_PROTOCOL_CAPABILITY) and firmware version.",
                last="board_version",
                optional="middleware_sw_version",
            ),
            Declared("NAMED_VALUE_FLOAT", "a named value, which autopilots write to their logs."),
            Declared("SETUP_SIGNING", "a key for signed frames; all zeros: nothing is signed any more."),
            Declared(
                "RADIO_STATUS",
                "a radio's signal and noise, here and at the other end, free buffer (`txbuf`, %), errors.",
            ),
            Declared(
                "STATUSTEXT", "a text for the operator; the chunks of a longer one share a non-zero id.", optional="id"
            ),
            Declared(
                "CURRENT_MODE",
                "the mode, sent when it changes, and the one that was asked for.",
                optional="intended_custom_mode",
            ),
        ),
    ),
    "telemetry": Module(
        "Messages in which a vehicle reports its state.",
        (
            Declared(
                "SYS_STATUS",
                "sensors present, enabled and healthy (bits of MAV_SYS_STATUS_SENSOR), and the battery.",
                last="battery_remaining",
                optional="load",
                defaults={"voltage_battery_v": "math.nan", "battery_remaining": "-1"},
            ),
            Declared("GPS_RAW_INT", "the receiver's fix.", last="satellites_visible"),
            Declared("ATTITUDE", "roll, pitch, yaw and the body's rates."),
            Declared("LOCAL_POSITION_NED", "position and ground velocity from the estimator's origin, NED."),
            Declared("GLOBAL_POSITION_INT", "filtered position, height above sea level and home, NED ground velocity."),
            Declared("NAV_CONTROLLER_OUTPUT", "the setpoints and errors of the fixed-wing navigation controllers."),
            Declared("VFR_HUD", "airspeed, ground speed, compass heading, height above sea level, climb rate."),
            Declared(
                "BATTERY_STATUS",
                "one battery; its cells' voltages, or its total in the first element, NaN for the rest.",
                last="time_remaining",
                optional="time_remaining",
            ),
            Declared(
                "WIND", "the autopilot's wind estimate: the direction it comes from, its speed, its downward speed."
            ),
            Declared(
                "EKF_STATUS_REPORT",
                "which estimates are good (bits of EKF_STATUS_FLAGS), and their variances.",
                optional="airspeed_variance",
            ),
            Declared(
                "ESTIMATOR_STATUS",
                "which estimates are good, and innovations as shares of their gates.",
            ),
            Declared("HOME_POSITION", "the home position.", optional="approach_x_m"),
            Declared("EXTENDED_SYS_STATE", "on the ground or in the air (MAV_LANDED_STATE)."),
        ),
    ),
    "command": Module(
        """Messages that command a vehicle, set which messages it streams, and read its parameters or files.

Source: MAVLink guide, "Command Protocol", "Requesting Data From Vehicles", "Parameter Protocol" and "File Transfer
Protocol (FTP)".
""",
        (
            Declared(
                "COMMAND_INT",
                "a command whose position is in scaled integers; the command defines the units.",
                optional="current",
            ),
            Declared(
                "COMMAND_LONG",
                "a command with seven float parameters; the command defines their units.",
                optional="confirmation",
            ),
            Declared(
                "COMMAND_ACK",
                "the result of a command (MAV_RESULT), and the system that it answers.",
                optional="progress",
            ),
            Declared("SET_MODE", "the predecessor of MAV_CMD_DO_SET_MODE, which ground stations still send."),
            Declared("REQUEST_DATA_STREAM", "the older request for groups of messages at a rate."),
            Declared("MESSAGE_INTERVAL", "the interval at which a message is sent; 0: unavailable, -1: not sent."),
            Declared(
                "SET_POSITION_TARGET_LOCAL_NED",
                "a setpoint of velocity and yaw; `type_mask` says which fields don't count.",
                optional="x_m",
            ),
            Declared(
                "SET_POSITION_TARGET_GLOBAL_INT",
                "a setpoint by latitude and longitude; `type_mask` leaves fields out.",
            ),
            Declared(
                "PARAM_REQUEST_READ",
                "one parameter, by name or, where index isn't -1, by index.",
                optional="param_index",
                defaults={"param_index": "-1"},
            ),
            Declared("PARAM_REQUEST_LIST", "all parameters."),
            Declared("PARAM_VALUE", "a parameter's value, as a float whatever its type."),
            Declared("PARAM_SET", "change a parameter."),
            Declared("PARAM_ERROR", "why there is no such answer to a request, by MAV_PARAM_ERROR."),
            Declared("FILE_TRANSFER_PROTOCOL", "one packet of MAVLink FTP, as bytes."),
            Declared("LOG_REQUEST_LIST", "asks for the list of stored logs."),
            Declared("LOG_ENTRY", "one stored log, of `num_logs`; there is none where that is 0."),
            Declared("LOG_REQUEST_DATA", "asks for `count` bytes of a stored log, from `ofs` on."),
            Declared("LOG_DATA", "a part of a stored log; fewer than 90 bytes end what was asked for."),
            Declared("LOG_REQUEST_END", "ends the transfer of logs, and lets the vehicle log again."),
        ),
    ),
    "mission": Module(
        """Messages of the mission protocol.

The dialect declares no unit for an item's x, y and z, since they depend on the item's command and frame: they stay as
they are on the wire. An item's `current` is 1 for the one that is flown now, 2 for a position to fly to at once, which
isn't of the mission, and 3 for a height alone. Source: MAVLink guide, "Mission Protocol".
""",
        (
            Declared(
                "MISSION_WRITE_PARTIAL_LIST",
                "the items from start_index to end_index will be replaced.",
                optional="mission_type",
            ),
            Declared("MISSION_ITEM", "an item whose position, if it has one, is in degrees.", optional="mission_type"),
            Declared(
                "MISSION_REQUEST", "asks for an item, as MISSION_ITEM or MISSION_ITEM_INT.", optional="mission_type"
            ),
            Declared("MISSION_SET_CURRENT", "continue the mission at this item."),
            Declared(
                "MISSION_CURRENT",
                "the active item's number, how many there are, their state, whether the mode flies them.",
                last="mission_mode",
                optional="total",
            ),
            Declared(
                "MISSION_REQUEST_LIST",
                "asks for the number of items of a type (MAV_MISSION_TYPE).",
                optional="mission_type",
            ),
            Declared("MISSION_COUNT", "how many items there are, or will be sent.", optional="mission_type"),
            Declared("MISSION_CLEAR_ALL", "delete all items.", optional="mission_type"),
            Declared("MISSION_ITEM_REACHED", "an item has been flown."),
            Declared("MISSION_ACK", "the result of a mission request (MAV_MISSION_RESULT).", optional="mission_type"),
            Declared("MISSION_REQUEST_INT", "asks for an item, as MISSION_ITEM_INT.", optional="mission_type"),
            Declared(
                "MISSION_ITEM_INT",
                "an item whose position, if it has one, is in 1e-7 degrees.",
                optional="mission_type",
            ),
        ),
    ),
}

SI = {
    "ms": ("_s", "MILLI"),
    "m": ("_m", ""),
    "mm": ("_m", "MILLI"),
    "m/s": ("_mps", ""),
    "cm/s": ("_mps", "CENTI"),
    "m/s/s": ("_mps2", ""),
    "rad": ("_rad", ""),
    "rad/s": ("_radps", ""),
    "deg": ("_rad", "DEG"),
    "cdeg": ("_rad", "CDEG"),
    "degE7": ("_rad", "DEGE7"),
    "mV": ("_v", "MILLI"),
    "cA": ("_a", "CENTI"),
}
"""For each unit of the dialect: the suffix of our field's name, and the size of a unit in SI."""
WHOLE_UNITS = {"ns": "_ns"}
"""For integers that keep their unit."""
BITS = {
    "int8_t": "i8",
    "uint8_t": "u8",
    "uint8_t_mavlink_version": "u8",
    "int16_t": "i16",
    "uint16_t": "u16",
    "int32_t": "i32",
    "uint32_t": "u32",
    "int64_t": "i64",
    "uint64_t": "u64",
    "float": "f32",
}
SCALED = ("i8", "i16", "u16", "i32", "u32")
"""Integer packings of fields with a unit."""
ARRAYS = {"u8": "octets", "f32": "f32s", "u16": "knowns"}


@dataclass(frozen=True)
class Field:
    """A field of a message."""

    wire_name: str
    bits: str
    """Packing: `i16`, `f32`, …, or `text`."""
    unit: str
    count: int
    """Length of the array; 0 if it isn't one."""
    at: int
    """Offset in the payload."""

    @property
    def size(self) -> int:
        """Size in the payload, in bytes."""
        return max(self.count, 1) * (1 if self.bits == "text" else int(self.bits[1:]) // 8)

    @property
    def si(self) -> str:
        """Name of the unit's size in SI; empty if that is 1 or there is no unit."""
        return SI.get(self.unit, ("", ""))[1]

    @property
    def name(self) -> str:
        """Our name of the field."""
        ending = WHOLE_UNITS.get(self.unit) or SI.get(self.unit, ("", ""))[0]
        return self.wire_name.removesuffix("_ms" if self.unit == "ms" else "") + ending

    @property
    def of_type(self) -> str:
        """Python type."""
        if self.bits == "text":
            return "str"
        one = "float" if self.bits == "f32" or self.unit in SI else "int"
        return f"tuple[{one}, ...]" if self.count else one

    @property
    def empty(self) -> str:
        """Default value of its type."""
        if self.count:
            return '""' if self.bits == "text" else "()"
        return "0" if self.of_type == "int" else "0.0"

    def read(self) -> str:
        """Return the expression that reads the field."""
        arguments = f"frame, begin + {self.at}, end" if self.at else "frame, begin, end"
        if self.bits == "text":
            return f"get_text({arguments}, {self.count})"
        if self.count:
            unit = f", {self.si}" if self.bits == "u16" else ""
            return f"get_{ARRAYS[self.bits]}({arguments}, {self.count}{unit})"
        number = f"get_{self.bits}({arguments})"
        if self.unit not in SI or self.bits == "f32":
            return f"{number} * {self.si}" if self.si else number
        number = f"known({number})" if self.bits == "u16" else number
        return f"{number} * {self.si or '1.0'}"

    def write(self) -> str:
        """Return the statement that writes the field."""
        value = f"self.{self.name}"
        if self.bits == "text":
            return f"put_text(payload, {value}, {self.count})"
        if self.count:
            per_unit = f", PER_{self.si}" if self.bits == "u16" else ""
            return f"put_{ARRAYS[self.bits]}(payload, {value}, {self.count}{per_unit})"
        value += f" * PER_{self.si}" if self.si else ""
        if self.unit in SI and self.bits != "f32":
            return f"put_near_{self.bits}(payload, {value})"
        return f"put_{self.bits}(payload, {value})"


def fields_of(source: Layout) -> list[Field]:
    """Return the fields of a message in the XML's order."""
    order = _packed_order(source)
    sizes = [Field("", *_packing(source, index), "", source.array_lengths[index], 0).size for index in order]
    starts = {index: sum(sizes[:position]) for position, index in enumerate(order)}
    return [
        Field(name, *_packing(source, index), source.units[index], source.array_lengths[index], starts[index])
        for index, name in enumerate(source.fields)
    ]


def _packing(source: Layout, index: int) -> tuple[str]:
    return ("text" if source.types[index] == "char" else BITS[source.types[index]],)


def _packed_order(source: Layout) -> list[int]:
    """Return the fields' indices in the order in which they are packed."""
    return sorted(range(len(source.fields)), key=source.wire_order.__getitem__)


def class_name(name: str) -> str:
    """Return our name of a message: GLOBAL_POSITION_INT -> GlobalPositionInt."""
    return "".join(part.capitalize() for part in name.split("_"))


def rendered(said: Declared) -> Iterator[str]:
    """Yield the lines of a message's class and of its kind."""
    source = layout(said.name)
    everything = fields_of(source)
    names = [each.name for each in everything]
    used = everything[: names.index(said.last) + 1] if said.last else everything
    first = names.index(said.optional) if said.optional else len(used)
    names = names[: len(used)]
    own = class_name(said.name)
    arguments = [
        f"{each.name}: {each.of_type}"
        + (f" = {said.defaults.get(each.name, '0.0' if each.of_type == 'float' else '0')}" if index >= first else "")
        for index, each in enumerate(used)
    ]
    yield "@mypyc_attr(acyclic=True, free_list_len=1)"
    yield f"class {own}(Message):"
    yield f'    """{said.name} ({source.message_id}): {said.text}"""'
    yield f"    def __init__(self, {', '.join(arguments)}) -> None:"
    yield from (f"        self.{each.name} = {each.name}" for each in used)
    yield "    def kind(self) -> Kind:"
    yield f"        return {said.name}"
    yield "    def write(self, payload: BytesWriter) -> None:"
    yield from (f"        {line}" for line in _written(everything, used))
    if "time_boot_s" in names:
        yield "    def boot_s(self) -> float:"
        yield "        return self.time_boot_s"
    if "target_system" in names:
        yield "    def addressee(self) -> int:"
        yield "        return self.target_system"
    yield "    def read(self, frame: bytes, begin: i64, end: i64) -> Message:"
    yield f"        return {own}({', '.join(each.read() for each in used)})"
    length = sum(each.size for each in everything)
    facts = f'"{said.name}", {source.message_id}, {source.crc_extra}, ({source.base_length}, {length})'
    empty = f"{own}({', '.join(each.empty for each in used[:first])})"
    yield f"{said.name}: Final = Kind({facts}, {tuple(each.name for each in used)}, {empty})"


def _written(everything: list[Field], used: list[Field]) -> Iterator[str]:
    """Yield the statements that write a payload: fields in the order of packing, zeros for fields left out."""
    zeros = 0
    for each in sorted(everything, key=lambda each: each.at):
        if each not in used:
            zeros += each.size
            continue
        if zeros:
            yield f"put_zeros(payload, {zeros})"
            zeros = 0
        yield each.write()
    if zeros:
        yield f"put_zeros(payload, {zeros})"


def module(of: Module) -> str:
    """Return a module's source."""
    body = "\n".join(line for said in of.messages for line in rendered(said))
    helpers = [name for name in _helpers() if re.search(rf"\b{name}\b", re.sub(r'"[^"]*"', "", body))]
    math = "import math\n" if "math." in body else ""
    origin = f"# Written by: {WRITE}\n# A class for each message of the service, all after one plan: not edited here."
    head = f'"""{of.text}"""\n\n{origin}\n\nfrom __future__ import annotations\n'
    native = "from librt.strings import BytesWriter\nfrom mypy_extensions import i64, mypyc_attr"
    wire = f"{native}\n\nfrom airlink.messages.payload import {', '.join(helpers)}\n"
    kinds = f"KINDS: Final = ({', '.join(said.name for said in of.messages)},)"
    return formatted(f"{head}\n{math}from typing import Final\n\n{wire}\n{body}\n\n{kinds}\n")


def _helpers() -> Iterator[str]:
    units = {unit for _, unit in SI.values() if unit}
    packed = {"text", *BITS.values(), *ARRAYS.values()}
    yield from ("Kind", "Message", "known", "put_zeros", *(f"put_near_{bits}" for bits in SCALED))
    yield from sorted({*units, *(f"PER_{unit}" for unit in units)})
    yield from sorted(f"{access}_{each}" for access in ("get", "put") for each in packed)


def formatted(source: str) -> str:
    """Return source text formatted like the project's other files."""
    for how in (["check", "--select=I", "--fix-only", "--quiet"], ["format", "--quiet"]):
        command = [sys.executable, "-m", "ruff", *how, "--stdin-filename", str(HERE / "x.py"), "-"]
        source = subprocess.run(command, input=source, capture_output=True, text=True, check=True).stdout
    return source


if __name__ == "__main__":
    for name, each in MODULES.items():
        (HERE / f"{name}.py").write_text(module(each))
