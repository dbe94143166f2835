"""What is simulated, and what a family's simulator brings: how it is started, and where it keeps the true motion."""

from __future__ import annotations

import socket
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Final, NamedTuple

import numpy as np

from airlink.endpoint import Endpoint
from flight_model.arrays import Array
from formation_scenario import Scenario, Vehicle
from formation_scenario.stored_landing import LandingItem
from gcs_formation.app.sitl.exchange import Exchange
from gcs_formation.errors import RunAbortedError

Parameters = Mapping[str, float]


class SimulatorError(RunAbortedError):
    """A simulator can't be started, or doesn't take what a vehicle needs."""


class Home(NamedTuple):
    """Where a vehicle begins, on the ground."""

    lat_deg: float
    lon_deg: float
    alt_m: float
    """Above sea level."""
    heading_deg: float = 0.0


@dataclass(frozen=True)
class Craft:
    """One vehicle to simulate."""

    system: int
    number: int
    """Its number among the simulated vehicles, from 1, by which simulators have ports of their own."""
    home: Home
    station: Endpoint
    """Where the ground station listens for it, or sends to it."""
    hovers: bool = False
    speedup: float = 1.0
    parameters: Parameters = field(default_factory=dict)
    """With which its autopilot is switched on."""
    stepped: bool = False
    """Whether its motion is integrated and its clock stepped by us."""
    steps_port: int = 0
    """The port at which it asks for that, once that is known."""
    landing: tuple[LandingItem, ...] = ()
    """The landing that its stored mission has; empty: it has none."""


class Launch(NamedTuple):
    """How a simulator is started, in a directory of its own."""

    command: list[str]
    variables: Mapping[str, str] = {}
    """Environment variables besides ours."""
    files: Mapping[str, str] = {}
    """Text files in its directory, by their names."""


class TrueMotion(NamedTuple):
    """Where a simulated vehicle truly was, by its own log: (N,) each, in order of time."""

    boot_s: Array
    """Time since its boot, on the clock by which it stamps telemetry."""
    lat_rad: Array
    lon_rad: Array
    alt_m: Array
    """Above sea level."""
    north_mps: Array
    east_mps: Array
    climb_mps: Array
    heading_rad: Array
    airspeed_mps: Array
    """NaN where the simulator doesn't log it."""

    @classmethod
    def of(cls, columns: Mapping[str, Array]) -> TrueMotion:
        """Return the columns by their names, without samples that don't follow the one before."""
        rising = np.append(True, np.diff(np.maximum.accumulate(columns["boot_s"])) > 0.0)
        return cls(**{name: columns[name][rising] for name in cls._fields})


BATTERY_TO_SPARE: Final = 2.0
BESIDE_PATH_S: Final = 1200.0
"""Time for take-off, assembly and the landings, of which a vehicle waits for those before it, s."""


def endurance_s(scenario: Scenario) -> float:
    """Return how long a simulated vehicle's battery lasts, s: twice the flight, so that it doesn't end that.

    By their defaults an ArduCopter's lasts for 400 s, and a PX4's for 60 s.
    """
    return BATTERY_TO_SPARE * (scenario.duration_s + BESIDE_PATH_S)


class Simulator(ABC):
    """A family's simulator; a module of `families` has each as `SIMULATOR`."""

    name: ClassVar[str]
    """The family, as `autopilot:` of a vehicle and `--sitl` name it."""
    allowed_endpoints: ClassVar[str]
    """Of the scenario, in words."""

    @abstractmethod
    def of_scenario(self, vehicle: Vehicle, scenario: Scenario) -> dict[str, float]:
        """Return the parameters that suit the scenario: failsafes on, limits as its model says, its wind."""

    def found_wrong(self, program: Path) -> str:  # noqa: ARG002 - most need nothing else
        """Return in words what a program lacks that it needs with it; "" if nothing."""
        return ""

    @abstractmethod
    def exchange(self, craft: Craft, seed: int) -> Exchange:
        """Return what steps a vehicle's clock, listening for it.

        `seed`: the run's, for what its sensors measure.

        Raises:
            SimulatorError: its port is taken.
        """

    def serial_port(self, craft: Craft) -> int:  # noqa: ARG002 - most send to the station by themselves
        """Return the UDP port of this machine at which its link waits for a station; 0: it sends to one."""
        return 0

    def cannot(
        self,
        vehicle: Vehicle,
        scenario: Scenario,
        program: Path,  # noqa: ARG002 - for versions
        *,
        stepped: bool,
    ) -> list[str]:
        """Return in words what the scenario says of the vehicle, or of its surroundings, and the simulator can't do.

        `stepped`: the vehicle moves in the scenario's air.
        """
        lacks = ["disturbances"] if scenario.disturbances and not stepped else []
        lacks += ["faults of vehicles"] if scenario.faults else []
        lacks += [f"navigation of source {vehicle.navigation.source}"] if vehicle.navigation.source != "truth" else []
        return lacks

    @abstractmethod
    def reaches(self, craft: Craft) -> bool:
        """Return whether the simulator can be at the other end of the station's endpoint."""

    @abstractmethod
    def ports(self, craft: Craft) -> tuple[tuple[socket.SocketKind, int], ...]:
        """Return the ports of this machine that it needs, which must be free, each with its socket's kind."""

    @abstractmethod
    def launch(self, program: Path, craft: Craft) -> Launch:
        """Return how a vehicle is started."""

    def prepare(self, craft: Craft, clock_s: Callable[[], float]) -> None:  # noqa: B027 - most have all by parameters
        """Give a simulator that has just been started what it can't be started with; `clock_s` is its time, s.

        Raises:
            SimulatorError: it doesn't take it.
        """

    @abstractmethod
    def true_motion(self, directory: Path) -> TrueMotion | None:
        """Return where the vehicle was, by the newest log in its directory; None without one that says so.

        Raises:
            OSError: a log can't be read.
            ValueError: it isn't one.
        """


def newest(directory: Path, pattern: str) -> Path | None:
    """Return the newest file of a pattern, in any subdirectory."""
    found = sorted(directory.rglob(pattern), key=lambda each: (each.stat().st_mtime_ns, each.name))
    return found[-1] if found else None


def kept(parameters: Parameters, given: Any) -> dict[str, float]:  # noqa: ANN401 - a scenario's mapping or None
    """Return parameters with those that a scenario gives itself in their place."""
    return {**parameters, **{name: float(value) for name, value in (given or {}).items()}}
