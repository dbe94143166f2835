"""Coverage-guided fuzzing (atheris, libFuzzer) of the parser, and of what either end of a flight does with frames.

For the parser the fuzzer's bytes are datagrams. For the ends they select messages, senders, payloads and times;
checksums, and optionally targets, stamps and commands, are filled in, because no mutation finds them. Every input meets
a copy of the same flight, 12 s old, so each result can be reproduced.
"""

from __future__ import annotations

import copy
import copyreg
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, NamedTuple

from librt.strings import BytesWriter
from librt.vecs import vec
from mypy_extensions import i64

from airlink.endpoint import LOOPBACK, Address
from airlink.engine import FIRST_EPHEMERAL_PORT, Datagram
from airlink.stream_parser import StreamParser
from gcs_formation.vehicle.autopilot_family import STATION
from sim_vehicles.families.arduplane.plane import HANDLERS
from tests.airlink.layouts import Layout
from tests.fuzz.flight import FOLLOWER, USUAL, Flight
from tests.fuzz.frames import LAYOUTS, Header, framed, packed

Target = Literal["parser", "station", "vehicles"]
TARGETS: tuple[Target, ...] = ("parser", "station", "vehicles")
AGE_S = 12.0
PAUSES_S = (0.0, 0.02, 0.1, 0.3)
HEAD, LONGEST = 5, 2048
"""Length of what precedes a payload, and of an input, in bytes."""
COMMANDS = sorted(HANDLERS)
STRANGER = Address("10.0.0.1", 14550)
OURS, HELPED, VERSION_1, SIGNED, OTHERS_PORT, COMPONENT = 0x01, 0x02, 0x04, 0x08, 0x10, 0x20
copyreg.pickle(type(vec[float]()), lambda numbers: (vec[float], (list(numbers),)))
copyreg.pickle(type(vec[i64]()), lambda numbers: (vec[i64], (list(numbers),)))
copyreg.pickle(type(vec[vec[float]]()), lambda rows: (_rows, ([list(row) for row in rows],)))
copyreg.pickle(BytesWriter, lambda written: (_written, (written.getvalue(),)))
"""Fields of packed numbers that can't be copied in any other way."""


def _rows(numbers: list[list[float]]) -> vec[vec[float]]:
    return vec[vec[float]]([vec[float](row) for row in numbers])


def _written(data: bytes) -> BytesWriter:
    writer = BytesWriter()
    writer.write(data)
    return writer


class Said(NamedTuple):
    """One frame of an input."""

    flags: int
    layout: Layout
    system: int
    payload: bytes
    pause_s: float


def parse(data: bytes) -> None:
    """Feed a parser: its results don't depend on how the bytes are cut, and nothing is lost or counted twice."""
    whole, parts = StreamParser(), StreamParser()
    cut = data[0] if data else 0
    found = whole.feed(data)
    pieces = [*parts.feed(data[:cut]), *parts.feed(data[cut:])]
    assert [(each.raw, each.message) for each in found] == [(each.raw, each.message) for each in pieces]
    counted = sum(len(frame.raw) for frame in found) + whole.counts.garbage_bytes
    assert counted + len(whole._pending) == len(data)
    assert whole.counts.garbage_bytes == parts.counts.garbage_bytes


def said(data: bytes) -> list[Said]:
    """Return the frames that an input's bytes encode."""
    frames: list[Said] = []
    while len(data) >= HEAD:
        flags, number, system, pause, length = data[:HEAD]
        layout = LAYOUTS[number % len(LAYOUTS)]
        payload, data = data[HEAD : HEAD + length], data[HEAD + length :]
        frames.append(Said(flags, layout, system, payload, PAUSES_S[pause % len(PAUSES_S)]))
    return frames


class Ends:
    """A flight of which every input gets a copy."""

    def __init__(self, end: Literal["station", "vehicles"]) -> None:
        """Fly until the formation is on its path."""
        self._flight = Flight(AGE_S)
        self._flight.recorder.forget()
        self._unchanging = (self._flight.station.scenario, self._flight.fleet.config)
        self._end = end

    def receive(self, data: bytes) -> None:
        """Let one end receive what an input's bytes encode; the flight must stay within the envelope."""
        flight = copy.deepcopy(self._flight, {id(each): each for each in self._unchanging})
        tell = self._tell_station if self._end == "station" else self._tell_vehicle
        for each in said(data):
            tell(flight, each)
            if each.pause_s:
                flight.run(each.pause_s)
        flight.run(PAUSES_S[-2])
        flight.check()

    def _tell_station(self, flight: Flight, each: Said) -> None:
        system = 1 + each.system % FOLLOWER.system if each.flags & OURS else each.system
        peer = Address(LOOPBACK, FIRST_EPHEMERAL_PORT + system - 1) if not each.flags & OTHERS_PORT else STRANGER
        header = _header(each, system, 1 if not each.flags & COMPONENT else each.payload[0] if each.payload else 0)
        values = {"target_system": STATION.system, "ts1": flight.probe()}
        frame = framed(each.layout.message_id, _payload(each, values), header)
        flight.station.receive([Datagram(0, peer, frame)], flight.clock.now())

    def _tell_vehicle(self, flight: Flight, each: Said) -> None:
        ground = flight.station.endpoints()[0].address
        peer = ground if not each.flags & OTHERS_PORT else STRANGER
        header = _header(each, STATION.system if each.flags & OURS else each.system, STATION.component)
        values = {"target_system": FOLLOWER.system, "command": COMMANDS[each.system % len(COMMANDS)]}
        frame = framed(each.layout.message_id, _payload(each, values), header)
        flight.fleet.receive([Datagram(FOLLOWER.system - 1, peer, frame)], flight.clock.now())


def _header(each: Said, system: int, component: int) -> Header:
    version = 1 if each.flags & VERSION_1 and each.layout.message_id < 256 else 2
    return Header(system, component, 0, version, bool(each.flags & SIGNED))


def _payload(each: Said, values: dict[str, int]) -> bytes:
    """Return the payload; if the input asks for it, with values that a stranger couldn't know."""
    if not each.flags & HELPED:
        return each.payload
    layout = each.layout
    size = layout.packer.size
    raw = layout.packer.unpack(each.payload[:size].ljust(size, b"\0"))
    flat, place = list(raw), 0
    for number in sorted(range(len(layout.fields)), key=layout.wire_order.__getitem__):
        if layout.fields[number] in values:
            flat[place] = values[layout.fields[number]]
        length = layout.array_lengths[number]
        place += length if length and layout.types[number] != "char" else 1
    return layout.packer.pack(*flat)


def seeds(target: Target) -> list[bytes]:
    """Return an input for every message, with usual values; for the parser, its frame."""
    found: list[bytes] = []
    for number, layout in enumerate(LAYOUTS):
        payload = packed(layout, {field: value for field, value in USUAL.items() if field in layout.fields})
        if target == "parser":
            found.append(framed(layout.message_id, payload, Header(FOLLOWER.system)))
        else:
            commands = range(len(COMMANDS)) if target == "vehicles" and "command" in layout.fields else (1,)
            found += [bytes((OURS | HELPED, number, each, 2, len(payload))) + payload for each in commands]
    return found


def one_input(target: Target) -> Callable[[bytes], None]:
    """Return the function that takes an input."""
    return parse if target == "parser" else Ends(target).receive


def fuzz(target: Target, seconds: int, corpus: Path, inputs: tuple[Path, ...]) -> None:
    """Search for inputs that reach new code for a while, or try those given; exits the process.

    Needs atheris, which must have instrumented this module's imports.
    """
    atheris: Any = importlib.import_module("atheris")
    corpus.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(seeds(target)):
        (corpus / f"seed-{number:03}").write_bytes(seed)
    limits = [f"-max_total_time={seconds}", f"-max_len={LONGEST}", "-timeout=60", "-rss_limit_mb=2048"]
    where = [str(path) for path in inputs] or [str(corpus)]
    atheris.Setup(
        [sys.argv[0], *limits, f"-artifact_prefix={corpus}/found-", "-print_final_stats=1", *where], one_input(target)
    )
    atheris.Fuzz()
