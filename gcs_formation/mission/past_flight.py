"""The state of a flight whose station was killed, as its record has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from formation_scenario.slot_assignment import Arrangement

TAKEN, LEFT, TO_PILOT = "taken over", "left as it is", "left to its pilot"
"""How events say what became of a vehicle."""
BEHIND_M = 100.0
BEYOND = 1.5
"""Largest ground speed that the leader may have had with the wind, as a multiple of the path's speed."""


@dataclass(frozen=True)
class RecordedVehicle:
    """State of a vehicle at the end of the record."""

    mode: str | None
    """Its last mode, in words."""
    parted: bool
    """Whether it had left the formation, by its pilot or its failsafe."""
    flew: bool


@dataclass(frozen=True)
class PastFlight:
    """State of a flight at the end of its record."""

    at: Instant
    """The present instant, on the record's clock."""
    vehicles: Mapping[VehicleId, RecordedVehicle]
    mission_s: float
    """Mission time of the last tick, s; NaN before the path."""
    path_began: Instant | None
    distance_m: float
    """The leader's distance along the path."""
    speed_mps: float
    """Speed at which the path was flown."""
    heading_rad: float | None
    """Heading that hovering multirotors had been ordered to; None without an order."""
    arrangement: Arrangement
    slots_m: Array
    """(C, 3) the slots, forward, right and up of the leader."""
    near: tuple[VehicleId, ...] = ()
    """Vehicles that could lead: the leader, then others by their distance from it; empty with a virtual leader."""
    ending: bool = False
    """Whether the flight was ending; vehicles that still follow setpoints are then led to their circles."""
    take: bool = False
    """Whether vehicles are taken over too that fly under somebody else's command."""
    silent_s: float = 0.0
    """How long vehicles may have been without a ground station since the flight was last commanded, s."""

    @property
    def reach_m(self) -> tuple[float, float]:
        """Range of distances along the path at which the leader may be now, if it flew on."""
        gone_s = 0.0 if self.path_began is None else seconds_between(self.path_began, self.at) - self.mission_s
        return self.distance_m - BEHIND_M, self.distance_m + BEYOND * self.speed_mps * gone_s + BEHIND_M
