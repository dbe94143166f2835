"""The model of the aircraft that a parameter file is of, and the account of what was taken from the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

from formation_scenario.parameter_files import arduplane, px4
from formation_scenario.parameter_files.taking import Taking, Wanted
from formation_scenario.parameter_files.text import ParameterFile, ParameterFileError, read_parameters
from formation_scenario.source import Key, Plain
from formation_scenario.vehicles import EnergyAirframe

Firmware = Literal["ardupilot", "px4"]
DIGITS: Final = 6
"""Significant digits of what is computed from parameters."""


@dataclass(frozen=True)
class ParameterModel:
    """A model from parameters, and what became of them."""

    file: ParameterFile
    firmware: Firmware
    model: Mapping[Key, Plain]
    taken: Mapping[str, str]
    """The parameters that were taken, and for each the key that it became."""
    defaults: Mapping[str, float]
    """Parameters that the file lacks, with the firmware's defaults, which were used."""

    @property
    def left(self) -> list[str]:
        """Names of the file that concern how it flies, but of which nothing is taken."""
        known = arduplane.CONCERN_FLIGHT if self.firmware == "ardupilot" else px4.CONCERN_FLIGHT
        return [name for name in self.file.parameters if name not in self.taken and name.startswith(known)]

    @property
    def others(self) -> int:
        """Number of the other parameters, which don't concern that."""
        return len(self.file.parameters) - len(self.taken) - len(self.left)


def of_file(path: Path, shipped: Mapping[str, Mapping[Key, Plain]]) -> ParameterModel:
    """Return the model of a parameter file; `shipped` has the models of the shipped vehicle files by name.

    Raises:
        ParameterFileError: it can't be read, isn't a fixed wing's, or has a value out of range.
    """
    return model_of(read_parameters(path), shipped)


def model_of(file: ParameterFile, shipped: Mapping[str, Mapping[Key, Plain]]) -> ParameterModel:
    """Return the model of a file's parameters.

    Raises:
        ParameterFileError: it isn't a fixed wing's, or a value is out of range.
    """
    take = Taking(file)
    if any(take.has(each) for each in px4.AIRSPEEDS):
        base = _numbers(shipped["px4"])
        return ParameterModel(file, "px4", _rounded(px4.px4_model(take, base)), take.taken, take.defaults)
    if any(take.has(each) for each in arduplane.AIRSPEEDS):
        plane = shipped["arduplane"]
        airframe = EnergyAirframe.model_validate(plane["airframe"]).model_dump()
        made = arduplane.arduplane_model(take, _numbers(airframe))
        return ParameterModel(file, "ardupilot", _rounded(made), take.taken, take.defaults)
    raise ParameterFileError(f"{file.file}: found no airspeed; allowed: a fixed wing's: {_names()}")


def _names() -> str:
    both: tuple[tuple[Wanted, ...], ...] = (arduplane.AIRSPEEDS, px4.AIRSPEEDS)
    return ", ".join(name.name for each in both for name in each[0].names)


def _numbers(keys: Mapping[Any, Any]) -> dict[str, float]:
    return {str(key): float(value) for key, value in keys.items() if isinstance(value, int | float)}


def _rounded(keys: Mapping[Key, Plain]) -> dict[Key, Plain]:
    found = dict[Key, Plain]()
    for key, value in keys.items():
        if isinstance(value, dict):
            found[key] = _rounded(value)
        else:
            found[key] = float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value
    return found
