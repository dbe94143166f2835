"""Before the first command of a flight that ends in landings: whether all can land, and one after another.

Each fixed wing is asked for the landing in its mission, and each multirotor that is in the air already for its home:
one on the ground will have it where it stands.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from airlink.messages import Message
from formation_scenario import Scenario
from gcs_formation.features.ending.holding_stack import home_of
from gcs_formation.features.ending.landing_order import LandingOrder
from gcs_formation.fleet.circle_heights import GroundFloor
from gcs_formation.mission.gate import AlwaysExamined
from gcs_formation.vehicle.stored_mission import RETRY_S, TRIES, StoredMission
from gcs_formation.vehicle.vehicle import Vehicle

KEY: Final = "finish.then: found land, but"
ALLOWED: Final = "allowed: rtl, loiter, or another place or a stored landing for it"


class _HomeRequests:
    """Asks a multirotor for its home, if it is in the air and hasn't reported it."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Prepare requests."""
        self._vehicle, self._tries, self._next = vehicle, 0, Instant(0)

    @property
    def complete(self) -> bool:
        """Whether its home is known or needn't be, or it doesn't answer."""
        return not self._vehicle.airborne or home_of(self._vehicle) is not None or self._tries >= TRIES

    def requests(self, now: Instant) -> list[Message]:
        """Return the request to send now, if one is due."""
        if self.complete or now < self._next:
            return []
        self._next = after(now, RETRY_S)
        self._tries += 1
        return [self._vehicle.ask(self._vehicle.autopilot.home_request())]


class LandingCheck(AlwaysExamined):
    """Reads the landings of stored missions and homes, then judges all landings together."""

    def __init__(self, scenario: Scenario, vehicles: Mapping[VehicleId, Vehicle]) -> None:
        """Ask every fixed wing for its mission and others for their homes, if the scenario ends in landings."""
        self._vehicles, self._ground = vehicles, GroundFloor(scenario)
        asked = scenario.finish.then == "land"
        self._readers = {
            identity: StoredMission(
                each.autopilot.system,
                each.autopilot.station,
                each.autopilot.origin,
                needs_mark=each.autopilot.landing_is_marked,
            )
            for identity, each in vehicles.items()
            if asked and each.autopilot.lands_by_mission
        }
        self._homes = {
            identity: _HomeRequests(each) for identity, each in vehicles.items() if asked and each.autopilot.hovers
        }
        self._judged = not asked
        self.only_warns = False

    @property
    def passed(self) -> bool:
        """Whether all can land, or needn't."""
        return self._judged or self.only_warns

    def requests(self, now: Instant) -> list[tuple[Vehicle, Message]]:
        """Return the requests to send now; take the landings of missions that are read."""
        found = list[tuple[Vehicle, Message]]()
        for identity, home in self._homes.items():
            vehicle = self._vehicles[identity]
            if not self._judged and vehicle.connection.talks:
                found += [(vehicle, request) for request in home.requests(now)]
        for identity, reader in self._readers.items():
            vehicle = self._vehicles[identity]
            if not self._judged and vehicle.connection.talks:
                found += [(vehicle, request) for request in reader.requests(now)]
            motion = vehicle.telemetry.motion
            if reader.complete and vehicle.autopilot.landing is None and motion is not None:
                home_m = motion.height_m - motion.above_home_m
                vehicle.autopilot.landing = reader.landing(home_m + vehicle.autopilot.origin.alt_m)
        return found

    def take_item(self, vehicle: Vehicle, message: Message, now: Instant) -> None:
        """Take the number of a mission's items, or one of them."""
        reader = self._readers.get(vehicle.identity)
        if reader is not None:
            reader.handle(message, now)

    def refusal(self, *, ready: bool) -> str | None:
        """Judge, once all is read and all are `ready`; return why they can't land, None if they can.

        Where it only warns, those that can't land circle over their homes at the end.
        """
        read = all(each.complete for each in self._readers.values())
        known = all(each.complete for each in self._homes.values())
        if self._judged or not (ready and read and known):
            return None
        grounded = not any(each.airborne for each in self._vehicles.values())
        why = LandingOrder(self._vehicles, self._ground, planned=grounded).refusal
        self._judged = why is None or self.only_warns
        return None if why is None else f"{KEY} {why}; {ALLOWED}"
