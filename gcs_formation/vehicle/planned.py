"""The scenario's vehicles, and the sockets on which they are heard."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from airlink.endpoint import Endpoint, parse_endpoint
from airlink.geodesy import GeodeticOrigin
from airlink.identity import VehicleId
from formation_scenario import Scenario
from formation_scenario import Vehicle as PlannedVehicle
from formation_scenario.arrangement import columns
from gcs_formation.link.connection import Connection
from gcs_formation.vehicle.families import autopilot_for
from gcs_formation.vehicle.vehicle import Vehicle


class Planned(NamedTuple):
    """A scenario's vehicles and sockets."""

    endpoints: tuple[Endpoint, ...]
    """The sockets: one for each different endpoint."""
    networks: tuple[int, ...]
    """The MAVLink network that each socket hears."""
    vehicles: Mapping[VehicleId, Vehicle]
    """The leader first."""


def planned(scenario: Scenario) -> Planned:
    """Return a scenario's vehicles, none of them heard yet."""
    order = [vehicle for vehicle in columns(scenario) if vehicle is not None]
    texts = list(dict.fromkeys(vehicle.endpoint for vehicle in order))
    endpoints = tuple(parse_endpoint(text) for text in texts)
    networks = {vehicle.endpoint: vehicle.network for vehicle in order}
    vehicles = {each.vehicle_id: _vehicle(each, texts.index(each.endpoint), endpoints, scenario) for each in order}
    return Planned(endpoints, tuple(networks[text] for text in texts), vehicles)


def origin_of(scenario: Scenario) -> GeodeticOrigin:
    """Return the point that the scenario's places are counted from."""
    keys = scenario.origin
    return GeodeticOrigin(math.radians(keys.lat_deg), math.radians(keys.lon_deg), keys.alt_m)


def _vehicle(planned: PlannedVehicle, socket: int, endpoints: tuple[Endpoint, ...], scenario: Scenario) -> Vehicle:
    endpoint, origin, telemetry = endpoints[socket], origin_of(scenario), scenario.telemetry
    connection = Connection(socket, endpoint.address if endpoint.kind == "udpout" else None)
    autopilot = autopilot_for(planned, origin)
    return Vehicle(planned.vehicle_id, autopilot, connection, origin, telemetry.rate_hz, by_utc=telemetry.by_utc)
