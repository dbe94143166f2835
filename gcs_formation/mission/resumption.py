"""Taking over what flies, after the ground station was killed: who is taken, who leads, and where on the path.

Nobody is armed or taken off. Whoever isn't as the flight had left it is in other hands, and left there.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from formation_scenario.slot_assignment import Arrangement
from gcs_formation.link.link_health import LinkState
from gcs_formation.recorder import Note
from gcs_formation.vehicle.vehicle import Member, Vehicle

WAIT_S = 5.0
"""Longest wait for somebody who flew when the record ended; then the others begin without."""
RETAKE = "; --retake takes it, if its failsafe sent it"
BEHIND_M = 100.0
BEYOND = 1.5
"""How much faster than the path's speed the wind may have carried it."""


@dataclass(frozen=True)
class RecordedVehicle:
    """What the record says of a vehicle at its end."""

    mode: str | None
    """Its last mode, in words."""
    parted: bool
    """Whether it had left the formation: its pilot had it, or its failsafe."""
    flew: bool


@dataclass(frozen=True)
class Resumption:
    """Where a flight stood when its record ended."""

    at: Instant
    """The present instant, on the record's clock."""
    vehicles: Mapping[VehicleId, RecordedVehicle]
    mission_s: float
    """Mission time of the last tick, s; NaN before the path."""
    path_began: Instant | None
    distance_m: float
    """How far along the path the leader had come."""
    speed_mps: float
    """At which the path was flown."""
    heading_rad: float | None
    """Where multirotors that stand had been ordered to face; None: nowhere."""
    arrangement: Arrangement
    slots_m: Array
    """(C, 3) the slots, forward, right and up of the leader."""
    near: tuple[VehicleId, ...] = ()
    """Everybody who could lead: the one that led, then by their distance from it; nobody behind a virtual leader."""
    ending: bool = False
    """Whether the flight was at its end: who still follows setpoints is brought to circle."""
    retake: bool = False
    """Whether vehicles on their way home are taken too, as their failsafe may have sent them."""

    @property
    def reach_m(self) -> tuple[float, float]:
        """Between which distances along the path the leader may be now, if it flew on."""
        gone_s = 0.0 if self.path_began is None else seconds_between(self.path_began, self.at) - self.mission_s
        return self.distance_m - BEHIND_M, self.distance_m + BEYOND * self.speed_mps * gone_s + BEHIND_M


def why_left(
    known: RecordedVehicle, resumed: Resumption, mode: str, *, airborne: bool, guided: bool, homeward: bool
) -> str | None:
    """Return why a vehicle that is found in a mode is left as it is, in words; None if it is taken.

    `guided`: it follows setpoints; `homeward`: it is in the mode of its failsafe.
    """
    if not airborne:
        return "on the ground"
    as_left = mode == known.mode and not known.parted
    if guided or (not resumed.ending and (as_left or (homeward and resumed.retake and not known.parted))):
        return None
    if resumed.ending:
        return f"in {mode} at the flight's end"
    if known.parted:
        return f"in {mode}, its pilot's or its failsafe's already before"
    home = RETAKE if homeward else ""
    return f"in {mode}, and the flight had left it in {known.mode or 'an unknown mode'}{home}"


class Takeover:
    """Decides vehicle by vehicle, as they are heard; without a resumption everybody is started as usual."""

    def __init__(self, resumed: Resumption | None, vehicles: Mapping[VehicleId, Vehicle], note: Note) -> None:
        """Take over `vehicles`."""
        self.resumed, self._vehicles, self._note = resumed, vehicles, note
        self._decided, self._left = set[VehicleId](), dict[VehicleId, str]()
        """Of whom it is decided, and why those are left that are."""

    def waits_for(self, now: Instant) -> list[Vehicle] | None:
        """Return the vehicles that haven't been heard and are waited for; None if a start waits for all of them."""
        if self.resumed is None:
            return None
        late = self.waited(now)
        flew = {identity for identity, known in self.resumed.vehicles.items() if known.flew} or self._vehicles.keys()
        return [] if late else [each for identity, each in self._silent() if identity in flew]

    def may_act(self, vehicle: Vehicle, now: Instant) -> bool:
        """Return whether a vehicle may be commanded; one that is to be left as it is, is left to its pilot here."""
        resumed, seen = self.resumed, vehicle.telemetry
        if resumed is None or vehicle.identity in self._decided:
            return True
        if not (vehicle.start_up.asked_for_telemetry and seen.complete and seen.heartbeat):
            return False
        self._decided.add(vehicle.identity)
        autopilot, mode = vehicle.autopilot, vehicle.autopilot.mode_name(seen)
        reason = why_left(
            resumed.vehicles[vehicle.identity],
            resumed,
            mode,
            airborne=autopilot.is_airborne(seen),
            guided=autopilot.takes_setpoints(seen),
            homeward=seen.custom_mode == autopilot.home_mode,
        )
        if reason is not None:
            self._left[vehicle.identity] = reason
            vehicle.leave_to_pilot(now)
        self._note(now, "takeover", f"left as it is: {reason}" if reason else f"taken over in {mode}", vehicle)
        return True

    def leader(self, now: Instant) -> VehicleId | None:
        """Return who is to lead: whoever led, or after a while the nearest to it that follows setpoints."""
        resumed = self.resumed
        if resumed is None or not resumed.near:
            return None
        fit: Iterable[VehicleId] = resumed.near if self.waited(now) else resumed.near[:1]
        return next((each for each in fit if self._vehicles[each].member is Member.FLYING), None)

    def waited(self, now: Instant, for_s: float = WAIT_S) -> bool:
        """Return whether a flight was taken up longer ago than this."""
        return self.resumed is not None and seconds_between(self.resumed.at, now) > for_s

    def settled(self, now: Instant) -> bool:
        """Return whether it is decided of everybody who is heard and gets ready, and nobody else is waited for."""
        silent = {identity for identity, _ in self._silent()}
        abandoned = {identity for identity, vehicle in self._vehicles.items() if vehicle.start_up.abandoned}
        return not self.waits_for(now) and self._decided >= self._vehicles.keys() - silent - abandoned

    @property
    def took_any(self) -> bool:
        """Whether anybody has been taken over."""
        return len(self._left) < len(self._decided)

    def failure(self, now: Instant) -> str | None:
        """Return why there is nothing to take over, None while there is, or may be."""
        if self.resumed is None or not self.settled(now):
            return None
        taken = [vehicle for i, vehicle in self._vehicles.items() if i in self._decided and not vehicle.is_left]
        if not taken:
            return f"no vehicle to take over: {self._why_nobody()}"
        if not self.resumed.near and len(taken) < len(self._vehicles):
            return "a virtual leader flies amid all vehicles, and not all can be taken over"
        return None

    def _why_nobody(self) -> str:
        """Return how everybody was found who is left, and what takes those who may have been sent home."""
        found = dict[str, list[str]]()
        for identity in self._vehicles:
            if identity in self._decided:
                reason = self._left.get(identity, "taken by its pilot since").removesuffix(RETAKE)
                found.setdefault(reason, []).append(str(identity))
        home = any(reason.endswith(RETAKE) for reason in self._left.values())
        each = "; ".join(f"vehicle {', '.join(who)}: {reason}" for reason, who in found.items())
        return (each or "none got ready") + ("; --retake takes those that their failsafe sent home" if home else "")

    def _silent(self) -> list[tuple[VehicleId, Vehicle]]:
        searching = LinkState.SEARCHING
        return [(i, each) for i, each in self._vehicles.items() if each.connection.state is searching]
