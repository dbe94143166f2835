"""The scenario: all keys, typed, in the units that their names carry."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from formation_scenario.disturbances import Disturbance
from formation_scenario.expectation import Expectation
from formation_scenario.faults import Fault
from formation_scenario.fields import (
    Allowed,
    Distance,
    Flag,
    Keys,
    Name,
    NonNegative,
    Number,
    Offset,
    Positive,
    Rate,
    Speed,
    Vector,
    VehicleSelection,
)
from formation_scenario.formation import Formation
from formation_scenario.law import Law
from formation_scenario.links import Links, LinkStep, link_steps
from formation_scenario.orders import PlannedOrder
from formation_scenario.terrain import Terrain
from formation_scenario.vehicles import Vehicle

Seconds = Annotated[Positive, Field(le=1e6)]
Seed = Annotated[int, Field(strict=True, ge=0, le=2**63 - 1), Allowed("a whole number from 0 to 2^63 - 1")]
Waypoints = Annotated[tuple[Vector, ...], Field(min_length=2), Allowed("a list of 2 or more [north, east, height]")]


Fleet = Annotated[tuple[Vehicle, ...], Field(min_length=1), Allowed("a list of 1 or more vehicles, or {count: N}")]


class Origin(Keys):
    """The origin of north, east and height."""

    lat_deg: Annotated[Number, Field(ge=-85.0, le=85.0)] = Field(default=35.0, description="latitude, degrees")
    lon_deg: Annotated[Number, Field(ge=-180.0, le=180.0)] = Field(default=125.0, description="longitude, degrees")
    alt_m: Annotated[Number, Field(ge=-500.0, le=9000.0)] = Field(default=0.0, description="above sea level, m")


class Start(Keys):
    """The start of the flight."""

    in_air: Flag = Field(default=False, description="emulators only: begin in flight, without take-off")
    offset_m: Offset = Field(default=(0.0, 0.0, 0.0), description="follower from its slot: forward, right, up, m")
    run_in_s: Annotated[NonNegative, Field(le=3600.0)] = Field(
        description="how long the leader flies straight to the path's start before t = 0, s; "
        "default 10 in the air, 60 from the ground"
    )
    tolerance_m: Positive = Field(default=3.0, description="a follower this near its slot counts as assembled, m")
    timeout_s: Seconds = Field(default=300.0, description="longest wait for take-off and assembly, s")


class Wind(Keys):
    """Constant wind on all vehicles."""

    velocity_mps: Vector = Field(default=(0.0, 0.0, 0.0), description="where it blows to: north, east, down, m/s")


class Avoidance(Keys):
    """The separation rule."""

    enabled: Flag = Field(default=True, description="whether setpoints give way to it")
    distance_m: Positive = Field(description="distance that it keeps, m; default: safety.separation_m + 5")
    horizon_s: Annotated[Number, Field(ge=4.0, le=60.0)] = Field(default=12.0, description="how far it looks ahead, s")


class Safety(Keys):
    """Limits that fail a run if they are violated, and the rule that prevents it."""

    separation_m: Distance = Field(default=5.0, description="least distance of two vehicles, m")
    avoidance: Avoidance
    clearance_m: NonNegative = Field(default=5.0, description="least height above ground, m")


class Finish(Keys):
    """The end of a run."""

    loiter_s: NonNegative = Field(default=10.0, description="how long the vehicles loiter after the run, s")


class Telemetry(Keys):
    """What the vehicles send."""

    rate_hz: Rate = Field(default=10.0, description="position and attitude messages a second, Hz")


class PathPlan(Keys):
    """The leader's path."""

    speed_mps: Speed = Field(default=22.0, description="the leader's speed, m/s")
    waypoints_m: Waypoints = Field(description="north, east and height above the origin, m")


class Scenario(Keys):
    """A scenario with every default filled in; `load_scenario` makes them, from a file or a mapping."""

    schema_: Literal[1] = Field(default=1, alias="schema", description="version of these keys")
    name: Name = Field(default="scenario", description="name of the run; default: the file's")
    seed: Seed = Field(default=1, description="of all randomness")
    duration_s: Seconds = Field(default=120.0, description="end of the run, from the leader's start on its path, s")
    origin: Origin = Origin()
    start: Start
    vehicles: Fleet = Field(description="a list of vehicles, or {count: N}")
    telemetry: Telemetry = Telemetry()
    formation: Formation = Formation()
    law: Law
    path: PathPlan
    terrain: Terrain | None = Field(default=None, description="the ground; without it, a plain at the origin's height")
    links: Links = Links()
    wind: Wind = Wind()
    disturbances: tuple[Disturbance, ...] = ()
    orders: tuple[PlannedOrder, ...] = ()
    faults: tuple[Fault, ...] = ()
    safety: Safety
    finish: Finish = Finish()
    expect: tuple[Expectation, ...] = ()

    @property
    def leader(self) -> Vehicle | None:
        """The vehicle that leads at the start, None if a virtual leader does."""
        return next((vehicle for vehicle in self.vehicles if vehicle.role == "leader"), None)

    @property
    def followers(self) -> tuple[Vehicle, ...]:
        """The vehicles that follow, in the scenario's order: the order of every slot array."""
        return tuple(vehicle for vehicle in self.vehicles if vehicle.role == "follower")

    def selected(self, selection: VehicleSelection) -> tuple[Vehicle, ...]:
        """Return the vehicles that a key such as `vehicles: [2, 3]` names, in the scenario's order."""
        if selection == "all":
            return self.vehicles
        return tuple(vehicle for vehicle in self.vehicles if vehicle.id in selection or long_ref(vehicle) in selection)

    def link_steps(self, vehicle: Vehicle) -> tuple[LinkStep, ...]:
        """Return the states of one vehicle's link in time order, the first at 0 s."""
        changes = (change for change in self.links.changes if vehicle in self.selected(change.vehicles))
        return link_steps(self.links, changes)


def long_ref(vehicle: Vehicle) -> str:
    """Return "network:id", which names one vehicle even if several networks use its id."""
    return f"{vehicle.network}:{vehicle.id}"
