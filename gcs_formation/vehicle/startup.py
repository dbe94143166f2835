"""One vehicle's start-up in steps, its take-off, and what its pilot chose meanwhile."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from airlink.clock import Instant, seconds_between
from gcs_formation.vehicle.acknowledgement import SHOWN_IN_HEARTBEATS, CommandQueue, Outcome
from gcs_formation.vehicle.autopilot_family import StartUpStep
from gcs_formation.vehicle.telemetry import ReportedMotion, Telemetry

UP_M: Final = 5.0


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


@dataclass
class TakeOff:
    """What was seen of a take-off; nothing if the vehicle was in the air before."""

    stood: ReportedMotion | None = None
    """Where it was before it was armed."""
    course_rad: float | None = None

    def watch(self, seen: Telemetry) -> None:
        """Look at a new position."""
        motion = seen.motion
        if motion is None or seen.heartbeat is None:
            return
        if not seen.armed:
            self.stood, self.course_rad = motion, None
        elif self.stood is not None and self.course_rad is None and motion.above_home_m > UP_M:
            self.course_rad = math.atan2(motion.east_mps, motion.north_mps)


@dataclass
class StartUp:
    """Goes through the steps; a step that is already done sends nothing."""

    steps: tuple[StartUpStep, ...]
    modes: frozenset[int] = frozenset()
    """Those in which its steps lead the vehicle."""
    index: int = -1
    abandoned: bool = False
    """Whether we have given up getting it ready."""
    left: bool = False
    """Whether nothing is asked of it but that its pilot gives it back."""
    acted: bool = False
    """Whether a step has begun that changes what it does."""
    held: bool = False
    """Whether it is ready for its first command, and that may not be given yet."""
    _led: bool = False
    """Whether the vehicle has been in one of its modes since it acts."""
    _began: Instant = Instant(0)

    @property
    def finished(self) -> bool:
        """Whether every step is done."""
        return self.index >= len(self.steps)

    @property
    def doing(self) -> str:
        """The step under way, in words."""
        if self.held:
            return "waited for leave to begin"
        return self.steps[self.index].name if 0 <= self.index < len(self.steps) else "waited"

    @property
    def takes_off(self) -> bool:
        """Whether the step under way brings the vehicle off the ground."""
        return 0 <= self.index < len(self.steps) and self.steps[self.index].takes_off

    @property
    def asks_for_telemetry(self) -> bool:
        """Whether the step under way asks the vehicle for what it is to send, and waits for it."""
        return 0 <= self.index < len(self.steps) and self.steps[self.index].every_command_acknowledged

    @property
    def asked_for_telemetry(self) -> bool:
        """Whether the vehicle has acknowledged what it is to send."""
        return any(step.every_command_acknowledged for step in self.steps[: max(self.index, 0)])

    def taken_over(self, seen: Telemetry) -> bool:
        """Return whether somebody else has led the vehicle into another mode since."""
        return self._led and not self.finished and seen.custom_mode not in self.modes

    def advance(self, telemetry: Telemetry, commands: CommandQueue, now: Instant, *, may_act: bool = True) -> None:
        """Begin the next step when the one under way is done; several at once when they need nothing.

        Before `may_act` no step begins that changes what the vehicle does.
        """
        self.held = False
        self._led = self._led or (self.acted and telemetry.custom_mode in self.modes)
        while not self.finished and (self.index < 0 or self._is_done(telemetry, commands)):
            following = self.steps[self.index + 1 : self.index + 2]
            acts = any(step.acts(telemetry) for step in following)
            if acts and not may_act:
                self.held, self._began = True, now
                return
            self.acted = self.acted or acts
            self.index += 1
            self._began = now
            if not self.finished:
                step = self.steps[self.index]
                needed = step.every_command_acknowledged or not step.done(telemetry)
                commands.begin(step.commands(telemetry) if needed else (), now)

    def failure(self, commands: CommandQueue, now: Instant) -> str | None:
        """Return why it can't go on, None while it can."""
        if self.finished or self.index < 0:
            return None
        if commands.outcome is Outcome.REFUSED:
            return f"refused when we {self.doing}"
        step = self.steps[self.index]
        began = max(self._began, commands.since) if step.every_command_acknowledged else self._began
        if seconds_between(began, now) > step.timeout_s:
            return f"not done within {step.timeout_s:.0f} s after we {self.doing}"
        return None

    def _is_done(self, telemetry: Telemetry, commands: CommandQueue) -> bool:
        step = self.steps[self.index]
        acknowledged = commands.outcome is Outcome.ACCEPTED or not step.every_command_acknowledged
        return acknowledged and step.done(telemetry)
