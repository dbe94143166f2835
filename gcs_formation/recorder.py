"""What the station reports at control ticks and in events, and the interface of recorders."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from mypy_extensions import mypyc_attr

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from flight_model.flight_state import FlightState
from flight_model.slot import UNKNOWN, Vector3
from gcs_formation.control.law_interface import LawOutput
from gcs_formation.control.setpoint import AS_DECIDED, Replaced
from gcs_formation.vehicle.vehicle import Vehicle

Detail = str | int | float | bool | None
GiveUp = Callable[[str, Instant], None]
"""Ends a run that can't continue, with the reason."""


@mypyc_attr(acyclic=True)
class VehicleLink:
    """The link to one vehicle at a tick."""

    brakes: int | None = None
    """Instant at which a multirotor was commanded to stop, None if it wasn't."""

    def __init__(self, now: Instant) -> None:
        """Start with the link of a virtual leader: no delay, always received."""
        self.ready = False
        """Whether the vehicle follows setpoints."""
        self.delay_s = 0.0
        """Measured one-way delay, half the round trip."""
        self.asymmetry_s = 0.0
        """Excess of the uplink delay over `delay_s`, as estimated from steps."""
        self.up_s = self.down_s = math.nan
        """Delays up and down; NaN while the asymmetry of the round trip is unknown."""
        self.jitter_s, self.loss, self.mean_gap = math.nan, 0.0, 1.0
        """Interarrival jitter of the telemetry, NaN while unknown; the share of its frames that are lost, and how many
        of them in a row on average."""
        self.further_delay_s = self.dead_s = 0.0
        """Further delay of a setpoint: half a period of the vehicle's main loop, the mean wait on arrival, its dead
        time, and the time for which the station delays it; and the autopilot's dead time alone."""
        self.airborne = True
        """Whether the vehicle flies; False after its link is lost."""
        self.flew = True
        """Whether it was flying when last received."""
        self.circling, self.holds_at_m = False, math.nan
        """Whether it circles, or may do so on an earlier command; and the height commanded for that, NaN without
        one."""
        self.flies_home_m: tuple[float, float] | None = None
        self.home_m: tuple[float, float] | None = None
        """Its home, north and east: if its mode, not a command, brings it there; and whenever it is known."""
        self.received_at: int = now
        """Until when it is known to have received commands."""
        self.disobeying = False
        """Whether it seems not to fly as commanded although it receives."""
        self.hovers_after_s, self.returns_after_s = math.inf, 0.0
        """Time from the last setpoint received until it hovers, infinite if it flies on; and time from that setpoint
        until its failsafe has sent it home, 0 without such a failsafe."""
        self.speeds_mps: tuple[float, float] | None = None
        """Lowest and highest true airspeed within reach soon, m/s; None if these are its model's limits."""

    @property
    def uplink_delay_s(self) -> float:
        """Delay of a setpoint up, s: estimated from the round trip while its asymmetry is unknown."""
        return self.delay_s + self.asymmetry_s if math.isnan(self.up_s) else self.up_s

    @property
    def until_it_acts_s(self) -> float:
        """Delay of a setpoint up and by the autopilot's dead time, s."""
        return self.uplink_delay_s + self.dead_s


def unknown_state() -> FlightState:
    """Return the state of a vehicle that was never received: all NaN."""
    return FlightState(math.nan, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)


class Tick:
    """One control tick: lists with an entry for each of C vehicles; index 0 is the scenario's leader, real or virtual.

    Only the controller writes it.
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
        """Start without commands.

        Args:
            now: the tick's instant.
            mission_time_s: NaN before the path has begun.
            phase: phase of the run.
            leader: the leader's index.
            links: the measured links.
            age_s: ages of the newest states, NaN if there is none.
            margin_used: share of the delay margin that the loops use.
            active: which vehicles are commanded.
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
        """The states that the law acted on, predicted to the time when setpoints take effect."""
        self.virtual_leader: FlightState | None = None
        """State of a virtual leader at this instant; None with a real one."""
        self.setpoints: list[Vector3] = [UNKNOWN] * count
        """Airspeed in m/s, heading in rad and height in m; NaN if none is sent."""
        self.replaced: list[Replaced] = [AS_DECIDED] * count
        """Which of these differ from the law's."""
        self.yielding = [False] * count
        """Vehicles whose setpoints are the separation rule's instead of the law's."""
        self.slots_m: list[Vector3] = [UNKNOWN] * count
        """Forward, right and up; NaN for the leader."""
        self.slots_left = False
        """Whether heights of the end are flown, so that there are no slots."""
        self.decided: list[LawOutput | None] = [None] * count
        """Decision, mixed errors and gains of the law; None for the leader and vehicles not commanded."""
        self.events: list[Event] = []
        """Events on beginning and end of replacements."""

    def error_of(self, index: int) -> Vector3:
        """Return a vehicle's formation error, forward, right and up; NaN for the leader, and without slots."""
        decided = self.decided[index]
        if decided is None or self.slots_left:
            return (math.nan, math.nan, math.nan)
        return decided.error_m

    @property
    def error_m(self) -> list[Vector3]:
        """The errors of all vehicles."""
        return [self.error_of(index) for index in range(len(self.decided))]

    def replace(self, index: int, setpoint: Vector3) -> None:
        """Replace a vehicle's setpoint, and record which components changed."""
        speed_mps, heading_rad, height_m = self.setpoints[index]
        faster, turned, higher = self.replaced[index]
        faster, turned = faster or setpoint[0] != speed_mps, turned or setpoint[1] != heading_rad
        self.replaced[index] = faster, turned, higher or setpoint[2] != height_m
        self.setpoints[index] = setpoint


@dataclass(frozen=True)
class Event:
    """An event, with text and figures."""

    now: Instant
    kind: str
    text: str
    vehicle: VehicleId | None = None
    details: Mapping[str, Detail] = field(default_factory=dict[str, Detail])


class Recorder(Protocol):
    """Stores what the station reports."""

    def frames(self, now: Instant, raws: list[bytes]) -> None:
        """Store frames received or sent."""
        ...

    def tick(self, tick: Tick) -> None:
        """Store a control tick."""
        ...

    def event(self, event: Event) -> None:
        """Store an event."""
        ...


class LogEvent(Protocol):
    """Records an event of a vehicle or the run."""

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
