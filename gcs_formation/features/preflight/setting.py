"""Sets on consent what the check of parameters asks for, of vehicles on the ground; the gate restores it later."""

from __future__ import annotations

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from airlink.messages import Message
from airlink.messages.command import ParamValue
from gcs_formation.mission.gate import Gate
from gcs_formation.vehicle.checks import Finding, ParameterReader
from gcs_formation.vehicle.parameter_setting import ParameterWriter
from gcs_formation.vehicle.vehicle import Vehicle


class ParameterSetting:
    """Sets the parameters of each vehicle once they have been read."""

    def __init__(self, gate: Gate) -> None:
        """Set them if the gate allows it."""
        self._gate, self._writers = gate, dict[VehicleId, ParameterWriter]()

    def done(self, vehicle: Vehicle, reader: ParameterReader, now: Instant) -> bool:
        """Return whether all that is to be set has been, or couldn't be; begin if that is due.

        Nothing is set in flight, where a change acts at once.
        """
        writer = self._writers.get(vehicle.identity)
        if writer is not None:
            return not writer.pending
        if not self._gate.sets_parameters or vehicle.airborne:
            return True
        changes, autopilot = reader.changes(), vehicle.autopilot
        self._gate.restoration.remember(vehicle, changes, now)
        self._writers[vehicle.identity] = ParameterWriter(changes, autopilot.set_parameter, autopilot.parameter)
        return not changes

    def requests(self, vehicle: Vehicle, now: Instant) -> list[Message]:
        """Return what to send a vehicle now."""
        return list(self._writers[vehicle.identity].requests(now))

    def take(self, vehicle: Vehicle, message: ParamValue, now: Instant) -> None:
        """Take a parameter reported by a vehicle."""
        writer = self._writers.get(vehicle.identity)
        if writer is not None:
            writer.take(message, now)

    def findings(self, vehicle: Vehicle, reader: ParameterReader) -> list[Finding]:
        """Return what couldn't be set, or in a dry run what would be."""
        if self._gate.says_what_to_set and not vehicle.airborne:
            return [Finding(f"would set {each.words}") for each in reader.changes()]
        writer = self._writers.get(vehicle.identity)
        return [] if writer is None else [Finding(f"couldn't set {each.words}") for each in writer.failed]
