"""Rules between the keys of vehicles and formation: identities, roles, limits, slots, changes, orders, the graph."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from airlink.endpoint import EndpointError, VehicleId, parse_endpoint
from flight_model.arrays import Array
from flight_model.energy import steepest_climb_mps
from formation_scenario.extensions import EMULATED_FAMILY
from formation_scenario.fields import VehicleRef, did_you_mean
from formation_scenario.formation import CUSTOM, SHAPE_NAMES, Formation, FormationChange
from formation_scenario.law import LAW_TYPES
from formation_scenario.model import Scenario
from formation_scenario.orders import ALLOWED, read_order
from formation_scenario.shapes import SHAPE
from formation_scenario.signing import unreadable
from formation_scenario.slot_assignment import arrangements, shape_slots
from formation_scenario.source import Finding, KeyPath, show
from formation_scenario.vehicles import Vehicle, VehicleModel, family_of, reads_equivalent_airspeed

MIN_FLYING_MPS = 1e-3


def identities(scenario: Scenario) -> Iterator[Finding]:
    """Yield system ids that occur twice on one network, or are the ground station's."""
    seen: dict[tuple[int, int], int] = {}
    for index, vehicle in enumerate(scenario.vehicles):
        first = seen.setdefault(vehicle.vehicle_id, index)
        if first != index:
            found = f"found {vehicle.id} again on network {vehicle.network}, first at vehicles.{first}"
            yield ("vehicles", index, "id"), found, "each id once on a network"
        if vehicle.id == scenario.station.system:
            found = f"found {vehicle.id}, the ground station's own system id (station.system)"
            yield ("vehicles", index, "id"), found, "an id that the ground station doesn't have"


def roles(scenario: Scenario) -> Iterator[Finding]:
    """Yield leaders beyond the first."""
    leaders = [index for index, vehicle in enumerate(scenario.vehicles) if vehicle.role == "leader"]
    for index in leaders[1:]:
        found = f"found a second leader, first at vehicles.{leaders[0]}"
        yield ("vehicles", index, "role"), found, "one leader, or none (a virtual one)"


def endpoints(scenario: Scenario) -> Iterator[Finding]:
    """Yield endpoints that aren't connection strings, that two networks share, or at which two emulators listen."""
    networks: dict[str, int] = {}
    emulated: dict[str, VehicleId] = {}
    refused: set[str] = set()
    for path, vehicle, text in _each_link(scenario):
        if text in refused:
            continue
        try:
            endpoint = str(parse_endpoint(text))
        except EndpointError as error:
            refused.add(text)
            found, _, allowed = str(error).partition("; allowed: ")
            yield path, found, allowed
            continue
        first = networks.setdefault(endpoint, vehicle.network)
        if first != vehicle.network:
            found = f"found {endpoint} for networks {first} and {vehicle.network}"
            yield path, found, "endpoints of its own for each network"
        elif vehicle.autopilot == "emulator" and endpoint.startswith("udpout:"):
            other = emulated.setdefault(endpoint, vehicle.vehicle_id)
            if other != vehicle.vehicle_id:
                found = f"found {endpoint} for vehicles {other} and {vehicle.vehicle_id}: both emulators listen there"
                yield path, found, "udpout:HOST:PORT of its own for each of them, or udpin:HOST:PORT"


def _each_link(scenario: Scenario) -> Iterator[tuple[KeyPath, Vehicle, str]]:
    """Yield the key path, the vehicle and the endpoint of each link."""
    for index, vehicle in enumerate(scenario.vehicles):
        for number, text in enumerate(vehicle.endpoints):
            path: KeyPath = ("vehicles", index, "endpoint")
            yield path if isinstance(vehicle.endpoint, str) else (*path, number), vehicle, text


def several_links(scenario: Scenario) -> Iterator[Finding]:
    """Yield endpoints that a vehicle has twice, and changes of links that none of their vehicles has."""
    for path, vehicle, text in _each_link(scenario):
        number = path[-1]
        if isinstance(number, int) and text in vehicle.endpoints[:number]:
            yield path, f"found {text} twice", "another endpoint for each link of a vehicle"
    for index, change in enumerate(scenario.links.changes):
        maximum = max((len(each.endpoints) for each in scenario.selected(change.vehicles)), default=1)
        if change.link is not None and change.link > maximum:
            found = f"found {change.link}, where its vehicles have {maximum} link{'s' * (maximum > 1)} at most"
            yield (
                ("links", "changes", index, "link"),
                found,
                f"1 to {maximum}, the place in the vehicle's list `endpoint`",
            )


def signing(scenario: Scenario) -> Iterator[Finding]:
    """Yield vehicles that share an endpoint, which is one link, and are signed differently there."""
    first = dict[str, int]()
    for index, vehicle in enumerate(scenario.vehicles):
        for text in vehicle.endpoints:
            other = first.setdefault(text, index)
            if scenario.signing_of(vehicle) != scenario.signing_of(scenario.vehicles[other]):
                found = f"found another signing at {text} than vehicles.{other} has there"
                yield ("vehicles", index, "signing"), found, "the same for all at one endpoint, which is one link"


def key_files(scenario: Scenario) -> Iterator[Finding]:
    """Yield key files that can't be used; not asked of a scenario that has been flown, whose key may have gone."""
    known = dict[Path, str | None]()
    yield from unreadable(scenario.links.default.signing, ("links", "default"), known)
    for index, vehicle in enumerate(scenario.vehicles):
        yield from unreadable(vehicle.signing, ("vehicles", index), known)


def speeds(scenario: Scenario) -> Iterator[Finding]:
    """Yield models whose lowest airspeed is above their highest."""
    refused: set[VehicleModel] = set()
    for index, vehicle in enumerate(scenario.vehicles):
        for name, model in (("model", vehicle.model), ("true_model", vehicle.true_model)):
            if model is None or model.speed_min_mps <= model.speed_max_mps or model in refused:
                continue
            refused.add(model)
            path: KeyPath = ("vehicles", index, name, "speed_min_mps")
            allowed = f"at most speed_max_mps, {model.speed_max_mps:g}"
            yield path, f"found {model.speed_min_mps:g}", allowed


def climbing(scenario: Scenario) -> Iterator[Finding]:
    """Yield climb limits that an airframe can't fly, its own as assumed by its autopilot, or its model's."""
    refused: set[VehicleModel] = set()
    for index, vehicle in enumerate(scenario.vehicles):
        for name, model in (("model", vehicle.model), ("true_model", vehicle.true_model)):
            if model is None or model.airframe is None or model in refused:
                continue
            max_mps = steepest_climb_mps(model.airframe.parameters())
            for keys, climb_mps in (((), model.climb_max_mps), (("airframe",), model.airframe.climb_max_mps)):
                if climb_mps > max_mps:
                    refused.add(model)
                    path: KeyPath = ("vehicles", index, name, *keys, "climb_max_mps")
                    why = "what the airframe's thrust leaves at its cruising airspeed"
                    yield path, f"found {climb_mps:g}", f"up to {max(max_mps, 0.0):.3g} m/s, {why}"


def hovering(scenario: Scenario) -> Iterator[Finding]:
    """Yield contradictions about multirotors: mixed with fixed wings, or with a frame or law that they can't fly."""
    for index, vehicle in enumerate(scenario.vehicles):
        for name, model in (("model", vehicle.model), ("true_model", vehicle.true_model)):
            if model is not None:
                yield from _of_its_kind(vehicle, model, ("vehicles", index, name))
    if not any(vehicle.model.hovers for vehicle in scenario.vehicles):
        return
    if not scenario.hovers:
        yield ("vehicles",), "found vehicles that hover and others that don't", "one kind in a formation"
    if scenario.formation.frame == "follower_heading":
        yield ("formation", "frame"), "found follower_heading of vehicles that hover", "leader_heading, or north"
    if scenario.law.type == "consensus":
        others = ", ".join(law for law in LAW_TYPES if law != "consensus")
        yield ("law", "type"), "found consensus of vehicles that hover", others


def emulators(scenario: Scenario) -> Iterator[Finding]:
    """Yield emulated families of extensions in place of a family that they aren't like."""
    for index, vehicle in enumerate(scenario.vehicles):
        entry = scenario.registered.get(vehicle.own_family, EMULATED_FAMILY)
        if entry is not None and entry.made.emulates != family_of(vehicle):
            found = f"found {show(entry.name)}, which emulates {entry.made.emulates}"
            yield ("vehicles", index, "emulator", "family"), found, f"one that emulates {family_of(vehicle)}"


def _of_its_kind(vehicle: Vehicle, model: VehicleModel, at: KeyPath) -> Iterator[Finding]:
    """Yield keys of a model that contradict its vehicle's kind."""
    if model.hovers and vehicle.autopilot == "arduplane":
        yield (*at, "hovers"), f"found true of {vehicle.autopilot}", "false"
    elif not model.hovers and vehicle.autopilot == "arducopter":
        yield (*at, "hovers"), "found false of arducopter", "true"
    elif model.hovers != vehicle.model.hovers:
        found, allowed = (str(each.hovers).lower() for each in (model, vehicle.model))
        yield (*at, "hovers"), f"found {found} beside a model with {allowed}", allowed
    elif model.prompt_share < 1.0 and family_of(vehicle) == "arduplane":
        allowed = "1; less of what hovers, and of a PX4"
        yield (*at, "prompt_share"), f"found {model.prompt_share:g} of an ArduPlane", allowed
    elif model.prompt_share < 1.0 and model.airframe is not None:
        found = f"found {model.prompt_share:g} beside an airframe, which has time constants of its own"
        yield (*at, "prompt_share"), found, "1"
    elif not model.hovers and model.speed_min_mps < MIN_FLYING_MPS:
        found = f"found {model.speed_min_mps:g} of a vehicle that doesn't hover"
        yield (*at, "speed_min_mps"), found, f"{MIN_FLYING_MPS:g} m/s or more"
    elif model.hovers and model.speed_min_mps > 0.0:
        yield (*at, "speed_min_mps"), f"found {model.speed_min_mps:g} of a vehicle that hovers", "0: it can hover"
    elif model.airframe and model.airframe.airspeed_scale != 1.0 and not reads_equivalent_airspeed(vehicle):
        found = f"found {model.airframe.airspeed_scale:g} of a vehicle whose model has no airframe: no sensor is read"
        yield (*at, "airframe", "airspeed_scale"), found, "1, or an airframe in its model too"


def one_vehicle(ref: VehicleRef, vehicles: tuple[Vehicle, ...], path: KeyPath) -> Iterator[Finding]:
    """Yield the problem of a key that should name one of `vehicles`, if it names none of them, or several."""
    named = [vehicle for vehicle in vehicles if ref in vehicle.refs]
    if not named:
        yield path, f"found {ref}", ", ".join(str(vehicle.vehicle_id) for vehicle in vehicles) or "none"
    elif len(named) > 1:
        full = ", ".join(f"'{vehicle.refs[1]}'" for vehicle in named)
        yield path, f"found {ref}, the id of {len(named)} vehicles", full


def slots(scenario: Scenario) -> Iterator[Finding]:
    """Yield slots of vehicles that don't exist, and followers without a slot in a custom shape."""
    formation = scenario.formation
    steps: dict[KeyPath, Formation | FormationChange] = {("formation",): formation}
    steps |= {("formation", "changes", index): change for index, change in enumerate(formation.changes)}
    for above, step in steps.items():
        path, own = (*above, "slots_m"), step.slots_m
        for ref in own or ():
            yield from one_vehicle(ref, scenario.followers, (*path, ref))
        if step.shape == "custom" or (step.shape is None and own is not None):
            known = (own if own is not None else formation.slots_m) or {}
            missing = [each for each in scenario.followers if not any(ref in known for ref in each.refs)]
            if missing:
                ids = ", ".join(str(vehicle.vehicle_id) for vehicle in missing)
                yield path, f"found no slot for follower {ids}", "a slot for each follower"
    for above, arrangement in zip(steps, arrangements(scenario), strict=True):
        if arrangement.shape != CUSTOM:
            try:
                shape_slots(scenario, arrangement, len(scenario.followers))
            except ValueError as error:
                yield (*above, "shape"), str(error), ""


def changes(scenario: Scenario) -> Iterator[Finding]:
    """Yield changes that change nothing, or name a leader although a virtual leader can't be succeeded."""
    for index, change in enumerate(scenario.formation.changes):
        path: KeyPath = ("formation", "changes", index)
        if change.leader is not None:
            yield from one_vehicle(change.leader, scenario.vehicles, (*path, "leader"))
            if scenario.leader is None:
                found = f"found {change.leader}, but a virtual leader flies the path"
                yield (*path, "leader"), found, "none, or a vehicle with role: leader at the start"
        if all(each is None for each in (change.shape, change.spacing_m, change.slots_m, change.leader)):
            yield path, "found no change", "shape, spacing_m, slots_m or leader"


def orders(scenario: Scenario) -> Iterator[Finding]:
    """Yield planned orders that name vehicles which don't exist, or a turn on the spot of vehicles that can't hover."""
    for index, planned in scenario.timed_orders:
        order, path = read_order(planned.order), ("orders", index, "order")
        if order.heading_rad is not None and not scenario.hovers:
            yield path, f"found '{planned.order}'", "only of vehicles that hover"
        if order.change is not None and order.change.leader is not None:
            yield from one_vehicle(order.change.leader, scenario.vehicles, path)
        if order.change is not None and order.change.shape is not None:
            known = (*SHAPE_NAMES, *scenario.registered.names(SHAPE))
            if order.change.shape not in known:
                near = did_you_mean(order.change.shape, known)
                yield path, f"found '{planned.order}'", f"{ALLOWED}; NAME: {', '.join(known)}{near}"


def consensus(scenario: Scenario) -> Iterator[Finding]:
    """Yield weights of a graph that don't fit the vehicles, or with which consensus is impossible."""
    graph, count = scenario.law.consensus.graph, len(scenario.vehicles)
    if isinstance(graph, str):
        return
    path: KeyPath = ("law", "consensus", "graph")
    sizes = {len(graph), *(len(row) for row in graph)}
    if sizes != {count}:
        found = f"found {len(graph)} rows of {', '.join(str(len(row)) for row in graph)}"
        yield path, found, f"{count} rows of {count} weights, one for each vehicle"
    elif any(graph[index][index] for index in range(count)):
        yield path, "found a weight on the diagonal", "0 there: no vehicle receives from itself"
    elif not all_receive_one(np.array(graph)):
        allowed = "a vehicle from which all receive, directly or through others (a spanning tree)"
        yield path, "found none from which all receive", allowed


def all_receive_one(weights: Array) -> bool:
    """Return whether all hear one vehicle, directly or through others, by weights [p, q] > 0: p receives q."""
    receives: Array = np.sign(weights + np.eye(len(weights)))
    for _ in range(len(weights).bit_length()):
        receives = np.sign(receives @ receives)  # each squaring doubles the number of vehicles in between
    return bool(receives.all(axis=0).any())
