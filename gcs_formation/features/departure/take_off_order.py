# Compiled by mypyc: it runs every tick.

"""The order of take-offs: none is armed before all are ready to be, and while one ahead on its line isn't."""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import NANOSECONDS, NEVER, Instant
from airlink.endpoint import VehicleId
from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.phases import Phase
from gcs_formation.vehicle.vehicle import Vehicle

LATERAL_M: Final = 25.0
"""Distance beside its line of take-off within which another stands in its way. Tuned: m; 10 to 30; shown by `pytest
tests/gcs_formation/features/departure`: slots are 30 m apart, and a gust or a slope of the ground turns a plane that
rolls."""
AHEAD_M: Final = 600.0
"""Distance ahead within which it may come near another that takes off later. Tuned: m; 300 to 1000; shown by `pytest
tests/gcs_formation/features/departure`: at 3 m/s it takes 20 s to climb out, at 22 m/s 440 m."""
SAID_AFTER_NS: Final = 3 * NANOSECONDS
"""A wait is said once it is longer than an answer takes. Tuned: ns; 2 to 5 s; shown by `pytest
tests/gcs_formation/features/departure`."""


class TakeOffOrder(Stage):
    """Says who may be armed, before the start-up goes on: one that is armed in TAKEOFF rolls at once."""

    name = "take_off_order"
    after = ("restarts",)

    def __init__(self, cycle: Cycle) -> None:
        """Begin with all on the ground."""
        self._planes = [each for each in cycle.each if not each.autopilot.hovers]
        self._waits = dict[VehicleId, tuple[Instant, str]]()
        """Since when each has waited, and for what; NEVER if that has been recorded."""

    def run(self, cycle: Cycle) -> None:
        """Look who isn't ready yet, and who stands in whose way."""
        if cycle.flight.phase is not Phase.CONNECTING:
            for vehicle in self._planes:
                vehicle.start_up.may_arm = True
            return
        waiting = [each for each in self._planes if not (each.telemetry.armed or each.start_up.abandoned)]
        unready = next((each for each in waiting if not each.start_up.ready_to_arm), None)
        for vehicle in waiting:
            ahead = next((each for each in waiting if is_ahead(each, vehicle) and not _first(vehicle, each)), None)
            vehicle.start_up.may_arm = unready is None and ahead is None
            if vehicle.start_up.held and vehicle.start_up.ready_to_arm:
                if unready is not None:
                    self._say(cycle, vehicle, f"vehicle {unready.identity} is ready")
                elif ahead is not None:
                    self._say(cycle, vehicle, f"vehicle {ahead.identity} is armed, ahead on its line")

    def _say(self, cycle: Cycle, vehicle: Vehicle, until: str) -> None:
        """Record what a vehicle has waited for a while."""
        begun, waits_for = self._waits.get(vehicle.identity, (cycle.now, ""))
        if waits_for != until:
            self._waits[vehicle.identity] = cycle.now, until
        elif begun != NEVER and cycle.now - begun > SAID_AFTER_NS:
            self._waits[vehicle.identity] = NEVER, until
            cycle.log_event(cycle.now, "take_off_order", f"stays on the ground until {until}", vehicle)


def is_ahead(other: Vehicle, vehicle: Vehicle) -> bool:
    """Return whether another vehicle that is to take off stands ahead on a vehicle's take-off line, as far as known."""
    at, others, attitude = vehicle.telemetry.motion, other.telemetry.motion, vehicle.telemetry.attitude
    if other is vehicle or at is None or others is None or attitude is None:
        return False
    north_m, east_m = others.north_m - at.north_m, others.east_m - at.east_m
    north, east = math.cos(attitude.yaw_rad), math.sin(attitude.yaw_rad)
    along_m, lateral_m = north_m * north + east_m * east, east_m * north - north_m * east
    return 0.0 < along_m < AHEAD_M and abs(lateral_m) < LATERAL_M


def _first(vehicle: Vehicle, other: Vehicle) -> bool:
    """Return whether of two that stand nose to nose a vehicle goes first: the one that is named first."""
    return vehicle.index < other.index and is_ahead(vehicle, other)
