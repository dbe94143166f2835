"""The leader's setpoints of the last seconds, by which followers expect it to fly."""

from __future__ import annotations

from mypy_extensions import mypyc_attr

from airlink.clock import Instant
from flight_model.autopilot_model import signed
from gcs_formation.estimation.setpoint_history import HISTORY_S


@mypyc_attr(acyclic=True)
class LeaderCommand:
    """The leader's setpoints at an instant."""

    def __init__(self, speed_mps: float, heading_rad: float, height_m: float, turn_rps: float) -> None:
        """Take speed, heading and height, and the rate of the commanded heading."""
        self.speed_mps = speed_mps
        self.heading_rad = heading_rad
        self.height_m = height_m
        self.turn_rps = turn_rps


class LeaderCommands:
    """The leader's setpoints of the last seconds, tick by tick."""

    def __init__(self, dt_s: float) -> None:
        """Begin with none; `dt_s` is the time between ticks."""
        self._length = max(2, int(HISTORY_S / dt_s))
        self._acts: list[int] = []
        self._commands: list[LeaderCommand] = []

    def drop_state(self) -> None:
        """Remove all: another vehicle leads."""
        self._acts.clear()
        self._commands.clear()

    def add(self, acts: Instant, command: LeaderCommand) -> None:
        """Add a tick's command, and when it acts; its heading is unwrapped to continue the one before."""
        if self._commands:
            before_rad = self._commands[-1].heading_rad
            command.heading_rad = before_rad + signed(command.heading_rad - before_rad)
        self._acts.append(max(acts, self._acts[-1]) if self._acts else acts)
        self._commands.append(command)
        if len(self._commands) > self._length:
            del self._acts[0], self._commands[0]

    def at(self, instant: int) -> LeaderCommand:
        """Return the leader's mean command over the tick that begins at an instant, in ns.

        Setpoints are held from tick to tick, so these means are linear between them. Before the oldest command the
        oldest is returned, after the newest the newest.
        """
        index = len(self._acts) - 1
        while index > 0 and self._acts[index] > instant:
            index -= 1
        if index == len(self._acts) - 1 or self._acts[index] > instant:
            return self._commands[index]
        share = (instant - self._acts[index]) / (self._acts[index + 1] - self._acts[index])
        now, then = self._commands[index], self._commands[index + 1]
        return LeaderCommand(
            now.speed_mps + share * (then.speed_mps - now.speed_mps),
            now.heading_rad + share * (then.heading_rad - now.heading_rad),
            now.height_m + share * (then.height_m - now.height_m),
            now.turn_rps + share * (then.turn_rps - now.turn_rps),
        )
