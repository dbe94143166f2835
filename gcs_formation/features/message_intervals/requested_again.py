# Compiled by mypyc: it runs every tick.

"""Watches in flight for messages that stop coming as requested.

Another ground station may have set rates (REQUEST_DATA_STREAM) or switched messages off (MAV_CMD_SET_MESSAGE_INTERVAL):
a vehicle has one set of intervals for everybody on a link.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from librt.vecs import vec
from mypy_extensions import i64, mypyc_attr

from airlink import mavlink as m
from airlink.clock import Instant, after, seconds_between
from airlink.endpoint import VehicleId
from airlink.messages import KINDS
from gcs_formation.link.frame_loss import SequenceTracker
from gcs_formation.link.link_health import LinkState
from gcs_formation.recorder import LogEvent
from gcs_formation.vehicle.command_delivery import Outcome
from gcs_formation.vehicle.vehicle import Vehicle

LOOK_S: Final = 0.5
"""Interval of the looks. Tuned: s; 0.2 to 1; shown by `pytest tests/gcs_formation/features/message_intervals`."""
FEWEST: Final = 16
"""Messages expected in the time over which they are counted, which is at least `WINDOW_S`. Tuned: messages; 10 to 40;
shown by `pytest tests/gcs_formation/features/message_intervals`."""
FEWEST_SENT: Final = 8.0
"""Messages expected in the time in which anything was received, from which on their lack says something. Tuned:
messages; 5 to 20; shown by `pytest tests/gcs_formation/features/message_intervals`."""
QUICK_HZ: Final = 5.0
"""Messages that come at least as often as attitudes are counted over `WINDOW_S`. Tuned: Hz; 2 to 10; shown by `pytest
tests/gcs_formation/features/message_intervals`."""
WINDOW_S: Final = 2.0
"""Time over which quick messages are counted. Tuned: s; 1 to 5; shown by `pytest
tests/gcs_formation/features/message_intervals`."""
MIN_SHARE: Final = 0.5
"""Share of the expected number below which a message is missing. Tuned: share; 0.3 to 0.7; shown by `pytest
tests/gcs_formation/features/message_intervals`."""
SLOWED_SHARE: Final = 0.9
"""Share of the expected number below which a message is requested again together with one that is missing. Tuned:
share; 0.8 to 0.95; shown by `pytest tests/gcs_formation/features/message_intervals`."""
SIGMAS: Final = 4.0
"""Standard deviations of a binomial distribution beyond which loss doesn't explain missing messages. Tuned: standard
deviations; 3 to 5; shown by `pytest tests/gcs_formation/features/message_intervals`."""
ASK_AGAIN_S, ASK_AGAIN_MAX_S = 2.5, 60.0
"""Interval between requests, doubled after each that changes nothing, up to the maximum."""


@mypyc_attr(acyclic=True)
class MessageCounts:
    """Counts of a vehicle's messages at its last looks: a ring of numbers, there from the start.

    A look is named by how many there were since the last `clear` before it.
    """

    def __init__(self, maximum: int, kinds: int) -> None:
        """Keep the counts of so many looks, at so many requested messages."""
        self._max: i64 = maximum
        self._kinds: i64 = kinds
        self.looks: i64 = 0
        """How many there were."""
        self._received_s = vec[float]([0.0] * maximum)
        self._received, self._lost, self._total = (
            vec[i64]([0] * maximum),
            vec[i64]([0] * maximum),
            vec[i64]([0] * maximum),
        )
        self._messages = vec[i64]([0] * (maximum * kinds))

    def clear(self) -> None:
        """Begin again."""
        self.looks = 0

    def add(self, vehicle: Vehicle, indices: vec[i64], since_s: float) -> None:
        """Take the counts; time since the last look in which nothing at all arrived isn't counted against any message.

        Of news: copies of a vehicle that has fallen silent don't count.
        """
        at, total = self.looks % self._max, i64(0)
        for count in vehicle.messages_in:
            total += count
        received_s = 0.0
        if self.looks:
            before = (self.looks - 1) % self._max
            received_s = self._received_s[before] + (since_s if total > self._total[before] else 0.0)
        self._received_s[at], self._total[at] = received_s, total
        self._received[at], self._lost[at] = vehicle.sequence.received, vehicle.sequence.lost
        for index in range(len(indices)):
            self._messages[at * self._kinds + index] = vehicle.messages_in[indices[index]]
        self.looks += 1

    def received_s(self, span: i64) -> float:
        """Return the time, in the last `span` intervals, in which anything was received, s."""
        first, last = self._ends(span)
        return self._received_s[last] - self._received_s[first]

    def arrived(self, index: i64, span: i64) -> i64:
        """Return the number of messages of the kind at `index` in the last `span` intervals."""
        first, last = self._ends(span)
        return self._messages[last * self._kinds + index] - self._messages[first * self._kinds + index]

    def share_arriving(self, span: i64) -> float:
        """Return the share of the frames of the last `span` intervals that arrived."""
        first, last = self._ends(span)
        received, lost = (
            float(self._received[last] - self._received[first]),
            float(self._lost[last] - self._lost[first]),
        )
        return received / (received + max(lost, 0.0)) if received + max(lost, 0.0) > 0.0 else 1.0

    def _ends(self, span: i64) -> tuple[i64, i64]:
        """Return where the first and the last look of `span` intervals are."""
        newest = self.looks - 1
        return (newest - span) % self._max, newest % self._max


class RequestedMessages:
    """The messages requested from one vehicle, and those that arrived."""

    def __init__(self, rates_hz: Mapping[int, float], sequence: SequenceTracker) -> None:
        """Keep counts for as long as the rarest message needs; `sequence`: of the link in use."""
        self.sequence = sequence
        self.missing: tuple[int, ...] = ()
        self.refused = False
        self.next_request = self.last_look = Instant(0)
        self.wait_s = ASK_AGAIN_S
        self.expect(rates_hz)

    def expect(self, rates_hz: Mapping[int, float]) -> None:
        """Expect messages at other rates from now on."""
        self.expected_hz, self.rates_hz = rates_hz, dict(rates_hz)
        self._ids, self._rates = list(self.rates_hz), list(self.rates_hz.values())
        spans = [math.ceil(_window_s(rate_hz) / LOOK_S) for rate_hz in self._rates]
        self._min_hz = vec[float]([MIN_SHARE * rate_hz for rate_hz in self._rates])
        self._spans = vec[i64](spans)
        self.counts = MessageCounts(1 + max(spans), len(spans))
        """The last counts, as many as the rarest message needs."""
        self._places = vec[i64]([KINDS[each].index for each in self._ids])

    def look(self, vehicle: Vehicle, now: Instant) -> None:
        """Record the counts; time in which nothing at all arrives isn't counted against any message."""
        self.counts.add(vehicle, self._places, seconds_between(self.last_look, now))
        self.last_look = now

    def too_few(self) -> tuple[int, ...]:
        """Return the messages of which less than half of the expected number, after loss, arrives."""
        counts, found = self.counts, list[int]()
        for index in range(len(self._spans)):
            span = self._spans[index]
            if counts.looks <= span:
                continue
            count, received_s = counts.arrived(index, span), counts.received_s(span)
            if float(count) < self._min_hz[index] * received_s:
                sent = self._rates[index] * received_s
                if sent >= FEWEST_SENT and _is_too_few(count, sent, counts.share_arriving(span)):
                    found.append(self._ids[index])
        return tuple(found)

    def slowed(self) -> tuple[int, ...]:
        """Return the messages that seem to come more rarely than requested, too few or not.

        Who lowers the rate of one message of motion lowers those of all as a rule; one that was requested at a lower
        rate may still come more than half as often.
        """
        counts, found = self.counts, list[int]()
        for index in range(len(self._spans)):
            span = min(self._spans[index], counts.looks - 1)
            sent = self._rates[index] * counts.received_s(span)
            if float(counts.arrived(index, span)) < SLOWED_SHARE * sent * counts.share_arriving(span):
                found.append(self._ids[index])
        return tuple(found)

    def judged(self, message_ids: tuple[int, ...]) -> bool:
        """Return whether these messages have been counted for long enough."""
        return self.counts.looks > max([self._spans[self._ids.index(message_id)] for message_id in message_ids])


class MessageIntervals:
    """Requests missing messages again, and records events `streams`."""

    def __init__(self, vehicles: Mapping[VehicleId, Vehicle], log_event: LogEvent) -> None:
        """Watch `vehicles`."""
        self._streams = [(each, RequestedMessages(each.rates_hz, each.sequence)) for each in vehicles.values()]
        self._log_event = log_event
        self._next_look = Instant(0)

    def check_all(self, now: Instant) -> None:
        """Check every vehicle if that is due."""
        if now < self._next_look:
            return
        self._next_look = after(now, LOOK_S)
        for vehicle, streams in self._streams:
            if not vehicle.start_up.asked_for_telemetry or not vehicle.connection.talks:
                streams.counts.clear()
            elif vehicle.commands.outcome is not Outcome.WAITING:
                if streams.expected_hz is not vehicle.rates_hz or streams.sequence is not vehicle.sequence:
                    streams.expect(vehicle.rates_hz)
                    streams.sequence = vehicle.sequence
                self._judge(vehicle, streams, now)

    def _judge(self, vehicle: Vehicle, streams: RequestedMessages, now: Instant) -> None:
        streams.look(vehicle, now)
        missing = streams.too_few()
        if vehicle.connection.state is LinkState.MUTE and m.MAVLINK_MSG_ID_HEARTBEAT not in missing:
            missing = (*missing, m.MAVLINK_MSG_ID_HEARTBEAT)
        if streams.missing and not streams.refused and _refuses(vehicle):
            streams.refused = True
            self._log_event(now, "streams", f"refuses to send {_names(streams.missing)} as often as asked for", vehicle)
        if missing and now >= streams.next_request:
            self._request(vehicle, streams, missing, now)
        elif streams.missing and not missing and streams.judged(streams.missing):
            self._log_event(now, "streams", f"sends {_names(streams.missing)} again", vehicle)
            streams.missing, streams.refused, streams.wait_s = (), False, ASK_AGAIN_S

    def _request(self, vehicle: Vehicle, streams: RequestedMessages, missing: tuple[int, ...], now: Instant) -> None:
        if not set(missing) <= set(streams.missing):
            text = f"sends {_names(missing)} less than half as often as asked for, or not at all; it is asked again"
            self._log_event(now, "streams", text, vehicle, {"messages": _names(missing)})
            streams.missing = tuple(dict.fromkeys((*streams.missing, *missing)))
        fast = vehicle.autopilot.fast_messages
        slowed = streams.slowed() if any(each in fast for each in missing) else ()
        wanted = [each for each in streams.rates_hz if each in missing or (each in fast and each in slowed)]
        requests = (vehicle.autopilot.set_message_interval(each, streams.rates_hz[each]) for each in wanted)
        vehicle.commands.send(tuple(requests), now)
        streams.next_request = after(now, streams.wait_s)
        streams.wait_s = min(2.0 * streams.wait_s, ASK_AGAIN_MAX_S)
        streams.counts.clear()


def _window_s(rate_hz: float) -> float:
    return WINDOW_S if rate_hz >= QUICK_HZ else max(WINDOW_S, FEWEST / rate_hz)


def _is_too_few(count: i64, sent: float, arriving: float) -> bool:
    """Return whether `count` is too few of `sent` messages that each arrive with the probability `arriving`."""
    expected, sigma = sent * arriving, math.sqrt(sent * arriving * (1.0 - arriving))
    return expected > 1.0 and float(count) < min(MIN_SHARE * expected, expected - SIGMAS * sigma)


def _refuses(vehicle: Vehicle) -> bool:
    refusal = vehicle.commands.refusal
    refused = vehicle.commands.outcome is Outcome.REFUSED
    return refused and refusal is not None and refusal[0] == m.MAV_CMD_SET_MESSAGE_INTERVAL


def _names(message_ids: tuple[int, ...]) -> str:
    return ", ".join(KINDS[message_id].name for message_id in message_ids)
