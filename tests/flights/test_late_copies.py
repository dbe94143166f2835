"""Every frame arrives in time, and once more later, as through a second link: the flight is as without that."""

from __future__ import annotations

import random
from typing import Any

import pytest

from airlink.clock import Instant, after
from airlink.endpoint import Endpoint
from airlink.engine import Datagram, DelayQueue
from sim_vehicles.fleet import Fleet
from tests.flights.in_memory import Between, World

SPREAD = 0.5
"""Share of the delay by which shuffled copies differ from it."""
LOSS = 0.005
"""Largest share of frames that seem lost by mistake: before copies are known as such."""


class Copying(Between):
    """Delivers a copy of everything that vehicles send after `late_s`; some originals may never come."""

    late_s, shuffled, elsewhere, loss = 2.0, False, False, 0.0

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self._copies, self._random, self._now = DelayQueue[Datagram](), random.Random(1), Instant(0)

    def endpoints(self) -> tuple[Endpoint, ...]:
        return self.fleet.endpoints() * (2 if self.elsewhere else 1)

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        self._now = now
        super().receive(datagrams, now)

    def datagrams_to_send(self) -> list[Datagram]:
        sent, found = super().datagrams_to_send(), self._copies.pop_due(self._now)
        for each in sent:
            late_s = self.late_s * (self._random.uniform(1 - SPREAD, 1 + SPREAD) if self.shuffled else 1.0)
            socket = each.socket + (len(self.fleet.vehicles) if self.elsewhere else 0)
            self._copies.push(after(self._now, late_s), Datagram(socket, each.peer, each.data))
            if self._random.random() >= self.loss:
                found.append(each)
        return found

    def next_timer(self) -> Instant | None:
        timer, due = super().next_timer(), self._copies.next()
        return timer if due is None else due if timer is None else min(timer, due)

    def handle_timer(self, now: Instant) -> None:
        self._now = now
        timer = super().next_timer()
        if timer is not None and timer <= now:
            super().handle_timer(now)


def flown(between: type[Between], seconds: float = 24.0, restart: bool = False, **keys: Any) -> World:
    """Fly with a change of slots, a freeze and, if wanted, a restart; copies of a minute ago need a minute's flight."""
    world = World(between, **keys)
    world.fly_to(seconds / 2.0)
    if restart:
        world.inject(3, "restart")
    world.run(seconds / 2.0)
    return world


def copying(**given: Any) -> type[Copying]:
    return type("Copied", (Copying,), given)


def reported(world: World) -> list[tuple[str, str, Any]]:
    """Return what was noted, but for copies."""
    return [(event.kind, event.text, event.vehicle) for event in world.recorder.events if event.kind != "copies"]


def figures(world: World) -> tuple[float, ...]:
    vehicles = world.station.vehicles.values()
    return (
        world.worst_m(),
        max(each.jitter.jitter_s for each in vehicles),
        max(each.clock.one_way_s for each in vehicles),
    )


@pytest.fixture(scope="module")
def alone() -> World:
    return flown(Between)


@pytest.mark.parametrize(
    ("late_s", "shuffled", "elsewhere"),
    [
        (0.05, False, False),
        (0.05, True, False),
        (2.0, False, False),
        (2.0, True, False),
        (3.0, False, False),
        (3.0, True, False),
        (2.0, False, True),
        *(
            pytest.param(*each, marks=pytest.mark.slow)
            for each in (
                (0.05, False, True),
                (0.5, True, True),
                (2.0, True, True),
                (6.0, True, True),
                (15.0, True, True),
            )
        ),
        (15.0, False, True),
    ],
)
def test_a_flight_with_late_copies_is_as_one_without(
    late_s: float, shuffled: bool, elsewhere: bool, alone: World
) -> None:
    world = flown(copying(late_s=late_s, shuffled=shuffled, elsewhere=elsewhere))
    assert reported(world) == reported(alone)
    assert figures(world) == pytest.approx(figures(alone), abs=0.002)
    assert max(each.sequence.whole_loss for each in world.station.vehicles.values()) < LOSS
    assert len(world.words("copies")) == len(world.station.vehicles)
    came = 0.8 if late_s < 4.0 else 0.35
    for vehicle in world.station.vehicles.values():
        assert int(vehicle.history.copies) > came * int(vehicle.sequence.received)


class LosingInBursts(Between):
    """Loses a fifth of what vehicles send, 5 datagrams in a row on average."""

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self._random, self._lost = random.Random(2), set[int]()

    def datagrams_to_send(self) -> list[Datagram]:
        return [each for each in super().datagrams_to_send() if not self._is_lost(each.socket)]

    def _is_lost(self, socket: int) -> bool:
        if self._random.random() < (0.2 if socket in self._lost else 0.05):
            self._lost ^= {socket}
        return socket in self._lost


def test_frames_after_bursts_of_losses_are_no_copies() -> None:
    """A heartbeat whose number comes again after 255 others is the same by each bit, and its number isn't the next."""
    world = flown(LosingInBursts, seconds=40.0)
    vehicles = world.station.vehicles.values()
    assert [each.sequence.loss for each in vehicles] == pytest.approx([0.2] * len(vehicles), abs=0.05)
    assert sum(int(each.history.copies) for each in vehicles) <= 1
    assert world.words("copies") == []


class Reordering(Between):
    """Delays each datagram of vehicles by itself, so that later ones overtake it, and loses a few."""

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self._delayed, self._random, self._now = DelayQueue[Datagram](), random.Random(3), Instant(0)

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        self._now = now
        super().receive(datagrams, now)

    def datagrams_to_send(self) -> list[Datagram]:
        for each in super().datagrams_to_send():
            if self._random.random() >= LOSS:
                self._delayed.push(after(self._now, self._random.uniform(0.3, 0.45)), each)
        return list(self._delayed.pop_due(self._now))

    def next_timer(self) -> Instant | None:
        return min((each for each in (super().next_timer(), self._delayed.next()) if each is not None), default=None)

    def handle_timer(self, now: Instant) -> None:
        self._now = now
        timer = super().next_timer()
        if timer is not None and timer <= now:
            super().handle_timer(now)


@pytest.mark.slow
def test_frames_that_others_overtook_are_no_copies() -> None:
    """The same: such a heartbeat's number comes before its turn, and seems to follow losses that are rare here."""
    world = flown(Reordering, seconds=30.0)
    vehicles = world.station.vehicles.values()
    assert min(int(each.history.late) for each in vehicles) > 20, "some are overtaken by others of their kind"
    assert sum(int(each.history.copies) for each in vehicles) <= 3
    assert world.words("copies") == []


@pytest.mark.parametrize("elsewhere", [False, True])
@pytest.mark.slow
def test_copies_while_frames_are_lost_are_no_other_sender(elsewhere: bool) -> None:
    world = flown(copying(late_s=3.0, shuffled=True, loss=0.05, elsewhere=elsewhere))
    assert world.words("duplicate") == []
    assert world.station.flight.path_began is not None
    assert world.worst_m() < 0.2


@pytest.mark.parametrize(("late_s", "elsewhere"), [(2.0, True), (2.0, False)])
def test_copies_of_the_very_first_frames_change_nothing(late_s: float, elsewhere: bool) -> None:
    """Of vehicles that boot on the ground, before their clocks are known or any telemetry was requested."""
    worlds = [World(each, start={"in_air": False}) for each in (copying(late_s=late_s, elsewhere=elsewhere), Between)]
    for world in worlds:
        world.run(6.0)
    copied, alone = map(reported, worlds)
    assert copied == alone
    assert worlds[0].station.phase_machine.failure is None


@pytest.mark.parametrize(("late_s", "elsewhere"), [(8.0, False), pytest.param(8.0, True, marks=pytest.mark.slow)])
def test_copies_do_not_keep_a_vehicle_alive_that_has_fallen_silent(late_s: float, elsewhere: bool) -> None:
    worlds = [World(each) for each in (copying(late_s=late_s, elsewhere=elsewhere), Between)]
    for world in worlds:
        world.fly_to(8.0)
        world.inject(3, "freeze")
        world.run(8.0)
    assert reported(worlds[0]) == reported(worlds[1])
    assert len(worlds[0].times_s("link", 3, "lost")) == 1


def test_a_restart_among_late_copies_is_recognised() -> None:
    world = flown(copying(late_s=3.0), restart=True)
    assert len(world.times_s("restarted", 3)) == 1
    assert world.words("duplicate") == []


@pytest.mark.slow
@pytest.mark.parametrize("shuffled", [False, True])
def test_copies_of_a_minute_ago_change_nothing_either(shuffled: bool) -> None:
    keys: dict[str, Any] = {"duration_s": 120, "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [4000, 0, 100]]}}
    world, alone = (flown(each, 130.0, **keys) for each in (copying(late_s=60.0, shuffled=shuffled), Between))
    assert sorted(map(str, reported(world))) == sorted(map(str, reported(alone))), (
        "a heartbeat may count a second later"
    )
    assert figures(world) == pytest.approx(figures(alone), abs=0.002)
