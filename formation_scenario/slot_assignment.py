"""The slots of each shape, and their assignment to vehicles, at the start and after each change of the formation.

Arrays of vehicles have an index for each: first the scenario's leader, real or virtual, then its followers in the
scenario's order.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple, Protocol

import numpy as np

from airlink.endpoint import VehicleId
from flight_model.arrays import Array, Mask
from formation_scenario import shapes
from formation_scenario.extensions import registered_in
from formation_scenario.fields import Vector, VehicleRef, did_you_mean
from formation_scenario.formation import SHAPE_NAMES, Formation, FormationChange
from formation_scenario.registry import Registry
from formation_scenario.shapes import SHAPE, Shape
from formation_scenario.vehicles import Vehicle, VehicleModel

OURS: Final = registered_in(shapes, SHAPE)
"""Our shapes by their names."""
NO_KEYS: Final[Mapping[str, Any]] = {}


class Members(Protocol):
    """What of a scenario decides who has which slot: the formation's keys and its vehicles."""

    @property
    def formation(self) -> Formation:
        """The keys of the formation."""
        ...

    @property
    def vehicles(self) -> tuple[Vehicle, ...]:
        """All vehicles, in the scenario's order."""
        ...

    @property
    def leader(self) -> Vehicle | None:
        """The vehicle that leads at the start, None for a virtual leader."""
        ...

    @property
    def followers(self) -> tuple[Vehicle, ...]:
        """The vehicles that follow, in the scenario's order."""
        ...

    @property
    def registered(self) -> Registry:
        """What extensions register."""
        ...


def slots(shape: str, followers: int, spacing_m: float, own: Shape | None = None) -> Array:
    """Return the slots (followers, 3) of a shape, in m forward, right and up of the leader.

    No two vehicles, the leader included, are nearer to each other than the spacing. Of our shapes only circle and plus,
    with the leader in their middle, have slots ahead of it. Except in the circle, further vehicles don't move them.

    Args:
        shape: its name.
        followers: how many.
        spacing_m: unit of the shape.
        own: the shape, if it is an extension's.
    """
    made = OURS[shape].instance({}) if own is None else own
    found = np.zeros((followers, 3))
    for row, slot in zip(found, made.slots(followers, spacing_m) if followers else (), strict=True):
        row[: len(slot)] = slot
    return found


class Arrangement(NamedTuple):
    """A formation without its assignment to vehicles: shape, spacing, a custom shape's slots, index of the leader."""

    shape: str
    spacing_m: float
    slots_m: Mapping[VehicleRef, Vector] | None
    leader: int
    parameters: Mapping[str, Any] = NO_KEYS
    """The own keys of a shape that an extension registers."""

    def changed(self, change: FormationChange, scenario: Members) -> Arrangement:
        """Return the arrangement after a change; what the change doesn't name is kept."""
        return Arrangement(
            change.shape or self.shape,
            change.spacing_m or self.spacing_m,
            change.slots_m if change.slots_m is not None else self.slots_m,
            self.leader if change.leader is None else index_of(scenario, change.leader),
            self._parameters(change, scenario.formation),
        )

    def _parameters(self, change: FormationChange, formation: Formation) -> Mapping[str, Any]:
        """Return the own keys of the shape after a change; where it gives none, those before or the formation's."""
        if change.parameters is not None:
            return change.parameters
        if change.shape in (None, self.shape):
            return self.parameters
        return (formation.parameters if change.shape == formation.shape else None) or NO_KEYS


class SlotStep(NamedTuple):
    """The formation from `at_s` on: positions (C, 3) of all vehicles, m forward, right and up of the leader."""

    at_s: float
    arrangement: Arrangement
    positions_m: Array

    @property
    def shape(self) -> str:
        """The arrangement's shape."""
        return self.arrangement.shape


def vehicles_by_index(scenario: Members) -> tuple[Vehicle | None, ...]:
    """Return the vehicle of each index, None for a virtual leader."""
    return (scenario.leader, *scenario.followers)


def models_by_index(scenario: Members) -> tuple[VehicleModel, ...]:
    """Return the model of each index; a virtual leader has the first follower's."""
    return tuple((vehicle or scenario.followers[0]).model for vehicle in vehicles_by_index(scenario))


def names_by_index(scenario: Members) -> tuple[str, ...]:
    """Return a name for the vehicle of each index, for messages."""
    return tuple(f"vehicle {v.vehicle_id}" if v else "the virtual leader" for v in vehicles_by_index(scenario))


def ids_by_index(scenario: Members) -> list[VehicleId | None]:
    """Return the network and system id of the vehicle of each index, None for a virtual leader."""
    return [None if vehicle is None else vehicle.vehicle_id for vehicle in vehicles_by_index(scenario)]


def index_of(scenario: Members, ref: VehicleRef) -> int:
    """Return the index of the vehicle with an id, or 'network:id'.

    Raises:
        ValueError: there is no such vehicle.
    """
    for index, vehicle in enumerate(vehicles_by_index(scenario)):
        if vehicle is not None and ref in vehicle.refs:
            return index
    known = ", ".join(str(vehicle.vehicle_id) for vehicle in scenario.vehicles)
    raise ValueError(f"found vehicle {ref}; allowed: {known}")


def first_arrangement(scenario: Members) -> Arrangement:
    """Return the formation at the start."""
    formation = scenario.formation
    return Arrangement(formation.shape, formation.spacing_m, formation.slots_m, 0, formation.parameters or NO_KEYS)


def arrangements(scenario: Members) -> list[Arrangement]:
    """Return the shapes at the start and after each of `formation.changes`, in the keys' order, led by index 0."""
    found = [first_arrangement(scenario)]
    for change in scenario.formation.changes:
        found.append(found[-1].changed(change.model_copy(update={"leader": None}), scenario))
    return found


def slot_table(scenario: Members) -> Array:
    """Return the slots (F, 3) at the start, in the order of `scenario.followers`."""
    return _in_order(scenario, first_arrangement(scenario))[1:]


def slot_schedule(scenario: Members) -> tuple[SlotStep, ...]:
    """Return the formation at the start and after each of `formation.changes`, in time order, with all present."""
    arrangement = first_arrangement(scenario)
    steps = [SlotStep(0.0, arrangement, _in_order(scenario, arrangement))]
    for change in sorted(scenario.formation.changes, key=lambda change: change.at_s):
        arrangement = arrangement.changed(change, scenario)
        before = steps[-1].positions_m
        positions = assigned(scenario, arrangement, before - before[arrangement.leader])
        steps.append(SlotStep(change.at_s, arrangement, positions))
    return tuple(steps)


def planned_slots(scenario: Members) -> dict[VehicleId, Array]:
    """Return the slots (S, 3) of each vehicle, for the S steps of the schedule in which it follows.

    The scenario's leader has slots if another vehicle leads later. A vehicle that never follows has no entry.
    """
    steps, planned = slot_schedule(scenario), dict[VehicleId, Array]()
    for index, vehicle in enumerate(vehicles_by_index(scenario)):
        slots_m = [step.positions_m[index] for step in steps if step.arrangement.leader != index]
        if vehicle is not None and slots_m:
            planned[vehicle.vehicle_id] = np.array(slots_m)
    return planned


def assigned(scenario: Members, arrangement: Arrangement, now_m: Array, present: Mask | None = None) -> Array:
    """Return the positions (C, 3) of an arrangement, by the least sum of squared distances from `now_m` (C, 3).

    Vehicles that aren't `present` (C,) are assigned the last slots, which are kept free for them; by default all are
    present. The slots of a custom shape are assigned by the scenario; if another vehicle leads, its slot goes to the
    scenario's leader.

    Raises:
        ValueError: a custom shape has no slot for one of the vehicles.
    """
    positions = _in_order(scenario, arrangement)
    if arrangement.shape == "custom":
        return positions
    following = np.flatnonzero(np.arange(len(positions)) != arrangement.leader)
    seen = np.ones(len(positions), dtype=np.bool_) if present is None else present
    there, away = following[seen[following]], following[~seen[following]]
    free = positions[following]
    import scipy  # noqa: PLC0415 - only changes of the formation assign slots again

    cost = np.square(now_m[there, None] - free[None, : there.size]).sum(axis=2)
    _, chosen = scipy.optimize.linear_sum_assignment(cost)
    given = np.zeros_like(positions)
    given[there], given[away] = free[chosen], free[there.size :]
    return given


def _in_order(scenario: Members, arrangement: Arrangement) -> Array:
    """Return the positions (C, 3) with the shape's slots in the order of the indices, 0 for the leader."""
    followers, leader = len(scenario.followers), arrangement.leader
    positions = np.zeros((1 + followers, 3))
    if arrangement.shape != "custom":
        positions[np.arange(1 + followers) != leader] = shape_slots(scenario, arrangement, followers)
        return positions
    table = arrangement.slots_m or {}
    positions[1:] = np.array([_own(table, follower) for follower in scenario.followers]).reshape(followers, 3)
    positions[0], positions[leader] = positions[leader].copy(), 0.0
    return positions


def shape_slots(scenario: Members, arrangement: Arrangement, followers: int) -> Array:
    """Return the slots (F, 3) of a shape that isn't custom.

    Raises:
        ValueError: there is no such shape, or an extension's can't make them.
    """
    name, spacing_m = arrangement.shape, arrangement.spacing_m
    if name in OURS:
        return slots(name, followers, spacing_m)
    entry = scenario.registered.get(name, SHAPE)
    if entry is None:
        known = (*SHAPE_NAMES, *scenario.registered.names(SHAPE))
        raise ValueError(f"found shape '{name}'; allowed: {', '.join(known)}{did_you_mean(name, known)}")
    found = entry.call(
        lambda: slots(name, followers, spacing_m, entry.instance(arrangement.parameters)),
        lambda why: ValueError(f"found no slots by shape '{name}': {why}"),
    )
    if not np.isfinite(found).all():
        raise ValueError(f"found a slot by shape '{name}' that isn't finite ({entry.where})")
    return found


def _own(table: Mapping[VehicleRef, Vector], vehicle: Vehicle) -> Vector:
    own = next((table[ref] for ref in vehicle.refs if ref in table), None)
    if own is None:
        raise ValueError(
            f"found no slot for vehicle {vehicle.vehicle_id}; allowed: formation.slots_m for each follower"
        )
    return own
