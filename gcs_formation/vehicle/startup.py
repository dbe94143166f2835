"""One vehicle's start-up steps, and its take-off."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from airlink.clock import Instant, seconds_between
from gcs_formation.vehicle.autopilot_family import StartUpStep
from gcs_formation.vehicle.command_delivery import CommandQueue, Outcome
from gcs_formation.vehicle.telemetry import ReportedMotion, Telemetry

UP_M: Final = 5.0


@dataclass
class TakeOff:
    """What was observed of a take-off; empty if the vehicle was in the air from the beginning."""

    stood: ReportedMotion | None = None
    """Last position while disarmed."""
    course_rad: float | None = None

    def watch(self, seen: Telemetry) -> None:
        """Update with a new position."""
        motion = seen.motion
        if motion is None or seen.heartbeat is None:
            return
        if not seen.armed:
            self.stood, self.course_rad = motion, None
        elif self.stood is not None and self.course_rad is None and motion.above_home_m > UP_M:
            self.course_rad = math.atan2(motion.east_mps, motion.north_mps)


@dataclass
class StartUp:
    """Executes the steps in order; a step that is already done sends no commands."""

    steps: tuple[StartUpStep, ...]
    modes: frozenset[int] = frozenset()
    """The modes that its steps lead through."""
    index: int = -1
    abandoned: bool = False
    """Whether preparing the vehicle has been given up."""
    left: bool = False
    """Whether the station only waits for the pilot to hand the vehicle back."""
    acted: bool = False
    """Whether a step has begun that changes what the vehicle does."""
    held: bool = False
    """Whether the next step acts, and must wait for permission."""
    _led: bool = False
    """Whether the vehicle has been in one of `modes` since `acted`."""
    _began: Instant = Instant(0)

    @property
    def finished(self) -> bool:
        """Whether every step is done."""
        return self.index >= len(self.steps)

    @property
    def doing(self) -> str:
        """The current step, in words."""
        if self.held:
            return "waited for leave to begin"
        return self.steps[self.index].name if 0 <= self.index < len(self.steps) else "waited"

    @property
    def takes_off(self) -> bool:
        """Whether the current step makes the vehicle leave the ground."""
        return 0 <= self.index < len(self.steps) and self.steps[self.index].takes_off

    def lacks(self, telemetry: Telemetry) -> str:
        """Return what the current step waits for, in words, if that isn't plain from its name."""
        return self.steps[self.index].lacks(telemetry) if 0 <= self.index < len(self.steps) else ""

    @property
    def asks_for_telemetry(self) -> bool:
        """Whether the current step requests telemetry."""
        return 0 <= self.index < len(self.steps) and self.steps[self.index].every_command_acknowledged

    @property
    def asked_for_telemetry(self) -> bool:
        """Whether the vehicle has acknowledged the telemetry requests."""
        return any(step.every_command_acknowledged for step in self.steps[: max(self.index, 0)])

    def taken_over(self, seen: Telemetry) -> bool:
        """Return whether somebody else has changed the vehicle's mode during start-up."""
        return self._led and not self.finished and seen.custom_mode not in self.modes

    def advance(self, telemetry: Telemetry, commands: CommandQueue, now: Instant, *, may_act: bool = True) -> None:
        """Begin the next step when the current one is done; steps already done are passed at once.

        Without `may_act` no step begins that changes what the vehicle does. One that a failsafe has undone since is
        begun again.
        """
        self.held = False
        undone = self._undone(telemetry)
        if undone is not None:
            self._begin(undone, telemetry, commands, now)
        self._led = self._led or (self.acted and telemetry.custom_mode in self.modes)
        while not self.finished and (self.index < 0 or self._is_done(telemetry, commands)):
            following = self.steps[self.index + 1 : self.index + 2]
            acts = any(step.acts(telemetry) for step in following)
            if acts and not may_act:
                self.held, self._began = True, now
                return
            self.acted = self.acted or acts
            self._begin(self.index + 1, telemetry, commands, now)

    def _begin(self, index: int, telemetry: Telemetry, commands: CommandQueue, now: Instant) -> None:
        """Begin a step, unless the last one is done."""
        self.index, self._began = index, now
        if not self.finished:
            step = self.steps[index]
            needed = step.every_command_acknowledged or not step.done(telemetry)
            commands.begin(step.commands(telemetry) if needed else (), now)

    def _undone(self, telemetry: Telemetry) -> int | None:
        """Return the index of the first step that a failsafe has undone; None if there is none."""
        if self.finished or telemetry.heartbeat is None:
            return None
        for index in range(max(self.index, 0)):
            if self.steps[index].lost(telemetry):
                return index
        return None

    def failure(self, commands: CommandQueue, now: Instant) -> str | None:
        """Return why the start-up can't continue, None while it can."""
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
