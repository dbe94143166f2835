"""Stages that record the cycle: with what was commanded, and without a formation to command."""

from __future__ import annotations

from flight_model.flight_state import FlightState
from gcs_formation.core.cycle import IN_COMMAND, NOT_IN_COMMAND, Cycle, Stage
from gcs_formation.fleet.dispatch import Dispatch
from gcs_formation.mission.orders import Orders
from gcs_formation.recorder import Recorder, Tick


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


def _record(tick: Tick, cycle: Cycle, recorder: Recorder) -> None:
    recorder.tick(tick)
    cycle.newest = tick
    cycle.recorded_ticks += 1
