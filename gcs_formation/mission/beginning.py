"""How the formation begins to be commanded: the plain way, in which all vehicles are started and waited for.

A feature may bring another for a flight that is resumed.
"""

from __future__ import annotations

from collections.abc import Mapping

from mypy_extensions import mypyc_attr

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from airlink.messages import Message
from airlink.messages.command import ParamValue
from formation_scenario import Scenario
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle


@mypyc_attr(allow_interpreted_subclasses=True)
class Beginning:
    """Says which vehicles are waited for, which may be commanded, and when the formation is."""

    from_start = True
    """Whether the flight begins where the scenario has it."""

    def __init__(self, scenario: Scenario, vehicles: Mapping[VehicleId, Vehicle]) -> None:
        """Begin with all vehicles."""
        self._vehicles = vehicles
        leader = scenario.leader
        self._needed = list(vehicles.values()) if leader is None else [vehicles[leader.vehicle_id]]

    def waits_for(self, now: Instant) -> list[Vehicle] | None:  # noqa: ARG002 - for all, by default
        """Return the silent vehicles that are waited for; None if all are, for a limited time."""
        return None

    def may_act(self, vehicle: Vehicle, now: Instant) -> bool:  # noqa: ARG002 - always, by default
        """Return whether a vehicle may be commanded."""
        return True

    def requests(self, now: Instant) -> list[tuple[Vehicle, Message]]:  # noqa: ARG002 - none, by default
        """Return what to ask vehicles now."""
        return []

    def receive_parameter(self, vehicle: Vehicle, message: ParamValue, now: Instant) -> None:
        """Take a parameter reported by a vehicle."""

    def may_begin(self, now: Instant) -> bool:  # noqa: ARG002 - as soon as they follow, by default
        """Return whether the leader follows setpoints or, with a virtual leader, whether all do that are awaited."""
        awaited = [vehicle for vehicle in self._needed if vehicle.awaited]
        return bool(awaited) and all(vehicle.member is Member.FLYING for vehicle in awaited)
