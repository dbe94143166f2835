"""Stages that send the setpoints, and move the run from phase to phase."""

from __future__ import annotations

from gcs_formation.core.cycle import IN_COMMAND, Cycle, Stage
from gcs_formation.fleet.dispatch import Dispatch
from gcs_formation.fleet.heartbeats import HeartbeatScheduler
from gcs_formation.phases import OVER, Cause, Phase


class Setpoints(Stage):
    """Makes messages of the setpoints; what is no news to a vehicle isn't sent, and it goes on by what it holds."""

    name = "setpoints"
    when = IN_COMMAND

    def __init__(self, dispatch: Dispatch) -> None:
        """Take what sends them at once, or later."""
        self._dispatch = dispatch

    def run(self, cycle: Cycle) -> None:
        """Hand them over; the tick and the predictions have what vehicles hold from then on."""
        self._dispatch.accept(cycle.tick, cycle.hold_s, cycle.now)
        cycle.controller.history.record(self._dispatch.held(cycle.tick))
        cycle.last_tick = cycle.tick


class Phases(Stage):
    """Begins the path when the leader has passed its start, ends the flight in time, and lets vehicles leave then."""

    name = "phases"
    when = IN_COMMAND

    def __init__(self, heartbeats: HeartbeatScheduler, until_s: float) -> None:
        """Take what sends the mission time, at once when the path begins, and when to end early."""
        self._heartbeats, self._until_s = heartbeats, until_s

    def run(self, cycle: Cycle) -> None:
        """Move if it is time."""
        now, opening = cycle.now, cycle.opening
        begins = cycle.phase is Phase.ASSEMBLING and cycle.controller.guidance.started
        over = cycle.mission_s >= cycle.scenario.duration_s  # possible for a resumed flight; False before the path
        if begins and not over and cycle.phase_machine.move(Cause.PATH_BEGUN, now):
            self._heartbeats.hasten(now)
        if opening is None:
            cycle.phase_machine.end_in_time(self._until_s, now)
        elif opening.may_leave(now):
            cycle.phase_machine.move(Cause.OPENED, now)


class StandIns(Stage):
    """Sends something to vehicles that need a stream of setpoints, and got none in this cycle."""

    name = "stand_ins"

    def __init__(self, dispatch: Dispatch) -> None:
        """Take what knows who got none."""
        self._dispatch = dispatch

    def run(self, cycle: Cycle) -> None:
        """Send each its family's stand-in for a setpoint, as PX4 needs before OFFBOARD."""
        cycle.send(self._dispatch.stand_ins(cycle.now), cycle.now)


class End(Stage):
    """Brings a run that is over to its end: circles, landings. Last, for the phase may just have changed."""

    name = "end"

    def run(self, cycle: Cycle) -> None:
        """Go on with it."""
        if cycle.flight.phase in OVER:
            cycle.phase_machine.bring_to_end(cycle.now)
