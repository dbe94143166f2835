"""Each vehicle's simulator, derived from the scenario and from what the command line says of the user's programs."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Final

import numpy as np

from airlink.endpoint import VehicleId, parse_endpoint
from formation_scenario import Scenario, Vehicle
from formation_scenario.fields import refused
from formation_scenario.start_states import StartState, start_states
from formation_scenario.stored_landing import items_of, landing_position
from gcs_formation.app.sitl import families
from gcs_formation.app.sitl.simulator import Craft, Home, Simulator, kept

SIMULATORS: Final[Mapping[str, Simulator]] = {
    each.name: each
    for each in (
        import_module(f"{families.__name__}.{module.name}").SIMULATOR for module in iter_modules(families.__path__)
    )
}
"""Those that are here, by their families' names."""
NAMES: Final = ", ".join(SIMULATORS)


@dataclass(frozen=True)
class Simulated:
    """A vehicle of the scenario with its simulator."""

    identity: VehicleId
    simulator: Simulator
    program: Path
    craft: Craft
    lacks: tuple[str, ...] = ()
    """What the scenario says and the simulator can't do, in words."""


class ProgramError(ValueError):
    """`--sitl` names a family or a program that can't be used; the message says what was found and is allowed."""


def programs_of(given: tuple[str, ...]) -> dict[str, Path]:
    """Return the user's programs by family, as `--sitl FAMILY=PROGRAM` gives them.

    Raises:
        ProgramError: it isn't of that form, or there is no such program.
    """
    found = dict[str, str]()
    for text in given:
        name, _, path = text.partition("=")
        if name not in SIMULATORS or not path:
            raise ProgramError(f"found '{text}'; allowed: FAMILY=PROGRAM, with FAMILY one of {NAMES}")
        if name in found:
            raise ProgramError(f"found {name} twice; allowed: one program a family")
        found[name] = path
    return programs_at(found)


def programs_at(paths: Mapping[str, str | Path]) -> dict[str, Path]:
    """Return the programs at paths, by family.

    Raises:
        ProgramError: there is no such family, or no such program.
    """
    if not isinstance(paths, Mapping):
        raise ProgramError(f"found {paths!r}; allowed: paths by family")
    found = dict[str, Path]()
    for name, path in paths.items():
        if name not in SIMULATORS:
            raise ProgramError(f"found '{name}'; allowed: {NAMES}")
        program = Path(path).expanduser().absolute()
        if not (program.is_file() and os.access(program, os.X_OK)):
            raise ProgramError(f"found no program {path}; allowed: the path of a simulator of {name}, built by you")
        if wrong := SIMULATORS[name].found_wrong(program):
            raise ProgramError(f"of {path} found {wrong}; allowed: the program where its build has put it")
        found[name] = program
    return found


def simulated(
    programs: Mapping[str, Path], scenario: Scenario, speedup: float, *, stepped: bool = False
) -> list[Simulated]:
    """Return the simulator of each vehicle, in the scenario's order, where emulated vehicles would begin.

    `stepped`: their clocks are stepped, and their motion is ours.

    Raises:
        ScenarioError: a vehicle is of a family without a program, or can't be simulated as the scenario says.
    """
    if scenario.start.in_air:
        raise refused("start.in_air", "found true with --sitl", "false: simulators begin on the ground")
    starts = enumerate(zip(scenario.vehicles, start_states(scenario), strict=True))
    return [
        _one(programs, scenario, speedup, index, vehicle, start, stepped=stepped) for index, (vehicle, start) in starts
    ]


def _one(
    programs: Mapping[str, Path],
    scenario: Scenario,
    speedup: float,
    index: int,
    vehicle: Vehicle,
    start: StartState,
    *,
    stepped: bool,
) -> Simulated:
    key, name = f"vehicles.{index}", vehicle.autopilot
    if name not in programs:
        given = " and ".join(f"--sitl {each}=…" for each in programs)
        raise refused(f"{key}.autopilot", f"found {name} with {given}", _programs_allowed(name, programs))
    if vehicle.network != 1:
        raise refused(f"{key}.network", f"found {vehicle.network} with --sitl", "1: simulators have one network")
    simulator = SIMULATORS[name]
    craft = Craft(
        vehicle.id,
        index + 1,
        _home(scenario, start),
        parse_endpoint(vehicle.endpoints[0]),
        vehicle.model.hovers,
        speedup,
        stepped=stepped,
        parameters=kept(simulator.of_scenario(vehicle, scenario), vehicle.autopilot_parameters),
        landing=()
        if vehicle.landing is None
        else items_of(landing_position(vehicle.landing, start), scenario.origin.geodetic),
    )
    if len(vehicle.endpoints) > 1 or not (stepped or simulator.reaches(craft)):
        found = f"found {', '.join(vehicle.endpoints)} of a simulated {name}"
        raise refused(f"{key}.endpoint", found, simulator.allowed_endpoints)
    lacks = tuple(simulator.cannot(vehicle, scenario, programs[name], stepped=stepped))
    return Simulated(vehicle.vehicle_id, simulator, programs[name], craft, lacks)


def not_simulated(fleet: Sequence[Simulated]) -> list[str]:
    """Return a line for each family whose simulators can't do all that the scenario says."""
    lacks = dict[str, dict[str, None]]()
    for each in fleet:
        lacks.setdefault(each.simulator.name, {}).update(dict.fromkeys(each.lacks))
    return [f"{name} is flown without: {', '.join(what)}" for name, what in lacks.items() if what]


def _programs_allowed(name: str, programs: Mapping[str, Path]) -> str:
    """Return what would give a vehicle a simulator."""
    own = f"; or --sitl {name}=PROGRAM" if name in SIMULATORS else ""
    return f"one of {', '.join(programs)}, as every vehicle is simulated{own}"


def _home(scenario: Scenario, start: StartState) -> Home:
    lat_rad, lon_rad, alt_m = scenario.origin.geodetic.from_ned(start.north_m, start.east_m, 0.0)
    ground_m = (
        0.0
        if scenario.terrain is None
        else float(scenario.ground.height(np.array(start.north_m), np.array(start.east_m)))
    )
    heading_deg = math.degrees(start.heading_rad) % 360.0
    return Home(math.degrees(lat_rad), math.degrees(lon_rad), alt_m + ground_m, heading_deg)
