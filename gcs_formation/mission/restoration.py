"""Parameters that were set for the flight, and that get their values back after it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from airlink.clock import NEVER, Instant, after
from airlink.endpoint import VehicleId
from airlink.messages import Message
from airlink.messages.command import ParamValue
from gcs_formation.recorder import Detail, LogEvent
from gcs_formation.vehicle.parameter_setting import Change, ParameterWriter
from gcs_formation.vehicle.vehicle import Vehicle

LIMIT_S = 10.0
"""Longest wait for all vehicles after the flight."""
LOOK_S = 0.1


class Restoration:
    """Remembers what is set, from before the first attempt on, and undoes it."""

    def __init__(self, vehicles: Mapping[VehicleId, Vehicle], log_event: LogEvent) -> None:
        """Start with nothing set; `log_event` records what is set and restored."""
        self._vehicles, self._log_event = vehicles, log_event
        self._changes = dict[VehicleId, dict[str, Change]]()
        self._writers = dict[VehicleId, ParameterWriter]()
        self.due: Instant = NEVER
        """When there is something to do next."""
        self._until: Instant = NEVER
        self.left = list[str]()
        """What couldn't be restored, in words."""

    def remember(self, vehicle: Vehicle, changes: Iterable[Change], now: Instant) -> None:
        """Take what will be set. It is recorded before that: a killed station's successor restores it."""
        known = self._changes.setdefault(vehicle.identity, {})
        for each in changes:
            if each.name not in known:
                known[each.name] = each
                details: dict[str, Detail] = {
                    "name": each.name,
                    "param_type": each.kind,
                    "before": each.before,
                    "after": each.after,
                }
                self._log_event(now, "parameters", f"sets {each.words}", vehicle, details)

    def take_over(self, found: Iterable[tuple[str, Change]]) -> None:
        """Take what an earlier station set, and didn't restore, each with the vehicle's id in words."""
        named = {str(identity): identity for identity in self._vehicles}
        for whose, change in found:
            if whose in named:
                self._changes.setdefault(named[whose], {}).setdefault(change.name, change)

    @property
    def has_some(self) -> bool:
        """Whether there is anything to restore."""
        return any(self._changes.values())

    def begin(self, now: Instant) -> None:
        """Begin, unless it has begun."""
        if self._until != NEVER:
            return
        self.due, self._until = now, after(now, LIMIT_S)
        for identity, changes in self._changes.items():
            autopilot = self._vehicles[identity].autopilot
            back = [each.back() for each in changes.values()]
            self._writers[identity] = ParameterWriter(back, autopilot.set_parameter, autopilot.parameter)

    def requests(self, now: Instant) -> list[tuple[Vehicle, Message]]:
        """Return what to send now; nothing before it has begun."""
        found = list[tuple[Vehicle, Message]]()
        if now >= self.due:
            self.due = after(now, LOOK_S)
            for identity, writer in self._writers.items():
                found += [(self._vehicles[identity], request) for request in writer.requests(now)]
        return found

    def take(self, vehicle: Vehicle, message: ParamValue, now: Instant) -> None:
        """Take a parameter reported by a vehicle."""
        writer = self._writers.get(vehicle.identity)
        restored = None if writer is None else writer.take(message, now)
        if restored is not None:
            details: dict[str, Detail] = {"name": restored.name, "restored": True}
            self._log_event(now, "parameters", f"restored {restored.words}", vehicle, details)

    def over(self, now: Instant) -> bool:
        """Return whether it is over; what couldn't be restored is recorded then."""
        if now < self._until and any(writer.pending for writer in self._writers.values()):
            return False
        self.due = NEVER
        for identity, writer in self._writers.items():
            lacking = [*writer.failed, *writer.pending]
            if lacking:
                words = ", ".join(f"{each.name} is {each.before:g}, was {each.after:g}" for each in lacking)
                self.left.append(f"vehicle {identity}: {words}")
                self._log_event(now, "parameters", f"couldn't be restored: {words}", self._vehicles[identity])
        self._writers.clear()
        return True
