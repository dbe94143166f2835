"""The links of one vehicle, where it has several: what each measures, and which one is in use.

Each link has its own address, sequence numbers, round trips and clock. Telemetry is taken once: what has a stamp from
whichever link brings it first, what has none from the link in use. What is sent goes out on the link in use alone: the
copy of a setpoint that comes later, by the slower link, would undo a newer one. Heartbeats and TIMESYNC go out on all.

The rule: the link in use is the one by which a setpoint has come through soonest, on average, by its delay, jitter and
loss (as the expected transmission time of routing: Draves, Padhye, Zill, "Routing in Multi-Radio, Multi-Hop Wireless
Mesh Networks", MobiCom 2004). A link that falls silent or is no longer answered on is left at once, if another is
received and answers. A better one is taken once it has been better by `BETTER` for `BETTER_S`, and one that failed not
before `BARRED_S` are over, twice as long after each further failure.

A second vehicle with the same system id must not come in by a second link. So a link is the vehicle's only while its
clock is the one known from the others: their offsets agree to within half of both round trips.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from librt.vecs import vec

from airlink import mavlink as m
from airlink.clock import LONG_AGO, NANOSECONDS, NEVER, Instant, after, seconds_between
from airlink.endpoint import Address
from airlink.frame import Frame
from airlink.messages import KINDS
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.link.frame_history import FrameHistory
from gcs_formation.link.frame_loss import RARELY, SequenceTracker, run_length
from gcs_formation.link.jitter import JitterMeter
from gcs_formation.link.link_health import Connection, LinkState
from gcs_formation.link.round_trips import RoundTrips
from gcs_formation.link.source_binding import SourceBinding

SILENT_S: Final = 0.5
"""A link on which nothing comes for this long is silent: 5 positions at 10 Hz and as much else, one at 2 Hz. Tuned: s;
0.3 to 1; shown by `python -m benchmarks.several_links`."""
OVERDUE_S: Final = 0.08
"""A request is overdue this long after an answer usually comes, for the wait at both ends, besides the jitter. Tuned:
s; 0.04 to 0.2; shown by `python -m benchmarks.several_links`."""
JITTERS: Final = 3.0
"""Standard deviations of the round trip that an answer may take longer. Tuned: standard deviations; 2 to 5; shown by
`pytest tests/gcs_formation/link`."""
FEWEST_UNANSWERED: Final = 2
"""Requests in a row that are overdue, from which on a link is no longer answered on; more where answers are lost.
Tuned: requests; 1 to 5; shown by `python -m benchmarks.several_links`."""
FEWEST_SAMPLES: Final = 4
"""Answers after which a link's delay and clock are known well enough to use it. Tuned: answers; 3 to 10; shown by
`pytest tests/gcs_formation/link`."""
AGREES_S: Final = 0.1
"""Two links' clocks are one if they differ by this more than half of both round trips. Tuned: s; 0.05 to 0.5; shown by
`pytest tests/gcs_formation/link`."""
MEMORY_S: Final = 20.0
"""Losses are remembered for this time (exponentially). Tuned: s; 10 to 60; shown by `pytest
tests/gcs_formation/link`."""
RESEND_S: Final = 0.15
"""A setpoint that is lost is sent again after the round trip and this. Tuned: s; 0.1 to 0.4; shown by `pytest
tests/gcs_formation/link`."""
BETTER: Final = 0.7
"""Share of the other's expected time below which a link is better. Tuned: ratio; 0.5 to 0.9; shown by `pytest
tests/gcs_formation/link`."""
BETTER_BY_S: Final = 0.02
"""By how much less than that share. Tuned: s; 0.01 to 0.05; shown by `pytest tests/gcs_formation/link`."""
BETTER_S: Final = 1.0
"""A link is better if its expected time is below this share of the other's, less this; and is taken after this time.
Tuned: s; 0.5 to 5; shown by `python -m benchmarks.several_links`."""
BARRED_S: Final = 2.0
"""First time for which a link that failed isn't chosen again; doubled at each failure. Tuned: s; 1 to 5; shown by
`pytest tests/gcs_formation/link`."""
BARRED_MAX_S: Final = 30.0
"""Longest such time. Tuned: s; 10 to 120; shown by `pytest tests/gcs_formation/link`."""
FORGIVEN_S: Final = 60.0
"""After this time without a failure a link is barred for `BARRED_S` again. Tuned: s; 30 to 300; shown by `pytest
tests/gcs_formation/link`."""
RESTARTED_S: Final = 10.0
"""A stamp that is older by more than this is of a clock that has restarted; the link's own history has judged that.
Tuned: s; 5 to 30; shown by `pytest tests/gcs_formation/link`."""
GONE: Final = (LinkState.SEARCHING, LinkState.LOST)
"""Nothing is received of the vehicle on a link in these states: then another link may, whatever its clock."""
TRIAL_S: Final = 5.0
"""Time within which a link that has appeared by itself must be proven. Tuned: s; 3 to 15; shown by `pytest
tests/gcs_formation/link`."""
ALIKE: Final = 3
"""Positions near to the vehicle's by which it is. Tuned: positions; 2 to 6; shown by `pytest
tests/gcs_formation/link`."""
NEAR_M: Final = 5.0
"""A link that has appeared by itself is proven by so many positions so near to the vehicle's, within this time; or it
is another's. Nearer than that two vehicles don't fly; a fixed wing turns by 2 m off its velocity in 0.6 s. Tuned: m; 3
to 10; shown by `pytest tests/gcs_formation/link`."""
DISAGREES_S: Final = 3.0
"""After this time a clock that differs is another vehicle's; one that has just restarted is soon seen on all links.
Tuned: s; 2 to 10; shown by `pytest tests/gcs_formation/link`."""
ANSWERS: Final = frozenset(
    (
        m.MAVLINK_MSG_ID_COMMAND_ACK,
        m.MAVLINK_MSG_ID_PARAM_VALUE,
        m.MAVLINK_MSG_ID_HOME_POSITION,
    )
)
"""Messages without a stamp that a vehicle sends where it was asked: they are taken from any link."""


class Link:
    """One link of a vehicle: where it is received there, and what is measured there."""

    def __init__(self, number: int, connection: Connection, loop_s: float, *, by_utc: bool) -> None:
        """Start with nothing received; `number` counts from 1, `loop_s` is the period of its answering loop."""
        self.number, self.connection = number, connection
        self.round_trips = RoundTrips(loop_s, by_utc=by_utc)
        self.source_binding = SourceBinding(connection, self.round_trips.clock)
        self.history = FrameHistory(self.round_trips.clock)
        self.jitter, self.sequence = JitterMeter(), SequenceTracker()
        self.frames_out = 0
        self.loss_down: float = 0.0
        self.loss_up: float = 0.0
        """Shares lost of late, 0 to 1."""
        self.agrees, self.disagrees_since, self.reported = False, NEVER, False
        """Whether its clock has been shown to be the vehicle's, since when it differs, and whether that was said."""
        self.on_trial_since = NEVER
        """Since when it is unproven: it isn't named, it has appeared by itself."""
        self.near, self.far = 0, 0
        """How many positions there were near to, and far from where the vehicle is by the link in use."""
        self.barred_until, self.barred_s, self.failed_at = LONG_AGO, BARRED_S, LONG_AGO
        self._looked = NEVER
        self._counts = [0.0, 0.0, 0.0, 0.0]
        """Frames received and lost, requests and answers, at the last look."""
        self._recent = [0.0, 0.0, 0.0, 0.0]
        """The same, remembered for `MEMORY_S`."""

    @property
    def clock(self) -> ClockSync:
        """The vehicle's clock as known by this link."""
        return self.round_trips.clock

    @property
    def is_known(self) -> bool:
        """Whether its delay and the vehicle's clock are known by it."""
        return self.clock.samples >= FEWEST_SAMPLES

    @property
    def expected_s(self) -> float:
        """The mean time until a setpoint has come through, s; infinite while that isn't known."""
        if not self.is_known:
            return math.inf
        one_way_s, jitter_s = self.clock.one_way_s, self.jitter.jitter_s
        lost = min(max(self.loss_down, self.loss_up), 0.99)
        again_s = lost / (1.0 - lost) * (2.0 * one_way_s + RESEND_S)
        return one_way_s + (0.0 if math.isnan(jitter_s) else jitter_s) + again_s

    def look(self, now: Instant) -> None:
        """Update the shares that are lost while anything passes; called once a tick."""
        sequence, trips = self.sequence, self.round_trips
        requests = trips.requests - self.unanswered(now)  # a run that isn't answered may be the link's end
        counts = [float(sequence.received), float(sequence.lost), float(requests), float(self.clock.samples)]
        if self.failing(now):
            counts[2] = float(trips.requests)
            self._looked, self._counts = now, counts
            return
        kept = 0.0 if self._looked == NEVER else math.exp(-max(0.0, seconds_between(self._looked, now)) / MEMORY_S)
        for index, count in enumerate(counts):
            self._recent[index] = kept * self._recent[index] + count - self._counts[index]
        self._looked, self._counts = now, counts
        received, lost, asked, answered = (max(0.0, each) for each in self._recent)
        self.loss_down = lost / (received + lost) if received + lost > 0.0 else 0.0
        passes = 1.0 - self.loss_down
        both = min(1.0, (answered + 1.0) / (asked + 1.0))  # as if one more had been answered: the newest is under way
        self.loss_up = max(0.0, 1.0 - both / passes) if passes > 0.0 else 0.0

    def failing(self, now: Instant) -> str:
        """Return in words why nothing passes any more, empty if it does."""
        silent_s = seconds_between(self.connection.last_received, now)
        if silent_s > SILENT_S:
            return f"nothing has come for {silent_s:.1f} s"
        overdue = self.unanswered(now)
        answered = (1.0 - self.loss_down) * (1.0 - self.loss_up)
        if overdue >= max(FEWEST_UNANSWERED, math.ceil(run_length(1.0 - answered, RARELY))):
            return f"{overdue} requests in a row aren't answered"
        return ""

    def unanswered(self, now: Instant) -> int:
        """Return how many requests in a row are overdue."""
        if not self.is_known:
            return 0
        jitter_s = self.jitter.jitter_s
        usual_s = 2.0 * self.clock.one_way_s + OVERDUE_S + (0.0 if math.isnan(jitter_s) else JITTERS * jitter_s)
        return self.round_trips.overdue(usual_s, now)

    def usable(self, now: Instant) -> bool:
        """Return whether the vehicle is received here, and receives from us."""
        connection = self.connection
        return connection.talks and self.is_known and self.agrees and not self.failing(now)

    def compare_position(self, separation_m: float) -> None:
        """Take how far a position that came here is from where the vehicle is by the link in use, m."""
        self.near += separation_m <= NEAR_M
        self.far += separation_m > NEAR_M

    def bar(self, now: Instant) -> None:
        """Note that it failed while it was in use."""
        often = seconds_between(self.failed_at, now) < FORGIVEN_S
        self.barred_s = min(2.0 * self.barred_s, BARRED_MAX_S) if often else BARRED_S
        self.failed_at, self.barred_until = now, after(now, self.barred_s)


def links_by(connections: Sequence[Connection], loop_s: float, *, by_utc: bool) -> list[Link]:
    """Return a vehicle's links, one for each connection."""
    return [Link(number, each, loop_s, by_utc=by_utc) for number, each in enumerate(connections, 1)]


class Links:
    """Several links of one vehicle."""

    def __init__(self, each: list[Link]) -> None:
        """Start with the first in use."""
        self.each, self.in_use = each, each[0]
        self.used = [(Instant(0), each[0].number)]
        """From when on each link was in use."""
        self.drains_until = LONG_AGO
        """Until when setpoints that were sent on a slower link before may arrive after newer ones."""
        self._better_since = NEVER
        self._newest_s = vec[float]([math.nan] * len(KINDS))
        """Newest stamp of each kind of message, by any link."""
        self._at_socket = {link.connection.socket: link for link in each}
        self._named = len(each)
        """So many were named in the scenario; the others have appeared by themselves."""

    def at(self, socket: int, peer: Address) -> Link:
        """Return the link of a socket and an address, or the one that was named for the socket; else the one in use."""
        for link in self.each[self._named :]:
            if link.connection.socket == socket and link.connection.peer == peer:
                return link
        return self._at_socket.get(socket, self.in_use)

    def try_port(self, socket: int, peer: Address, now: Instant) -> None:
        """Try a link that isn't named."""
        number, trips = 1 + max(link.number for link in self.each), self.in_use.round_trips
        link = Link(number, Connection(socket, peer), trips.loop_s, by_utc=trips.by_utc)
        link.on_trial_since = now
        self.each.append(link)

    def judge_trial(self, link: Link, now: Instant) -> bool | None:
        """Return whether a link on trial is the vehicle's: its clock and position are; None while that isn't known."""
        used = self.in_use
        if link.far >= ALIKE or seconds_between(link.on_trial_since, now) > TRIAL_S:
            return False
        if not link.is_known or not used.is_known:
            return None
        if not is_one_clock(used.clock, link.clock, now):
            return False
        return True if link.near >= ALIKE else None

    def of(self, connection: Connection) -> Link:
        """Return the link that has a connection."""
        for link in self.each:
            if link.connection is connection:
                return link
        return self.in_use

    def is_news(self, frame: Frame, link: Link) -> bool:
        """Return whether a frame that is news on its link is news of the vehicle, and take it as such."""
        message = frame.message
        if message is None:
            return link is self.in_use
        stamp_s = message.boot_s()
        if math.isnan(stamp_s):
            return link is self.in_use or (link.agrees and frame.message_id in ANSWERS)
        if link is not self.in_use and not link.agrees:
            return False
        place = message.kind().index
        newest_s = self._newest_s[place]
        if stamp_s <= newest_s and (link is not self.in_use or newest_s - stamp_s < RESTARTED_S):
            return False
        self._newest_s[place] = stamp_s
        return True

    def restart(self) -> None:
        """Take stamps from their beginning: the vehicle has restarted."""
        for index in range(len(self._newest_s)):
            self._newest_s[index] = math.nan

    def doubtful(self, now: Instant) -> bool:
        """Return whether an answer on the link in use is overdue."""
        return self.in_use.unanswered(now) > 0

    def choose(self, now: Instant) -> str:
        """Choose the link in use; return why it is another one from now on, empty if it is as it was."""
        used = self.in_use
        for link in self.each:
            link.look(now)
        usable = [link for link in self.each if link is not used and link.usable(now)]
        if not usable:
            self._better_since = NEVER
            return ""
        best = min(usable, key=lambda link: link.expected_s)
        why = "nothing has come there" if used.connection.state is LinkState.SEARCHING else used.failing(now)
        if why:
            used.bar(now)
            return self._take(best, f"on link {used.number} {why}", now)
        better = best.expected_s < BETTER * used.expected_s - BETTER_BY_S and now >= best.barred_until
        if not better:
            self._better_since = NEVER
        elif self._better_since == NEVER:
            self._better_since = now
        elif seconds_between(self._better_since, now) >= BETTER_S:
            times_ms = f"{1e3 * best.expected_s:.0f} ms instead of {1e3 * used.expected_s:.0f} ms"
            return self._take(best, f"a setpoint comes through in {times_ms}", now)
        return ""

    def _take(self, link: Link, why: str, now: Instant) -> str:
        before, self.in_use, self._better_since = self.in_use, link, NEVER
        self.used.append((now, link.number))
        sooner_s = before.clock.one_way_s - link.clock.one_way_s
        if before.is_known and sooner_s > 0.0:
            jitter_s = before.jitter.jitter_s
            self.drains_until = after(now, sooner_s + (0.0 if math.isnan(jitter_s) else JITTERS * jitter_s))
        if before.is_known and is_one_clock(before.clock, link.clock, now):
            link.clock.continue_from(before.clock, now)
        return f"link {link.number} is in use: {why}"

    def compare_clocks(self, now: Instant) -> list[Link]:
        """Judge whose clock is the vehicle's; return the links on which it has just been found to be another's."""
        found, used = list[Link](), self.in_use
        used.agrees, used.disagrees_since, gone = True, NEVER, used.connection.state in GONE
        for link in self.each:
            if link is used or not link.is_known:
                continue
            agrees = used.is_known and is_one_clock(used.clock, link.clock, now)
            if link.on_trial_since != NEVER:
                continue
            link.agrees = agrees or gone
            if link.agrees or not used.is_known:
                link.disagrees_since = NEVER
            elif link.disagrees_since == NEVER:
                link.disagrees_since = now
            elif not link.reported and seconds_between(link.disagrees_since, now) >= DISAGREES_S:
                link.reported = True
                found.append(link)
        return found


def is_one_clock(one: ClockSync, other: ClockSync, now: Instant) -> bool:
    """Return whether two estimates may be of one clock."""
    at_s = now / NANOSECONDS
    difference_s = abs(one.offset_at_s(at_s) - other.offset_at_s(at_s))
    return difference_s <= one.one_way_s + other.one_way_s + AGREES_S
