"""A router that passes some kinds of messages only takes numbers out of the sequence, which is no loss."""

from __future__ import annotations

import math
import random
from collections.abc import Container
from typing import Any

import pytest

from airlink import mavlink as m
from airlink.checksum import checksum
from airlink.clock import Instant
from airlink.endpoint import VehicleId
from airlink.engine import Datagram
from airlink.frame import CHECKSUM
from airlink.messages import KINDS
from airlink.messages.command import RequestDataStream
from airlink.stream_parser import StreamParser
from gcs_formation.features.stream_loss.stream_loss import UNKNOWN_GAP
from sim_vehicles.fleet import Fleet
from tests.flights.in_memory import Between, World
from tests.flights.other_station import tell

LONG: dict[str, Any] = {"duration_s": 60, "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [3000, 0, 100]]}}
STREAMS = (m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, m.MAVLINK_MSG_ID_VFR_HUD)
"""The fastest streams: a loss behind a filter is what these lack."""
STATES = (m.MAVLINK_MSG_ID_SYS_STATUS, m.MAVLINK_MSG_ID_EKF_STATUS_REPORT, m.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
SECONDS = 25.0
SIGMAS = 3.0
"""Standard deviations by which a drawn share may be off: of 5300 frames it is off by more than 0.01 in a tenth of
all draws."""


class Router(Between):
    """Passes one in `one_in` frames, by kinds that nobody here requests, and not those in `without`.

    It loses `loss` of what it passes down; while it is `out`, nothing passes either way.
    """

    one_in, loss, out = 5, 0.0, False
    without: tuple[int, ...] = ()

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self._random, self._last = random.Random(1), dict[int, tuple[int, int]]()
        self.fates = dict[int, list[tuple[int, bool]]]()
        """The message ids of each vehicle's frames, and whether they were lost."""

    def take(self, datagram: Datagram, now: Instant) -> None:
        if not self.out:
            super().take(datagram, now)

    def datagrams_to_send(self) -> list[Datagram]:
        return [
            Datagram(each.socket, each.peer, passed)
            for each in super().datagrams_to_send()
            for frame in StreamParser().feed(each.data)
            if (passed := self._passed(frame.raw)) is not None and frame.message_id not in self.without
        ]

    def _passed(self, raw: bytes) -> bytes | None:
        """Return a frame with the number that it has among all that its vehicle sends; None if it's lost."""
        own, number = self._last.get(raw[5], (raw[4] - 1, raw[4] - self.one_in))
        number += (raw[4] - own) % 256 * self.one_in
        if self.one_in > 1:
            number += self._random.randint(-1, 1)
        self._last[raw[5]] = raw[4], number
        kind = int.from_bytes(raw[7:10], "little")
        lost = self.out or self._random.random() < self.loss
        self.fates.setdefault(raw[5], []).append((kind, lost))
        if lost:
            return None
        extra = KINDS[kind].crc_extra
        renumbered = raw[:4] + bytes([number % 256]) + raw[5:-CHECKSUM]
        return renumbered + int(checksum(renumbered, len(renumbered), extra)).to_bytes(2, "little")

    def lost(self, kinds: Container[int] = KINDS) -> list[float]:
        """Return each vehicle's share of lost frames, of some kinds."""
        fates = [[lost for kind, lost in each if kind in kinds] for _, each in sorted(self.fates.items())]
        return [sum(each) / len(each) for each in fates]


def routed(seconds: float = SECONDS, **given: Any) -> World:
    world = World(type("Routed", (Router,), given), **LONG)
    world.run(seconds)
    return world


def router(world: World) -> Router:
    assert isinstance(world.between, Router)
    return world.between


def losses(world: World) -> list[float]:
    return [each.whole_loss for each in world.station.cycle.findings.losses.values()]


def by_numbers(world: World, number: int = 2) -> float:
    return world.station.vehicles[VehicleId(1, number)].sequence.whole_loss


def test_what_a_router_filters_is_no_loss() -> None:
    """Also messages that are requested."""
    world = routed(without=STATES)
    assert by_numbers(world) == pytest.approx(0.8, abs=0.05)
    assert max(losses(world)) < 0.02
    assert {each.mean_gap for each in world.station.cycle.findings.losses.values()} == {UNKNOWN_GAP}


@pytest.mark.parametrize(("loss", "seconds"), [(0.1, SECONDS), pytest.param(0.3, 60.0, marks=pytest.mark.slow)])
def test_what_is_lost_behind_a_filter_is_counted(loss: float, seconds: float) -> None:
    """Of windows of 5 s and more, which leave up to a window's share of the frames out."""
    world = routed(seconds, loss=loss)
    fates = [lost for each in router(world).fates.values() for _, lost in each]
    assert sum(fates) / len(fates) == pytest.approx(loss, abs=SIGMAS * math.sqrt(loss * (1.0 - loss) / len(fates)))
    assert losses(world) == pytest.approx(router(world).lost(STREAMS), abs=0.03)


@pytest.mark.slow
def test_without_a_filter_numbers_count_whatever_the_streams_rates() -> None:
    """Somebody else has them sent more often, to one vehicle, and less often, to another."""
    world = World(type("Routed", (Router,), {"one_in": 1, "loss": 0.2}), **LONG)
    world.fly_to(2.0)
    for number, rate_hz in ((2, 20), (3, 4)):
        tell(world, number, [RequestDataStream(number, 1, m.MAV_DATA_STREAM_ALL, rate_hz, 1)])
    world.run(SECONDS)
    assert losses(world) == [by_numbers(world, number) for number in (1, 2, 3)]


@pytest.mark.slow
def test_a_restart_behind_a_filter_is_no_loss() -> None:
    world = routed()
    world.inject(2, "restart")
    world.run(15.0)
    assert len(world.times_s("restarted", 2)) == 1
    assert max(losses(world)) < 0.03


@pytest.mark.slow
def test_an_outage_behind_a_filter_is_counted_as_without() -> None:
    """For 10 s of some 40 nothing passes either way, so the vehicles don't answer.

    Whether they did, numbers that wrap can't always tell: behind this filter they do so five times as often.
    """
    for one_in in (5, 1):
        world = routed(one_in=one_in)
        router(world).out = True
        world.run(10.0)
        router(world).out = False
        world.run(8.0)
        assert losses(world) == pytest.approx(router(world).lost(), abs=0.02)
