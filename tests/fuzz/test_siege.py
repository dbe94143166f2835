"""Both ends of a flight receive hostile datagrams from thousands of addresses."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from airlink.clock import Instant
from airlink.endpoint import Address, VehicleId
from airlink.engine import Datagram
from airlink.frame import FrameWriter
from airlink.messages.system import Heartbeat
from airlink.signing.key import write_new_key
from airlink.stream_parser import StreamParser
from gcs_formation.station import Station
from tests.fuzz.datagrams import FOREIGN, FOREIGN_TARGET, Hostile
from tests.fuzz.siege import End, Flown, MemoryRecorder, Siege, check, fly, planned, worst_error_m

DURATION_S = 5
THRONG, BAND, CROWD = 5, 10, 40
"""Datagrams in each cycle of 20 ms."""
TURNS = 500
"""Least number of datagrams in a flight."""
ENDS: tuple[End, ...] = ("station", "vehicles")
DELAYED = {"default": {"delay_ms": 40}}
in_peace = cache(lambda delayed: fly(DURATION_S, Siege(links=DELAYED if delayed else {})))


@pytest.mark.parametrize(
    ("end", "delayed", "each_turn"),
    [
        ("station", False, BAND),
        pytest.param("station", False, CROWD, marks=pytest.mark.slow),
        pytest.param("station", True, CROWD, marks=pytest.mark.slow),
        pytest.param("vehicles", False, CROWD, marks=pytest.mark.slow),
    ],
)
def test_strangers_change_nothing(end: End, delayed: bool, each_turn: int) -> None:
    peace = in_peace(delayed)
    flown = fly(DURATION_S, Siege(1, each_turn, end, links=DELAYED if delayed else {}))
    assert flown.thrown > TURNS * each_turn
    check(flown)
    assert np.array_equal(np.array(flown.recorder.setpoints), np.array(peace.recorder.setpoints), equal_nan=True)
    assert sum(event.kind == "stranger" for event in flown.recorder.events) <= 7


@pytest.mark.slow
@pytest.mark.parametrize(
    ("end", "each_turn"),
    [("vehicles", BAND), ("vehicles", CROWD), ("station", CROWD)],
)
def test_noise_from_a_peers_own_address_is_no_more_than_a_bad_link(end: End, each_turn: int) -> None:
    flown = fly(DURATION_S, Siege(1, each_turn, end, own_share=0.5))
    check(flown)
    assert worst_error_m(flown.recorder) < 0.05
    assert flown.dropped > flown.thrown / 3
    if end == "station":
        assert min(flown.station.bad_frames(identity) for identity in flown.station.vehicles) > 1000


@pytest.mark.slow
@pytest.mark.parametrize("end", ENDS)
def test_forged_frames_break_nothing(end: End) -> None:
    """A forger may fly the aircraft; but nothing raises, and all that is sent stays inside the envelope."""
    check(fly(DURATION_S, Siege(1, CROWD if end == "station" else THRONG, end, forged=True, own_share=0.5)))


@pytest.mark.parametrize(
    ("end", "each_turn"),
    [
        ("station", THRONG),
        pytest.param("vehicles", THRONG, marks=pytest.mark.slow),
        pytest.param("station", CROWD, marks=pytest.mark.slow),
        pytest.param("vehicles", CROWD, marks=pytest.mark.slow),
    ],
)
def test_forged_frames_change_nothing_on_signed_links(end: End, each_turn: int, tmp_path: Path) -> None:
    """Frames in the peers' names, half of them from their own addresses: to the bit the flight in peace."""
    write_new_key(tmp_path / "link.key")
    links = {"default": {"signing": {"key_file": str(tmp_path / "link.key")}}}
    siege = Siege(1, each_turn, end, forged=True, forged_share=1.0, own_share=0.5, links=links)
    flown, peace = fly(DURATION_S, siege), in_peace(False)
    check(flown)
    assert np.array_equal(np.array(flown.recorder.setpoints), np.array(peace.recorder.setpoints), equal_nan=True)
    refused = flown.station.refused() if end == "station" else refused_by_vehicles(flown)
    assert refused > 0.9 * flown.thrown
    assert {each.kind for each in flown.recorder.events} <= {each.kind for each in peace.recorder.events} | {
        "signing",
        "flood",
    }


def refused_by_vehicles(flown: Flown) -> int:
    """Return the number of frames that vehicles refused by their signatures."""
    links = [vehicle.link.signed for vehicle in flown.fleet.vehicles]
    return sum(judged.frames_refused for link in links if link for judged in link.judged.values())


@pytest.mark.slow
@pytest.mark.parametrize("end", ENDS)
def test_memory_does_not_grow_with_what_is_thrown(end: End) -> None:
    few, many = (fly(DURATION_S, Siege(1, each, end)).kept for each in (THRONG, 3 * THRONG))
    assert many - few < 200


def test_broken_frames_are_counted_for_the_vehicle_they_came_from() -> None:
    station = Station(planned(5), MemoryRecorder())
    peer, writer = Address("127.0.0.1", 40000), FrameWriter(2, 1)
    station.receive([Datagram(0, peer, writer.encode(Heartbeat(1, 3)))], Instant(0))
    for _ in range(3):
        broken = bytearray(writer.encode(Heartbeat(1, 3)))
        broken[12] ^= 0x10
        station.receive([Datagram(0, peer, bytes(broken))], Instant(0))
    assert station.bad_frames(VehicleId(1, 2)) == 3


def test_sound_frames_of_strangers_are_to_none_in_the_formation() -> None:
    """Frames of version 1 used to have the last byte of a longer id: it may be a command's, to any target."""
    source = Hostile(1)
    frames = [frame for _ in range(4000) for frame in StreamParser().feed(source._sound(FOREIGN))]
    targets = {getattr(frame.message, "target_system", FOREIGN_TARGET) for frame in frames}
    assert len(frames) > 3900
    assert targets == {FOREIGN_TARGET}
