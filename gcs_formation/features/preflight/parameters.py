"""Reads the parameters on which the flight depends, and judges each vehicle by its own."""

from __future__ import annotations

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from airlink.messages import Message
from airlink.messages.command import ParamValue
from gcs_formation.core.cycle import Cycle
from gcs_formation.features.preflight.own_fences import OwnFences
from gcs_formation.features.preflight.read_limits import ReadLimits
from gcs_formation.features.preflight.setting import ParameterSetting
from gcs_formation.mission.gate import Examination
from gcs_formation.vehicle.checks import ParameterReader
from gcs_formation.vehicle.vehicle import Vehicle


class ParameterExamination(Examination):
    """Reads and judges the parameters of all vehicles; their limits bound what is commanded."""

    def __init__(self, cycle: Cycle) -> None:
        """Prepare to read."""
        scenario = cycle.scenario
        self._gate, self._changes = cycle.phase_machine.gate, cycle.reconfiguration
        self._limits = ReadLimits(scenario, cycle.controller.bound)
        self._readers = dict[VehicleId, ParameterReader]()
        for planned in scenario.vehicles:
            autopilot = cycle.vehicles[planned.vehicle_id].autopilot
            checks = autopilot.checks(planned.model, scenario.path)
            self._readers[planned.vehicle_id] = ParameterReader(planned.id, checks, autopilot.parameter)
        self._fences, self._judged = OwnFences(scenario), set[VehicleId]()
        self._setting = ParameterSetting(self._gate)

    @property
    def complete(self) -> bool:
        """Whether all vehicles have been judged."""
        return len(self._judged) == len(self._readers) and self._fences.settled

    def requests(self, vehicle: Vehicle, now: Instant) -> list[Message]:
        """Return the parameter requests to send a vehicle now; judge a complete set of parameters."""
        self._fences.settle()
        if vehicle.identity in self._judged or not vehicle.connection.talks:
            return []
        reader = self._readers[vehicle.identity]
        if not reader.complete:
            return list(reader.requests(now))
        if not self._setting.done(vehicle, reader, now):
            return self._setting.requests(vehicle, now)
        self._judge(vehicle, reader, now)
        return []

    def receive_parameter(self, vehicle: Vehicle, message: ParamValue, now: Instant) -> None:
        """Take a parameter reported by a vehicle."""
        self._readers[vehicle.identity].receive_parameter(message, now)
        self._setting.take(vehicle, message, now)

    def objections(self) -> list[str]:
        """Return in words what can't be flown within the limits that vehicles tell."""
        return [*self._limits.unflyable(), *self._fences.unflyable]

    def _judge(self, vehicle: Vehicle, reader: ParameterReader, now: Instant) -> None:
        """Record the findings. Those that prevent a take-off are warnings for a vehicle already in flight."""
        findings, flies = [*reader.findings(), *self._setting.findings(vehicle, reader)], vehicle.airborne
        self._limits.apply(vehicle, reader.bounds())
        self._fences.apply(vehicle, vehicle.autopilot.own_fence(reader.values))
        vehicle.autopilot.take_approach(reader.values)
        news = self._limits.take_news()
        if news is not None:
            self._changes.plan_with(news)
        self._judged.add(vehicle.identity)
        self._gate.record(vehicle, [each._replace(refuses=each.refuses and not flies) for each in findings], now)
