"""The scenario: all keys, typed, in the units that their names carry."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, PrivateAttr

from flight_model.arrays import Array
from flight_model.earth import true_by_equivalent_airspeed
from flight_model.legs.detour import Detours
from flight_model.legs.speeds import SpeedProfile
from flight_model.legs.turn import TurnLimits
from flight_model.path import FlightPath
from flight_model.path_offsets import Bounds
from flight_model.spline import SplinePath
from formation_scenario.consensus_graph import graph_adjacency
from formation_scenario.expectation import Expectation
from formation_scenario.extensions import FAULT
from formation_scenario.fields import (
    MAX_ENTRIES,
    WHOLE,
    Allowed,
    AtMost,
    Keys,
    Later,
    Name,
    Seconds,
    key,
)
from formation_scenario.finish import Finish
from formation_scenario.formation import Formation
from formation_scenario.geofence import Geofence
from formation_scenario.law import Law
from formation_scenario.links import Links
from formation_scenario.links_of_vehicles import LinksOfVehicles
from formation_scenario.orders import PlannedOrder
from formation_scenario.origin import Origin
from formation_scenario.path_of_legs import path_of_legs, planned_speeds
from formation_scenario.path_plan import PathPlan
from formation_scenario.registry import Registry
from formation_scenario.repair_plan import RepairPlan
from formation_scenario.safety import Safety
from formation_scenario.scripted import AnyOrder, ScriptedOrder
from formation_scenario.start import Start
from formation_scenario.station import StationId
from formation_scenario.surroundings import Disturbance, Fault, Terrain
from formation_scenario.telemetry import Telemetry
from formation_scenario.terrain import LEADER_SHARE, Ground, ground_of, with_clearance
from formation_scenario.vehicles import Vehicle, reads_equivalent_airspeed
from formation_scenario.wind import Wind

Seed = Annotated[int, Field(strict=True, ge=0, le=2**63 - 1), WHOLE, Allowed("a whole number from 0 to 2^63 - 1")]
Fleet = Annotated[
    tuple[Vehicle, ...],
    Field(min_length=1, max_length=MAX_ENTRIES),
    Allowed(f"a list of 1 to {MAX_ENTRIES} vehicles, or {{count: N}}"),
]


class Scenario(LinksOfVehicles, Keys):
    """A scenario with every default filled in; `load_scenario` makes them, from a file or a mapping."""

    schema_: Literal[1] = Field(default=1, alias="schema", description="version of these keys")
    name: Name = key("scenario", "name of the run", "three-followers", derived="the file's")
    seed: Seed = key(1, "seed of all randomness: the same seed, the same flight", 7)
    duration_s: Seconds = key(
        120.0,
        "end of the run, from the leader's start on its path, s; the path's end may come first",
        600,
        derived="the path's end",
    )
    origin: Origin = Origin()
    start: Start = key(..., "", derived="its keys'")
    vehicles: Fleet = key(
        ...,
        "a list of vehicles, or {count: N}; without a leader in the list, a virtual one flies the path",
        [{"id": 1, "role": "leader"}, {"id": 2}, {"id": 3, "model": {"tau_v_s": 5.0}}],
        {"count": 4, "navigation": {"source": "noisy"}},
    )
    station: StationId = StationId()
    telemetry: Telemetry = Telemetry()
    formation: Formation = key(Formation(), "", derived="its keys'")
    law: Law = key(..., "", derived="its keys'")
    path: PathPlan
    repair: Later[RepairPlan] | None = key(None, "what `check --repair` may change, and in which order")
    terrain: Later[Terrain] | None = key(None, "the ground; without it, a plain at the origin's height")
    links: Links = Links()
    wind: Wind = Wind()
    disturbances: AtMost[Later[Disturbance]] = key(
        (),
        "velocities that the air adds to vehicles besides the wind; they add up",
        [
            {"at_s": 60, "velocity_mps": [0.6, 0.6, 0.0]},
            {"at_s": 70, "until_s": 90, "kind": "ramp", "velocity_mps": [2, 0, 0], "duration_s": 5},
            {"at_s": 80, "vehicles": [2], "kind": "sine", "velocity_mps": [0, 0.5, 0], "period_s": 8},
            {"at_s": 90, "kind": "dryden", "wind_6m_mps": 7},
        ],
    )
    orders: AtMost[Later[AnyOrder]] = key(
        (),
        "orders that are given at a mission time, as by `gcs-formation tell`; and what a program did at a control tick",
        [{"at_s": 40, "order": "shape line 40"}, {"at_s": 80, "order": "speed 20"}],
    )
    faults: AtMost[Later[Fault]] = key(
        (),
        "faults of vehicles; emulators only",
        [
            {"at_s": 50, "until_s": 60, "vehicles": [2], "kind": "freeze"},
            {"at_s": 90, "vehicles": [3], "kind": "crash"},
        ],
    )
    safety: Safety = key(..., "", derived="its keys'")
    finish: Finish = Finish()
    extensions: Annotated[
        Mapping[str, Mapping[str, Any]], Allowed("a mapping of what extensions register to its keys")
    ] = key(
        {},
        "filters, monitors and recorders that are on, in this order, each with its own keys; metrics' keys",
        {"ceiling": {"top_m": 140}},
    )
    expect: AtMost[Later[Expectation]] = key(
        (),
        "bounds that the run must have kept; exit status 1 if one is broken",
        [
            {"metric": "error_x_m.max", "from_s": 70, "to_s": 120, "below": 0.22},
            {"metric": "measured_delay_ms.p99", "followers": [2], "below": 350},
            {"metric": "min_separation_m", "above": 20},
        ],
    )

    _registered: Registry = PrivateAttr(default_factory=Registry)
    _detours: dict[TurnLimits, Detours] = PrivateAttr(default_factory=dict[TurnLimits, Detours])

    @property
    def registered(self) -> Registry:
        """What the extensions that it was loaded with register."""
        return self._registered

    def with_registered(self, registry: Registry) -> Self:
        """Return the scenario with other extensions."""
        copied = self.model_copy()
        copied._registered = registry
        return copied

    @property
    def detours(self) -> dict[TurnLimits, Detours]:
        """The detours of its path, by their limits."""
        return self._detours

    def sharing(self, detours: dict[TurnLimits, Detours]) -> Self:
        """Return the scenario with detours that were found for others like it, to which its path adds its own."""
        copied = self.model_copy()
        copied._detours = detours
        return copied

    def crashes(self, fault: Fault) -> bool:
        """Return whether a fault crashes vehicles."""
        own = self._registered.get(fault.kind, FAULT)
        return fault.kind == "crash" if own is None else bool(own.made.crashes)

    def silences(self, fault: Fault) -> bool:
        """Return whether vehicles send nothing while a fault lasts."""
        own = self._registered.get(fault.kind, FAULT)
        return fault.kind in {"crash", "freeze"} if own is None else bool(own.made.crashes or own.made.silences)

    @property
    def fence(self) -> Geofence | None:
        """Where vehicles must stay; None if they may fly anywhere."""
        return next(self.safety.each(Geofence), None)

    @cached_property
    def ground(self) -> Ground:
        """The ground; without terrain, a plain at the origin's height.

        Raises:
            FileError: the elevation file can't be read.
        """
        return ground_of(self.terrain, self.origin.geodetic, np.array(self.path.waypoints_m))

    @cached_property
    def written_path(self) -> FlightPath:
        """The path through the waypoints, without any clearance offset.

        Raises:
            PathError: no such path leads through them.
        """
        if self.path.kind == "legs":
            return path_of_legs(self, self.path, self.drift_mps, self.fence, self._detours)
        return SplinePath(self.path.waypoints_m)

    @property
    def speeds(self) -> SpeedProfile:
        """The leader's planned airspeed along its path.

        Raises:
            PathError: no path leads through the waypoints.
        """
        return self._planned_speeds[0]

    @cached_property
    def _planned_speeds(self) -> tuple[SpeedProfile, dict[int, float]]:
        if not isinstance(self.path.speed_mps, tuple) and not (
            self.hovers and self.path.kind == "legs" and self.path.speed_mps > 0.0
        ):
            return SpeedProfile(self.path.speed_mps), {}
        return planned_speeds(self, self.path, self.written_path, float(np.hypot(*self.drift_mps)))

    @property
    def short_legs(self) -> dict[int, float]:
        """Legs that are too short for their planned speed, by their index, and the speed that is reached on each."""
        return self._planned_speeds[1]

    @cached_property
    def leader_path(self) -> FlightPath:
        """The path that the leader flies: raised if the scenario has terrain, as written otherwise.

        Raises:
            FileError: the elevation file can't be read.
        """
        if self.terrain is None:
            return self.written_path
        return with_clearance(self.written_path, self.ground, self.terrain.clearance_m, self.rise_bounds(LEADER_SHARE))

    def rise_bounds(self, share: float) -> Bounds:
        """Return the bounds of a path that every vehicle can follow with a share of its climb limit, in calm air.

        The climb rate may change by its limit within twice the sum of the height's time constants in (7). What is left
        of the climb limit is for a tailwind, too: `check` counts it.
        """
        models = [vehicle.model for vehicle in self.vehicles]
        climb_mps = min(model.climb_max_mps for model in models)
        tau_s = max(model.tau_ha_s + model.tau_hb_s for model in models)
        speed_mps = self.path.fastest_mps
        return Bounds(share * climb_mps / speed_mps, climb_mps / (2.0 * tau_s) / speed_mps**2)

    def speeds_mps(self, vehicle: Vehicle) -> tuple[float, float]:
        """Return the lowest and highest true airspeed of a vehicle at the field.

        The model's limits are EAS if the vehicle flies by them: at a high density altitude its stall speed is a higher
        TAS.
        """
        model = vehicle.model
        thin = true_by_equivalent_airspeed(self.origin.alt_m) if reads_equivalent_airspeed(vehicle) else 1.0
        return model.speed_min_mps * max(1.0, thin), model.speed_max_mps * min(1.0, thin)

    @property
    def leader(self) -> Vehicle | None:
        """The vehicle that leads at the start, None for a virtual leader."""
        return next((vehicle for vehicle in self.vehicles if vehicle.role == "leader"), None)

    @property
    def adjacency(self) -> Array:
        """The weights of the consensus graph, (N, N) in the order of the vehicles: [p, q] > 0 if p receives q."""
        graph = self.law.consensus.graph
        return graph_adjacency(graph, len(self.vehicles)) if isinstance(graph, str) else np.array(graph, np.float64)

    @property
    def hovers(self) -> bool:
        """Whether the vehicles hover: all do, or none."""
        return all(vehicle.model.hovers for vehicle in self.vehicles)

    @property
    def drift_mps(self) -> tuple[float, float]:
        """The wind that carries the vehicles, north and east: none for multirotors, which hold their ground speed."""
        return (0.0, 0.0) if self.hovers else self.wind.velocity_mps[:2]

    @property
    def followers(self) -> tuple[Vehicle, ...]:
        """The vehicles that follow, in the scenario's order, which is that of all slot arrays."""
        return tuple(vehicle for vehicle in self.vehicles if vehicle.role == "follower")

    @property
    def run_in_m(self) -> float:
        """Length of the straight run-in before the path's start."""
        return self.start.run_in_s * self.path.begin_mps

    def at_speed(self, speed_mps: float) -> Scenario:
        """Return the scenario with another speed along the path, which stays where it was planned."""
        return self.on_same_path({"path": self.path.model_copy(update={"speed_mps": speed_mps})})

    def on_same_path(self, update: Mapping[str, Any]) -> Scenario:
        """Return a copy with some keys changed, on the path through the waypoints that this one has found."""
        copied, found = self.model_copy(update=update), {"written_path"}
        found |= set() if "path" in update else {"_planned_speeds"}
        vars(copied).update({name: vars(self)[name] for name in found & vars(self).keys()})
        return copied

    def with_seed(self, seed: int) -> Scenario:
        """Return the scenario with another seed; its path, and what else was computed from its other keys, is shared.

        Raises:
            FileError: the elevation file can't be read.
            PathError: no path leads through the waypoints.
        """
        computed = {"leader_path": self.leader_path, "_derived": self._derived} | vars(self)
        copied = self.model_copy(update={"seed": seed})
        vars(copied).update({name: computed[name] for name in computed.keys() - type(self).model_fields.keys()})
        return copied

    def derived(self, make: Callable[[Scenario], Scenario]) -> Scenario:
        """Return what `make` makes of the scenario; for scenarios that differ in their seed alone it is made once.

        Raises:
            FileError: the elevation file can't be read.
            PathError: no path leads through the waypoints.
        """
        if make not in self._derived:
            self._derived[make] = make(self)
        return self._derived[make].with_seed(self.seed)

    @cached_property
    def _derived(self) -> dict[Callable[[Scenario], Scenario], Scenario]:
        return {}

    def with_path_of(self, other: Scenario) -> Scenario:
        """Return itself with the path that another has found, whose keys that decide it are the same."""
        vars(self).update({name: vars(other)[name] for name in {"written_path"} & vars(other).keys()})
        return self

    def in_wind(self, north_mps: float, east_mps: float) -> Scenario:
        """Return the scenario in another constant wind, on the path that was planned."""
        return self.on_same_path({"wind": Wind(velocity_mps=(north_mps, east_mps, 0.0))})

    @property
    def timed_orders(self) -> list[tuple[int, PlannedOrder]]:
        """The orders that are given at a mission time, each with its index in `orders`."""
        return [(index, each) for index, each in enumerate(self.orders) if isinstance(each, PlannedOrder)]

    @property
    def scripted(self) -> list[tuple[int, ScriptedOrder]]:
        """What a program did at control ticks, each with its index in `orders`."""
        return [(index, each) for index, each in enumerate(self.orders) if isinstance(each, ScriptedOrder)]
