"""What a survey has measured of one vehicle's link."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, Instant, seconds_between
from airlink.frame import Frame
from airlink.messages.system import Heartbeat, Timesync
from flight_model.arrays import Array
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.link.frame_loss import SequenceTracker
from gcs_formation.link.jitter import JitterMeter

ANSWERING_S: Final = {m.MAV_AUTOPILOT_PX4: 0.0, m.MAV_AUTOPILOT_ARDUPILOTMEGA: 0.0025}
"""Period of the loop in which an autopilot answers TIMESYNC; ArduPlane's is `PLANES_S`."""
PLANES_S: Final = 0.02
LONGEST_S: Final = 10.0
"""Requests that are unanswered for less than this may still be answered."""
CLOCK_LIMIT_NS: Final = 2**62


class MeasuredLink:
    """One vehicle's link: its requests and answers, its frames' sequence, and how much came when."""

    def __init__(self, endpoint: str, heartbeat: Heartbeat, now: Instant) -> None:
        """Begin with its first heartbeat."""
        self.endpoint, self.autopilot = endpoint, heartbeat.autopilot
        planes = heartbeat.autopilot == m.MAV_AUTOPILOT_ARDUPILOTMEGA and heartbeat.type == m.MAV_TYPE_FIXED_WING
        self.answering_s = PLANES_S if planes else ANSWERING_S.get(heartbeat.autopilot, 0.0)
        self.clock, self.sequence, self.jitter = ClockSync(self.answering_s), SequenceTracker(), JitterMeter()
        self.first_received = self.last_received = now
        self.restarts = 0
        self.bursts = list[int]()
        """Numbers of frames missing in a row, down."""
        self.bytes_up, self.bytes_down = dict[int, int](), dict[int, int]()
        """By the second."""
        self._sent, self._received = list[Instant](), list[float]()
        self._shown = list[float]()
        """Send times of the requests, ns; arrivals of the answers and the vehicle's times in these, s, NaN: none."""
        self._pending = dict[int, int]()

    def ask(self, now: Instant) -> Timesync:
        """Return a request, and record it."""
        self._pending[now] = len(self._sent)
        self._sent.append(now)
        self._received.append(math.nan)
        self._shown.append(math.nan)
        self.sequence.asked += 1
        return Timesync(0, now)

    def receive(self, frame: Frame, now: Instant) -> None:
        """Take a frame of its autopilot."""
        lost = self.sequence.lost
        self.sequence.observe(frame.sequence, now, self.last_received)
        if self.sequence.lost > lost:
            self.bursts.append(int(self.sequence.lost - lost))
        self.last_received, second = now, int(now // NANOSECONDS)
        self.bytes_down[second] = self.bytes_down.get(second, 0) + len(frame.raw)
        message = frame.message
        if isinstance(message, Timesync):
            self._answered(message, now)
        elif message is not None and frame.message_id == m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT:
            self.jitter.observe(message.boot_s(), now, self.clock.drift)

    def sent(self, size: int, now: Instant) -> None:
        """Count what was sent to it, bytes."""
        second = int(now // NANOSECONDS)
        self.bytes_up[second] = self.bytes_up.get(second, 0) + size

    def _answered(self, answer: Timesync, now: Instant) -> None:
        index = self._pending.pop(answer.ts1_ns, None)
        if index is None or not 0 < answer.tc1_ns < CLOCK_LIMIT_NS:
            return
        self.sequence.answers += 1
        if self.clock.observe(self._sent[index], answer.tc1_ns, now):
            self.restarts += 1
            for earlier in range(index):  # their times are of another clock
                self._shown[earlier] = math.nan
        self._received[index], self._shown[index] = now / NANOSECONDS, answer.tc1_ns / NANOSECONDS

    def delays_s(self, until: Instant) -> tuple[Array, Array, Array, Array]:
        """Return send times, round trips, and delays up and down, (n,) each, s, of what was asked; NaN: unanswered.

        Requests of the last moments, whose answers may still come, are left out. Delays up and down assume that both
        directions take equally long on average. The wait for the answering loop, which is part of a round trip and of
        the delay up, is taken off: its mean, and its share of how these vary.
        """
        asked_s = np.array(self._sent, dtype=np.float64) / NANOSECONDS
        longest_s = 2.0 * float(np.nanmax(np.array(self._received) - asked_s, initial=0.5))
        known = asked_s <= until / NANOSECONDS - min(LONGEST_S, longest_s)
        sent_s, received_s, shown_s = asked_s[known], np.array(self._received)[known], np.array(self._shown)[known]
        at_end_s = float(asked_s[-1]) if self._sent else 0.0
        clock_s = sent_s + self.clock.offset_at_s(at_end_s) + self.clock.drift * (sent_s - at_end_s)
        wait_s = self.answering_s / 2.0
        up_s, trips_s = shown_s - clock_s - wait_s, received_s - sent_s - wait_s
        return sent_s, self._without_wait_s(trips_s), self._without_wait_s(up_s), trips_s - up_s

    def _without_wait_s(self, delays_s: Array) -> Array:
        """Return delays with the variance of the wait taken off theirs."""
        known = delays_s[~np.isnan(delays_s)]
        variance_s2 = float(np.var(known)) if known.size else 0.0
        if variance_s2 == 0.0:
            return delays_s
        share = math.sqrt(max(0.0, 1.0 - self.answering_s**2 / 12.0 / variance_s2))
        mean_s = float(np.mean(known))
        return mean_s + share * (delays_s - mean_s)

    @property
    def requests(self) -> int:
        """Number of requests."""
        return len(self._sent)

    @property
    def answers(self) -> int:
        """Number of answers."""
        return int(np.count_nonzero(~np.isnan(self._received)))

    def received_s(self) -> float:
        """Return for how long it has been received, s."""
        return seconds_between(self.first_received, self.last_received)
