"""Puts what happens into words, and reports it to the recorder."""

from __future__ import annotations

from collections.abc import Mapping

from airlink.clock import Instant
from airlink.identity import VehicleId
from gcs_formation.controller import FormationController
from gcs_formation.recorder import Detail, Event, Recorder
from gcs_formation.separation.keeper import words
from gcs_formation.vehicle.vehicle import Vehicle


class Reporter:
    """Reports events; each module of the station is given `event` as its `recorder.Note`."""

    def __init__(self, recorder: Recorder, columns: Mapping[VehicleId, int]) -> None:
        """Report to `recorder`; `columns` are the vehicles' in a tick."""
        self._recorder = recorder
        self._identities = {column: identity for identity, column in columns.items()}

    def event(
        self,
        now: Instant,
        kind: str,
        text: str,
        vehicle: Vehicle | None = None,
        details: Mapping[str, Detail] | None = None,
    ) -> None:
        """Report an event, of a vehicle or of the run."""
        self._recorder.event(Event(now, kind, text, vehicle.identity if vehicle else None, details or {}))

    def link(self, vehicle: Vehicle, now: Instant) -> None:
        """Report the new state of a link."""
        self.event(now, "link", vehicle.connection.state.value, vehicle, {"peer": str(vehicle.connection.peer)})

    def setpoints(self, controller: FormationController, now: Instant) -> None:
        """Report whose setpoints begin or end to be the separation rule's, or the fence's."""
        for encounter in controller.separation.changes:
            text, details = words(encounter, {column: str(each) for column, each in self._identities.items()})
            self._recorder.event(Event(now, "separation", text, self._identities[encounter.vehicle], details))
        for held in controller.fence.changes:
            identity = self._identities[held.column]
            self._recorder.event(Event(now, "fence", held.text, identity, {"begins": held.begins}))
