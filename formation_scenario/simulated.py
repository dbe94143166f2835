"""Base classes of what can be added to emulated vehicles, their air and their links, and what registers them.

`gcs_formation.extend` has them too. A method that raises, or returns what isn't finite, ends the flight safely: the
extension does nothing from then on, vehicles are commanded to circle, and the exit status is 3.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from formation_scenario.extensions import AIRCRAFT, DISTURBANCE, EMULATED_FAMILY, FAULT, LINK, NAVIGATION
from formation_scenario.register import Decorator, Extension, decorator


class Place(NamedTuple):
    """A position: north and east of the origin, and height above it, m; NaN where it isn't known."""

    north_m: float
    east_m: float
    height_m: float


class Carried(NamedTuple):
    """A datagram that enters a link."""

    time_s: float
    """Since the run's start, s."""
    size_bytes: int
    station: Place
    """The ground station's antenna, the scenario's `links.station_m`."""
    vehicle: Place
    """The vehicle: its true position where it is emulated, else the one that it reported last."""


class LinkProcess(Extension, ABC):
    """Delay and loss of one direction of a vehicle's link: `process: NAME` among a link's keys, with its `parameters`.

    It adds to the link's other keys. There is an instance for each direction of each link.
    """

    vehicle: int | str
    """The vehicle's id, "network:id" beyond the first network."""
    uplink: bool
    """Whether it is the direction from the ground station to the vehicle."""
    random: np.random.Generator
    """Random numbers of this direction of this link alone, by the scenario's seed."""
    ground_m: Callable[[float, float], float]
    """Returns the height of the ground above the origin, m, at a position north and east of it, m."""

    @abstractmethod
    def delay_s(self, carried: Carried) -> float | None:
        """Return by how long a datagram is delayed, s, 0 or more; None if it is lost."""


class AirPoint(NamedTuple):
    """Where and how a vehicle flies through the air."""

    time_s: float
    """Since the disturbance began, s."""
    north_m: float
    east_m: float
    height_m: float
    airspeed_mps: float
    heading_rad: float


class AirDisturbance(Extension, ABC):
    """A velocity that the air has besides the wind, by `disturbances: [{kind: NAME, at_s: …, parameters: {…}}]`.

    There is an instance for each vehicle of an entry. What pushes a vehicle is the velocity at which it drifts.
    """

    vehicle: int | str
    """The vehicle's id, "network:id" beyond the first network."""
    random: np.random.Generator
    """Random numbers of this vehicle in this entry alone, by the scenario's seed."""
    dt_s: float
    """Time between two calls while it acts, s."""

    @abstractmethod
    def velocity_mps(self, at: AirPoint) -> Sequence[float]:
        """Return the velocity north, east and down, m/s; called in every cycle of the vehicles' main loop."""


class Measured(NamedTuple):
    """A vehicle's motion as its telemetry has it; `_replace` returns another."""

    north_m: float
    east_m: float
    height_m: float
    velocity_north_mps: float
    """Over ground, as the next two."""
    velocity_east_mps: float
    velocity_down_mps: float
    airspeed_mps: float
    heading_rad: float


class NavigationSource(Extension, ABC):
    """What a vehicle's telemetry knows of its motion, by `navigation: {source: NAME, parameters: {…}}`.

    There is an instance for each vehicle. Its own control loops use the true state.
    """

    vehicle: int | str
    """The vehicle's id, "network:id" beyond the first network."""
    random: np.random.Generator
    """Random numbers of this vehicle alone, by the scenario's seed."""

    @abstractmethod
    def measure(self, true: Measured, time_s: float) -> Measured:
        """Return what is measured of a true motion at a time since the run's start, s; once for each instant."""


class EmulatedVehicle(ABC):
    """An emulated vehicle as a fault acts on it."""

    id: int | str
    """Its id, "network:id" beyond the first network."""

    @property
    @abstractmethod
    def time_s(self) -> float:
        """Time since the run's start, s."""

    @property
    @abstractmethod
    def true(self) -> Measured:
        """Its true motion."""

    @abstractmethod
    def crash(self) -> None:
        """Put it on the ground, silent."""

    @abstractmethod
    def restart(self) -> None:
        """Reboot its autopilot, with its clock at 0."""

    @abstractmethod
    def freeze(self, *, on: bool) -> None:
        """Hang its autopilot, so that it flies on by its last setpoint, for as long as any fault does."""

    @abstractmethod
    def ignore(self, *, on: bool) -> None:
        """Acknowledge commands without carrying them out, for as long as any fault does."""

    @abstractmethod
    def take_over(self, mode: str | None) -> None:
        """Let its pilot change to a mode and hold the sticks; None: back to where the ground station commands it."""

    @abstractmethod
    def limit(self, **limits: float) -> None:
        """Change time constants and limits, the names as in `model`: `speed_max_mps=18`, `tau_v_s=9`; none: as before.

        Aircraft under total-energy control have limits of speed and of the turn rate alone.

        Raises:
            ValueError: no such time constant or limit.
        """

    @abstractmethod
    def say(self, text: str) -> None:
        """Send a text to the operator (STATUSTEXT)."""


class VehicleFault(Extension):
    """A fault of an emulated vehicle, by `faults: [{kind: NAME, at_s: …, parameters: {…}}]`, `stress`, or `inject`.

    There is an instance for each vehicle and each entry.
    """

    lasts: ClassVar[bool] = True
    """Whether it may have an end (`until_s`)."""
    crashes: ClassVar[bool] = False
    """Whether it crashes the vehicle: its loss then isn't the run's failure."""
    silences: ClassVar[bool] = False
    """Whether the vehicle sends nothing while it lasts, which then isn't the link's failure."""
    vehicle: int | str
    """The vehicle's id, "network:id" beyond the first network."""
    random: np.random.Generator
    """Random numbers of this entry's vehicle alone, by the scenario's seed."""

    def strike(self, vehicle: EmulatedVehicle) -> None:
        """Begin."""

    def act(self, vehicle: EmulatedVehicle) -> None:
        """Act in a cycle of the vehicle's main loop, after it has begun and before it ends."""

    def end(self, vehicle: EmulatedVehicle) -> None:
        """End, at `until_s`."""

    def measure(self, measured: Measured, time_s: float) -> Measured:
        """Return what telemetry has in place of what was measured, at a time since the run's start, s."""
        del time_s
        return measured


class Aircraft(Extension, ABC):
    """A named kind of aircraft: `model: NAME`, or `model: {aircraft: NAME, parameters: {…}}` with keys that differ."""

    @abstractmethod
    def model(self) -> Mapping[str, Any]:
        """Return the keys of `model`, as a scenario writes them; the others have their defaults."""


def register_link_process(name: str) -> Decorator[type[LinkProcess]]:
    """Register a delay and loss process, which `process: NAME` among a link's keys chooses."""
    return decorator(LINK, name, LinkProcess)


def register_fault(name: str) -> Decorator[type[VehicleFault]]:
    """Register a fault, which `faults: [{kind: NAME}]` chooses, and `Flight.inject(NAME)`."""
    return decorator(FAULT, name, VehicleFault)


def register_disturbance(name: str) -> Decorator[type[AirDisturbance]]:
    """Register a disturbance of the air, which `disturbances: [{kind: NAME}]` chooses."""
    return decorator(DISTURBANCE, name, AirDisturbance)


def register_aircraft(name: str) -> Decorator[type[Aircraft]]:
    """Register an aircraft, which `model: NAME` chooses."""
    return decorator(AIRCRAFT, name, Aircraft)


def register_navigation(name: str) -> Decorator[type[NavigationSource]]:
    """Register a navigation source, which `navigation: {source: NAME}` chooses."""
    return decorator(NAVIGATION, name, NavigationSource)


def register_emulated_family(name: str) -> Decorator[type[Any]]:
    """Register an emulated autopilot, a subclass of one of `sim_vehicles.families`: `emulator: {family: NAME}`."""
    registering: Decorator[type[Any]] = decorator(EMULATED_FAMILY, name, object)

    def register(made: type[Any]) -> type[Any]:
        if not isinstance(getattr(made, "emulates", None), str):
            raise TypeError(f"found {made!r} as family '{name}'; allowed: a subclass of one of sim_vehicles.families")
        return registering(made)

    return register
