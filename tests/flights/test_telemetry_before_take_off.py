"""Telemetry that can't be true of a vehicle that stands on the ground: refused, with the field and what to set."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from airlink import mavlink as m
from airlink.engine import Datagram
from airlink.frame import reframed
from airlink.messages import Message
from airlink.messages.telemetry import Attitude, GlobalPositionInt, HomePosition, VfrHud
from airlink.stream_parser import StreamParser
from gcs_formation.phases import Phase
from sim_vehicles.fleet import Fleet
from tests.flights.in_memory import World
from tests.flights.test_preflight import GROUND, READ, Listening, commands_to

Altering = Callable[[Message], list[Message]]


def altered(change: Altering) -> type[Listening]:
    """Return what replaces each message of the last vehicle."""

    class Altered(Listening):
        def __init__(self, fleet: Fleet) -> None:
            super().__init__(fleet)
            self._parser = StreamParser()

        def datagrams_to_send(self) -> list[Datagram]:
            found = list[Datagram]()
            for each in super().datagrams_to_send():
                if each.socket != 1:
                    found.append(each)
                    continue
                for frame in self._parser.feed(each.data):
                    messages = [] if frame.message is None else change(frame.message)
                    sent = [reframed(frame, one) for one in messages] or [frame.raw]
                    found += [Datagram(each.socket, each.peer, data) for data in sent]
            return found

    return Altered


def of(kind: type[Message], **fields: Any) -> Altering:
    """Return a change of some fields of a kind of message."""
    return lambda message: [message.but(**fields) if isinstance(message, kind) else message]


def home_20_m_up(message: Message) -> list[Message]:
    if not isinstance(message, GlobalPositionInt):
        return [message]
    unknown = (1.0, 0.0, 0.0, 0.0)
    return [HomePosition(message.lat_rad, message.lon_rad, 20.0, 0.0, 0.0, 0.0, unknown, time_usec=0), message]


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (of(Attitude, roll_rad=math.radians(40.0)), "ATTITUDE.roll: found 40 degrees while it stands disarmed"),
        (of(Attitude, pitch_rad=-1.5), "ATTITUDE.pitch: found -86 degrees while it stands disarmed"),
        (of(Attitude, yaw_rad=2.0), "ATTITUDE.yaw: found 115 degrees, where GLOBAL_POSITION_INT.hdg is"),
        (of(GlobalPositionInt, vx_mps=20.0), "vx, vy: found 20.0 m/s over ground"),
        (of(GlobalPositionInt, vz_mps=-4.0), "vx, vy: found 0.0 m/s over ground, vz -4.0 m/s"),
        (of(GlobalPositionInt, relative_alt_m=25.0), "relative_alt: found 25 m above home while it stands disarmed"),
        (of(VfrHud, airspeed_mps=19.0), "VFR_HUD.airspeed: found 19.0 m/s while it stands disarmed"),
        (home_20_m_up, "relative_alt: found 0 m, where alt is -20 m above HOME_POSITION's altitude"),
    ],
)
def test_what_cannot_be_true_on_the_ground_keeps_everybody_there(change: Altering, text: str) -> None:
    world = World(altered(change), READ, **GROUND)
    world.run(40.0)
    failure = world.station.phase_machine.failure or ""
    assert failure.startswith("vehicle 2: ")
    assert text in failure
    assert "allowed: " in failure
    assert world.station.flight.phase is Phase.FAILED
    assert commands_to(world) == {m.MAV_CMD_SET_MESSAGE_INTERVAL}


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (
            of(GlobalPositionInt, lat_rad=0.0, lon_rad=0.0),
            "reported no position: GLOBAL_POSITION_INT's lat and lon are 0",
        ),
        (of(GlobalPositionInt, lat_rad=2.0), "reported no position: GLOBAL_POSITION_INT's lat is 115 degrees"),
        (of(Attitude, roll_rad=math.nan), "it tells no attitude: ATTITUDE's roll is NaN"),
        (of(Attitude, roll_rad=40.0), "it tells no attitude: ATTITUDE's roll is 40 rad"),
        (of(VfrHud, airspeed_mps=math.nan), "it has reported no airspeed in VFR_HUD"),
    ],
)
def test_a_field_that_is_not_filled_is_named(change: Altering, why: str) -> None:
    world = World(altered(change), READ, **GROUND)
    world.run(150.0)  # one without a fix is waited for longer
    assert why in (world.station.phase_machine.failure or "")
    assert commands_to(world) == {m.MAV_CMD_SET_MESSAGE_INTERVAL}


def test_in_the_air_a_home_of_another_datum_is_said_and_flown_with() -> None:
    world = World(altered(home_20_m_up), READ, vehicles={"count": 2})
    world.run(3.0)
    assert any("above HOME_POSITION's altitude" in each for each in world.words("parameters"))
    assert world.station.phase_machine.failure is None
