"""The scenario's vehicles, the class for each autopilot family, and the sockets on which they are heard."""

from __future__ import annotations

import math

from airlink.endpoint import Endpoint, VehicleId, parse_endpoint
from formation_scenario import Scenario
from formation_scenario import Vehicle as PlannedVehicle
from formation_scenario.slot_assignment import columns
from formation_scenario.vehicles import family_of, reads_equivalent_airspeed
from gcs_formation.estimation.airspeed import AirspeedCheck, AirspeedScale
from gcs_formation.link.link_health import Connection
from gcs_formation.vehicle.ardupilot import ArduCopter, ArduPlane
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.px4 import Px4Copter, Px4Plane
from gcs_formation.vehicle.vehicle import Vehicle
from gcs_formation.vehicle.velocity_setpoint import SpeedLead, VelocityLead


def autopilot_for(vehicle: PlannedVehicle, scenario: Scenario) -> Autopilot:
    """Return how a vehicle of the scenario is spoken to."""
    model, family, period_s = vehicle.model, family_of(vehicle), 1.0 / scenario.law.rate_hz
    who = vehicle.id, scenario.origin.geodetic, model.turn_rate_max_rps
    share, rest_s, limits_mps = model.prompt_share, model.rest_s, (model.speed_min_mps, model.speed_max_mps)
    scale = AirspeedScale(scenario.origin.alt_m, *limits_mps) if reads_equivalent_airspeed(vehicle) else None
    if family == "arduplane":
        return ArduPlane(*who, scale)
    if family == "px4_plane":
        return Px4Plane(*who, scale, SpeedLead(share, rest_s, limits_mps, period_s) if share < 1.0 else None)
    most_mps = model.speed_max_mps if share < 1.0 else math.inf
    lead = VelocityLead(share, rest_s, most_mps, period_s, model.climb_max_mps)
    return ArduCopter(*who, lead) if family == "arducopter" else Px4Copter(*who, lead)


def planned(scenario: Scenario) -> tuple[tuple[Endpoint, ...], tuple[int, ...], dict[VehicleId, Vehicle]]:
    """Return the endpoint of each socket, the MAVLink network it hears, and the vehicles, the leader first.

    There is a socket for each different endpoint; none of the vehicles has been heard yet.
    """
    order = {column: vehicle for column, vehicle in enumerate(columns(scenario)) if vehicle is not None}
    texts = list(dict.fromkeys(vehicle.endpoint for vehicle in order.values()))
    endpoints = tuple(parse_endpoint(text) for text in texts)
    networks = {vehicle.endpoint: vehicle.network for vehicle in order.values()}
    vehicles = {
        each.vehicle_id: _vehicle(each, column, texts.index(each.endpoint), endpoints, scenario)
        for column, each in order.items()
    }
    return endpoints, tuple(networks[text] for text in texts), vehicles


def _vehicle(
    planned: PlannedVehicle, column: int, socket: int, endpoints: tuple[Endpoint, ...], scenario: Scenario
) -> Vehicle:
    endpoint, origin, telemetry = endpoints[socket], scenario.origin.geodetic, scenario.telemetry
    connection = Connection(socket, endpoint.address if endpoint.kind == "udpout" else None)
    autopilot = autopilot_for(planned, scenario)
    check = None if autopilot.stands else AirspeedCheck(planned.model.speed_min_mps, planned.model.speed_max_mps)
    who, rate_hz, by_utc = (planned.vehicle_id, column), telemetry.rate_hz, telemetry.by_utc
    return Vehicle(*who, autopilot, connection, origin, rate_hz, by_utc=by_utc, airspeed_check=check)
