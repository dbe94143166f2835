"""Commands to one vehicle, each repeated until it is acknowledged, and its pilot's choice of mode against them.

Source: MAVLink guide, "Command Protocol".
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.messages.command import CommandAck, CommandLong
from gcs_formation.vehicle.autopilot import SHOWN_IN_HEARTBEATS, Command
from gcs_formation.vehicle.telemetry import Telemetry

RETRY_S: Final = 0.7
MAX_CONFIRMATION: Final = 255
TRY_AGAIN = (m.MAV_RESULT_TEMPORARILY_REJECTED, m.MAV_RESULT_FAILED)
"""Results that may change without our doing: a vehicle that can't be armed yet answers FAILED."""
UNDER_WAY: Final = m.MAV_RESULT_IN_PROGRESS


class Outcome(Enum):
    """Where a list of commands stands."""

    IDLE = "idle"
    WAITING = "waiting"
    ACCEPTED = "accepted"
    REFUSED = "refused"


@dataclass
class CommandQueue:
    """Sends a list of commands in order, each until its acknowledgement comes."""

    outcome: Outcome = Outcome.IDLE
    refusal: tuple[int, int] | None = None
    """Command and MAV_RESULT of the last acknowledgement that wasn't ACCEPTED."""
    _waiting: deque[Command] = field(default_factory=deque[Command])
    _attempt: int = 0
    _next_attempt: Instant = Instant(0)

    def begin(self, commands: tuple[Command, ...], now: Instant) -> None:
        """Start with these commands, and drop any earlier ones."""
        self._waiting = deque(commands)
        self._attempt, self._next_attempt, self.refusal = 0, now, None
        self.outcome = Outcome.WAITING if commands else Outcome.ACCEPTED

    def due(self, now: Instant) -> Command | None:
        """Return the command to send now, if any."""
        if self.outcome is not Outcome.WAITING or now < self._next_attempt:
            return None
        command = self._waiting[0]
        if isinstance(command, CommandLong):
            command = command._replace(confirmation=min(self._attempt, MAX_CONFIRMATION))
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
        if ack.result == UNDER_WAY:
            return None
        if ack.result == m.MAV_RESULT_ACCEPTED:
            if early:
                return None
            accepted = self._waiting.popleft()
            self._attempt, self._next_attempt = 0, now
            self.outcome = Outcome.WAITING if self._waiting else Outcome.ACCEPTED
            return accepted
        self.refusal = (ack.command, ack.result)
        if ack.result not in TRY_AGAIN:
            self.outcome = Outcome.REFUSED
        return None


class PilotsChoice:
    """Remembers a mode that was seen between setpoints, until the vehicle has it again.

    Setpoints stop, and the mode is commanded once more: it arrives after the last of them. Two heartbeats after it is
    acknowledged the vehicle's mode is the pilot's again, or the pilot has given the vehicle back.
    """

    def __init__(self) -> None:
        """Start with no choice."""
        self.mode: int | None = None
        """While there is one, the guided mode that heartbeats show may be the setpoints' doing."""
        self._heartbeats = 0

    def see(self, mode: int, guided_mode: int, seen: Telemetry) -> None:
        """Take the mode of a vehicle that gets setpoints."""
        if mode != guided_mode:
            self.mode, self._heartbeats = mode, seen.heartbeats

    def watch(self, seen: Telemetry, *, waiting: bool) -> None:
        """Forget the mode once heartbeats show what came of commanding it; `waiting`: that isn't acknowledged yet."""
        if self.mode is not None and waiting:
            self._heartbeats = seen.heartbeats
        elif seen.heartbeats >= self._heartbeats + SHOWN_IN_HEARTBEATS:
            self.mode = None
