"""The configuration of a fleet."""

from __future__ import annotations

from dataclasses import dataclass, field

from airlink.endpoint import Endpoint, VehicleId
from formation_scenario import Scenario, Vehicle
from formation_scenario.environment import DEFAULT_MODE, FaultKind
from formation_scenario.vehicles import Family, VehicleModel
from sim_vehicles.airframe.disturbances import Disturbance, Turbulence
from sim_vehicles.inertial.config import InertialConfig

EPOCH_2020_US = 1_577_836_800_000_000


class SimVehiclesError(Exception):
    """Root of what the emulated vehicles raise."""


class TruthError(SimVehiclesError):
    """A file that isn't a record of ground truth."""


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
    told = [_named(vehicle) for vehicle in scenario.vehicles if vehicle.autopilot != "emulator"]
    return f"{', '.join(told)} {'is' if len(told) == 1 else 'are'} emulated" if told else ""


def _named(vehicle: Vehicle) -> str:
    return f"vehicle {vehicle.vehicle_id} ({vehicle.autopilot})"
