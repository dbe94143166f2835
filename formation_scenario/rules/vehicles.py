"""Rules between the keys of the vehicles: identities, roles, endpoints and limits."""

from __future__ import annotations

from collections.abc import Iterator

from airlink.endpoint import parse_endpoint
from airlink.errors import EndpointError
from formation_scenario.errors import Problem
from formation_scenario.fields import VehicleRef
from formation_scenario.model import Scenario, long_ref
from formation_scenario.source import KeyPath, Source
from formation_scenario.vehicles import Vehicle, VehicleModel


def identities(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield system ids that stand twice on one network."""
    seen: dict[tuple[int, int], int] = {}
    for index, vehicle in enumerate(scenario.vehicles):
        first = seen.setdefault(vehicle.vehicle_id, index)
        if first != index:
            found = f"found {vehicle.id} again on network {vehicle.network}, first at vehicles.{first}"
            yield source.problem(("vehicles", index, "id"), found, "each id once on a network")


def roles(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield leaders beyond the first."""
    leaders = [index for index, vehicle in enumerate(scenario.vehicles) if vehicle.role == "leader"]
    for index in leaders[1:]:
        found = f"found a second leader, first at vehicles.{leaders[0]}"
        yield source.problem(("vehicles", index, "role"), found, "one leader, or none (a virtual one)")


def endpoints(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield endpoints that aren't connection strings, or that two networks share."""
    networks: dict[str, int] = {}
    refused: set[str] = set()
    for index, vehicle in enumerate(scenario.vehicles):
        if vehicle.endpoint in refused:
            continue
        path: KeyPath = ("vehicles", index, "endpoint")
        try:
            endpoint = str(parse_endpoint(vehicle.endpoint))
        except EndpointError as error:
            refused.add(vehicle.endpoint)
            yield source.problem(path, str(error))
            continue
        if networks.setdefault(endpoint, vehicle.network) != vehicle.network:
            found = f"found {endpoint} for networks {networks[endpoint]} and {vehicle.network}"
            yield source.problem(path, found, "endpoints of its own for each network")


def speeds(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield models whose lowest airspeed is above their highest."""
    refused: set[VehicleModel] = set()
    for index, vehicle in enumerate(scenario.vehicles):
        for name, model in (("model", vehicle.model), ("true_model", vehicle.true_model)):
            if model is None or model.speed_min_mps <= model.speed_max_mps or model in refused:
                continue
            refused.add(model)
            path: KeyPath = ("vehicles", index, name, "speed_min_mps")
            allowed = f"at most speed_max_mps, {model.speed_max_mps:g}"
            yield source.problem(path, f"found {model.speed_min_mps:g}", allowed)


def one_vehicle(ref: VehicleRef, vehicles: tuple[Vehicle, ...], path: KeyPath, source: Source) -> Iterator[Problem]:
    """Yield the problem of a key that should name one of `vehicles`, if it names none of them, or several."""
    named = [vehicle for vehicle in vehicles if ref in {vehicle.id, long_ref(vehicle)}]
    if not named:
        ids = ", ".join(str(vehicle.vehicle_id) for vehicle in vehicles) or "none"
        yield source.problem(path, f"found {ref}", f"{ids}")
    elif len(named) > 1:
        full = ", ".join(f"'{long_ref(vehicle)}'" for vehicle in named)
        yield source.problem(path, f"found {ref}, the id of {len(named)} vehicles", full)
