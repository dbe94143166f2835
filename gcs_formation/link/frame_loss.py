"""Frames of a vehicle that were lost, by their sequence numbers: gaps, late frames, copies, silences and restarts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from mypy_extensions import i64

from airlink.clock import NANOSECONDS, Instant, rounded, seconds_between

MODULUS: Final = 256
ANY: Final = -1
"""Sequence number not known yet, or not to be checked."""
LATE: Final = MODULUS // 2
"""A number up to this far behind the newest is a late or repeated frame's; any other is ahead of it."""
SKIPPED: Final = 8
"""A gap of more numbers than this, shortly before a restart is known, is due to the restart; a smaller one to loss.
Tuned: numbers; 4 to 32; shown by `pytest tests/gcs_formation/link`."""
NEAR: Final = 16
"""Numbers by which copies may displace the newest. Tuned: numbers; 8 to 64; shown by `pytest
tests/gcs_formation/link`."""
STALE_AFTER_S: Final = 1.5
"""Silence after which a link is stale. Tuned: s; 1 to 3; shown by `pytest tests/gcs_formation/link`."""
STALE_AFTER_NS: Final = round(STALE_AFTER_S * NANOSECONDS)
RARELY: Final = 1e-3
"""Probability that the link at its usual loss loses a longer run of frames than `Silence.run`. Tuned: probability; 1e-4
to 1e-2; shown by `pytest tests/gcs_formation/link`."""
RATE_SHARE: Final = 0.02
"""Relative uncertainty of frame rates. Tuned: share; 0.01 to 0.05; shown by `pytest tests/gcs_formation/link`."""


def run_length(loss: float, probability: float) -> float:
    """Return the run length of lost frames that has a given probability, for a loss of 0 to 1."""
    return math.log(probability) / math.log(loss) if 0.0 < loss < 1.0 else 0.0


class FrameCounts:
    """A vehicle's frame counts at an instant."""

    def __init__(self, at: Instant, received: i64, sent: i64, answers: i64, asked: i64) -> None:
        """Take the instant, frames received and sent, answers among those received, and requests sent."""
        self.at, self.received, self.sent, self.answers, self.asked = at, received, sent, answers, asked


@dataclass
class Silence:
    """What is needed to estimate the number of frames lost in a silence that has ended."""

    seconds: float
    gap: int
    """Number of frames missing by sequence numbers, modulo 256."""
    own: float
    """Number of frames that the vehicle would have sent unasked."""
    answers: float
    """Number of answers that it would have sent besides, had it received the requests."""
    run: float
    """Longest run of frames that the link plausibly loses at its usual loss, and has lost or a filter has kept back."""

    def missed(self, seconds: float) -> int:
        """Return the number of frames lost if the vehicle sent for `seconds`.

        It is the count that agrees with the sequence numbers and is nearest to what the vehicle would have sent, with
        or without answers; if both fit, without. If the numbers have barely advanced and no count fits, the vehicle
        hung and sent nothing.
        """
        if seconds < 0.0:  # it has restarted
            return 0
        share = min(1.0, seconds / self.seconds)
        own, every = share * self.own, share * (self.own + self.answers)
        missed, off = self._nearest(own)
        other, other_off = self._nearest(every)
        if other_off < off and off > RATE_SHARE * own:  # most outages are of both ways
            missed, off = other, other_off
        return self.gap if self.gap <= self.run and off > RATE_SHARE * every else missed

    def _nearest(self, expected: float) -> tuple[int, float]:
        """Return the count nearest to the expected one that agrees with the numbers, and their difference."""
        count = self.gap + MODULUS * max(0, rounded((expected - self.gap) / MODULUS))
        return count, abs(count - expected)


class SequenceTracker:
    """Counts frames received and lost (MAVLink guide, "Packet loss").

    A late frame cancels the loss that its gap was counted as; a repeated one counts as neither received nor lost.
    Sequence numbers wrap: the loss in a silence is the count that agrees with them and with the rate before it. A
    vehicle that receives nothing sends no answers, so its own messages and its answers have separate rates.
    """

    def __init__(self) -> None:
        """Start with nothing received."""
        self.received: i64 = 0
        self.lost: i64 = 0
        self.gaps: i64 = 0
        """Number of gaps that `lost` frames are in: a late frame closes, shortens or parts one."""
        self._longest: i64 = 0  # the most numbers skipped at one of them
        self.repeated: i64 = 0
        self.missed: i64 = 0
        """Frames lost in silences, counted apart from `lost`: they don't tell the link's loss in normal operation."""
        self.answers: i64 = 0
        """Frames received in answer to the station."""
        self.asked: i64 = 0
        """Messages sent to the vehicle that it should answer."""
        self.silence: Silence | None = None
        """The last silence, until the vehicle's clock shows for how long of it the vehicle was sending."""
        self._since = self._next = FrameCounts(Instant(0), 0, 0, 0, 0)
        """The counts from which rates are taken, and the next ones to replace them."""
        self._own_hz = 0.0
        """Rate at which the vehicle sent unasked before the last silence."""
        self._newest: i64 = ANY
        self._expected: i64 = ANY
        """The number of the next frame if none is missing."""
        self._missing: set[int] = set()
        """Numbers counted as lost that may still arrive."""
        self._doubtful = list[int]()
        """Numbers since the newest, of frames that may be copies: the next number shows."""
        self.silent_s = 0.0
        """Time in silences that have ended, s."""
        self._overtakes: i64 = 0  # the most numbers by which a frame came before another, up to `NEAR`
        self._jump, self._jumped = i64(0), i64(0)  # frames counted as lost at the last gap, and received by then

    def observe(self, sequence: i64, now: Instant, last: Instant) -> bool:
        """Take the sequence number of a frame that arrived now; the previous frame arrived at `last`.

        Return whether the known number of lost frames has changed.
        """
        newest = self._newest
        changed = self._observe(sequence, now, last)
        if len(self._doubtful) > 0:
            self._settle(newest, sequence)
        return changed

    def doubt(self, sequence: i64) -> None:
        """Take the number of a frame that may be a copy, and may be news after more losses than are usual here.

        It counts as repeated, unless the next number shows that it was in its turn.
        """
        self.repeated += 1
        self._doubtful.append(sequence)

    def _settle(self, before: i64, sequence: i64) -> None:
        """Judge the doubtful numbers by the one that came next, after `before`."""
        gap = (sequence - before) % MODULUS
        for each in self._doubtful:
            if each in self._missing and (each - before) % MODULUS < gap:
                self.repeated -= 1
                self._observe_late(each)
        self._doubtful.clear()

    def _observe(self, sequence: i64, now: Instant, last: Instant) -> bool:
        silent = now - last >= STALE_AFTER_NS and self._newest != ANY
        marked = self.received == self._next.received and self._newest != ANY  # nothing received since but repeats
        if self.received % MODULUS == 0 and not silent and not marked:
            self._since, self._next = self._next, self._mark(now)
        if sequence == self._expected and not silent:
            self.received += 1
            self._newest = sequence
            self._expected = (sequence + 1) % MODULUS
            return False
        if self._newest == ANY:
            self._newest = (sequence - 1) % MODULUS
        elif silent:
            return self._observe_after_silence(sequence, now, last)
        newest = self._newest
        if (newest - sequence) % MODULUS <= LATE:
            return self._observe_late(sequence)
        gap = (sequence - newest - 1) % MODULUS
        self.received += 1
        self.lost += gap
        self._newest = sequence
        if gap:
            self.gaps += 1
            self._longest = max(self._longest, gap)
            self._jump, self._jumped = gap, self.received
        if self._missing:
            for behind in range(LATE + 1, LATE + gap + 2):  # what was within `LATE` of the newest until now
                self._missing.discard(int((sequence - behind) % MODULUS))
        for ahead in range(1, gap + 1):
            self._missing.add(int((newest + ahead) % MODULUS))
        self._expect()
        return gap > 0

    def may_follow(self, sequence: i64, now: Instant, last: Instant) -> bool:
        """Return whether a number is in its turn.

        It is the next one, or others as may be lost here or in a silence are between; or others overtook it just now.
        """
        if sequence == self._expected or self._newest == ANY or now - last >= STALE_AFTER_NS:
            return True
        if self.was_overtaken(sequence):
            return True
        gap: i64 = (sequence - self._newest - 1) % MODULUS
        return gap <= self._overtakes or float(gap) <= self._likely_run()

    def was_overtaken(self, sequence: i64) -> bool:
        """Return whether a number was skipped just now and hasn't come since: no copy has it."""
        return sequence in self._missing and (self._newest - sequence) % MODULUS < NEAR

    def is_near(self, sequence: i64) -> bool:
        """Return whether a number is shortly before or after the newest: copies may have shown others between."""
        return (self._newest - sequence + NEAR) % MODULUS < 2 * NEAR

    def return_to(self, sequence: i64) -> None:
        """Take back that a number had come which copies showed, far ahead of the present one; what it skipped too."""
        ahead = (self._newest - sequence) % MODULUS
        if self._newest == ANY or not SKIPPED <= ahead <= LATE:
            return
        skipped = {each for each in self._missing if 0 <= (each - sequence) % MODULUS <= ahead}
        self._missing -= skipped
        self.lost -= len(skipped)
        self._newest = (sequence - 1) % MODULUS
        self._expect()

    def overtaken(self, sequence: i64, *, copy: bool) -> None:
        """Take the number of a frame that others overtook: a copy, or one that was counted as lost until now."""
        if copy:
            self.repeated += 1
        elif sequence in self._missing:
            self._observe_late(sequence)
        else:
            self.received += 1
            self.lost = max(0, self.lost - 1)

    def _expect(self) -> None:
        self._expected = ANY if self._missing or self._newest == ANY else (self._newest + 1) % MODULUS

    def restart(self) -> None:
        """Forget the last number: the sender has restarted. What its new numbers seemed to skip wasn't lost."""
        self.sent_for(-1.0)
        if self._jump > SKIPPED and self.received - self._jumped <= LATE:
            self.lost -= self._jump
            self._jump = 0
        self._newest = self._expected = ANY
        self._missing.clear()

    @property
    def loss(self) -> float:
        """Share of sent frames lost outside silences, 0 to 1."""
        sent = self.received + self.lost
        return float(self.lost) / float(sent) if sent else 0.0

    @property
    def mean_gap(self) -> float:
        """Mean number of frames lost in a row outside silences, at least 1."""
        return max(1.0, float(self.lost) / float(self.gaps)) if self.gaps else 1.0

    @property
    def whole_loss(self) -> float:
        """Share of all sent frames lost, silences included, 0 to 1."""
        lost = self.lost + self.missed
        return float(lost) / float(self.received + lost) if lost else 0.0

    def break_off(self, last: Instant, until: Instant) -> None:
        """Count the vehicle's own frames lost in a final silence, from `last` to `until`."""
        self.missed += rounded(self._own_rate_hz(last) * seconds_between(last, until))

    def sent_for(self, seconds: float) -> None:
        """Correct the last silence's loss by how long the vehicle was sending, on its own clock."""
        silence, self.silence = self.silence, None
        if silence is not None:
            self.missed += silence.missed(seconds) - silence.missed(silence.seconds)

    def _observe_after_silence(self, sequence: i64, now: Instant, last: Instant) -> bool:
        """Take the first number after a silence; the numbers skipped aren't expected to arrive late.

        If it is the next number, the vehicle itself was silent and the link lost nothing.
        """
        gap: int = (sequence - self._newest - 1) % MODULUS
        silent_s, missed, self.silence = seconds_between(last, now), 0, None
        self.silent_s += silent_s
        if gap:
            own = self._own_rate_hz(last) * silent_s
            silence = Silence(silent_s, gap, own, self._answers_due(), self._usual_run())
            missed, self.silence = silence.missed(silent_s), silence
        self.missed += missed
        self.received += 1
        self._newest = sequence
        self._since = self._next = self._mark(now)
        self._missing.clear()
        self._expect()
        return missed > 0

    def _usual_run(self) -> float:
        """Return the longest run of numbers that may be skipped as usual.

        Numbers that a router keeps back by kinds come in short runs however many they are, so none longer than those
        seen is usual.
        """
        return min(self._likely_run(), float(self._longest))

    def _likely_run(self) -> float:
        """Return the longest run of frames that is lost with a probability of `RARELY`, alone or in bursts.

        In a burst a frame is lost after another with a probability of 1 - 1 / its mean length (Gilbert 1960).
        """
        return run_length(max(self.loss, 1.0 - 1.0 / self.mean_gap), RARELY)

    def _own_rate_hz(self, last: Instant) -> float:
        """Return the rate of the vehicle's unasked frames until `last`; too short a time keeps the earlier rate."""
        since = self._since if self._since.at else self._next
        if last - since.at >= STALE_AFTER_NS or not self._own_hz:
            received: i64 = max(1, self.received - since.received)
            own_share = 1.0 - float(self.answers - since.answers) / float(received)
            sent: i64 = self.received + self.lost - since.sent
            self._own_hz = own_share * float(sent) * NANOSECONDS / max(last - since.at, STALE_AFTER_NS)
        return self._own_hz

    def _answers_due(self) -> float:
        """Return the number of answers outstanding to requests sent, by the share that the vehicle has answered."""
        since, until = self._since, self._next
        passes = 1.0 - self.loss
        asked, answers = float(until.asked - since.asked), float(until.answers - since.answers)
        answered = answers / (passes * asked) if since.at and asked else 1.0
        return max(0.0, answered * float(self.asked - until.asked) - float(self.answers - until.answers) / passes)

    def _mark(self, now: Instant) -> FrameCounts:
        return FrameCounts(now, self.received, self.received + self.lost, self.answers, self.asked)

    def _observe_late(self, sequence: i64) -> bool:
        late = sequence in self._missing
        if late:
            self._missing.remove(sequence)
            self._overtakes = max(self._overtakes, min((self._newest - sequence) % MODULUS, NEAR))
            self.received += 1
            self.lost -= 1
            before = int((sequence - 1) % MODULUS) in self._missing
            after = int((sequence + 1) % MODULUS) in self._missing
            if before and after:
                self.gaps += 1
            elif not before and not after:
                self.gaps -= 1
            self._jump = max(self._jump - 1, 0)
            self._expect()
        else:
            self.repeated += 1
        return late
