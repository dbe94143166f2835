"""The faults that a scenario injects into emulated vehicles, as events of its record."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from airlink.clock import Instant
from airlink.identity import VehicleId
from formation_scenario import Scenario
from gcs_formation.phases import Flight
from gcs_formation.recorder import Event, Recorder


class _Planned(NamedTuple):
    at_s: float
    vehicle: VehicleId
    kind: str
    ends: bool


class InjectedFaults:
    """Records each fault when it's due by mission time. The station isn't told: it has to notice by itself."""

    def __init__(self, scenario: Scenario, recorder: Recorder) -> None:
        """Take the faults from the scenario."""
        self._recorder = recorder
        self._pending = sorted(_planned(scenario))

    def note(self, flight: Flight, now: Instant) -> None:
        """Record what has become due."""
        while self._pending and self._pending[0].at_s <= flight.mission_time_s(now):
            fault = self._pending.pop(0)
            text = f"{fault.kind} is over" if fault.ends else fault.kind
            details = {"fault": fault.kind, "ends": fault.ends}
            self._recorder.event(Event(now, "fault", text, fault.vehicle, details))


def _planned(scenario: Scenario) -> Iterator[_Planned]:
    for fault in scenario.faults:
        for vehicle in scenario.selected(fault.vehicles):
            yield _Planned(fault.at_s, vehicle.vehicle_id, fault.kind, ends=False)
            if fault.until_s is not None:
                yield _Planned(fault.until_s, vehicle.vehicle_id, fault.kind, ends=True)
