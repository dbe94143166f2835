"""Decides which address speaks for a vehicle.

A system id is no proof of identity, and without signing nothing else is. So another address can't take a vehicle's
place while the vehicle is received. After the vehicle falls silent, another address can, if its time since boot agrees:
its clock must continue the vehicle's, or have started after the vehicle was last received.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Final

from airlink.clock import Instant, after, seconds_between
from airlink.endpoint import Address
from airlink.messages import Message
from airlink.messages.system import Heartbeat
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.link.frame_history import EARLY_S, LONGEST_DELAY_S, TURN_S
from gcs_formation.link.link_health import Connection, LinkState

BOOT_SLACK_S: Final = 1.0
"""Tolerance on a new clock's start: it may seem to precede the last stamp of the old clock by this much. Tuned: s; 0.5
to 3; shown by `pytest tests/gcs_formation/link`."""
BOTH_TALK_S: Final = 1.0
"""If a vehicle is still received this long after another sender started, there are two vehicles, not one that moved.
Tuned: s; 0.5 to 3; shown by `pytest tests/gcs_formation/link`."""
FEWEST_FRAMES: Final = 4
"""Of so many frames not all are ones that the vehicle's link lost, from a second link that isn't known as one yet.
Tuned: frames; 3 to 10; shown by `pytest tests/gcs_formation/link`."""
DISBELIEVED_S: Final = 2.0
"""After this long without a stamp that fits the known clock, an answer with another clock is accepted. Tuned: s; 1 to
5; shown by `pytest tests/gcs_formation/link`."""
NOW_S: Final = 3.0
"""Stamps no older than this, by the vehicle's clock, may be its own by another port. Tuned: s; 2 to 10; shown by
`pytest tests/gcs_formation/link`."""
FORGOTTEN_S: Final = 60.0
"""Silence after which a rival sender is forgotten. Tuned: s; 30 to 300; shown by `pytest tests/gcs_formation/link`."""
MAX_RIVALS: Final = 8
"""Rival senders that are remembered for one vehicle. Tuned: senders; 4 to 32; shown by `pytest
tests/gcs_formation/link`."""

Remote = tuple[int, Address]
"""Socket and address."""


class Evidence(Enum):
    """What the time since boot in a message says about its sender."""

    NONE = "nothing tells its clock"
    GOES_ON = "its clock goes on"
    BOOTED_SINCE = "its clock began after that"
    ANOTHERS = "its clock is another's"


Ruling = tuple[bool, str | None]
"""Whether a frame is accepted as the vehicle's, and the text to report, if any: that the vehicle has moved (accepted),
or that there is a second sender (refused)."""
NOTHING: Final = Evidence.NONE
GOES_ON: Final = Evidence.GOES_ON
ANOTHERS: Final = Evidence.ANOTHERS
SEARCHING: Final = LinkState.SEARCHING


@dataclass
class DuplicateId:
    """Another sender with the same system id."""

    since: Instant
    last: Instant
    refuted: bool = False
    """Whether its clock proved that it is another vehicle."""
    reported: bool = False
    frames: int = 0
    goes_on: bool = False
    stamped: bool = False
    """Whether each of its stamps is of now by the vehicle's clock; whether one came."""


class SourceBinding:
    """Judges the frames with one vehicle's system id."""

    def __init__(self, connection: Connection, clock: ClockSync) -> None:
        """Bind `connection` to the address that speaks for the vehicle; `clock` is the vehicle's."""
        self._connection = connection
        self._clock = clock
        self._agreed = Instant(0)
        """When a stamp of the vehicle's own clock was last seen."""
        self.refused_stamp_s = math.nan
        """Newest stamp from the vehicle's own address that contradicts its clock; NaN if there is none."""
        self.turned_s = 0.0
        """What to add to the last judged stamp for the time since boot, s: a whole number of wraps (`TURN_S`)."""
        self._duplicates: dict[Remote, DuplicateId] = {}
        self._age_s = math.nan
        """Age of the last judged stamp by the vehicle's clock."""

    def rule(self, message: Message | None, socket: int, peer: Address, now: Instant) -> Ruling:
        """Decide on a frame, and bind the vehicle to the frame's address if the evidence supports it."""
        connection, evidence = self._connection, NOTHING
        if message is not None:
            stamp_s = message.boot_s()
            if not math.isnan(stamp_s):
                evidence = self._of_stamp(stamp_s, now)
        if connection.state is SEARCHING:
            if connection.peer is None or isinstance(message, Heartbeat):
                connection.socket, connection.peer = socket, peer
        elif (peer is not connection.peer and peer != connection.peer) or socket != connection.socket:
            return self._judge_other((socket, peer), evidence, now, heartbeat=isinstance(message, Heartbeat))
        if evidence is ANOTHERS and message is not None:
            self.refused_stamp_s = message.boot_s()
            return False, self._duplicate_finding((socket, peer), evidence, now)
        if evidence is GOES_ON or not self._clock.samples:
            self._agreed = now
        return True, None

    def accepts(self, vehicle_time_s: float, now: Instant) -> bool:
        """Return whether to accept a TIMESYNC answer's clock as the vehicle's."""
        doubtful = self._evidence(vehicle_time_s, now) is ANOTHERS
        return not doubtful or seconds_between(self._agreed, now) > DISBELIEVED_S

    def _of_stamp(self, stamp_s: float, now: Instant) -> Evidence:
        """Return what a stamp says; where only a wrapped stamp continues the vehicle's clock, it has wrapped."""
        self.turned_s, evidence = 0.0, self._evidence(stamp_s, now)
        if evidence is GOES_ON or evidence is NOTHING:
            return evidence
        turned_s = TURN_S * math.floor(self._clock.age_s(stamp_s, now) / TURN_S + 0.5)
        if turned_s > 0.0 and self._evidence(stamp_s + turned_s, now) is GOES_ON:
            self.turned_s = turned_s
            return GOES_ON
        return evidence

    def _evidence(self, stamp_s: float, now: Instant) -> Evidence:
        if not self._clock.samples:
            return NOTHING
        self._age_s = self._clock.age_s(stamp_s, now)
        if -EARLY_S <= self._age_s <= LONGEST_DELAY_S:
            return GOES_ON
        booted = after(now, -stamp_s)
        return Evidence.BOOTED_SINCE if booted >= after(self._agreed, -BOOT_SLACK_S) else ANOTHERS

    def _judge_other(self, remote: Remote, evidence: Evidence, now: Instant, *, heartbeat: bool) -> Ruling:
        """Decide on a frame from another address than the vehicle's."""
        state = self._connection.state
        if self._connection.talks or evidence is ANOTHERS:
            return False, self._duplicate_finding(remote, evidence, now)
        refuted = remote in self._duplicates and self._duplicates[remote].refuted
        clockless = heartbeat and not refuted and (state is LinkState.LOST or not self._clock.samples)
        if evidence is NOTHING and not clockless:
            return False, None
        return True, self._move(remote, evidence, now)

    def _move(self, remote: Remote, evidence: Evidence, now: Instant) -> str:
        connection = self._connection
        silence_s = seconds_between(connection.last_received, now)
        before, (connection.socket, connection.peer) = connection.peer, remote
        self._duplicates.pop(remote, None)
        return f"is heard from {remote[1]}; {before} fell silent {silence_s:.1f} s ago, {evidence.value}"

    def _duplicate_finding(self, remote: Remote, evidence: Evidence, now: Instant) -> str | None:
        """Record another sender's frame; return a finding, once, when it is certain that there are two senders."""
        self._duplicates = {
            r: each for r, each in self._duplicates.items() if seconds_between(each.last, now) < FORGOTTEN_S
        }
        duplicate = self._duplicates.get(remote)
        if duplicate is None:
            if len(self._duplicates) >= MAX_RIVALS:
                return None
            duplicate = self._duplicates[remote] = DuplicateId(now, now)
        duplicate.last = now
        duplicate.frames += 1
        duplicate.refuted |= evidence is ANOTHERS
        if evidence is not NOTHING:
            alike = evidence is GOES_ON and self._age_s <= NOW_S
            duplicate.goes_on = alike and (duplicate.goes_on or not duplicate.stamped)
            duplicate.stamped = True
        bound = self._connection.peer
        enough = remote == (self._connection.socket, bound) or duplicate.frames >= FEWEST_FRAMES
        both = enough and self._last_certain(remote) >= after(duplicate.since, BOTH_TALK_S)
        refused = evidence is ANOTHERS and remote[1] != bound
        if duplicate.reported or not (both or refused):
            return None
        duplicate.reported = True
        about = f", {evidence.value}" if evidence is not NOTHING else ""
        return second_sender(remote[1], bound, about)

    def may_be_second_port(self, socket: int, peer: Address) -> bool:
        """Return whether another sender, which is received at the same time, may be the vehicle by another port."""
        duplicate = self._duplicates.get((socket, peer))
        elsewhere = socket != self._connection.socket or peer != self._connection.peer
        return elsewhere and duplicate is not None and duplicate.goes_on and not duplicate.refuted

    def _last_certain(self, remote: Remote) -> Instant:
        """Return when the vehicle itself was last received for certain, given the other sender `remote`."""
        connection = self._connection
        return self._agreed if remote == (connection.socket, connection.peer) else connection.last_received


def second_sender(peer: Address, bound: Address | None, about: str = "") -> str:
    """Return the text about a second sender at `peer`, where the vehicle is `bound` to another or the same address."""
    where = "from the same address" if peer == bound else f"from {peer}, beside {bound}"
    return f"another sender has its system id, {where}{about}; it is ignored"
