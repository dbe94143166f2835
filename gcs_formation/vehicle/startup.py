"""One vehicle's start-up steps, and its take-off."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

from airlink.clock import Instant, seconds_between
from gcs_formation.vehicle.command_delivery import CommandQueue, Outcome
from gcs_formation.vehicle.reported_motion import ReportedMotion
from gcs_formation.vehicle.startup_step import StartUpStep
from gcs_formation.vehicle.telemetry import Telemetry

UP_M: Final = 5.0
SLOWEST_S: Final = 600.0
FIX_S: Final = 90.0
"""Longest wait for a position fix without progress."""
ASKED_AGAIN_S: Final = 5.0
"""Time after which telemetry that was acknowledged and doesn't come is requested again: an acknowledgement doesn't say
of which message it is, and may have been a repeated request's. Tuned: s; 3 to 10; shown by `pytest
tests/gcs_formation/vehicle`."""
SOON_S: Final = 10.0
"""Progress within this time from a step's beginning isn't mentioned."""


@dataclass
class TakeOff:
    """What was observed of a take-off; empty if the vehicle was in the air from the beginning."""

    stood: ReportedMotion | None = None
    """Last position while disarmed."""
    course_rad: float | None = None
    """Course of the take-off: where its nose pointed before, or where it climbed to if that wasn't reported."""
    flew: bool = False
    """Whether it has been seen in the air since it was first found on the ground."""
    _nose_rad: float | None = None

    def update_position(self, seen: Telemetry) -> None:
        """Update with a new position."""
        motion = seen.motion
        if motion is None or seen.heartbeat is None:
            return
        if not seen.armed:
            self.stood, self.course_rad = motion, None
            self._nose_rad = None if seen.attitude is None else seen.attitude.yaw_rad
        elif self.stood is not None and self.course_rad is None and motion.above_home_m > UP_M:
            climbs_rad = math.atan2(motion.east_mps, motion.north_mps)
            self.course_rad, self.flew = climbs_rad if self._nose_rad is None else self._nose_rad, True


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
    may_arm: bool = True
    """Whether nothing keeps the vehicle from being armed."""
    ready_to_arm: bool = False
    """Whether all is done that comes before the vehicle is armed."""
    held: bool = False
    """Whether the next step acts, and must wait for permission."""
    _led: bool = False
    """Whether the vehicle has been in one of `modes` since `acted`."""
    _began: Instant = Instant(0)
    _progress: tuple[object, ...] = ()
    _progressed: Instant = Instant(0)
    """What shows the vehicle's progress, and when it last changed."""
    _texts: set[str] = field(default_factory=set[str])
    """Its status texts so far."""
    _asked: Instant | None = None
    """When the vehicle had acknowledged the requests that were sent again."""
    waits_for_fix: bool = False
    """Whether it has no position fix yet."""

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
            arms = any(step.arms and not step.done(telemetry) for step in following)
            self.ready_to_arm = self.ready_to_arm or arms
            if acts and not (may_act and (self.may_arm or not arms)):
                self.held, self._began = True, now
                return
            self.acted = self.acted or acts
            self._begin(self.index + 1, telemetry, commands, now)

    def ask_again(self, telemetry: Telemetry, commands: CommandQueue, now: Instant) -> None:
        """Request telemetry again, once, that was acknowledged a while ago and doesn't come."""
        acknowledged = commands.outcome is Outcome.ACCEPTED and self._asked is None
        if acknowledged and seconds_between(commands.since, now) > ASKED_AGAIN_S:
            self._asked = commands.since
            commands.send(self.steps[self.index].commands(telemetry), now)

    def _begin(self, index: int, telemetry: Telemetry, commands: CommandQueue, now: Instant) -> None:
        """Begin a step, unless the last one is done."""
        self.index, self._began = index, now
        if not self.finished:
            step = self.steps[index]
            needed = step.every_command_acknowledged or not step.done(telemetry)
            commands.send(step.commands(telemetry) if needed else (), now)

    def _undone(self, telemetry: Telemetry) -> int | None:
        """Return the index of the first step that a failsafe has undone; None if there is none."""
        if self.finished or telemetry.heartbeat is None:
            return None
        for index in range(max(self.index, 0)):
            if self.steps[index].lost(telemetry):
                return index
        return None

    def update_progress(self, telemetry: Telemetry, now: Instant) -> None:
        """Judge whether the vehicle makes progress in getting ready: by its state, or by a new status text."""
        progress, words = telemetry.progress(), telemetry.last_words
        if progress != self._progress or words not in self._texts:
            self._progress, self._progressed = progress, now
            self._texts.add(words)
        self.waits_for_fix = telemetry.unfixed

    def waited_s(self, now: Instant) -> float:
        """Return for how long the present step has been waited for, if that may take long; 0 for other steps."""
        slow = 0 <= self.index < len(self.steps) and self.steps[self.index].slow and not self.held
        return seconds_between(self._began, now) if slow else 0.0

    def failure(self, commands: CommandQueue, now: Instant, longest_s: float = SLOWEST_S) -> str | None:
        """Return why the start-up can't continue, None while it can.

        A step that may take long is waited for as long as the vehicle makes progress, `longest_s` at most.
        """
        if self.finished or self.index < 0:
            return None
        if commands.outcome is Outcome.REFUSED:
            return f"refused when we {self.doing}"
        step = self.steps[self.index]
        began = max(self._began, commands.since) if step.every_command_acknowledged else self._began
        if self._asked is not None and step.every_command_acknowledged and commands.outcome is Outcome.ACCEPTED:
            began = self._asked
        patience_s = max(step.timeout_s, FIX_S if step.slow and self.waits_for_fix else 0.0)
        since = max(began, self._progressed) if step.slow and commands.outcome is not Outcome.WAITING else began
        waited_s = seconds_between(began, now)
        if waited_s > longest_s and step.slow:
            return f"not done within {longest_s:.0f} s after we {self.doing}"
        if seconds_between(since, now) <= patience_s:
            return None
        if seconds_between(began, since) < SOON_S:
            return f"not done within {patience_s:.0f} s after we {self.doing}"
        return f"without progress for {patience_s:.0f} s, {waited_s:.0f} s after we {self.doing}"

    def _is_done(self, telemetry: Telemetry, commands: CommandQueue) -> bool:
        step = self.steps[self.index]
        acknowledged = commands.outcome is Outcome.ACCEPTED or not step.every_command_acknowledged
        return acknowledged and step.done(telemetry)
