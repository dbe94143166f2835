"""Whether a vehicle's heartbeats are missing because they weren't sent, or because the link lost them.

Heartbeats come once a second (MAVLink guide, "Heartbeat/Connection Protocol"). One that was due while no frame was
lost, by the sequence numbers, wasn't sent. How near its due time a lost frame must lie to have been the heartbeat
follows from how punctual they have been: four mean deviations of their intervals, as a TCP sender waits for an
acknowledgement (RFC 6298).
"""

from __future__ import annotations

from collections import deque
from typing import Final

from airlink.clock import NANOSECONDS, Instant, after, rounded, seconds_between
from gcs_formation.link.frame_loss import run_length

PERIOD_S: Final = 1.0
MUTE_AFTER_S: Final = 3.5
"""Three and a half heartbeat periods, as is usual in ground stations. Tuned: s; 2.5 to 5; shown by `pytest
tests/gcs_formation/link`."""
ALL_LOST: Final = 1e-5
"""On a lossy link the limit is longer: until the probability that all due heartbeats were lost is below this. A vehicle
leaves the formation 1.5 s later, when one or two more were due: by a chance of 1e-6. Tuned: probability; 1e-7 to 1e-4;
shown by `python -m benchmarks.features.telemetry_health.faults --fault heartbeat`."""
DEVIATION_SHARE: Final = 1 / 4
"""Weight of each new deviation in their running mean (RFC 6298, section 2)."""
DEVIATIONS: Final = 4.0
"""Mean deviations by which a heartbeat may be off its due time (RFC 6298, section 2)."""
NEAREST_NS: Final = NANOSECONDS // 16
FARTHEST_NS: Final = NANOSECONDS // 4
"""Limits of how far off a lost frame may have been a heartbeat; the farther before heartbeats have shown how punctual
they are. Tuned: ns; 0.03 to 0.1 s and 0.1 to 0.4 s; shown by `pytest tests/gcs_formation/link`: a tick, and an
autopilot's scheduler."""
KEPT_GAPS: Final = 64
"""Gaps in the sequence numbers that are remembered, the newest."""


class Heartbeats:
    """A vehicle's heartbeats on one link, and the gaps in its sequence numbers."""

    def __init__(self) -> None:
        """Start before the first."""
        self.last: Instant = Instant(0)
        """The last heartbeat, or when the vehicle was received again after silence."""
        self._deviation_ns = FARTHEST_NS / DEVIATIONS
        self._gaps: deque[tuple[Instant, Instant]] = deque(maxlen=KEPT_GAPS)
        """When the frames before and after each gap in its sequence numbers were received."""

    def record_gap(self, begun: Instant, ended: Instant) -> None:
        """Record that frames were lost between the arrivals of two others."""
        self._gaps.append((begun, ended))

    def record(self, now: Instant) -> None:
        """Record a heartbeat."""
        interval_s = seconds_between(self.last, now)
        off_s = abs(interval_s - PERIOD_S * max(1, rounded(interval_s / PERIOD_S)))
        off_ns = min(off_s * NANOSECONDS, FARTHEST_NS / DEVIATIONS)
        self._deviation_ns += DEVIATION_SHARE * (off_ns - self._deviation_ns)
        self.last = now

    def missing_s(self, last_received: Instant, loss: float) -> float:
        """Return for how long heartbeats have been missing beyond what `loss` explains, s; negative if they aren't."""
        late_s = seconds_between(self.last, last_received) - MUTE_AFTER_S
        if late_s <= 0.0 or self._unsent(last_received):
            return late_s
        return min(late_s, late_s + MUTE_AFTER_S - run_length(loss, ALL_LOST))

    def _unsent(self, last_received: Instant) -> bool:
        """Return whether one has been due since the last while no frame was lost."""
        near_ns = min(FARTHEST_NS, max(NEAREST_NS, round(DEVIATIONS * self._deviation_ns)))
        known_from = self._gaps[0][0] if len(self._gaps) == KEPT_GAPS else self.last
        due = after(self.last, PERIOD_S)
        while due <= last_received - near_ns:
            lost = any(begun <= due + near_ns and due - near_ns <= ended for begun, ended in self._gaps)
            if not lost and due - near_ns >= known_from:
                return True
            due = after(due, PERIOD_S)
        return False
