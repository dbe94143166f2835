"""Equipment between a ground station and its vehicles in the field, and other systems there."""

from __future__ import annotations

from typing import ClassVar

import pytest
from fastcrc import crc16

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import Endpoint
from airlink.engine import Datagram
from airlink.frame import CHECKSUM, HEADER_V2, SIGNATURE, SIGNED_FLAG, FrameWriter
from airlink.messages.system import Heartbeat
from airlink.stream_parser import StreamParser
from gcs_formation.phases import Phase
from sim_vehicles.fleet import Fleet
from tests.flights.in_memory import Between, World

GROUND = {"in_air": False, "run_in_s": 30}
INSIDE_M = 0.5
EXTRAS = m.crc_extras()


class Late(Between):
    """Vehicles are switched on one after another, the last one first."""

    on_from_s: ClassVar = (20.0, 9.0, 2.0)

    def datagrams_to_send(self) -> list[Datagram]:
        now_s = self.fleet.next_timer() / NANOSECONDS
        return [each for each in super().datagrams_to_send() if now_s >= self.on_from_s[each.socket]]


class Router(Between):
    """One address for all, as with mavlink-router: what it receives is passed on to every vehicle."""

    def endpoints(self) -> tuple[Endpoint, ...]:
        return self.fleet.endpoints()[:1]

    def take(self, datagram: Datagram, now: Instant) -> None:
        for socket in range(len(self.fleet.vehicles)):
            self.fleet.receive([Datagram(socket, datagram.peer, datagram.data)], now)

    def datagrams_to_send(self) -> list[Datagram]:
        return [Datagram(0, each.peer, each.data) for each in super().datagrams_to_send()]


class Rewriter(Between):
    """Rewrites what vehicles send, frame by frame."""

    def datagrams_to_send(self) -> list[Datagram]:
        return [Datagram(each.socket, each.peer, self.rewrite(each.data)) for each in super().datagrams_to_send()]

    def rewrite(self, data: bytes) -> bytes:
        raise NotImplementedError


class Old(Rewriter):
    """Vehicles send MAVLink 1, and understand both."""

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self._writers = {
            each.config.identity.system: FrameWriter(each.config.identity.system, 1) for each in fleet.vehicles
        }

    def rewrite(self, data: bytes) -> bytes:
        (frame,) = StreamParser().feed(data)
        assert frame.message is not None
        return self._writers[frame.system].encode(frame.message, version=1)


class Signing(Rewriter):
    """Vehicles sign frames with a key that we don't have; unsigned commands are accepted on the first link."""

    def rewrite(self, data: bytes) -> bytes:
        body = data[1:2] + bytes([SIGNED_FLAG]) + data[3:-CHECKSUM]
        extra = bytes([EXTRAS[int.from_bytes(data[HEADER_V2 - 3 : HEADER_V2], "little")]])
        return data[:1] + body + crc16.mcrf4xx(body + extra).to_bytes(2, "little") + bytes(range(SIGNATURE))


class Crowded(Between):
    """A camera, a gimbal, an ADS-B receiver and a companion computer share each vehicle's system id and address."""

    others: ClassVar = (
        (m.MAV_COMP_ID_CAMERA, Heartbeat(m.MAV_TYPE_CAMERA, m.MAV_AUTOPILOT_INVALID)),
        (m.MAV_COMP_ID_GIMBAL, Heartbeat(m.MAV_TYPE_GIMBAL, m.MAV_AUTOPILOT_INVALID)),
        (m.MAV_COMP_ID_ADSB, Heartbeat(m.MAV_TYPE_ADSB, m.MAV_AUTOPILOT_INVALID, custom_mode=11)),
        (m.MAV_COMP_ID_ONBOARD_COMPUTER, Heartbeat(m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA, 0, 0)),
        (m.MAV_COMP_ID_AUTOPILOT1, Heartbeat(m.MAV_TYPE_ONBOARD_CONTROLLER, m.MAV_AUTOPILOT_INVALID, 0, 12)),
    )

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self._writers = [
            [(FrameWriter(each.config.identity.system, component), beat) for component, beat in self.others]
            for each in fleet.vehicles
        ]

    def datagrams_to_send(self) -> list[Datagram]:
        out: list[Datagram] = []
        for each in super().datagrams_to_send():
            out.append(each)
            if each.data[HEADER_V2 - 3 : HEADER_V2] == b"\0\0\0":
                others = [writer.encode(beat) for writer, beat in self._writers[each.socket]]
                out += [Datagram(each.socket, each.peer, data) for data in others]
        return out


def flies(world: World) -> None:
    """Fly to the end: no vehicle is told to loiter, nothing is refused, and every follower is in its slot."""
    world.run()
    assert world.station.phase_machine.failure is None
    assert world.station.flight.phase is Phase.DONE
    assert not world.times_s("member", text="loiter")
    assert not world.times_s("member", text="pilot")
    assert not world.times_s("disobeys")
    assert world.worst_m(from_s=5.0) < INSIDE_M


@pytest.mark.slow
def test_vehicles_that_are_switched_on_one_after_another_are_waited_for_and_take_off_together() -> None:
    world = World(Late, duration_s=10, start=GROUND)
    flies(world)
    first_received = [world.times_s("link", number, "connected")[0] for number in (1, 2, 3)]
    assert first_received == pytest.approx([20.0, 9.0, 2.0], abs=1.1)
    assert min(world.times_s("mode", text="TAKEOFF")) > first_received[0]


@pytest.mark.parametrize(
    "between", [Old, Signing, *(pytest.param(each, marks=pytest.mark.slow) for each in (Router, Crowded))]
)
def test_a_formation_flies_through(between: type[Between]) -> None:
    world = World(between, duration_s=7)
    flies(world)
    losses = [vehicle.sequence.loss for vehicle in world.station.vehicles.values()]
    assert losses == [0.0] * 3
    assert {event.text for event in world.recorder.events if event.kind == "mode"} == {"GUIDED", "LOITER"}


def another(autopilot: int, kind: int) -> type[Between]:
    """Return the engine that makes the last vehicle report another autopilot."""

    class Foreign(Old):
        def rewrite(self, data: bytes) -> bytes:
            (frame,) = StreamParser().feed(data)
            if frame.system != 3 or not isinstance(frame.message, Heartbeat):
                return data
            return self._writers[3].encode(frame.message.but(autopilot=autopilot, type=kind))

    return Foreign


@pytest.mark.parametrize(
    ("autopilot", "kind", "words"),
    [
        (m.MAV_AUTOPILOT_PX4, m.MAV_TYPE_FIXED_WING, "PX4 FIXED_WING"),
        (m.MAV_AUTOPILOT_ARDUPILOTMEGA, m.MAV_TYPE_QUADROTOR, "ARDUPILOTMEGA QUADROTOR"),
    ],
)
def test_an_autopilot_of_another_family_is_refused_in_words_before_any_takes_off(
    autopilot: int, kind: int, words: str
) -> None:
    """Mode 15, GUIDED of an ArduPlane, is AUTOTUNE of an ArduCopter."""
    world = World(another(autopilot, kind), start={"in_air": False})
    world.run()
    assert world.station.phase_machine.failure is not None
    assert world.station.phase_machine.failure == f"vehicle 3 says that it is a {words}; allowed: ArduPlane"
    assert [each.pilot.condition.armed for each in world.fleet.vehicles] == [False] * 3
    assert world.now_s < 5.0
