"""Every field of every message takes its extremes: NaN, infinities, the ends of its range; at both ends, in flight."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from airlink import mavlink as m
from airlink.frame import FrameWriter
from airlink.messages.command import RequestDataStream, SetMode
from gcs_formation.vehicle.autopilot_family import STATION
from sim_vehicles.families.arduplane.plane import HANDLERS
from tests.airlink.layouts import Layout
from tests.fuzz.flight import FOLLOWER, USUAL, Flight
from tests.fuzz.frames import LAYOUTS, Header, extreme_payloads, framed

TURN_S = 0.02
STAMP = "time_boot_ms"
NOW_MS = 0x7FFFFFFE
"""Stands for the vehicle's present time since boot: it is no extreme."""


def payloads(layout: Layout, probe: int) -> Iterator[bytes]:
    """Yield a message's payloads; for a command message, for every command that vehicles know."""
    usual = {field: value for field, value in (USUAL | {"ts1": probe, STAMP: NOW_MS}).items() if field in layout.fields}
    commands = HANDLERS if "command" in layout.fields else (0,)
    for command in commands:
        yield from extreme_payloads(layout, usual | {"command": command})


def stamped(layout: Layout, payload: bytes, now_ms: int) -> bytes:
    """Return a payload with the present time since boot in place of `NOW_MS`."""
    if STAMP not in layout.fields:
        return payload
    values, place = list(layout.packer.unpack(payload)), layout.wire_order[layout.fields.index(STAMP)]
    values[place] = now_ms if values[place] == NOW_MS else values[place]
    return layout.packer.pack(*values)


@pytest.mark.slow
def test_no_value_that_a_vehicle_tells_breaks_the_flight() -> None:
    """Each frame has its next number and, where it isn't what is tried, its present time: others would be history."""
    flight = Flight()
    told, tells = flight.station.vehicles[FOLLOWER], flight.follower
    for layout in LAYOUTS:
        for payload in payloads(layout, flight.probe()):
            header = Header(FOLLOWER.system, sequence=flight.next_number())
            now_ms = round(1e3 * tells.time_s)
            flight.tell_station(framed(layout.message_id, stamped(layout, payload, now_ms), header))
            flight.run(TURN_S)
        flight.check()
    assert float(told.history.late + told.history.copies) < 0.01 * float(told.sequence.received)
    assert told.telemetry.implausible > 50
    flight.flies_on()


@pytest.mark.slow
def test_no_value_that_a_vehicle_is_reported_breaks_the_flight() -> None:
    flight = Flight()
    for layout in LAYOUTS:
        for payload in payloads(layout, 0):
            flight.tell_vehicle(framed(layout.message_id, payload, Header(*STATION)))
            flight.run(TURN_S)
        flight.check()
    # Some of it was valid, and carried out: no telemetry, other modes.
    writer = FrameWriter(*STATION)
    streams = RequestDataStream(FOLLOWER.system, 1, m.MAV_DATA_STREAM_ALL, 10, 1)
    flight.tell_vehicle(writer.encode(streams))
    flight.tell_vehicle(
        writer.encode(SetMode(FOLLOWER.system, m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, m.PLANE_MODE_GUIDED))
    )
    flight.flies_on()
