"""Which frames of a vehicle are news, and which are copies of earlier ones or come after newer ones: history.

A second link, a router or a radio may deliver every frame once more, seconds or a minute late. What such a frame says
was true once: it must change nothing. Three things tell:

- Frames with a time since boot: one that is older than the newest of its kind is history, known or not.
- Frames that were received before, byte for byte: their checksums, which cover the sequence number too, are kept for
  two minutes at least. By that alone a heartbeat isn't a copy, for its number comes again after 255 others.
- So while copies come, a frame without a time is news only if its number follows the newest one's. If it also was
  received before and contradicts the newest of its kind, the vehicle must have stopped saying the newest.

From another address a known frame is a copy however old, also before the vehicle's clock is known. A second vehicle
with the same id may begin with the same frames, but it isn't asked what the first one is: its numbers soon differ, and
frames that never came before show that it sends its own.
"""

from __future__ import annotations

import math
from typing import Final

from librt.vecs import vec
from mypy_extensions import i64

from airlink import mavlink as m
from airlink.clock import LONG_AGO, NANOSECONDS, Instant
from airlink.frame import HEADER_V1, HEADER_V2, Frame
from airlink.messages import KINDS
from gcs_formation.link.clock_sync import ClockSync

LONGEST_DELAY_S: Final = 10.0
"""Largest age of a time stamp on arrival. Tuned: s; 5 to 60; shown by `pytest tests/gcs_formation/link`."""
EARLY_S: Final = 2.0
"""How far in the future a stamp may lie: the clock mapping errs by half the difference of the two delays. Tuned: s; 1
to 5; shown by `pytest tests/gcs_formation/link`."""
TURN_S: Final = 2.0**32 / 1e3
"""Stamps are milliseconds in 32 bits and wrap after this time, 49.7 days; TIMESYNC's have 64 bits."""
KEPT_NS: Final = 120 * NANOSECONDS
"""Received frames are remembered for this long at least, twice as long at most. Tuned: ns; 30 to 600 s; shown by
`pytest tests/gcs_formation/link`."""
MARKS: Final = 1 << 18
"""Bits, one of which each remembered frame sets: of a vehicle's frames in `KEPT_NS` some 3 % share one by chance."""
COPIES_COME_NS: Final = 10 * NANOSECONDS
"""For this long after a copy, others are expected. Tuned: ns; 5 to 60 s; shown by `pytest tests/gcs_formation/link`."""
CURRENT_NS: Final = 5 * NANOSECONDS // 2
"""What wasn't sent again for this long may be contradicted by a frame as received before. Tuned: ns; 1 to 5 s; shown by
`pytest tests/gcs_formation/link`."""
SUSPICION: Final = 3.0
"""Number of frames that must seem to be copies until copies come. Tuned: frames; 2 to 6; shown by `pytest
tests/gcs_formation/link`."""
CALMED: Final = 0.25
"""Copies come once this many frames seem to be some; each other frame counts for so much less. By chance, or where a
heartbeat's number comes again just after a loss, one in twenty may seem so. Tuned: frames; 0.1 to 0.5; shown by `pytest
tests/gcs_formation/link`."""
OTHERS_OWN: Final = 12
"""After so many frames in a row that hadn't been received before, another address doesn't send copies, but its own.
Tuned: frames; 8 to 30; shown by `pytest tests/gcs_formation/link`."""
BYTE: Final = 8
STATES: Final = (
    m.MAVLINK_MSG_ID_HEARTBEAT,
    m.MAVLINK_MSG_ID_CURRENT_MODE,
    m.MAVLINK_MSG_ID_SYS_STATUS,
    m.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    m.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
)
"""Messages without a time that say how the vehicle is, until it is otherwise. A measurement contradicts no other."""


class CopyEvidence:
    """What speaks for copies that come from one place: when one came last, and how much suggests others."""

    def __init__(self) -> None:
        """Start without any."""
        self.last: i64 = LONG_AGO
        """When a copy came last."""
        self._suspicion: float = 0.0

    def weigh(self, now: i64, *, suspicious: bool) -> None:
        """Take whether a frame seems to be a copy; a few may seem so by chance."""
        suspicion = self._suspicion + (1.0 if suspicious else -CALMED)
        self._suspicion = max(0.0, min(2.0 * SUSPICION, suspicion))
        if suspicious and suspicion >= SUSPICION:
            self.last = now


class FrameHistory:
    """What was received from one vehicle, by which later frames are judged."""

    def __init__(self, clock: ClockSync) -> None:
        """Start with nothing received; `clock` is the vehicle's."""
        self.copies: i64 = 0
        """Number of frames that had been received before."""
        self.late: i64 = 0
        """Number of others that came after newer ones."""
        self.is_news = True
        """Whether the frame judged last is news."""
        self.was_copy = False
        """Whether it had been received before."""
        self.may_be_copy = False
        """Whether the frame taken last, without a time, had been received before: its number proves no loss."""
        self._clock = clock
        self._newest_s = vec[float]([math.nan] * len(KINDS))
        """Newest stamp of each kind of message."""
        self._seen, self._seen_before = bytearray(MARKS // BYTE), bytearray(MARKS // BYTE)
        self._renewed = Instant(0)
        self._own, self._others = CopyEvidence(), CopyEvidence()
        """From the vehicle's own address, and from others."""
        self._others_own: i64 = 0
        """Frames from other addresses since the last one that had been received before."""
        self._last = dict[int, tuple[bytes, Instant]]()
        """Newest payload of each of `STATES`, and when it was sent last."""

    def copies_come(self, now: Instant, *, elsewhere: bool = False) -> bool:
        """Return whether copies have just come from the vehicle's own address, or from another one."""
        if elsewhere:
            return now - self._others.last < COPIES_COME_NS and self._others_own < OTHERS_OWN
        return now - self._own.last < COPIES_COME_NS

    def is_copy(
        self, frame: Frame, now: Instant, *, elsewhere: bool, follows: bool, overtaken: bool, silent: bool
    ) -> bool:
        """Return whether a frame had been received before, and count it if so.

        `elsewhere`: it is from another address than the vehicle's; `follows`: its number may follow the newest one's;
        `overtaken`: its number was skipped just now, so that it has a known frame's mark by chance.
        After a silence any number may: while copies come, that is none of the vehicle's words, and without them one
        from another address may be, for it may have moved.
        """
        known = self._knows(_mark(frame)) and (elsewhere or not overtaken)
        stamp_s = math.nan if frame.message is None else frame.message.boot_s()
        timed = not math.isnan(stamp_s)
        if elsewhere:
            self._others_own = 0 if known else self._others_own + 1
        copied = known and timed and (self._is_old(frame, stamp_s) or not self._is_of_now(stamp_s, now))
        if timed or not elsewhere:
            evidence = self._others if elsewhere else self._own
            evidence.weigh(now, suspicious=copied or (known and not timed and not follows))
        if known and not timed:
            if elsewhere:
                copied = not silent or self.copies_come(now, elsewhere=True)
            elif self.copies_come(now):
                copied = silent or not (follows and self._agrees(frame, now))
            else:
                copied = not (follows or self._agrees(frame, now))
        if copied:
            self.copies += 1
            self.is_news, self.was_copy = False, True
        return copied

    def is_lost_one(self, frame: Frame, now: Instant, *, elsewhere: bool) -> bool:
        """Return whether a frame that never came seems to be among the copies that come: it shows no other sender.

        Copies of a minute ago would otherwise look like those of another vehicle, with another clock.
        """
        if not self.copies_come(now, elsewhere=elsewhere):
            return False
        stamp_s = math.nan if frame.message is None else frame.message.boot_s()
        if elsewhere:
            return math.isnan(stamp_s) or self._is_old(frame, stamp_s) or not self._is_of_now(stamp_s, now)
        return self._is_old(frame, stamp_s) and not self._is_of_now(stamp_s, now)

    def record(self, frame: Frame, now: Instant, *, follows: bool, awaited: bool) -> None:
        """Take a frame of the vehicle that isn't a copy, and judge whether it is news.

        `awaited`: it is the answer to a request, which no other frame can be.
        """
        mark, message = _mark(frame), frame.message
        stamp_s = math.nan if message is None else message.boot_s()
        self.may_be_copy = math.isnan(stamp_s) and self._knows(mark)
        self._remember(mark, now)
        self.was_copy = False
        if message is None or math.isnan(stamp_s):
            self.is_news = follows or awaited or not self.copies_come(now)
            if self.is_news and frame.message_id in STATES:
                self._last[frame.message_id] = _payload(frame), now
        else:
            self.is_news = not (self._is_old(frame, stamp_s) and self._goes_on(frame, stamp_s, now))
            if self.is_news:
                self._newest_s[message.kind().index] = stamp_s
        self.late += not self.is_news

    def restart(self) -> None:
        """Take stamps from their beginning: the vehicle has restarted, or another sender is the vehicle now."""
        for index in range(len(self._newest_s)):
            self._newest_s[index] = math.nan
        self._last.clear()

    def _is_old(self, frame: Frame, stamp_s: float) -> bool:
        """Return whether a stamp is no newer than the newest of its kind."""
        if frame.message is None:
            return False
        since_s = stamp_s - self._newest_s[frame.message.kind().index]
        return -TURN_S / 2.0 < since_s <= 0.0

    def _goes_on(self, frame: Frame, stamp_s: float, now: Instant) -> bool:
        """Return whether an older stamp, and the newest of its kind, are of the vehicle's present clock."""
        if frame.message is None or not self._clock.samples:
            return False
        newest_s = self._newest_s[frame.message.kind().index]
        return stamp_s < newest_s and self._is_of_now(stamp_s, now) and self._is_of_now(newest_s, now)

    def _is_of_now(self, stamp_s: float, now: Instant) -> bool:
        """Return whether the vehicle's clock showed a stamp shortly before now; True while the clock is unknown."""
        if not self._clock.samples:
            return True
        age_s = self._clock.age_s(stamp_s, now)
        age_s -= TURN_S * math.floor(age_s / TURN_S + 0.5)
        return -EARLY_S <= age_s <= LONGEST_DELAY_S

    def _agrees(self, frame: Frame, now: Instant) -> bool:
        """Return whether a frame received before says what the newest of its kind does, or that is no longer said."""
        if frame.message_id not in STATES:
            return True
        last = self._last.get(frame.message_id)
        return last is None or last[0] == _payload(frame) or now - last[1] > CURRENT_NS

    def _knows(self, mark: i64) -> bool:
        index, bit = mark // BYTE, 1 << mark % BYTE
        return bool((self._seen[index] | self._seen_before[index]) & bit)

    def _remember(self, mark: i64, now: Instant) -> None:
        if now - self._renewed > KEPT_NS:
            self._renewed, self._seen_before, self._seen = now, self._seen, bytearray(MARKS // BYTE)
        self._seen[mark // BYTE] |= 1 << mark % BYTE


def _begin(frame: Frame) -> int:
    return HEADER_V2 if frame.version == 2 else HEADER_V1


def _payload(frame: Frame) -> bytes:
    begin = _begin(frame)
    return frame.raw[begin : begin + frame.raw[1]]


def _mark(frame: Frame) -> i64:
    """Return by which bit a frame is remembered: its checksum, and two bits of its payload's first byte."""
    raw, begin = frame.raw, _begin(frame)
    end = begin + raw[1]
    return raw[end] | raw[end + 1] << BYTE | (raw[begin] & 3) << 2 * BYTE
