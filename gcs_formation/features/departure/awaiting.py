# Compiled by mypyc: it runs every tick.

"""What fixed wings do that have climbed out and wait for the formation: straight on, then circles at own heights."""

from __future__ import annotations

from typing import Final

from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from flight_model.flight_state import Setpoint
from gcs_formation.core.cycle import NOT_IN_COMMAND, Cycle, Stage
from gcs_formation.phases import Phase
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle

STRAIGHT_S: Final = 20.0
"""Longest flight straight on. Tuned: s; 10 to 40; shown by `pytest tests/gcs_formation/features/departure`: commands
that are lost half of the time are there by then with a probability of 0.9999, and at 22 m/s it is 440 m."""


TURNS_S: Final = 1.0
"""Time for which it may circle first: mostly the leader is there by then, and nothing needs to be sent. Tuned: s; 0.5
to 2; shown by `pytest tests/gcs_formation/features/departure`: at 22 m/s and 0.25 rad/s it is 3 m off its line by
then."""


class AwaitingFormation(Stage):
    """Commands those that wait to fly on as they took off: in guided mode without a setpoint they would circle."""

    name = "awaiting_formation"
    when = NOT_IN_COMMAND
    after = ("look_on",)

    def __init__(self, cycle: Cycle) -> None:
        """Begin with none in the air."""
        self._planes = [each for each in cycle.each if not each.autopilot.hovers]
        self._speed_mps = cycle.scenario.path.begin_mps
        self._straight = dict[VehicleId, tuple[Instant, Setpoint]]()
        """Since when each flies straight on, and what it is commanded."""

    def run(self, cycle: Cycle) -> None:
        """Command each that waits, as long as it may fly straight on; release those that circle once all are there.

        A follower that isn't awaited any more, as its pilot has it or it is lost, needn't be.
        """
        waiting = cycle.findings.waiting
        if cycle.flight.phase is not Phase.CONNECTING:
            return
        leader = cycle.reconfiguration.leader
        awaited = [each for each in cycle.each if each.awaited or each is leader]
        if waiting and all(each.member is Member.FLYING or each.identity in waiting for each in awaited):
            waiting.clear()
            self._straight.clear()
        for vehicle in self._planes:
            if vehicle.member is Member.FLYING and vehicle.take_off.course_rad is not None:
                self._fly_on(cycle, vehicle, vehicle.take_off.course_rad)

    def _fly_on(self, cycle: Cycle, vehicle: Vehicle, course_rad: float) -> None:
        found = vehicle.sampler.extrapolated(cycle.now)
        if found is None:
            return
        state, _ = found
        begun = self._straight.get(vehicle.identity)
        if begun is None:
            begun = cycle.now, Setpoint(self._speed_mps, course_rad, state.height_m)
            self._straight[vehicle.identity] = begun
        since, setpoint = begun
        waited_s = seconds_between(since, cycle.now)
        if waited_s < TURNS_S:
            return
        if waited_s > STRAIGHT_S:
            cycle.findings.waiting.add(vehicle.identity)
            return
        state.wind_north_mps = state.wind_east_mps = 0.0  # not estimated yet
        messages = vehicle.new_setpoints(setpoint, state, cycle.now)
        cycle.send([(vehicle, message) for message in messages], cycle.now)
