"""A scenario's vehicles as a fleet."""

from __future__ import annotations

import math

from airlink.endpoint import parse_endpoint
from airlink.identity import VehicleId
from formation_scenario import Scenario, start_states
from formation_scenario.fields import VehicleSelection
from sim_vehicles.config import Airframe, Disturbance, Fault, FleetConfig, Start, VehicleConfig


def fleet_config(scenario: Scenario) -> FleetConfig:
    """Return the fleet that a scenario describes: each vehicle at the other end of its endpoint, at its start."""
    states = start_states(scenario)
    vehicles = tuple(
        VehicleConfig(
            identity=vehicle.vehicle_id,
            endpoint=parse_endpoint(vehicle.endpoint).opposite(),
            start=Start(
                north_m=float(states.north_m[i]),
                east_m=float(states.east_m[i]),
                height_m=float(states.height_m[i]),
                heading_rad=float(states.heading_rad[i]),
                airspeed_mps=float(states.airspeed_mps[i]),
                in_air=states.in_air,
            ),
            airframe=Airframe(**vehicle.model.model_dump()),
            clock_offset_s=vehicle.clock.offset_s,
            clock_drift=vehicle.clock.drift_ppm * 1e-6,
        )
        for i, vehicle in enumerate(scenario.vehicles)
    )
    origin = scenario.origin
    return FleetConfig(
        origin_lat_rad=math.radians(origin.lat_deg),
        origin_lon_rad=math.radians(origin.lon_deg),
        origin_alt_m=origin.alt_m,
        vehicles=vehicles,
        cruise_mps=scenario.path.speed_mps,
        wind_mps=scenario.wind.velocity_mps,
        disturbances=tuple(
            Disturbance(each.at_s, _selected(scenario, each.vehicles), each.velocity_mps)
            for each in scenario.disturbances
        ),
        faults=tuple(Fault(each.at_s, _selected(scenario, each.vehicles), each.kind) for each in scenario.faults),
    )


def _selected(scenario: Scenario, selection: VehicleSelection) -> frozenset[VehicleId]:
    return frozenset(vehicle.vehicle_id for vehicle in scenario.selected(selection))
