"""What is sent to one vehicle until it acknowledges it, commands and setpoints, and whether it then does as told.

Source: MAVLink guide, "Command Protocol".
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from airlink import mavlink as m
from airlink.clock import NEVER, Instant, after, seconds_between
from airlink.messages.command import CommandAck, CommandInt, CommandLong
from gcs_formation.vehicle.autopilot_family import Command, Effect
from gcs_formation.vehicle.telemetry import Telemetry

RETRY_S: Final = 0.7
RETRY_REFUSED_S: Final = 3.0
"""When a command that is insisted on is sent again after a refusal that may last."""
MAX_CONFIRMATION: Final = 255
TRY_AGAIN = (m.MAV_RESULT_TEMPORARILY_REJECTED, m.MAV_RESULT_FAILED)
"""Results that may change without our doing: a vehicle that can't be armed yet answers FAILED."""
UNDER_WAY: Final = m.MAV_RESULT_IN_PROGRESS
REFUSES_S: Final = 2.0
"""A command counts as refused when it has had no other answer for this time."""
REFUSED_S: Final = 1.0
REFUSED_HEARTBEATS: Final = 2
"""A setpoint is refused when nothing else has been answered for this time, in which so many heartbeats have come: one
that a pilot has just taken refuses what was on its way."""
SILENT_S: Final = 5.0
"""A setpoint isn't acknowledged when it has been told so long, again and again, without an answer."""
GAP_S: Final = 0.5
"""Acknowledgements of setpoints that come later than this may mean that setpoints didn't arrive."""
REPEAT_S: Final = 1.0
"""After this long a setpoint is sent again, though nothing has changed."""
QUICKEST: Final = 0.75
PATIENCE: Final = 1.5
"""Shares of the usual round trip that the quickest answer takes, and the slowest."""
LOOPS_S: Final = 0.15
"""For how long a setpoint and its answer may wait for the loops of either end."""
SHOWN_WITHIN_S: Final = 2.0
SHOWN_IN_HEARTBEATS: Final = 2
"""A command has no effect when both this time and so many heartbeats have passed since its acknowledgement, and has had
its effect, acknowledged or not, when heartbeats show it after so long."""


class Outcome(Enum):
    """Where a list of commands stands."""

    IDLE = "idle"
    WAITING = "waiting"
    ACCEPTED = "accepted"
    REFUSED = "refused"


@dataclass
class CommandQueue:
    """Sends a list of commands in order, each until its acknowledgement comes.

    A refusal that may last ends a list, unless it is insisted on: then the command goes on being sent until it is
    accepted, or heartbeats show that it has been carried out.
    """

    outcome: Outcome = Outcome.IDLE
    refusal: tuple[int, int] | None = None
    """Command and MAV_RESULT of the last acknowledgement that wasn't ACCEPTED."""
    since: Instant = Instant(0)
    """Since when the command under way has been, or none."""
    insists: bool = False
    """Whether a refusal doesn't end the list."""
    lists: int = 0
    """How many lists have begun."""
    _waiting: deque[Command] = field(default_factory=deque[Command])
    _attempt: int = 0
    _next_attempt: Instant = Instant(0)
    _first_attempt: Instant = Instant(0)
    _answered: int = 0
    """How many attempts of the command under way have been answered."""
    _refused: Instant | None = None
    """Since when the command under way has been refused."""
    _shown: int = 0
    """How many heartbeats have shown that it has been carried out."""
    _late: tuple[int, int, Instant] = (0, 0, Instant(0))
    """What was accepted before all of its attempts were answered: its id, how many weren't, and until when that may
    come."""

    def begin(self, commands: tuple[Command, ...], now: Instant, *, insist: bool = False) -> None:
        """Start with these commands, and drop any earlier ones; `insist`: whatever the vehicle answers."""
        self._waiting, self.insists, self.refusal = deque(commands), insist, None
        self.lists += 1
        self._go_on(now)

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
        self._next_attempt = after(now, RETRY_S)
        return command

    @property
    def under_way(self) -> Command | None:
        """The command whose acknowledgement is awaited."""
        return self._waiting[0] if self._waiting else None

    def acknowledge(self, ack: CommandAck, now: Instant, *, early: bool = False) -> Command | None:
        """Take an acknowledgement; return the command that it accepts. One of any other command changes nothing.

        `early`: being accepted says nothing yet; the command is repeated.
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
            self._go_on(now)
            return accepted
        self._refuse(ack, now)
        return None

    def _go_on(self, now: Instant) -> None:
        """Turn to the next command."""
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
        """Return whether the command under way is insisted on, and has been refused for a while."""
        if not self.insists or self._refused is None:
            return False
        return seconds_between(self._refused, now) >= REFUSES_S

    @property
    def refused_with(self) -> int | None:
        """MAV_RESULT of the last refusal of the command under way, if it is insisted on; None if there is none."""
        if not self.insists or self._refused is None or self.refusal is None:
            return None
        return self.refusal[1]

    def look(self, *, shown: bool, known: bool, now: Instant) -> None:
        """Take a heartbeat that shows, or doesn't, that the command under way has been carried out.

        One that may have shown it before (`known`) says nothing until there is an answer.
        """
        self._shown = self._shown + 1 if shown and self._attempt else 0
        if self._shown < SHOWN_IN_HEARTBEATS or (known and self._refused is None):
            return
        if seconds_between(self._first_attempt, now) >= SHOWN_WITHIN_S:
            self._waiting.popleft()
            self._go_on(now)

    def _expect_late(self, command: int, now: Instant) -> None:
        """Note how many acknowledgements of earlier attempts at a command, just accepted, are still on their way.

        They arrive within a round trip of its last attempt; a round trip is no longer than the time since its first.
        """
        if self._attempt > self._answered:
            round_trip_s = seconds_between(self._first_attempt, now)
            until = after(self._next_attempt, round_trip_s - RETRY_S)
            self._late = command, self._attempt - self._answered, until

    def _is_late(self, ack: CommandAck, now: Instant) -> bool:
        """Return whether an acknowledgement is of an earlier attempt at the command before, and count it off if so."""
        command, count, until = self._late
        late = ack.command == command and count > 0 and now <= until
        if late:
            self._late = command, count - 1, until
        return late


class EffectWatch:
    """Watches the last command that a vehicle acknowledged until it takes effect, or somebody else's does."""

    def __init__(self) -> None:
        """Start with no command."""
        self.missing: str | None = None
        """What an acknowledged command should have led to and hasn't, in words; None where all is as it should be."""
        self.missing_s = 0.0
        """How long after the acknowledgement that was found, s."""
        self._effect: Effect | None = None
        self._since = Instant(0)
        self._before: int | None = None
        self._heartbeats = 0

    @property
    def watching(self) -> bool:
        """Whether there is a command whose effect hasn't been seen yet."""
        return self._effect is not None

    def acknowledged(self, effect: Effect, seen: Telemetry, now: Instant) -> None:
        """Watch for the effect of a command that has just been acknowledged, instead of the one before it."""
        self._effect, self._since = effect, now
        self._before, self._heartbeats = effect.shown(seen), seen.heartbeats

    def judge(self, seen: Telemetry, now: Instant) -> None:
        """Update `missing`. A state that is neither the expected one nor the one before is the pilot's choice."""
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
    """One of the setpoints of a vehicle that acknowledges them: what was sent last, and what has been acknowledged."""

    def __init__(self, command: int, gap_s: float) -> None:
        """Start with nothing sent; `command`: the id of what carries the setpoint.

        Acknowledgements that come up to `gap_s` later than they can don't break their run.
        """
        self.command = command
        self.result = m.MAV_RESULT_ACCEPTED
        """The MAV_RESULT of its last refusal."""
        self.accepted = False
        """Whether the last answer accepted it."""
        self._refused = NEVER
        """Since when there have been refusals only; the last of them, and the heartbeats that had come by the first."""
        self._refused_to, self._heartbeats = Instant(0), 0
        self._known: CommandInt | None = None
        self._sent, self._acknowledged_to = Instant(0), Instant(0)
        self._since = NEVER
        self._waiting = NEVER
        """Since when an acknowledgement has been waited for."""
        self._gap_s, self._round_trip_s = gap_s, 0.0

    def sent(self, command: CommandInt, at: Instant, round_trip_s: float) -> None:
        """Take what is sent at an instant, over a link that takes so long there and back."""
        self._known, self._sent, self._round_trip_s = command, at, round_trip_s
        if self._waiting == NEVER:
            self._waiting = at

    def forget(self) -> None:
        """Repeat whatever comes next: the vehicle may have other setpoints meanwhile."""
        self._known, self._refused = None, NEVER

    def refused(self, result: int, heartbeats: int, now: Instant) -> None:
        """Take an answer that isn't ACCEPTED; so many heartbeats have come from the vehicle."""
        if self._refused == NEVER:
            self._refused, self._heartbeats = now, heartbeats
        self.result, self._refused_to, self.accepted = result, now, False

    def is_refused(self, heartbeats: int) -> bool:
        """Return whether its setpoints are refused, by now that so many heartbeats have come."""
        if self._refused == NEVER or heartbeats < self._heartbeats + REFUSED_HEARTBEATS:
            return False
        return seconds_between(self._refused, self._refused_to) >= REFUSED_S

    def acknowledged(self, now: Instant) -> None:
        """Take an acknowledgement: it answers what was sent a round trip ago, if nothing was lost or quicker."""
        self._refused, self.accepted = NEVER, True
        if self._since == NEVER or self._is_late(now):
            self._since = now
        self._acknowledged_to = after(now, -QUICKEST * self._round_trip_s)
        self._waiting = now if self._sent > self._acknowledged_to else NEVER

    def known(self, at: Instant) -> CommandInt | None:
        """Return what the vehicle has been sent last, None if it is to be sent again at an instant in any case."""
        return None if seconds_between(self._sent, at) >= REPEAT_S else self._known

    def overdue(self, at: Instant) -> bool:
        """Return whether what was sent last should have been acknowledged by an instant, and isn't."""
        if self._sent <= self._acknowledged_to:
            return False
        return seconds_between(self._sent, at) > PATIENCE * self._round_trip_s + LOOPS_S

    def is_silent(self, since: Instant, now: Instant) -> bool:
        """Return whether nothing that was sent since an instant has been answered for long, however often it was."""
        if self._waiting == NEVER or self._refused != NEVER:
            return False
        return seconds_between(max(self._waiting, since), now) > SILENT_S + self._round_trip_s

    def known_since(self, instant: Instant, now: Instant) -> bool:
        """Return whether all that was sent since an instant has been acknowledged."""
        return self._since <= instant and not self._is_late(now)

    def _is_late(self, now: Instant) -> bool:
        return seconds_between(self._waiting, now) > self._gap_s + self._round_trip_s
