"""What must hold before anybody is commanded: parameters that were read and are in order, and the operator's word."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from airlink.clock import Instant
from airlink.identity import VehicleId
from airlink.messages import Message
from airlink.messages.parameter import ParamValue
from formation_scenario import Scenario
from gcs_formation.link.connection import TALKING
from gcs_formation.recorder import GiveUp, Note
from gcs_formation.vehicle.checks import ParameterReader, demands
from gcs_formation.vehicle.vehicle import Vehicle

IN_ORDER = "in order"


@dataclass(frozen=True)
class Caution:
    """What is done before anybody is commanded: changes of mode, arming, setpoints."""

    parameters: bool = False
    """Whether parameters are read and judged."""
    confirm: bool = False
    """Whether somebody's word is awaited when all vehicles are ready."""
    rehearse: bool = False
    """Whether the run ends there."""


CARELESS = Caution()


class PreFlight:
    """Holds all vehicles' start-ups before their first command until everybody may begin."""

    def __init__(
        self, scenario: Scenario, vehicles: Mapping[VehicleId, Vehicle], caution: Caution, note: Note, give_up: GiveUp
    ) -> None:
        """Read parameters of `vehicles`, unless the scenario starts emulators in the air."""
        self._vehicles, self._caution = vehicles, caution
        self._note, self._give_up = note, give_up
        self._confirmed = not (caution.confirm or caution.rehearse)
        self._readers: dict[VehicleId, ParameterReader] = {}
        if caution.parameters:
            for planned in scenario.vehicles:
                autopilot = vehicles[planned.vehicle_id].autopilot
                checks = autopilot.checks(demands(scenario, planned))
                self._readers[planned.vehicle_id] = ParameterReader(planned.id, checks, autopilot.parameter)
        self._judged, self._refused = set[VehicleId](), False
        self.warnings: dict[VehicleId, tuple[str, ...]] = {}
        """What isn't as it should be, and doesn't keep anybody on the ground."""

    @property
    def passed(self) -> bool:
        """Whether vehicles may be commanded."""
        return self._confirmed and self._checked

    @property
    def awaits_word(self) -> bool:
        """Whether everybody is connected, ready and checked, and only the operator's word is missing."""
        held = all(vehicle.start_up.held for vehicle in self._vehicles.values())
        return not self._confirmed and self._checked and held

    @property
    def rehearsed(self) -> bool:
        """Whether a rehearsal is over."""
        return self._caution.rehearse and self.awaits_word

    @property
    def _checked(self) -> bool:
        return len(self._judged) == len(self._readers) and not self._refused

    def question(self) -> str:
        """Return what to ask when `awaits_word`."""
        flying = sum(vehicle.airborne for vehicle in self._vehicles.values())
        warned = sum(map(bool, self.warnings.values()))
        state = f"{len(self._vehicles)} vehicles are connected, ready and checked ({warned} with warnings)"
        what = f"arm {len(self._vehicles) - flying} and take off" + (f", take over {flying}" if flying else "")
        return f"{state}. Type yes to {what}; anything else ends the run"

    def confirm(self) -> None:
        """Let everybody begin."""
        self._confirmed = True

    def requests(self, now: Instant) -> Iterator[tuple[Vehicle, Message]]:
        """Yield the requests for parameters to send now, and judge those that have been read."""
        for identity, reader in self._readers.items():
            vehicle = self._vehicles[identity]
            if identity in self._judged or vehicle.connection.state not in TALKING:
                continue
            if reader.complete:
                self._judge(vehicle, reader, now)
            else:
                yield from ((vehicle, request) for request in reader.requests(now))

    def take(self, vehicle: Vehicle, message: ParamValue, now: Instant) -> None:
        """Take a parameter that a vehicle has told."""
        if vehicle.identity in self._readers:
            self._readers[vehicle.identity].take(message, now)

    def _judge(self, vehicle: Vehicle, reader: ParameterReader, now: Instant) -> None:
        """Record what was found. What refuses a take-off only warns of a vehicle that flies already."""
        findings, flies = reader.findings(), vehicle.airborne
        refused = [finding.text for finding in findings if finding.refuses and not flies]
        told = tuple(finding.text for finding in findings if finding.text not in refused)
        self._judged.add(vehicle.identity)
        self.warnings[vehicle.identity] = told
        if told or not refused:
            self._note(now, "parameters", "; ".join(told) or IN_ORDER, vehicle)
        if refused:
            self._refused = True
            self._give_up(f"vehicle {vehicle.identity}: {'; '.join(refused)}", now)
