"""Resumes a flight after the ground station was killed: which vehicles are taken over, which leads, and where it is.

No vehicle is armed or takes off. A vehicle that isn't as the flight had left it is under other control, and left alone.
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
"""Longest wait for a vehicle that was flying when the record ended; then the others begin without it."""
RETAKE = "; --retake takes it, if its failsafe sent it"
BEHIND_M = 100.0
BEYOND = 1.5
"""Largest ground speed that the leader may have had with the wind, as a multiple of the path's speed."""


@dataclass(frozen=True)
class RecordedVehicle:
    """State of a vehicle at the end of the record."""

    mode: str | None
    """Its last mode, in words."""
    parted: bool
    """Whether it had left the formation, by its pilot or its failsafe."""
    flew: bool


@dataclass(frozen=True)
class Resumption:
    """State of a flight at the end of its record."""

    at: Instant
    """The present instant, on the record's clock."""
    vehicles: Mapping[VehicleId, RecordedVehicle]
    mission_s: float
    """Mission time of the last tick, s; NaN before the path."""
    path_began: Instant | None
    distance_m: float
    """The leader's distance along the path."""
    speed_mps: float
    """Speed at which the path was flown."""
    heading_rad: float | None
    """Heading that hovering multirotors had been ordered to; None without an order."""
    arrangement: Arrangement
    slots_m: Array
    """(C, 3) the slots, forward, right and up of the leader."""
    near: tuple[VehicleId, ...] = ()
    """Vehicles that could lead: the leader, then others by their distance from it; empty with a virtual leader."""
    ending: bool = False
    """Whether the flight was ending; vehicles that still follow setpoints are then led to their circles."""
    retake: bool = False
    """Whether vehicles flying home are taken over too, as their failsafe may have sent them."""

    @property
    def reach_m(self) -> tuple[float, float]:
        """Range of distances along the path at which the leader may be now, if it flew on."""
        gone_s = 0.0 if self.path_began is None else seconds_between(self.path_began, self.at) - self.mission_s
        return self.distance_m - BEHIND_M, self.distance_m + BEYOND * self.speed_mps * gone_s + BEHIND_M


def why_left(
    known: RecordedVehicle, resumed: Resumption, mode: str, *, airborne: bool, guided: bool, homeward: bool
) -> str | None:
    """Return in words why a vehicle found in a mode is left alone, None if it is taken over.

    `guided`: it follows setpoints; `homeward`: it is in its failsafe's mode.
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
    """Decides for each vehicle as it is heard; without a resumption all are started as usual."""

    def __init__(self, resumed: Resumption | None, vehicles: Mapping[VehicleId, Vehicle], note: Note) -> None:
        """Take over `vehicles`."""
        self.resumed, self._vehicles, self._note = resumed, vehicles, note
        self._decided, self._left = set[VehicleId](), dict[VehicleId, str]()
        """Vehicles decided on; those left alone, with the reason."""

    def waits_for(self, now: Instant) -> list[Vehicle] | None:
        """Return the silent vehicles that are waited for; None if this is a start, which waits for all vehicles."""
        if self.resumed is None:
            return None
        late = self.waited(now)
        flew = {identity for identity, known in self.resumed.vehicles.items() if known.flew} or self._vehicles.keys()
        return [] if late else [each for identity, each in self._silent() if identity in flew]

    def may_act(self, vehicle: Vehicle, now: Instant) -> bool:
        """Return whether a vehicle may be commanded; one that must be left alone is left to its pilot here."""
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
        """Return the vehicle to lead: the former leader or, after a wait, the nearest to it that follows setpoints."""
        resumed = self.resumed
        if resumed is None or not resumed.near:
            return None
        fit: Iterable[VehicleId] = resumed.near if self.waited(now) else resumed.near[:1]
        return next((each for each in fit if self._vehicles[each].member is Member.FLYING), None)

    def waited(self, now: Instant, for_s: float = WAIT_S) -> bool:
        """Return whether the flight was resumed longer ago than `for_s`."""
        return self.resumed is not None and seconds_between(self.resumed.at, now) > for_s

    def settled(self, now: Instant) -> bool:
        """Return whether every vehicle heard is decided on, except those given up, and no other is waited for."""
        silent = {identity for identity, _ in self._silent()}
        abandoned = {identity for identity, vehicle in self._vehicles.items() if vehicle.start_up.abandoned}
        return not self.waits_for(now) and self._decided >= self._vehicles.keys() - silent - abandoned

    @property
    def took_any(self) -> bool:
        """Whether any vehicle has been taken over."""
        return len(self._left) < len(self._decided)

    def failure(self, now: Instant) -> str | None:
        """Return why there is nothing to take over, None while there is or may be."""
        if self.resumed is None or not self.settled(now):
            return None
        taken = [vehicle for i, vehicle in self._vehicles.items() if i in self._decided and not vehicle.is_left]
        if not taken:
            return f"no vehicle to take over: {self._why_nobody()}"
        if not self.resumed.near and len(taken) < len(self._vehicles):
            return "a virtual leader flies amid all vehicles, and not all can be taken over"
        return None

    def _why_nobody(self) -> str:
        """Return why vehicles were left alone, and how to take over those that may have been sent home."""
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
