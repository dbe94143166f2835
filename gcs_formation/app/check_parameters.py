"""What `check` says of parameter files: what of each was taken for a vehicle's model, and what wasn't."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from formation_scenario import Scenario
from formation_scenario.vehicle_files import shipped_models

if TYPE_CHECKING:
    from formation_scenario.parameter_files import ParameterModel

FIRMWARE = {"ardupilot": "ArduPlane", "px4": "PX4"}


def parameter_models(scenario: Scenario) -> Iterator[tuple[list[str], ParameterModel]]:
    """Yield the model of each parameter file, and the vehicles whose it is; a file that has gone is left out."""
    whose = defaultdict[str, list[str]](list)
    for vehicle in scenario.vehicles:
        for model in {vehicle.model, vehicle.true_model} - {None}:
            if model is not None and isinstance(model.parameters, str):
                whose[model.parameters].append(str(vehicle.vehicle_id))
    if not whose:
        return
    from formation_scenario.parameter_files import ParameterFileError, of_file  # noqa: PLC0415 - few scenarios name one

    shipped = shipped_models()
    for file, vehicles in whose.items():
        try:
            found = of_file(Path(file), shipped)
        except ParameterFileError:
            continue
        yield vehicles, found


def parameter_text(scenario: Scenario) -> Iterator[str]:
    """Yield the lines about each file: taken, by default, not taken."""
    for vehicles, found in parameter_models(scenario):
        plural = "s" * (len(vehicles) > 1)
        count = f"{len(found.file.parameters)} parameters of {FIRMWARE[found.firmware]}"
        yield f"{found.file.file} (vehicle{plural} {', '.join(vehicles)}): {count}"
        taken = (f"{name} {found.file.parameters[name].value:g} as {key}" for name, key in found.taken.items())
        yield f"  taken: {', '.join(taken)}"
        if found.defaults:
            listed = ", ".join(f"{name} {value:g}" for name, value in found.defaults.items())
            yield f"  not in the file, taken by the firmware's default: {listed}"
        yield f"  not taken: {', '.join([*found.left, f'{found.others} others'])}; emulators answer with them"
        if found.file.directives:
            yield f"  not read: {'; '.join(found.file.directives)}"


def parameter_report(scenario: Scenario) -> list[dict[str, Any]]:
    """Return the same for `check --json`: values as in the file."""
    return [
        {
            "file": found.file.file,
            "vehicles": vehicles,
            "firmware": found.firmware,
            "taken": {
                name: {"value": found.file.parameters[name].value, "key": key} for name, key in found.taken.items()
            },
            "defaults": dict(found.defaults),
            "not_taken": [name for name in found.file.parameters if name not in found.taken],
            "not_read": list(found.file.directives),
        }
        for vehicles, found in parameter_models(scenario)
    ]
