"""A medium that several ends share: bytes are conserved, the rate is kept, the order too, whoever sends."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink.clock import Instant, after, nanoseconds, seconds_between
from airlink.impairment import Direction
from airlink.radio.medium import GROUND, Medium
from airlink.radio.settings import RadioSettings

UP, DOWN = Direction.UPLINK, Direction.DOWNLINK
RATE_BPS = 57_600.0


class Offer(NamedTuple):
    at: Instant
    direction: Direction
    vehicle: int
    size_bytes: int

    @property
    def end(self) -> object:
        return GROUND if self.direction is UP else self.vehicle


@st.composite
def traffic(draw: st.DrawFn) -> list[Offer]:
    gaps_us = draw(st.lists(st.integers(0, 30_000), min_size=1, max_size=40))
    found, now = list[Offer](), 0
    for gap_us in gaps_us:
        now += 1000 * gap_us
        direction, vehicle = draw(st.sampled_from(Direction)), draw(st.integers(1, 3))
        found.append(Offer(Instant(now), direction, vehicle, draw(st.integers(1, 280))))
    return found


radios = st.builds(
    RadioSettings,
    uplink_bps=st.floats(5e3, 2e5),
    downlink_bps=st.floats(5e3, 2e5),
    half_duplex=st.booleans(),
    turnaround_s=st.floats(0.0, 0.02),
    buffer_bytes=st.integers(300, 3000),
    arbitration=st.sampled_from(("tdm", "first_come")),
    window_s=st.floats(0.001, 0.2),
)


class Carried(NamedTuple):
    at: Instant
    offer: Offer


def carry(
    settings: RadioSettings, offers: list[Offer], look_s: float = 1e9
) -> tuple[list[Carried], list[Offer], Medium[Offer]]:
    """Return what was carried and what was dropped; until the last offer the medium is looked at every `look_s`."""
    medium, carried, dropped, looked = Medium[Offer](settings), list[Carried](), list[Offer](), Instant(0)
    for offer in [*offers, None]:
        until = after(offers[-1].at, 1e4) if offer is None else offer.at
        while offer is not None and after(looked, look_s) < until:
            looked = after(looked, look_s)
            carried += [Carried(*each) for each in medium.departed(looked)]
        carried += [Carried(*each) for each in medium.departed(until)]
        if offer is not None and not medium.offer(offer.direction, offer.vehicle, offer.size_bytes, offer, offer.at):
            dropped.append(offer)
    return carried, dropped, medium


@given(radios, traffic())
def test_bytes_are_conserved_at_every_end_at_every_moment(settings: RadioSettings, offers: list[Offer]) -> None:
    medium, out = Medium[Offer](settings), dict[object, int]()
    offered, dropped = dict[object, int](), dict[object, int]()
    for offer in offers:
        for _, sent in medium.departed(offer.at):
            out[sent.end] = out.get(sent.end, 0) + sent.size_bytes
        offered[offer.end] = offered.get(offer.end, 0) + offer.size_bytes
        if not medium.offer(offer.direction, offer.vehicle, offer.size_bytes, offer, offer.at):
            dropped[offer.end] = dropped.get(offer.end, 0) + offer.size_bytes
        end = medium.end(offer.direction, offer.vehicle)
        queued = sum(each.size_bytes for each in end.buffer)
        assert queued == end.waiting_bytes <= settings.buffer_bytes
        held = end.offered_bytes - out.get(offer.end, 0) - dropped.get(offer.end, 0)
        assert offered[offer.end] == end.offered_bytes
        assert queued <= held == end.held_bytes


@given(radios, traffic())
def test_the_rate_is_never_exceeded_and_a_change_of_direction_takes_its_time(
    settings: RadioSettings, offers: list[Offer]
) -> None:
    carried, dropped, _ = carry(settings, offers)
    assert len(carried) + len(dropped) == len(offers)
    lanes = (
        [carried] if settings.half_duplex else [[c for c in carried if c.offer.direction is each] for each in Direction]
    )
    for lane in lanes:
        for before, each in pairwise(lane):
            up = each.offer.direction is UP
            min_ns = nanoseconds(settings.airtime_s(each.offer.size_bytes, up=up))
            if before.offer.direction is not each.offer.direction:
                min_ns += nanoseconds(settings.turnaround_s)
            assert each.at - before.at >= min_ns


@given(radios, traffic())
def test_each_end_keeps_the_order_and_sends_nothing_before_it_came(
    settings: RadioSettings, offers: list[Offer]
) -> None:
    carried, dropped, _ = carry(settings, offers)
    for end in {offer.end for offer in offers}:
        passed = [each for each in offers if each.end == end and each not in dropped]
        assert [each.offer for each in carried if each.offer.end == end] == passed
    for at, offer in carried:
        assert at - offer.at >= nanoseconds(settings.airtime_s(offer.size_bytes, up=offer.direction is UP))


@given(radios, traffic(), st.floats(0.002, 0.1))
def test_how_often_the_medium_is_looked_at_changes_nothing(
    settings: RadioSettings, offers: list[Offer], look_s: float
) -> None:
    assert carry(settings, offers)[:2] == carry(settings, offers, look_s)[:2]


@given(traffic(), st.floats(0.0, 0.01))
def test_first_come_is_one_queue(offers: list[Offer], turnaround_s: float) -> None:
    """Recomputed by Lindley's recursion: each begins once it is there and the one before it has left."""
    settings = RadioSettings(
        RATE_BPS, RATE_BPS, turnaround_s=turnaround_s, arbitration="first_come", buffer_bytes=10**6
    )
    free, last, expected = 0, None, list[int]()
    for offer in offers:
        turn = nanoseconds(turnaround_s) if last not in {None, offer.direction} else 0
        free = max(offer.at, free + turn if last is not None else 0) + nanoseconds(8 * offer.size_bytes / RATE_BPS)
        last = offer.direction
        expected.append(free)
    assert [each.at for each in carry(settings, offers)[0]] == expected


def flood(seconds: float, *ends: tuple[Direction, int], size_bytes: int = 60, every_s: float = 0.005) -> list[Offer]:
    steps = int(seconds / every_s)
    return [Offer(after(Instant(0), i * every_s), *end, size_bytes) for i in range(steps) for end in ends]


def test_a_full_half_duplex_channel_carries_its_rate_and_no_more() -> None:
    settings = RadioSettings(RATE_BPS, RATE_BPS)
    carried, dropped, _ = carry(settings, flood(10.0, (UP, 1), (DOWN, 1), (DOWN, 2)))
    sent = [each for each in carried if each.at <= after(Instant(0), 10.0)]
    assert sum(each.offer.size_bytes for each in sent) * 8 / 10.0 == pytest.approx(RATE_BPS, rel=0.002)
    assert dropped


def test_full_duplex_carries_the_rate_in_both_directions() -> None:
    settings = RadioSettings(RATE_BPS, RATE_BPS / 2, half_duplex=False, turnaround_s=0.1)
    carried, _, _ = carry(settings, flood(10.0, (UP, 1), (DOWN, 1)))
    sent = [each for each in carried if each.at <= after(Instant(0), 10.0)]
    for direction, rate_bps in ((UP, RATE_BPS), (DOWN, RATE_BPS / 2)):
        size = sum(each.offer.size_bytes for each in sent if each.offer.direction is direction)
        assert size * 8 / 10.0 == pytest.approx(rate_bps, rel=0.005)


def test_in_turns_every_end_that_floods_gets_the_same_share_and_a_quiet_one_all_it_wants() -> None:
    settings = RadioSettings(RATE_BPS, RATE_BPS, window_s=0.05)
    quiet = [Offer(after(Instant(0), 0.5 * i), UP, 1, 50) for i in range(40)]
    offers = sorted([*flood(20.0, (DOWN, 1), (DOWN, 2), (DOWN, 3)), *quiet], key=lambda each: each.at)
    carried, dropped, _ = carry(settings, offers)
    assert all(each.direction is DOWN for each in dropped)
    shares = [sum(1 for each in carried if each.offer.end == end) for end in (1, 2, 3)]
    assert max(shares) - min(shares) <= 40
    waits_s = [seconds_between(each.offer.at, each.at) for each in carried if each.offer.direction is UP]
    assert max(waits_s) < 3 * 0.05 + 2 * settings.airtime_s(60, up=False)


def test_with_a_turnaround_turns_carry_more_than_first_come() -> None:
    sent = {}
    for rule in ("tdm", "first_come"):
        settings = RadioSettings(RATE_BPS, RATE_BPS, turnaround_s=0.005, arbitration=rule)
        carried, _, _ = carry(settings, flood(10.0, (UP, 1), (DOWN, 1)))
        sent[rule] = sum(1 for each in carried if each.at <= after(Instant(0), 10.0))
    assert sent["tdm"] > 1.4 * sent["first_come"]


def test_the_free_share_of_a_buffer_is_what_doesnt_wait() -> None:
    medium = Medium[int](RadioSettings(8e3, 8e3, buffer_bytes=1000))
    assert medium.free_percent(UP, 1) == 100
    for number in range(5):
        assert medium.offer(UP, 1, 200, number, Instant(0))
    assert medium.free_percent(UP, 1) == 20  # one is being sent, four wait
    assert medium.offer(UP, 1, 200, 5, Instant(0))
    assert not medium.offer(UP, 1, 1, 6, Instant(0))
    assert medium.free_percent(UP, 1) == 0
    assert medium.free_percent(DOWN, 1) == 100
    assert [each.item for each in medium.departed(after(Instant(0), 0.4))] == [0, 1]
    assert medium.free_percent(UP, 1) == 40


def test_an_end_that_is_forgotten_drops_what_waits_and_leaves_its_place_to_another() -> None:
    medium = Medium[str](RadioSettings(8e3, 8e3))
    for word in ("sent", "dropped"):
        medium.offer(DOWN, 1, 100, word, Instant(0))
    medium.remove(1)
    assert medium.offer(DOWN, 2, 100, "other", Instant(0))
    assert [each.item for each in medium.departed(after(Instant(0), 1.0))] == ["sent", "other"]
    assert len(medium.lanes[DOWN].ends) == 1
    assert medium.end(DOWN, 2).held_bytes == 0
