"""The configuration of a fleet, and that of a scenario's vehicles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from airlink.endpoint import Endpoint, VehicleId, parse_endpoint
from formation_scenario import Scenario, Vehicle, start_states
from formation_scenario import environment as fault_keys
from formation_scenario import environment as keys
from formation_scenario.environment import DEFAULT_MODE, FaultKind
from formation_scenario.fields import VehicleSelection
from formation_scenario.navigation import InertialNavigation, TrueNavigation
from formation_scenario.vehicles import Family, VehicleModel, family_of
from sim_vehicles.airframe.disturbances import Disturbance, Intensity, Ramp, Sine, Turbulence
from sim_vehicles.inertial.config import InertialConfig, aid, inertial_sensors

EPOCH_2020_US = 1_577_836_800_000_000


@dataclass(frozen=True)
class Start:
    """State at boot: NED from the fleet's origin, height upwards, heading clockwise from north."""

    north_m: float
    east_m: float
    height_m: float = 0.0
    heading_rad: float = 0.0
    airspeed_mps: float = 0.0
    in_air: bool = False


@dataclass(frozen=True)
class SensorErrors:
    """Standard deviations of the errors in telemetry, in SI units, and their correlation in time."""

    rate_hz: float
    """New errors a second."""
    position_m: float
    """North, east and down each, as for the velocity."""
    velocity_mps: float
    airspeed_mps: float
    heading_rad: float
    correlation_s: float = 0.0
    """Time constant of a first-order Gauss-Markov process; 0: each sample's error is independent."""
    outlier_share: float = 0.0
    """Share of the samples whose position is `outlier_m` off, to some side."""
    outlier_m: float = 0.0


@dataclass(frozen=True)
class VehicleConfig:
    """One vehicle."""

    identity: VehicleId
    endpoint: Endpoint
    """The vehicle's own end: `udpout` to where a ground station listens, or `udpin`."""
    start: Start
    model: VehicleModel = field(default_factory=VehicleModel)
    family: Family | None = None
    """As which autopilot it speaks; None: as an emulator of its model."""
    clock_offset_s: float = 0.0
    clock_drift: float = 0.0
    """Relative rate by which its clock runs faster than true time."""
    utc_error_s: float | None = 0.0
    """Error of its receiver's UTC; None: it has none."""
    sensors: SensorErrors | InertialConfig | None = None
    """None: telemetry carries the exact state."""


@dataclass(frozen=True)
class Fault:
    """Something that happens to some vehicles at a mission time."""

    at_s: float
    vehicles: frozenset[VehicleId]
    kind: FaultKind
    ends: bool = False
    """Whether the fault ends at `at_s`; it begins then otherwise."""
    mode: str = DEFAULT_MODE
    """kind `pilot`: the mode that the pilot switches to."""


@dataclass(frozen=True)
class FleetConfig:
    """Vehicles and the air that they fly in."""

    origin_lat_rad: float
    origin_lon_rad: float
    origin_alt_m: float
    vehicles: tuple[VehicleConfig, ...]
    cruise_mps: float = 22.0
    wind_mps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    disturbances: tuple[Disturbance | Turbulence, ...] = ()
    faults: tuple[Fault, ...] = ()
    utc_at_0_us: int = EPOCH_2020_US
    """UTC at instant 0, microseconds since 1970."""
    seed: int = 1
    """Seed of every random stream."""
    ready_s: float = 3.0
    """Time from boot until a vehicle may be armed; a real one's estimator takes 23 s."""


def stand_ins(scenario: Scenario) -> str:
    """Return which vehicles of a real autopilot family are emulated, in words; "" if none is."""
    named = [_named(vehicle) for vehicle in scenario.vehicles if vehicle.autopilot != "emulator"]
    return f"{', '.join(named)} {'is' if len(named) == 1 else 'are'} emulated" if named else ""


def _named(vehicle: Vehicle) -> str:
    return f"vehicle {vehicle.vehicle_id} ({vehicle.autopilot})"


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
