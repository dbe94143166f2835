"""Puts what happens into words for the recorder, and records where everyone is while nobody is commanded."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from flight_model.autopilot_model import FlightState
from gcs_formation.controller import FormationController
from gcs_formation.recorder import Detail, Event, Recorder, Tick
from gcs_formation.separation.resolver import Encounter
from gcs_formation.vehicle.vehicle import Vehicle


class Reporter:
    """Reports events; each module of the station is given `event` as its `recorder.Note`."""

    def __init__(self, recorder: Recorder, vehicles: Mapping[VehicleId, Vehicle]) -> None:
        """Report to `recorder`."""
        self._recorder = recorder
        self._identities = {vehicle.column: identity for identity, vehicle in vehicles.items()}

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


def look_on(tick: Tick, vehicles: Iterable[Vehicle], now: Instant) -> Tick:
    """Fill in a blank tick and return it: the newest positions as told, and their ages."""
    tick.active = [False] * len(tick.active)
    for vehicle in vehicles:
        column, seen = vehicle.column, vehicle.telemetry
        if seen.motion is None:
            continue
        motion, heading_rad = seen.motion, seen.attitude.yaw_rad if seen.attitude else math.nan
        place = motion.north_m, motion.east_m, motion.height_m, motion.climb_mps
        tick.state[column] = FlightState(*place, seen.airspeed_mps, heading_rad, math.nan, math.nan)
        if vehicle.clock.samples:
            tick.age_s[column] = seconds_between(vehicle.clock.to_instant(motion.stamp_s), now)
    return tick


def words(encounter: Encounter, names: Mapping[int, str]) -> tuple[str, dict[str, Detail]]:
    """Return what the record says of an encounter that begins or ends, in words and figures."""
    other = names[encounter.other]
    if encounter.ended is None:
        text = (
            f"gives way to {other}, {'upwards' if encounter.upwards else 'downwards'}: "
            f"they would be {encounter.nearest_m:.1f} m apart in {encounter.in_s:.1f} s"
        )
        return text, {"other": other, "begins": True, "nearest_m": encounter.nearest_m, "in_s": encounter.in_s}
    lasted_s = seconds_between(encounter.begun, encounter.ended)
    text = f"no longer gives way to {other}: {lasted_s:.1f} s, {encounter.least_m:.1f} m apart at least"
    return text, {"other": other, "begins": False, "least_m": encounter.least_m, "lasted_s": lasted_s}
