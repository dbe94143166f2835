"""Commands and setpoints of one vehicle, repeated until they are acknowledged, and whether they then take effect.

Source: MAVLink guide, "Command Protocol".
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from airlink import mavlink as m
from airlink.clock import NEVER, Instant, after, seconds_between
from airlink.messages.command import CommandAck, CommandInt, CommandLong
from gcs_formation.vehicle.effect import Effect
from gcs_formation.vehicle.startup_step import Command
from gcs_formation.vehicle.telemetry import Telemetry

RETRY_S: Final = 0.7
AT_ONCE_S: Final = 0.1
"""A command sent `twice` is repeated after this time first."""
MAX_SPARING: Final = 3
"""Over a full link an attempt waits for up to 2 to the power of this times `RETRY_S`."""
RETRY_REFUSED_S: Final = 3.0
"""Interval at which a command sent with `insist` is repeated after a lasting refusal."""
MAX_CONFIRMATION: Final = 255
TRY_AGAIN = (m.MAV_RESULT_TEMPORARILY_REJECTED, m.MAV_RESULT_FAILED)
"""Results that may change by themselves: a vehicle that can't be armed yet answers FAILED."""
UNDER_WAY: Final = m.MAV_RESULT_IN_PROGRESS
REFUSES_S: Final = 2.0
"""A command counts as refused once every answer for this time has been a refusal."""
REFUSED_S: Final = 1.0
REFUSED_HEARTBEATS: Final = 2
"""Setpoints count as refused once every answer for this time, and over this many heartbeats, has been a refusal. A
vehicle just taken over by a pilot refuses those that were still on their way."""
REFUSALS_ALIKE: Final = 2
"""A setpoint that has been refused so often isn't sent again alike, unless the vehicle's mode has changed since."""
SILENT_S: Final = 5.0
"""Setpoints repeated for this long without an answer count as unacknowledged."""
GAP_S: Final = 0.5
"""When acknowledgements of setpoints are later than this, setpoints may have been lost."""
REPEAT_S: Final = 1.0
"""A setpoint is repeated after this time while it isn't acknowledged; acknowledged ones take turns, one each time."""
QUICKEST: Final = 0.75
PATIENCE: Final = 1.5
"""Durations of the quickest and the slowest answer, as multiples of the usual round trip."""
LOOPS_S: Final = 0.15
"""Time that a setpoint and its answer may wait for the loops at both ends."""
LOSSY_WAIT_S: Final = 0.05
"""Over a link that loses, the first wait for an acknowledgement: the next tick repeats the setpoint."""
MAX_DOUBLINGS: Final = 10
SHOWN_WITHIN_S: Final = 2.0
SHOWN_IN_HEARTBEATS: Final = 2
"""A command has no effect if none is seen within this time and this many heartbeats after its acknowledgement. It has
had its effect, acknowledged or not, if this many heartbeats show it at least this time after its first attempt."""


class Outcome(Enum):
    """State of a list of commands."""

    IDLE = "idle"
    WAITING = "waiting"
    ACCEPTED = "accepted"
    REFUSED = "refused"


@dataclass
class CommandQueue:
    """Sends a list of commands in order, each until it is acknowledged.

    A lasting refusal ends the list, unless `insist` is set: then the command is repeated until it is accepted, or until
    heartbeats show that it has been carried out.
    """

    outcome: Outcome = Outcome.IDLE
    refusal: tuple[int, int] | None = None
    """Command and MAV_RESULT of the last refusal."""
    since: Instant = Instant(0)
    """When the current command began, or the list ended."""
    insists: bool = False
    """Whether the list continues after a refusal."""
    spares: bool = False
    """Whether the link is full: each attempt then waits twice as long for its answer as the one before."""
    lists: int = 0
    """Number of lists begun."""
    _waiting: deque[Command] = field(default_factory=deque[Command])
    _attempt: int = 0
    _next_attempt: Instant = Instant(0)
    _first_attempt: Instant = Instant(0)
    _answered: int = 0
    """Number of answered attempts of the current command."""
    _refused: Instant | None = None
    """Since when the current command has been refused."""
    _shown: int = 0
    """Number of consecutive heartbeats that have shown its effect."""
    _twice: bool = False
    """Whether the first attempt is repeated at once."""
    _late: tuple[int, int, Instant] = (0, 0, Instant(0))
    """A command accepted before all of its attempts were answered: its id, the number of answers outstanding, and until
    when they may arrive."""

    def send(self, commands: tuple[Command, ...], now: Instant, *, insist: bool = False, twice: bool = False) -> None:
        """Start these commands and drop any earlier ones; `insist`: repeat them whatever the vehicle answers.

        `twice`: repeat each at once, as over a link that loses where others are commanded the same.
        """
        self._waiting, self.insists, self.refusal, self._twice = deque(commands), insist, None, twice
        self.lists += 1
        self._start_next(now)

    def due(self, now: Instant) -> Command | None:
        """Return the command to send now, if any."""
        if self.outcome is not Outcome.WAITING or now < self._next_attempt:
            return None
        command = self._waiting[0]
        if not self._attempt:
            self._first_attempt, self._answered = now, 0
        if isinstance(command, CommandLong):
            command = command.but(confirmation=min(self._attempt, MAX_CONFIRMATION))
        self._attempt += 1
        doublings = min(self._attempt - 1, MAX_SPARING) if self.spares else 0
        at_once = self._twice and self._attempt == 1 and not self.spares
        self._next_attempt = after(now, AT_ONCE_S if at_once else RETRY_S * 2.0**doublings)
        return command

    @property
    def under_way(self) -> Command | None:
        """The command whose acknowledgement is awaited, if any."""
        return self._waiting[0] if self._waiting else None

    def acknowledge(self, ack: CommandAck, now: Instant, *, early: bool = False) -> Command | None:
        """Take an acknowledgement; return the command that it accepts. Those of other commands are ignored.

        `early`: an acceptance doesn't count yet, and the command is repeated.
        """
        if self.outcome is not Outcome.WAITING or ack.command != self._waiting[0].command or not self._attempt:
            return None
        if ack.result == UNDER_WAY or self._is_late(ack, now):
            return None
        self._answered += 1
        if ack.result == m.MAV_RESULT_ACCEPTED:
            if early:
                return None
            accepted = self._waiting.popleft()
            self._expect_late(ack.command, now)
            self._start_next(now)
            return accepted
        self._refuse(ack, now)
        return None

    def _start_next(self, now: Instant) -> None:
        self._attempt, self._next_attempt, self.since = 0, now, now
        self._refused, self._shown = None, 0
        self.outcome = Outcome.WAITING if self._waiting else Outcome.ACCEPTED

    def _refuse(self, ack: CommandAck, now: Instant) -> None:
        self.refusal = (ack.command, ack.result)
        if self._refused is None:
            self._refused = now
        if ack.result in TRY_AGAIN:
            return
        if self.insists:
            self._next_attempt = after(now, RETRY_REFUSED_S)
        else:
            self.outcome = Outcome.REFUSED

    def refused(self, now: Instant) -> bool:
        """Return whether the current command is sent with `insist` and has been refused for a while."""
        if not self.insists or self._refused is None:
            return False
        return seconds_between(self._refused, now) >= REFUSES_S

    @property
    def refused_with(self) -> int | None:
        """MAV_RESULT of the last refusal of the current command if it is sent with `insist`, otherwise None."""
        if not self.insists or self._refused is None or self.refusal is None:
            return None
        return self.refusal[1]

    def take_heartbeat(self, *, shown: bool, known: bool, now: Instant) -> None:
        """Take a heartbeat; `shown`: it shows the current command's effect.

        `known`: it may have shown this before the command, so it counts only after an answer.
        """
        self._shown = self._shown + 1 if shown and self._attempt else 0
        if self._shown < SHOWN_IN_HEARTBEATS or (known and self._refused is None):
            return
        if seconds_between(self._first_attempt, now) >= SHOWN_WITHIN_S:
            self._waiting.popleft()
            self._start_next(now)

    def _expect_late(self, command: int, now: Instant) -> None:
        """Note how many answers to earlier attempts at the command just accepted are still on their way.

        They arrive within a round trip of its last attempt; a round trip is at most the time since its first attempt.
        """
        if self._attempt > self._answered:
            round_trip_s = seconds_between(self._first_attempt, now)
            until = after(self._next_attempt, round_trip_s - RETRY_S)  # later, where attempts are spared
            self._late = command, self._attempt - self._answered, until

    def _is_late(self, ack: CommandAck, now: Instant) -> bool:
        """Return whether an acknowledgement answers an earlier attempt at the previous command, and count it if so."""
        command, count, until = self._late
        late = ack.command == command and count > 0 and now <= until
        if late:
            self._late = command, count - 1, until
        return late


class EffectWatch:
    """Watches the last acknowledged command until it takes effect, or until somebody else changes the state."""

    def __init__(self) -> None:
        """Start with no command."""
        self.missing: str | None = None
        """The effect that an acknowledged command should have had and hasn't, in words; None if nothing is missing."""
        self.missing_s = 0.0
        """Time from the acknowledgement until this was found, s."""
        self._effect: Effect | None = None
        self._since = Instant(0)
        self._before: int | None = None
        self._heartbeats = 0

    @property
    def watching(self) -> bool:
        """Whether a command's effect hasn't been seen yet."""
        return self._effect is not None

    def acknowledged(self, effect: Effect, seen: Telemetry, now: Instant) -> None:
        """Watch for the effect of a command just acknowledged, in place of the previous one."""
        self._effect, self._since = effect, now
        self._before, self._heartbeats = effect.shown(seen), seen.heartbeats

    def update(self, seen: Telemetry, now: Instant) -> None:
        """Update `missing`. A state that is neither the expected nor the earlier one was chosen by the pilot."""
        effect = self._effect
        if effect is None:
            return
        shown = effect.shown(seen)
        if shown in (effect.expected, None) or shown != self._before:
            self._effect = self.missing = None
            return
        waited_s = seconds_between(self._since, now)
        missed = waited_s >= SHOWN_WITHIN_S and seen.heartbeats >= self._heartbeats + SHOWN_IN_HEARTBEATS
        if missed and self.missing is None:
            self.missing, self.missing_s = effect.description, waited_s


class SetpointChannel:
    """One kind of setpoint of a vehicle that acknowledges setpoints: what was sent last, and what was acknowledged."""

    def __init__(self, command: int, gap_s: float) -> None:
        """Start with nothing sent; `command`: id of the command that carries the setpoint.

        A gap of up to `gap_s` beyond the round trip doesn't interrupt a series of acknowledgements.
        """
        self.command = command
        self.result = m.MAV_RESULT_ACCEPTED
        """MAV_RESULT of the last refusal."""
        self.accepted = False
        """Whether the last answer was an acceptance."""
        self._refused = NEVER
        """Start of the current series of refusals; the last of them, and the heartbeat count at the first."""
        self._refused_to, self._heartbeats = Instant(0), 0
        self._refusals, self._gave_up = 0, False
        """Refusals since what was sent last was news; whether one was given up for them since the last acceptance."""
        self.held: CommandInt | None = None
        """The last setpoint sent; None if the vehicle may hold another."""
        self._sent, self._acknowledged_to = Instant(0), Instant(0)
        self._resends = 0
        """How often what was sent last has been sent again since it was news."""
        self._since = NEVER
        self._waiting = NEVER
        """Since when an acknowledgement has been outstanding."""
        self._gap_s, self._round_trip_s = gap_s, 0.0

    def sent(self, command: CommandInt, at: Instant, round_trip_s: float, *, news: bool = True) -> None:
        """Record a setpoint sent at an instant over a link with this round trip; `news`: it differs from the last."""
        self.held, self._sent, self._round_trip_s = command, at, round_trip_s
        self._resends = 0 if news else self._resends + 1
        if news:
            self._refusals = 0
        if self._waiting == NEVER:
            self._waiting = at

    def invalidate(self) -> None:
        """Send the next setpoint even if unchanged: the vehicle may have received others meanwhile."""
        if self._refused != NEVER:
            self._waiting = NEVER  # a refusal was an answer
        self.held, self._refused, self._refusals, self._gave_up = None, NEVER, 0, False

    def retry(self) -> None:
        """Send again what has been refused: the vehicle's mode has changed."""
        self._refusals = 0

    def refused(self, result: int, heartbeats: int, now: Instant) -> None:
        """Record a refusal; `heartbeats`: the vehicle's heartbeats received so far."""
        if self._refused == NEVER:
            self._refused, self._heartbeats = now, heartbeats
        self.result, self._refused_to, self.accepted = result, now, False
        self._refusals += 1
        self._gave_up = self._gave_up or self._refusals >= REFUSALS_ALIKE

    def is_refused(self, heartbeats: int, now: Instant) -> bool:
        """Return whether setpoints are refused, with `heartbeats` received so far.

        One that isn't sent again counts as refused from then on.
        """
        if self._refused == NEVER or heartbeats < self._heartbeats + REFUSED_HEARTBEATS:
            return False
        to = now if self._gave_up else self._refused_to
        return seconds_between(self._refused, to) >= REFUSED_S

    def acknowledged(self, now: Instant) -> None:
        """Record an acceptance: it answers what was sent about a round trip ago, if nothing was lost."""
        self._refused, self._refusals, self._gave_up, self.accepted = NEVER, 0, False, True
        if self._since == NEVER or self._is_late(now):
            self._since = now
        self._acknowledged_to = after(now, -QUICKEST * self._round_trip_s)
        self._waiting = now if self._sent > self._acknowledged_to else NEVER

    def is_due(self, at: Instant, *, loses: bool, spares: bool = False, repeat_s: float = REPEAT_S) -> bool:
        """Return whether a setpoint is due at an instant though it isn't news: a first one, or one to be repeated.

        One that isn't acknowledged is sent again after each twice as long a wait: the first is until its answer is
        overdue or, over a link that `loses`, until the next tick; over one where bytes are spared, until the answer
        should have come. `repeat_s`: age at which one that was acknowledged is repeated.
        """
        if self.held is None:
            return True
        if self._refusals >= REFUSALS_ALIKE:
            return False
        age_s = seconds_between(self._sent, at)
        if self._sent <= self._acknowledged_to:
            return age_s >= repeat_s
        if age_s >= REPEAT_S:
            return True
        usual_s = 0.0 if loses and not spares else PATIENCE * self._round_trip_s
        wait_s = usual_s + (LOSSY_WAIT_S if loses else LOOPS_S)
        return age_s > wait_s * 2.0 ** min(self._resends, MAX_DOUBLINGS)

    def age_s(self, at: Instant) -> float:
        """Return how long ago a setpoint was sent; infinite if the vehicle may hold another."""
        return math.inf if self.held is None else seconds_between(self._sent, at)

    def overdue(self, at: Instant) -> bool:
        """Return whether the acknowledgement of the last setpoint is overdue at an instant."""
        if self._sent <= self._acknowledged_to:
            return False
        return seconds_between(self._sent, at) > PATIENCE * self._round_trip_s + LOOPS_S

    def is_silent(self, since: Instant, now: Instant) -> bool:
        """Return whether nothing sent since an instant has been answered for `SILENT_S`, in spite of repetition."""
        if self._waiting == NEVER or self._refused != NEVER:
            return False
        return seconds_between(max(self._waiting, since), now) > SILENT_S + self._round_trip_s

    def known_since(self, instant: Instant, now: Instant) -> bool:
        """Return whether everything sent since an instant has been acknowledged."""
        return self._since <= instant and not self._is_late(now)

    def _is_late(self, now: Instant) -> bool:
        return seconds_between(self._waiting, now) > self._gap_s + self._round_trip_s
