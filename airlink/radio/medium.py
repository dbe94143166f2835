"""One medium for the datagrams of several senders: who sends when, for how long, and what waits or is dropped.

A lane carries one datagram at a time. Half duplex has one lane for both directions, full duplex one for each. Every
end of the radio has a buffer; which end sends next is decided when the lane becomes free, by a rule of its own
(`FirstCome`, `Turns`), so what arrives meanwhile may come first. Times follow from the arrivals alone, not from when
`departed` is called: a late call finds the same departures. Bytes are conserved: what was offered has been sent, was
dropped, or is held.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Hashable, Sequence
from typing import Final, Generic, NamedTuple, TypeVar

from airlink.clock import Instant, nanoseconds
from airlink.impairment import Direction
from airlink.radio.settings import RadioSettings

T = TypeVar("T")
GROUND: Final = ("the end on the ground",)
"""The sender of all uplinks."""
PERCENT: Final = 100


class Waiting(NamedTuple, Generic[T]):
    """A datagram in a buffer."""

    number: int
    """How many were offered to the lane before it."""
    size_bytes: int
    airtime_ns: int
    item: T


class Departure(NamedTuple, Generic[T]):
    """A datagram whose last bit was sent."""

    at: Instant
    item: T


class End(Generic[T]):
    """One end of the radio: its buffer and its counts, in bytes."""

    def __init__(self, direction: Direction) -> None:
        """Start empty; what it sends goes in `direction`."""
        self.direction = direction
        self.buffer = deque[Waiting[T]]()
        self.waiting_bytes = 0
        """What waits to be sent; what is being sent no longer does."""
        self.offered_bytes = 0
        self.dropped_bytes = 0
        self.sent_bytes = 0

    @property
    def held_bytes(self) -> int:
        """What has neither left nor been dropped: waiting, or being sent."""
        return self.offered_bytes - self.dropped_bytes - self.sent_bytes


class Rule(ABC):
    """Decides which end sends next."""

    @abstractmethod
    def next(self, ends: Sequence[End[T]], last: int) -> int:
        """Return the index of an end whose buffer isn't empty, of which there is one; `last` sent last, -1: none."""


class FirstCome(Rule):
    """The end whose oldest datagram came first."""

    def next(self, ends: Sequence[End[T]], last: int) -> int:  # noqa: ARG002 - who sent last doesn't matter
        """Return its index."""
        ready = (index for index, end in enumerate(ends) if end.buffer)
        return min(ready, key=lambda index: ends[index].buffer[0].number)


class Turns(Rule):
    """The ends in their order, each for up to a window of time; one with nothing to send is passed over.

    So do SiK radios (time division; an end with nothing to send yields its window).
    """

    def __init__(self, window_s: float) -> None:
        """Start before the first turn; a datagram that takes longer than a window is a turn of its own."""
        self._window_ns, self._used_ns = nanoseconds(window_s), 0

    def next(self, ends: Sequence[End[T]], last: int) -> int:
        """Return the index of the end whose turn it is."""
        if last >= 0 and ends[last].buffer:
            used_ns = self._used_ns + ends[last].buffer[0].airtime_ns
            if used_ns <= self._window_ns:
                self._used_ns = used_ns
                return last
        count = len(ends)
        index = next(each % count for each in range(last + 1, last + 1 + count) if ends[each % count].buffer)
        self._used_ns = ends[index].buffer[0].airtime_ns
        return index


class Lane(Generic[T]):
    """Sends one datagram at a time."""

    def __init__(self, settings: RadioSettings) -> None:
        """Start idle."""
        self._settings = settings
        self._turnaround_ns = nanoseconds(settings.turnaround_s) if settings.half_duplex else 0
        self._rule: Rule = Turns(settings.window_s) if settings.arbitration == "tdm" else FirstCome()
        self.ends: list[End[T]] = []
        self._index: dict[Hashable, int] = {}
        self._vacant: list[int] = []
        """Indices of ends that were forgotten."""
        self._last = -1
        """Index of the end that sent last."""
        self._last_direction: Direction | None = None
        self._free_from = Instant(0)
        """When the last datagram had been sent."""
        self._sending: Departure[T] | None = None
        self._sender: End[T] | None = None
        self._sending_bytes = 0
        self._number = 0
        self.busy_ns = 0
        """Time spent sending what has left."""

    def end(self, sender: Hashable, direction: Direction) -> End[T]:
        """Return a sender's end; a new one if it hasn't sent before."""
        index = self._index.get(sender)
        if index is None:
            index = self._vacant.pop() if self._vacant else len(self.ends)
            self.ends[index:] = [End(direction), *self.ends[index + 1 :]]
            self._index[sender] = index
        return self.ends[index]

    def remove(self, sender: Hashable) -> None:
        """Drop what waits at a sender's end, whose index a later sender may take."""
        index = self._index.pop(sender, None)
        if index is not None:
            end = self.ends[index]
            end.buffer.clear()
            end.dropped_bytes, end.waiting_bytes = end.dropped_bytes + end.waiting_bytes, 0
            self._vacant.append(index)

    def offer(self, end: End[T], size_bytes: int, item: T, now: Instant) -> bool:
        """Take a datagram; return whether it fitted into the buffer. `departed` has been called for `now`."""
        end.offered_bytes += size_bytes
        if end.waiting_bytes + size_bytes > self._settings.buffer_bytes:
            end.dropped_bytes += size_bytes
            return False
        airtime_s = self._settings.airtime_s(size_bytes, up=end.direction is Direction.UPLINK)
        end.buffer.append(Waiting(self._number, size_bytes, nanoseconds(airtime_s), item))
        end.waiting_bytes += size_bytes
        self._number += 1
        if self._sending is None:
            self._send_next(now)
        return True

    def next_timer(self) -> Instant | None:
        """Return when a datagram will have been sent; None if nothing is being sent."""
        return None if self._sending is None else self._sending.at

    def departed(self, now: Instant) -> list[Departure[T]]:
        """Remove and return the datagrams that have been sent by now, in their order."""
        found: list[Departure[T]] = []
        while self._sending is not None and self._sending.at <= now:
            sent = self._sending
            found.append(sent)
            if self._sender is not None:
                self._sender.sent_bytes += self._sending_bytes
            self._free_from, self._sending, self._sender = sent.at, None, None
            if any(end.buffer for end in self.ends):
                self._send_next(sent.at)
        return found

    def _send_next(self, now: Instant) -> None:
        index = self._rule.next(self.ends, self._last)
        end = self.ends[index]
        begins = now
        if end.direction is not self._last_direction and self._last_direction is not None:
            begins = Instant(max(now, self._free_from + self._turnaround_ns))
        waiting = end.buffer.popleft()
        end.waiting_bytes -= waiting.size_bytes
        self._last, self._last_direction = index, end.direction
        self._sender, self._sending_bytes = end, waiting.size_bytes
        self._sending = Departure(Instant(begins + waiting.airtime_ns), waiting.item)
        self.busy_ns += waiting.airtime_ns


class Medium(Generic[T]):
    """The lanes of a radio."""

    def __init__(self, settings: RadioSettings) -> None:
        """Start idle."""
        self.settings = settings
        one = Lane[T](settings)
        self.lanes = {Direction.UPLINK: one, Direction.DOWNLINK: one if settings.half_duplex else Lane[T](settings)}

    def end(self, direction: Direction, vehicle: Hashable) -> End[T]:
        """Return the end that sends what goes to a vehicle, or comes from it."""
        return self.lanes[direction].end(GROUND if direction is Direction.UPLINK else vehicle, direction)

    def offer(self, direction: Direction, vehicle: Hashable, size_bytes: int, item: T, now: Instant) -> bool:
        """Take a datagram at `now`, after `departed` of `now`; return False if the buffer is full: it is dropped."""
        return self.lanes[direction].offer(self.end(direction, vehicle), size_bytes, item, now)

    def remove(self, vehicle: Hashable) -> None:
        """Forget a vehicle's end; what waits there is dropped."""
        self.lanes[Direction.DOWNLINK].remove(vehicle)

    def departed(self, now: Instant) -> list[Departure[T]]:
        """Remove and return what has been sent by now, in the order of time."""
        up, down = self.lanes.values()
        found = up.departed(now)
        if down is not up:
            found = sorted([*found, *down.departed(now)], key=lambda each: each.at)
        return found

    def next_timer(self) -> Instant | None:
        """Return when the next datagram will have been sent; None if none is being sent."""
        timers = [timer for lane in self.lanes.values() if (timer := lane.next_timer()) is not None]
        return min(timers, default=None)

    def free_percent(self, direction: Direction, vehicle: Hashable) -> int:
        """Return the free share of an end's buffer, %, as `txbuf` of RADIO_STATUS."""
        free_bytes = self.settings.buffer_bytes - self.end(direction, vehicle).waiting_bytes
        return PERCENT * free_bytes // self.settings.buffer_bytes
