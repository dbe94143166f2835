"""Stages that send the setpoints, record the cycle, and move the run from phase to phase by it."""

from __future__ import annotations

from flight_model.flight_state import FlightState
from gcs_formation.core.cycle import IN_COMMAND, NOT_IN_COMMAND, Cycle, Stage
from gcs_formation.fleet.dispatch import Dispatch
from gcs_formation.fleet.heartbeats import HeartbeatScheduler
from gcs_formation.mission.orders import Orders
from gcs_formation.phases import OVER, Cause, Phase
from gcs_formation.recorder import Recorder, Tick


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


class Record(Stage):
    """Records the tick: it is complete."""

    name = "record"
    when = IN_COMMAND

    def __init__(self, recorder: Recorder) -> None:
        """Write to `recorder`."""
        self._recorder = recorder

    def run(self, cycle: Cycle) -> None:
        """Write the tick as a row of the time series for each vehicle."""
        _record(cycle.tick, cycle, self._recorder)


class Events(Stage):
    """Records what limits and rules did to the setpoints, and fails if a part couldn't compute any."""

    name = "events"
    when = IN_COMMAND

    def __init__(self, recorder: Recorder) -> None:
        """Write to `recorder`."""
        self._recorder = recorder

    def run(self, cycle: Cycle) -> None:
        """Write the tick's events; end the run by the law's error, if there is one."""
        for event in cycle.tick.events:
            self._recorder.event(event)
        cycle.controlled_ticks += 1
        fault = cycle.controller.fault
        if fault is not None:
            cycle.phase_machine.fail_by(fault, cycle.now)


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


class LookOn(Stage):
    """Records the vehicles' states while none is commanded, once one has taken off; orders are taken then, too."""

    name = "look_on"
    when = NOT_IN_COMMAND

    def __init__(self, orders: Orders, dispatch: Dispatch, recorder: Recorder) -> None:
        """Take orders, links and the record."""
        self._orders, self._dispatch, self._recorder = orders, dispatch, recorder

    def run(self, cycle: Cycle) -> None:
        """Write states without setpoints, from the first take-off until the run has ended."""
        if cycle.flight.ended:
            return
        now, controller = cycle.now, cycle.controller
        self._orders.advance(now)
        if not cycle.recorded_ticks and not any(vehicle.airborne for vehicle in cycle.each):
            return
        links, _ = self._dispatch.links(controller.plan.leader, cycle.findings.doubted, now)
        seen = dict[int, tuple[FlightState, float]]()
        for vehicle in cycle.each:
            found = vehicle.sampler.extrapolated(now)
            if found is not None:
                seen[vehicle.index] = found
        mission_s, phase = cycle.flight.mission_time_s(now), cycle.flight.phase.value
        _record(controller.look_on(now, mission_s, phase, links, seen), cycle, self._recorder)


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


def _record(tick: Tick, cycle: Cycle, recorder: Recorder) -> None:
    recorder.tick(tick)
    cycle.newest = tick
    cycle.recorded_ticks += 1
