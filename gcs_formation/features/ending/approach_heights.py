"""Before the first command of an emulated flight that lands: how high each vehicle's approach is by its parameter.

The others wait above it. A flight whose vehicles are checked reads this parameter with all others.
"""

from __future__ import annotations

from collections.abc import Mapping

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from airlink.messages import Message
from airlink.messages.command import ParamValue
from formation_scenario import Scenario
from gcs_formation.mission.gate import AlwaysExamined
from gcs_formation.vehicle.checks import ParameterReader, only_read
from gcs_formation.vehicle.vehicle import Vehicle


class ApproachHeights(AlwaysExamined):
    """Reads the heights; what gets no answer is taken to be its default."""

    def __init__(self, vehicles: Mapping[VehicleId, Vehicle]) -> None:
        """Ask every vehicle whose family has such a parameter."""
        self._vehicles = vehicles
        self._readers = {
            identity: ParameterReader(identity.system, [only_read(name)], each.autopilot.parameter)
            for identity, each in vehicles.items()
            if (name := each.autopilot.approach_parameter)
        }
        self.only_warns = False

    @property
    def passed(self) -> bool:
        """Whether all have answered, or needn't."""
        return self.only_warns or all(each.complete for each in self._readers.values())

    def requests(self, now: Instant) -> list[tuple[Vehicle, Message]]:
        """Return the requests to send now."""
        asked = ((self._vehicles[identity], reader) for identity, reader in self._readers.items())
        return [(each, one) for each, reader in asked if each.connection.talks for one in reader.requests(now)]

    def take_item(self, vehicle: Vehicle, message: Message, now: Instant) -> None:
        """Take the height of an approach."""
        reader = self._readers.get(vehicle.identity)
        if reader is not None and isinstance(message, ParamValue):
            reader.receive_parameter(message, now)
            vehicle.autopilot.take_approach(reader.values)

    def refusal(self, *, ready: bool) -> str | None:  # noqa: ARG002 - any height will do
        """Return None: any height will do."""
        return None


def lands(scenario: Scenario) -> bool:
    """Return whether a scenario says that its vehicles land."""
    return scenario.finish.then == "land" or any(each.order == "land" for each in scenario.orders)
