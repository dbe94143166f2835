"""The scenario's vehicles, the class for each autopilot family, and the sockets on which they are heard."""

from __future__ import annotations

from airlink.endpoint import Endpoint, VehicleId, parse_endpoint
from formation_scenario import Scenario
from formation_scenario import Vehicle as PlannedVehicle
from formation_scenario.slot_assignment import columns
from formation_scenario.vehicles import Family, family_of, reads_equivalent_airspeed
from gcs_formation.estimation.airspeed_scale import AirspeedScale
from gcs_formation.link.link_health import Connection
from gcs_formation.vehicle.ardupilot import ArduCopter, ArduPlane
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.px4 import Px4Copter, Px4Plane
from gcs_formation.vehicle.vehicle import Vehicle
from gcs_formation.vehicle.velocity_setpoint import SpeedLead, VelocityLead

FAMILIES: dict[Family, type[Autopilot]] = {
    "arduplane": ArduPlane,
    "arducopter": ArduCopter,
    "px4_plane": Px4Plane,
    "px4_copter": Px4Copter,
}


def autopilot_for(vehicle: PlannedVehicle, scenario: Scenario) -> Autopilot:
    """Return the family's class for a vehicle of the scenario."""
    model = vehicle.model
    autopilot = FAMILIES[family_of(vehicle)](vehicle.id, scenario.origin.geodetic, model.turn_rate_max_rps)
    if reads_equivalent_airspeed(vehicle):
        autopilot.airspeed_scale = AirspeedScale(scenario.origin.alt_m, model.speed_min_mps, model.speed_max_mps)
    share, rest_s, period_s = model.prompt_share, model.rest_s, 1.0 / scenario.law.rate_hz
    if share < 1.0 and isinstance(autopilot, ArduCopter | Px4Copter):
        autopilot.velocity_lead = VelocityLead(share, rest_s, model.speed_max_mps, period_s)
    elif share < 1.0 and isinstance(autopilot, Px4Plane):
        autopilot.speed_lead = SpeedLead(share, rest_s, (model.speed_min_mps, model.speed_max_mps), period_s)
    return autopilot


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
    rate_hz, by_utc = telemetry.rate_hz, telemetry.by_utc
    return Vehicle(planned.vehicle_id, column, autopilot, connection, origin, rate_hz, by_utc=by_utc)
