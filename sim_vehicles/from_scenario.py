"""A scenario's vehicles as a fleet."""

from __future__ import annotations

import math
from collections.abc import Iterator

from airlink.endpoint import VehicleId, parse_endpoint
from formation_scenario import Scenario, Vehicle, start_states
from formation_scenario import environment as fault_keys
from formation_scenario import environment as keys
from formation_scenario.fields import VehicleSelection
from formation_scenario.navigation import InertialNavigation, TrueNavigation
from formation_scenario.vehicles import family_of
from sim_vehicles.airframe.disturbances import Disturbance, Intensity, Ramp, Sine, Turbulence
from sim_vehicles.config import Fault, FleetConfig, SensorErrors, Start, VehicleConfig
from sim_vehicles.inertial.config import InertialConfig, aid, inertial_sensors


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
            model=vehicle.true_model or vehicle.model,
            family=family_of(vehicle),
            clock_offset_s=vehicle.clock.offset_s,
            clock_drift=vehicle.clock.drift_ppm * 1e-6,
            utc_error_s=vehicle.clock.utc_error_s if vehicle.clock.utc else None,
            sensors=_sensors(vehicle, scenario.seed),
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
        disturbances=tuple(_disturbance(each, _selected(scenario, each.vehicles)) for each in scenario.disturbances),
        faults=tuple(part for each in scenario.faults for part in _fault(each, _selected(scenario, each.vehicles))),
        seed=scenario.seed,
    )


def _selected(scenario: Scenario, selection: VehicleSelection) -> frozenset[VehicleId]:
    return frozenset(vehicle.vehicle_id for vehicle in scenario.selected(selection))


def _sensors(vehicle: Vehicle, seed: int) -> SensorErrors | InertialConfig | None:
    keys = vehicle.true_navigation or vehicle.navigation
    if isinstance(keys, TrueNavigation):
        return None
    if isinstance(keys, InertialNavigation):
        aligned_s = keys.alignment_s if keys.flight_start == "aligned" else None
        sensors = inertial_sensors(keys, seed, vehicle.vehicle_id)
        return InertialConfig(sensors, aid(keys), aligned_s, keys.airspeed_sigma_mps)
    return SensorErrors(
        rate_hz=keys.rate_hz,
        position_m=keys.position_sigma_m,
        velocity_mps=keys.velocity_sigma_mps,
        airspeed_mps=keys.airspeed_sigma_mps,
        heading_rad=math.radians(keys.heading_sigma_deg),
        correlation_s=keys.correlation_s,
        outlier_share=keys.outlier_share,
        outlier_m=keys.outlier_m,
    )


def _disturbance(entry: keys.Disturbance, vehicles: frozenset[VehicleId]) -> Disturbance | Turbulence:
    when = entry.at_s, entry.end_s, vehicles
    match entry:
        case keys.StepDisturbance():
            return Disturbance(*when, entry.velocity_mps)
        case keys.RampDisturbance():
            return Ramp(*when, entry.velocity_mps, entry.duration_s)
        case keys.SineDisturbance():
            return Sine(*when, entry.velocity_mps, entry.period_s, math.radians(entry.phase_deg))
        case keys.DrydenTurbulence():
            return Turbulence(*when, _intensity(entry))


def _intensity(entry: keys.DrydenTurbulence) -> Intensity | float:
    if entry.sigma_mps is not None and entry.length_m is not None:
        return Intensity(entry.sigma_mps, entry.length_m)
    assert entry.wind_6m_mps is not None
    return entry.wind_6m_mps


def _fault(entry: fault_keys.Fault, vehicles: frozenset[VehicleId]) -> Iterator[Fault]:
    """Yield a fault's beginning, and its end if it has one."""
    mode = entry.mode or fault_keys.DEFAULT_MODE
    yield Fault(entry.at_s, vehicles, entry.kind, mode=mode)
    if entry.until_s is not None:
        yield Fault(entry.until_s, vehicles, entry.kind, ends=True, mode=mode)
