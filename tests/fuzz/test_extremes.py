"""Every field of every message takes its extremes: NaN, infinities, the ends of its range; at both ends, in flight."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

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


def payloads(layout: Layout, probe: int) -> Iterator[bytes]:
    """Yield a message's payloads; for a command message, for every command that vehicles know."""
    usual = {field: value for field, value in (USUAL | {"ts1": probe}).items() if field in layout.fields}
    commands = HANDLERS if "command" in layout.fields else (0,)
    for command in commands:
        yield from extreme_payloads(layout, usual | {"command": command})


@pytest.mark.slow
def test_no_value_that_a_vehicle_tells_breaks_the_flight() -> None:
    flight, numbers = Flight(), count()
    for layout in LAYOUTS:
        for payload in payloads(layout, flight.probe()):
            header = Header(FOLLOWER.system, sequence=next(numbers) % 256)
            flight.tell_station(framed(layout.message_id, payload, header))
            flight.run(TURN_S)
        flight.check()
    assert flight.station.vehicles[FOLLOWER].telemetry.implausible > 20
    flight.flies_on()


@pytest.mark.slow
def test_no_value_that_a_vehicle_is_told_breaks_the_flight() -> None:
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
