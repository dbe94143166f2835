"""Resumes a flight after the ground station was killed: which vehicles are taken over, and which leads.

No vehicle is armed or takes off. A vehicle that isn't as the flight had left it is under other control, and left alone,
unless its own failsafe explains its mode: its parameters say so, and it was without a station for long enough. Attempts
may follow one another: one in which no vehicle was taken over leaves no trace in the flight's state.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from airlink.messages import Message
from airlink.messages.command import ParamValue
from gcs_formation.core.cycle import Cycle
from gcs_formation.link.link_health import LinkState
from gcs_formation.mission.beginning import Beginning
from gcs_formation.mission.past_flight import LEFT, TAKEN, PastFlight, RecordedVehicle
from gcs_formation.vehicle.checks import ParameterReader, only_read
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.own_failsafe import OwnFailsafe
from gcs_formation.vehicle.vehicle import Vehicle

WAIT_S = 5.0
"""Longest wait for a vehicle that was flying when the record ended; then the others begin without it. Tuned: s; 3 to
15; by judgement."""
TAKE = "; --take takes it"
TAKES = "; --take takes those in the air"
ON_THE_GROUND = "on the ground"
START_AGAIN = "; fly it from its start, by its scenario"


class Found(NamedTuple):
    """How a vehicle is found."""

    mode: str
    airborne: bool
    guided: bool
    """Whether it follows setpoints."""
    ended: bool = False
    """Whether it is in a mode in which a flight ends."""
    by_failsafe: bool = False
    """Whether its own failsafe may have chosen its mode in the time without a ground station."""


def why_left(known: RecordedVehicle, resumed: PastFlight, found: Found) -> str | None:
    """Return in words why a vehicle is left alone, None if it is taken over."""
    if not found.airborne:
        return ON_THE_GROUND
    as_left = found.mode == known.mode and not known.parted
    sent = found.by_failsafe and not known.parted
    if found.guided or (sent and not as_left):
        return None
    if resumed.ending and (as_left or (found.ended and not resumed.take)):
        return f"in {found.mode} at the flight's end"
    if as_left or resumed.take:
        return None
    if known.parted:
        return f"in {found.mode}, its pilot's or its failsafe's already before{TAKE}"
    return f"in {found.mode}, and the flight had left it in {known.mode or 'an unknown mode'}{TAKE}"


class FailsafeReaders:
    """Reads the failsafes' parameters of vehicles that are found in another mode than the flight had left them in."""

    def __init__(self) -> None:
        """Start with none to read."""
        self._readers: dict[VehicleId, tuple[Vehicle, ParameterReader]] = {}

    def failsafe(self, vehicle: Vehicle) -> tuple[bool, OwnFailsafe | None]:
        """Return whether its parameters have been read, and its failsafe by them; begin to read them if need be."""
        autopilot = vehicle.autopilot
        if vehicle.identity not in self._readers:
            checks = [only_read(name) for name in autopilot.failsafe_parameters]
            reader = ParameterReader(vehicle.identity.system, checks, autopilot.parameter)
            self._readers[vehicle.identity] = vehicle, reader
        reader = self._readers[vehicle.identity][1]
        return reader.complete, autopilot.own_failsafe(reader.values) if reader.complete else None

    def requests(self, now: Instant) -> list[tuple[Vehicle, Message]]:
        """Return the parameter requests to send now."""
        found = list[tuple[Vehicle, Message]]()
        for vehicle, reader in self._readers.values():
            found += [(vehicle, request) for request in reader.requests(now)]
        return found

    def receive_parameter(self, vehicle: Vehicle, message: ParamValue, now: Instant) -> None:
        """Take a parameter reported by a vehicle."""
        if vehicle.identity in self._readers:
            self._readers[vehicle.identity][1].receive_parameter(message, now)


class Takeover(Beginning):
    """Decides for each vehicle as it is received."""

    from_start = False

    def __init__(self, cycle: Cycle, past: PastFlight) -> None:
        """Take over the vehicles of a past flight."""
        super().__init__(cycle.scenario, cycle.vehicles)
        self.past, self._log_event, self._changes = past, cycle.log_event, cycle.reconfiguration
        self._decided, self._left = set[VehicleId](), dict[VehicleId, str]()
        """Vehicles decided on; those left alone, with the reason."""
        self._failsafes = FailsafeReaders()

    def requests(self, now: Instant) -> list[tuple[Vehicle, Message]]:
        """Return the parameter requests to send now."""
        return self._failsafes.requests(now)

    def receive_parameter(self, vehicle: Vehicle, message: ParamValue, now: Instant) -> None:
        """Take a parameter reported by a vehicle."""
        self._failsafes.receive_parameter(vehicle, message, now)

    def may_begin(self, now: Instant) -> bool:
        """Return whether the flight goes on now: one that was ending doesn't."""
        return not self.past.ending and self.has_leader(now)

    def has_leader(self, now: Instant) -> bool:
        """Return whether the leader follows setpoints; let another vehicle lead if needed."""
        if not self.past.near:
            return super().may_begin(now)
        leader = self.leader(now)
        if leader is not None:
            self._changes.lead(leader, now)
        return leader is not None

    def waits_for(self, now: Instant) -> list[Vehicle]:
        """Return the silent vehicles that are waited for: those that flew, for a while."""
        late = self.waited(now)
        flew = {identity for identity, known in self.past.vehicles.items() if known.flew} or self._vehicles.keys()
        return [] if late else [each for identity, each in self._silent() if identity in flew]

    def may_act(self, vehicle: Vehicle, now: Instant) -> bool:
        """Return whether a vehicle may be commanded; one that must be left alone is left to its pilot here."""
        past, seen = self.past, vehicle.telemetry
        if vehicle.identity in self._decided:
            return True
        if not (vehicle.start_up.asked_for_telemetry and seen.complete and seen.heartbeat):
            return False
        found = self._found(vehicle, past)
        if found is None:
            return False
        self._decided.add(vehicle.identity)
        reason = why_left(past.vehicles[vehicle.identity], past, found)
        if reason is not None:
            self._left[vehicle.identity] = reason
            vehicle.leave_to_pilot(now)
        taken = f"{TAKEN} in {found.mode}{', sent there by its failsafe' if found.by_failsafe else ''}"
        self._log_event(now, "takeover", f"{LEFT}: {reason}" if reason else taken, vehicle)
        return True

    def _found(self, vehicle: Vehicle, past: PastFlight) -> Found | None:
        """Return how a vehicle is found; None while its failsafe's parameters aren't read that may explain its mode."""
        autopilot, seen, known = vehicle.autopilot, vehicle.telemetry, past.vehicles[vehicle.identity]
        ends = (autopilot.loiter_mode, autopilot.home_mode)
        mode, airborne = autopilot.mode_name(seen), autopilot.is_airborne(seen)
        found = Found(mode, airborne, autopilot.takes_setpoints(seen), seen.custom_mode in ends)
        if not airborne or found.guided or known.parted or mode == known.mode:
            return found
        read, failsafe = self._failsafes.failsafe(vehicle)
        if not read:
            return None
        sent = failsafe is not None and failsafe.led_to(seen.custom_mode, past.silent_s)
        return found._replace(by_failsafe=sent)

    def leader(self, now: Instant) -> VehicleId | None:
        """Return the vehicle to lead: the former leader or, after a wait, the nearest to it that follows setpoints."""
        near = self.past.near
        fit: Iterable[VehicleId] = near if self.waited(now) else near[:1]
        return next((each for each in fit if self._vehicles[each].member is Member.FLYING), None)

    def waited(self, now: Instant, for_s: float = WAIT_S) -> bool:
        """Return whether the flight was resumed longer ago than `for_s`."""
        return seconds_between(self.past.at, now) > for_s

    def settled(self, now: Instant) -> bool:
        """Return whether every vehicle received is decided on, except those given up, and no other is waited for."""
        silent = {identity for identity, _ in self._silent()}
        abandoned = {identity for identity, vehicle in self._vehicles.items() if vehicle.start_up.abandoned}
        return not self.waits_for(now) and self._decided >= self._vehicles.keys() - silent - abandoned

    @property
    def took_any(self) -> bool:
        """Whether any vehicle has been taken over."""
        return len(self._left) < len(self._decided)

    def failure(self, now: Instant) -> str | None:
        """Return why there is nothing to take over, None while there is or may be."""
        if not self.settled(now) or self.is_over(now):
            return None
        taken = [vehicle for i, vehicle in self._vehicles.items() if i in self._decided and not vehicle.is_left]
        if not taken:
            return f"no vehicle to take over: {self._why_none()}"
        if not self.past.near and len(taken) < len(self._vehicles):
            return "a virtual leader flies at the centroid of all vehicles, and not all can be taken over"
        return None

    def is_over(self, now: Instant) -> bool:
        """Return whether nothing is left to do: the flight had ended, and no vehicle follows setpoints any more."""
        if not self.past.ending or not self._decided:
            return False
        return not self.took_any and self.settled(now)

    def _why_none(self) -> str:
        """Return why vehicles were left alone, and how to take over those in the air."""
        found = dict[str, list[str]]()
        for identity in self._vehicles:
            if identity in self._decided:
                reason = self._left.get(identity, "taken by its pilot since").removesuffix(TAKE)
                found.setdefault(reason, []).append(str(identity))
        others = any(reason.endswith(TAKE) for reason in self._left.values())
        each = "; ".join(f"vehicle {', '.join(who)}: {reason}" for reason, who in found.items())
        grounded = list(found) == [ON_THE_GROUND]
        return (each or "none got ready") + (TAKES if others else START_AGAIN if grounded else "")

    def _silent(self) -> list[tuple[VehicleId, Vehicle]]:
        searching = LinkState.SEARCHING
        return [(i, each) for i, each in self._vehicles.items() if each.connection.state is searching]
