"""The configuration of a fleet, and its derivation from a scenario."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from airlink.clock import VIRTUAL_EPOCH_US
from airlink.endpoint import Endpoint, VehicleId, parse_endpoint
from airlink.signing.key import ALLOWED, KeyFileError, SigningKey, read_key
from flight_model.earth import GeodeticOrigin, true_by_equivalent_airspeed
from formation_scenario import Scenario, Vehicle
from formation_scenario.battery import EmulatedBattery
from formation_scenario.extensions import EMULATED_FAMILY, Registered
from formation_scenario.fields import VehicleSelection, refused
from formation_scenario.landing import StoredLanding
from formation_scenario.navigation import Navigation, TrueNavigation
from formation_scenario.registry import Registry
from formation_scenario.start_states import StartState, start_states
from formation_scenario.station import StationId
from formation_scenario.surroundings import Disturbance, Fault
from formation_scenario.vehicles import Family, VehicleClock, VehicleModel, family_of, reads_equivalent_airspeed

if TYPE_CHECKING:
    from formation_scenario.parameter_files import Parameter

STATION_SYSTEM: Final = StationId().system
"""The ground station's system id by default."""


@dataclass(frozen=True)
class Pitot:
    """The airspeed sensor by which an autopilot flies."""

    field_m: float
    """Height of the origin above sea level."""
    scale: float = 1.0
    """Ratio of indicated to equivalent airspeed."""

    def indicated(self, true_mps: float, height_m: float) -> float:
        """Return the indicated airspeed (IAS) at a true airspeed, at a height above the origin."""
        return self.scale * true_mps / true_by_equivalent_airspeed(self.field_m + height_m)

    def true(self, indicated_mps: float, height_m: float) -> float:
        """Return the true airspeed (TAS) at an indicated one, at a height above the origin."""
        return indicated_mps * true_by_equivalent_airspeed(self.field_m + height_m) / self.scale


@dataclass(frozen=True)
class VehicleConfig:
    """The configuration of one emulated vehicle."""

    identity: VehicleId
    endpoint: Endpoint
    """The vehicle's own end: `udpout` to where a ground station listens, or `udpin`."""
    start: StartState
    model: VehicleModel = field(default_factory=VehicleModel)
    family: Family = "arduplane"
    """The autopilot family that it emulates."""
    pitot: Pitot | None = None
    """None: airspeeds in messages are true."""
    clock: VehicleClock = field(default_factory=VehicleClock)
    navigation: Navigation = field(default_factory=TrueNavigation)
    """Source of its telemetry, with all keys of the resolved scenario."""
    own_family: Registered | None = None
    """The family of an extension in place of `family`."""
    own_keys: Any = None
    """Its keys, typed by its own model."""
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    """Its own parameters, by name, where they differ from its firmware's defaults."""
    set_up: bool = False
    """Whether the scenario gives some of them itself."""
    landing: StoredLanding | None = None
    """The landing in its stored mission; None: the mission is empty."""
    battery: EmulatedBattery | None = None
    """Its battery; None: it tells one that isn't drained."""
    onboard_log: bool = False
    """Whether it writes a log of its own."""
    signing_key: SigningKey | None = None
    """The key that it has been set up with; None: it signs nothing, and refuses nothing."""
    further_endpoints: tuple[Endpoint, ...] = ()
    """Its own ends of its other links: each has the same telemetry, numbered by itself, and takes the same commands."""

    @property
    def endpoints(self) -> tuple[Endpoint, ...]:
        """Its own end of each of its links."""
        return (self.endpoint, *self.further_endpoints)


@dataclass(frozen=True)
class FleetConfig:
    """Vehicles and the air that they fly in."""

    origin: GeodeticOrigin
    vehicles: tuple[VehicleConfig, ...]
    cruise_mps: float = 22.0
    wind_mps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    disturbances: tuple[tuple[Disturbance, frozenset[VehicleId]], ...] = ()
    """Each with the vehicles concerned."""
    faults: tuple[tuple[Fault, frozenset[VehicleId]], ...] = ()
    """Each with the vehicles concerned."""
    utc_at_0_us: int = VIRTUAL_EPOCH_US
    """UTC at instant 0, microseconds since 1970."""
    seed: int = 1
    """Seed of every random stream."""
    registered: Registry = field(default_factory=Registry)
    """What extensions register."""
    ready_s: float = 3.0
    """Time from boot until a vehicle may be armed; a real one's estimator takes 23 s."""
    station_system: int = STATION_SYSTEM
    """System id of the ground station whose heartbeats hold off their failsafes."""

    def sockets_of(self, index: int) -> tuple[int, ...]:
        """Return the numbers of a vehicle's sockets, a link each; the first ones of all vehicles come first."""
        further = [len(each.further_endpoints) for each in self.vehicles]
        begin = len(self.vehicles) + sum(further[:index])
        return (index, *range(begin, begin + further[index]))


def stand_ins(scenario: Scenario) -> str:
    """Return in words which vehicles of a real autopilot family are emulated; "" if none is."""
    named = [
        f"vehicle {each.vehicle_id} ({each.autopilot})" for each in scenario.vehicles if each.autopilot != "emulator"
    ]
    return f"{', '.join(named)} {'is' if len(named) == 1 else 'are'} emulated" if named else ""


def fleet_config(scenario: Scenario) -> FleetConfig:
    """Return the fleet of a scenario, with each vehicle at the other end of its endpoint and at its start.

    Raises:
        ParameterFileError: a model's parameter file has gone since the scenario was read.
        ScenarioError: so has a key file.
    """
    vehicles = tuple(
        VehicleConfig(
            identity=vehicle.vehicle_id,
            endpoint=parse_endpoint(vehicle.endpoints[0]).opposite(),
            start=start,
            model=vehicle.true_model or vehicle.model,
            family=family_of(vehicle),
            pitot=_pitot(vehicle, scenario),
            clock=vehicle.clock,
            navigation=vehicle.true_navigation or vehicle.navigation,
            **_own_family(vehicle, scenario),
            parameters=_parameters(vehicle),
            set_up=vehicle.autopilot_parameters is not None,
            landing=vehicle.landing,
            battery=vehicle.battery,
            onboard_log=vehicle.onboard_log,
            further_endpoints=tuple(parse_endpoint(text).opposite() for text in vehicle.endpoints[1:]),
            signing_key=_signing_key(vehicle, scenario),
        )
        for vehicle, start in zip(scenario.vehicles, start_states(scenario), strict=True)
    )
    return FleetConfig(
        origin=scenario.origin.geodetic,
        vehicles=vehicles,
        cruise_mps=scenario.path.begin_mps,
        wind_mps=scenario.wind.velocity_mps,
        disturbances=tuple((each, _selected(scenario, each.vehicles)) for each in scenario.disturbances),
        faults=tuple((each, _selected(scenario, each.vehicles)) for each in scenario.faults),
        seed=scenario.seed,
        registered=scenario.registered,
        station_system=scenario.station.system,
    )


def _own_family(vehicle: Vehicle, scenario: Scenario) -> dict[str, Any]:
    entry = scenario.registered.get(vehicle.own_family, EMULATED_FAMILY)
    if entry is None or vehicle.emulator is None:
        return {}
    keys = dict(vehicle.emulator.parameters or {})
    return {"own_family": entry, "own_keys": entry.keys_model.model_validate_json(json.dumps(keys))}


def _parameters(vehicle: Vehicle) -> Mapping[str, Parameter]:
    model, given = vehicle.true_model or vehicle.model, vehicle.autopilot_parameters
    if given is None and not isinstance(model.parameters, str):
        return {}
    from formation_scenario.parameter_files import Parameter, read_parameters  # noqa: PLC0415 - few name one

    of_file = read_parameters(Path(model.parameters)).parameters if isinstance(model.parameters, str) else {}
    return {**of_file, **{name: Parameter(value, 0) for name, value in (given or {}).items()}}


def _signing_key(vehicle: Vehicle, scenario: Scenario) -> SigningKey | None:
    signing = scenario.signing_of(vehicle)
    if signing is None or signing.file is None:
        return None
    try:
        return read_key(signing.file)
    except KeyFileError as error:
        raise refused("links.default.signing.key_file", str(error), ALLOWED) from error


def _pitot(vehicle: Vehicle, scenario: Scenario) -> Pitot | None:
    airframe = (vehicle.true_model or vehicle.model).airframe
    scale = 1.0 if airframe is None else airframe.airspeed_scale
    return Pitot(scenario.origin.alt_m, scale) if reads_equivalent_airspeed(vehicle) else None


def _selected(scenario: Scenario, selection: VehicleSelection) -> frozenset[VehicleId]:
    return frozenset(vehicle.vehicle_id for vehicle in scenario.selected(selection))
