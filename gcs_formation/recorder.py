"""What the station reports at a control tick and otherwise, and the interface to what stores it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from mypy_extensions import mypyc_attr

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from flight_model.autopilot_model import FlightState
from flight_model.slot import UNKNOWN, Triple
from gcs_formation.control.setpoint import AS_DECIDED, Replaced
from gcs_formation.control.situation import Decided
from gcs_formation.vehicle.vehicle import Vehicle

Detail = str | int | float | bool | None
GiveUp = Callable[[str, Instant], None]
"""Ends a run that can't go on, with the reason."""


@mypyc_attr(acyclic=True)
class VehicleLink:
    """The link to one vehicle at a tick."""

    def __init__(self, now: Instant) -> None:
        """Begin as that of a virtual leader: no delay, always heard."""
        self.ready = False
        """Whether it follows setpoints."""
        self.delay_s = 0.0
        """One-way delay as measured, half the round trip."""
        self.split_s = 0.0
        """How much longer the way up is, as far as a step told."""
        self.up_s = self.down_s = math.nan
        """Delays up and down; NaN where it isn't known how the round trip is split."""
        self.jitter_s = math.nan
        """Interarrival jitter of the telemetry, NaN where there is none yet."""
        self.lag_s = 0.0
        """Half a period of the vehicle's main loop, the mean wait of a setpoint that has arrived, and the time for
        which the station holds it back."""
        self.airborne = True
        """Whether it flies, as far as it can be heard."""
        self.flew = True
        """Whether it did when it was last heard."""
        self.circling, self.holds_at_m = False, math.nan
        """Whether it circles, or is about to turn onto its circle, or may, as it may have been told to; and the height
        that it was told for that, NaN if it wasn't."""
        self.flies_home_m: tuple[float, float] | None = None
        self.home_m: tuple[float, float] | None = None
        """Its home, north and east: if it isn't commanded and its mode brings it there, and as far as it is known."""
        self.heard: int = now
        """Until when it is known to have heard what it was commanded."""
        self.disobeying = False
        """Whether it doesn't seem to fly as it was commanded, though it hears it."""
        self.stands_after_s, self.returns_after_s = math.inf, 0.0
        """How long after the last setpoint that it heard it stands, infinite where it flies on; and how long after that
        setpoint it has set off for home, if it does for want of others."""
        self.speeds_mps: tuple[float, float] | None = None
        """The lowest and the highest true airspeed that it can reach soon, m/s; None where they are its model's."""

    @property
    def on_its_way_s(self) -> float:
        """How long a setpoint is on its way: half the round trip where no more is known of its split."""
        return self.delay_s + self.split_s if math.isnan(self.up_s) else self.up_s


def unknown_state() -> FlightState:
    """Return the state of a vehicle that was never heard: NaN."""
    return FlightState(math.nan, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)


class Tick:
    """One control tick: lists with an entry for each of C columns; column 0 is the scenario's leader, real or virtual.

    The controller fills it in; nobody does afterwards.
    """

    def __init__(
        self,
        now: Instant,
        mission_time_s: float,
        phase: str,
        leader: int,
        links: list[VehicleLink],
        age_s: list[float],
        margin_used: list[float],
        active: list[bool],
    ) -> None:
        """Begin with nothing commanded.

        Args:
            now: the tick's instant.
            mission_time_s: NaN before the path has begun.
            phase: of the flight.
            leader: the column that leads.
            links: as measured.
            age_s: of the newest state, NaN where there is none.
            margin_used: share of the delay margin that the loops use.
            active: which columns are commanded.
        """
        self.now = now
        self.mission_time_s = mission_time_s
        self.phase = phase
        self.leader = leader
        self.links = links
        self.age_s = age_s
        self.margin_used = margin_used
        self.active = active
        count = len(links)
        self.state: list[FlightState] = [unknown_state()] * count
        """What the law acted on: predicted to when the setpoints act."""
        self.virtual_leader: FlightState | None = None
        """Where a virtual leader is at this instant; None behind a real one."""
        self.setpoints: list[Triple] = [UNKNOWN] * count
        """Airspeed in m/s, heading in rad and height in m; NaN where none is sent."""
        self.replaced: list[Replaced] = [AS_DECIDED] * count
        """Which of them aren't the law's."""
        self.yielding = [False] * count
        """Which columns' setpoints are the separation rule's, not the law's."""
        self.slots_m: list[Triple] = [UNKNOWN] * count
        """Forward, right and up; NaN for the leader."""
        self.slots_left = False
        """Whether heights of the end are flown instead: there are no slots to be in."""
        self.decided: list[Decided | None] = [None] * count
        """What the law decided, and by which mixed errors and gains; None for the leader and who isn't commanded."""
        self.events: list[Event] = []
        """What began or ended as setpoints were replaced."""

    def error_of(self, column: int) -> Triple:
        """Return how far a vehicle is from its slot, forward, right and up; NaN for the leader, and without slots."""
        decided = self.decided[column]
        if decided is None or self.slots_left:
            return (math.nan, math.nan, math.nan)
        return decided.error_m

    @property
    def error_m(self) -> list[Triple]:
        """The same of all columns."""
        return [self.error_of(column) for column in range(len(self.decided))]

    def replace(self, column: int, setpoint: Triple) -> None:
        """Put another setpoint in the place of a column's, and note where it differs."""
        speed_mps, heading_rad, height_m = self.setpoints[column]
        faster, turned, higher = self.replaced[column]
        faster, turned = faster or setpoint[0] != speed_mps, turned or setpoint[1] != heading_rad
        self.replaced[column] = faster, turned, higher or setpoint[2] != height_m
        self.setpoints[column] = setpoint


@dataclass(frozen=True)
class Event:
    """Something that happened, in words and figures."""

    now: Instant
    kind: str
    text: str
    vehicle: VehicleId | None = None
    details: Mapping[str, Detail] = field(default_factory=dict[str, Detail])


class Recorder(Protocol):
    """Stores what the station reports."""

    def frames(self, now: Instant, raws: list[bytes]) -> None:
        """Keep frames that came in or went out."""
        ...

    def tick(self, tick: Tick) -> None:
        """Keep a control tick."""
        ...

    def event(self, event: Event) -> None:
        """Keep an event."""
        ...


class Note(Protocol):
    """Reports an event, of a vehicle or of the run."""

    def __call__(
        self,
        now: Instant,
        kind: str,
        text: str,
        vehicle: Vehicle | None = None,
        details: Mapping[str, Detail] | None = None,
    ) -> None:
        """Record an event."""
        ...
