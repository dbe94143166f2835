"""A control tick as code from outside sees it, filters as well as a program that steps a flight: plain values."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property

from airlink.clock import NANOSECONDS
from airlink.endpoint import VehicleId
from flight_model.slot import Vector3
from gcs_formation.control.plain_values import Setpoint, State, plain_state, vehicle_name
from gcs_formation.recorder import Detail, Event, Tick

READ_BACK = ("design", "failure", "leader", "member", "order", "phase", "port", "recording", "takeover")
"""Kinds of events from which a record is read back: the ground station's own."""
Wanted = tuple[float | None, float | None, float | None]
"""Speed m/s, heading rad and height m in place of what is commanded; None: as it is."""
Replace = Callable[[int, Wanted], None]
"""Replaces parts of a vehicle's setpoint, or raises because that isn't allowed."""


class Vehicle:
    """A vehicle at a tick, as the ground station knows it."""

    def __init__(self, tick: Tick, index: int, identity: VehicleId, replace: Replace) -> None:
        """Look at one vehicle of a tick."""
        self._tick, self._index, self._replace = tick, index, replace
        self.identity = identity
        self.id = vehicle_name(identity)
        """System id, or "network:id" beyond the first network, as a scenario writes it."""

    def __repr__(self) -> str:
        return f"Vehicle({self.id!r}, {self.setpoint})"

    @cached_property
    def state(self) -> State:
        """Its state when its setpoint acts; NaN if it was never received."""
        return plain_state(self._tick.state[self._index])

    @property
    def setpoint(self) -> Setpoint:
        """What it is commanded, as changed so far; NaN if it isn't commanded."""
        return Setpoint(*self._tick.setpoints[self._index])

    @property
    def active(self) -> bool:
        """Whether it is commanded in the formation."""
        return self._tick.active[self._index]

    @property
    def leads(self) -> bool:
        """Whether it leads the formation."""
        return self._tick.leader == self._index

    @property
    def error_m(self) -> Vector3:
        """Its formation error, forward, right and up, m; NaN for the leader, and while it isn't commanded."""
        return self._tick.error_of(self._index)

    @property
    def slot_m(self) -> Vector3:
        """Its slot, forward, right and up of the leader, m; NaN for the leader."""
        return self._tick.slots_m[self._index]

    @property
    def delay_s(self) -> float:
        """The measured one-way delay of its link, s: half the round trip."""
        return self._tick.links[self._index].delay_s

    @property
    def margin_used(self) -> float:
        """Share of the delay margin that its loops use; NaN for the leader, and if no margin is known."""
        return self._tick.margin_used[self._index]

    @property
    def age_s(self) -> float:
        """Age of its newest state, s; NaN if there is none."""
        return self._tick.age_s[self._index]

    @property
    def replaced(self) -> tuple[bool, bool, bool]:
        """Whether speed, heading and height differ from the law's."""
        return self._tick.replaced[self._index]

    @property
    def yielding(self) -> bool:
        """Whether the separation rule replaces its setpoint."""
        return self._tick.yielding[self._index]

    def replace(
        self, *, speed_mps: float | None = None, heading_rad: float | None = None, height_m: float | None = None
    ) -> None:
        """Command another speed, heading or height, limited to the vehicle's envelope.

        Filters may, at this tick; a program that steps a flight may, from the next tick until it takes another.
        """
        self._replace(self._index, (speed_mps, heading_rad, height_m))


class TickView:
    """A control tick."""

    def __init__(self, tick: Tick, identities: list[VehicleId | None], replace: Replace) -> None:
        """Look at a tick of vehicles with `identities`, None for a virtual leader."""
        self._tick, self._identities, self._replace = tick, identities, replace

    @property
    def time_s(self) -> float:
        """Time since the run's clock began, s."""
        return self._tick.now / NANOSECONDS

    @property
    def mission_time_s(self) -> float:
        """Time since the leader started along its path, s; NaN before."""
        return self._tick.mission_time_s

    @property
    def phase(self) -> str:
        """The run's phase, as in the time series: connecting, assembling, flying, ending, loitering."""
        return self._tick.phase

    @cached_property
    def every_vehicle(self) -> tuple[Vehicle, ...]:
        """All vehicles, commanded or not, the scenario's leader first."""
        return tuple(
            Vehicle(self._tick, index, identity, self._replace)
            for index, identity in enumerate(self._identities)
            if identity is not None
        )

    @cached_property
    def virtual_leader(self) -> State | None:
        """The state of a virtual leader now; None with a real one."""
        placed = self._tick.virtual_leader
        return None if placed is None else plain_state(placed)


class Cycle(TickView):
    """A control tick for filters, monitors and recorders."""

    def __init__(
        self,
        tick: Tick,
        identities: list[VehicleId | None],
        dt_s: float,
        replace: Replace,
        tell: Callable[[Event], None],
    ) -> None:
        """Look at a tick; `tell` takes events."""
        super().__init__(tick, identities, replace)
        self._tell = tell
        self.dt_s = dt_s
        """Time between ticks, s."""

    @cached_property
    def vehicles(self) -> tuple[Vehicle, ...]:
        """The vehicles that are commanded now, the scenario's leader first."""
        return tuple(each for each in self.every_vehicle if each.active)

    def event(self, kind: str, text: str, vehicle: Vehicle | None = None, **details: Detail) -> None:
        """Record an event of the run or of a vehicle, with further figures.

        An event that is raised again tick after tick is recorded once, when it begins.
        """
        if kind in READ_BACK:
            raise ValueError(f"found an event of kind '{kind}'; allowed: any but {', '.join(READ_BACK)}")
        known = {name: value for name, value in details.items() if not isinstance(value, float) or math.isfinite(value)}
        whose = None if vehicle is None else vehicle.identity
        self._tell(Event(self._tick.now, str(kind), str(text), whose, known))
