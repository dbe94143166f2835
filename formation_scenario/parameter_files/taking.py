"""Takes values from a parameter file by their names in any version of a firmware, and keeps account of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from formation_scenario.parameter_files.text import ParameterFile


class Name(NamedTuple):
    """A parameter's name in some versions, and its unit there."""

    name: str
    unit: float = 1.0


@dataclass(frozen=True)
class Wanted:
    """A parameter: its names, newest first, the firmware's default and the range that is allowed, in one unit."""

    names: tuple[Name, ...]
    default: float
    minimum: float
    maximum: float


@dataclass
class Taking:
    """What has been taken from a file."""

    file: ParameterFile
    taken: dict[str, str] = field(default_factory=dict[str, str])
    """Names of the file, and for each the key that it became."""
    defaults: dict[str, float] = field(default_factory=dict[str, float])
    """Newest names of those that the file lacks, and the firmware's default, which was used."""

    def has(self, wanted: Wanted) -> bool:
        """Return whether the file has a parameter, by any of its names."""
        return any(each.name in self.file.parameters for each in wanted.names)

    def value(self, wanted: Wanted, key: str) -> float:
        """Return a parameter's value, for the key `key` of a vehicle's model; the firmware's default if it is lacking.

        Raises:
            ParameterFileError: it is out of range.
        """
        for name, unit in wanted.names:
            found = self.file.parameters.get(name)
            if found is None:
                continue
            value = found.value * unit
            if not wanted.minimum <= value <= wanted.maximum:
                raise self.file.refused(name, f"{wanted.minimum / unit:g} to {wanted.maximum / unit:g}")
            self.taken[name] = key
            return value
        self.defaults[wanted.names[0].name] = wanted.default / wanted.names[0].unit
        return wanted.default


def wanted(default: float, minimum: float, maximum: float, *names: str | tuple[str, float]) -> Wanted:
    """Return a parameter by its names, newest first, each with its unit if that isn't the default's."""
    each = (Name(name) if isinstance(name, str) else Name(*name) for name in names)
    return Wanted(tuple(each), default, minimum, maximum)
