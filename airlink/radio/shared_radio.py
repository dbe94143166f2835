"""A radio between an engine's socket side and its vehicles: the medium, then the air, and RADIO_STATUS about both.

The order of a datagram's path: its end's buffer, the medium, the air (delay, jitter, loss of `RadioSettings.air`), then
whatever else impairs its vehicle's own link. Both ends send RADIO_STATUS once a second to what is connected to them,
as SiK's firmware does (`Firmware/radio/mavlink.c`): system 51 ('3'), component 68 ('D'), never over the air.
"""

from __future__ import annotations

from typing import Final, Generic, NamedTuple, TypeVar

from airlink.clock import Instant, after, seconds_between
from airlink.frame import FrameWriter
from airlink.impairment import UNIMPAIRED, Direction
from airlink.messages.system import RadioStatus
from airlink.one_way_channel import Channel
from airlink.radio.medium import GROUND, Medium
from airlink.radio.settings import NOISE, RADIO, RSSI, RadioSettings
from airlink.random_streams import random_stream

T = TypeVar("T")
Vehicle = tuple[int, ...]
"""What distinguishes vehicles, as a key of random streams."""
REPORT_S: Final = 1.0
COUNTS: Final = 0x10000
"""RADIO_STATUS has 16 bits for a count."""


class Passed(NamedTuple, Generic[T]):
    """A datagram that was sent."""

    item: T
    vehicle: Vehicle
    direction: Direction
    size_bytes: int
    left: Instant
    """When its last bit was sent."""
    waited_s: float
    """From its arrival at the radio until then."""
    air_s: float | None
    """How much longer it takes; None: lost."""


class _Entered(NamedTuple, Generic[T]):
    item: T
    vehicle: Vehicle
    direction: Direction
    size_bytes: int
    at: Instant


class SharedRadio(Generic[T]):
    """One radio with all its ends."""

    def __init__(self, settings: RadioSettings, seed: int, number: int = 0) -> None:
        """Start with empty buffers; `number` distinguishes the radios of a run, whose `seed` is that of the run."""
        self.settings = settings
        self.medium = Medium[_Entered[T]](settings)
        self._seed, self._number = seed, number
        self._air: dict[tuple[Vehicle, Direction], Channel] = {}
        self._errors: dict[tuple[Vehicle, Direction], int] = {}
        self._writers: dict[object, FrameWriter] = {}
        self._next_report: Instant | None = None

    def offer(self, direction: Direction, vehicle: Vehicle, size_bytes: int, item: T, now: Instant) -> bool:
        """Take a datagram at `now`, after `passed` of `now`; return False if the buffer is full: it is dropped."""
        if self._next_report is None and self.settings.reports:
            self._next_report = after(now, REPORT_S)
        entered = _Entered(item, vehicle, direction, size_bytes, now)
        return self.medium.offer(direction, vehicle, size_bytes, entered, now)

    def passed(self, now: Instant) -> list[Passed[T]]:
        """Remove and return the datagrams that have been sent by now, in their order."""
        found: list[Passed[T]] = []
        for left, (item, vehicle, direction, size_bytes, at) in self.medium.departed(now):
            air_s = self._air_s(vehicle, direction, size_bytes, left)
            found.append(Passed(item, vehicle, direction, size_bytes, left, seconds_between(at, left), air_s))
        return found

    def next_timer(self) -> Instant | None:
        """Return when a datagram will have been sent, or a report is due; None if neither."""
        timers = [each for each in (self.medium.next_timer(), self._next_report) if each is not None]
        return min(timers, default=None)

    def report_due(self, now: Instant) -> bool:
        """Return whether both ends report now; if so, schedule the next reports."""
        if self._next_report is None or now < self._next_report:
            return False
        missed = int(seconds_between(self._next_report, now) / REPORT_S)
        self._next_report = after(self._next_report, (missed + 1) * REPORT_S)
        return True

    def ground_report(self) -> bytes:
        """Return the frame with which the ground end reports."""
        errors = sum(count for (_, direction), count in self._errors.items() if direction is Direction.DOWNLINK)
        return self._report(GROUND, self.medium.free_percent(Direction.UPLINK, GROUND), errors)

    def vehicle_report(self, vehicle: Vehicle) -> bytes:
        """Return the frame with which a vehicle's end reports to its autopilot."""
        free = self.medium.free_percent(Direction.DOWNLINK, vehicle)
        return self._report(vehicle, free, self._errors.get((vehicle, Direction.UPLINK), 0))

    def lose(self, vehicle: Vehicle, direction: Direction) -> None:
        """Count a datagram that was sent and didn't arrive."""
        key = vehicle, direction
        self._errors[key] = self._errors.get(key, 0) + 1

    def remove(self, vehicle: Vehicle) -> None:
        """Forget a vehicle, whose buffered datagrams are dropped."""
        self.medium.remove(vehicle)
        self._writers.pop(vehicle, None)
        for direction in Direction:
            self._air.pop((vehicle, direction), None)
            self._errors.pop((vehicle, direction), None)

    def _report(self, end: object, free_percent: int, errors: int) -> bytes:
        writer = self._writers.get(end)
        if writer is None:
            writer = self._writers[end] = FrameWriter(*RADIO)
        return writer.encode(RadioStatus(RSSI, RSSI, free_percent, NOISE, NOISE, errors % COUNTS, 0))

    def _air_s(self, vehicle: Vehicle, direction: Direction, size_bytes: int, left: Instant) -> float | None:
        impairment = self.settings.air
        if impairment is UNIMPAIRED:
            return 0.0
        key = vehicle, direction
        channel = self._air.get(key)
        if channel is None:
            stream = random_stream(self._seed, "radio", self._number, *vehicle, direction)
            channel = self._air[key] = Channel(stream)
        arrivals = channel.pass_on(size_bytes, left, impairment)
        return seconds_between(left, arrivals[0]) if arrivals else None
