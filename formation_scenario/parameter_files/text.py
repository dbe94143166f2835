"""The text of parameter files: ArduPilot's (.parm, .param) and QGroundControl's, PX4's own (.params).

ArduPilot's, of Mission Planner, MAVProxy and the firmware's source: a name and a value a line, separated by a comma,
blanks, a tab or `=`; what follows on the line is a remark. QGroundControl's has five columns, separated by tabs:
vehicle, component, name, value, MAV_PARAM_TYPE. `#` begins a comment. As when a ground station sets them line by line,
the last value of a name counts. Sources: MAVProxy's `param load`; MAVLink guide, "Parameter Files".
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from formation_scenario.bounded_read import read_bounded
from formation_scenario.fields import FileError

MAX_BYTES: Final = 2_000_000
MAX_PARAMETERS: Final = 10_000
"""Real autopilots have up to 2,000."""
NAME: Final = re.compile(r"[A-Z][A-Z0-9_]{0,39}")
MAX_LETTERS: Final = 16
"""Of a name in MAVLink; a longer one, mostly a mistake, is no parameter of any autopilot."""
SEPARATORS: Final = re.compile(r"[\s,=]+")
MAX_VALUE: Final = 3.5e38
"""Values are 32-bit floats."""
ALLOWED: Final = "NAME VALUE (also with a comma, a tab or =), or QGroundControl's five columns"


class ParameterFileError(FileError):
    """A parameter file that can't be used: the message says what was found, where, and what is allowed."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter's value, the line that it stands on, and its MAV_PARAM_TYPE if the file says."""

    value: float
    line: int
    type: int | None = None


@dataclass(frozen=True)
class ParameterFile:
    """A file's parameters by name, in its order, and lines that aren't followed: `@include`, names no parameter has."""

    file: str
    parameters: Mapping[str, Parameter]
    directives: tuple[str, ...] = ()

    def refused(self, name: str, allowed: str) -> ParameterFileError:
        """Return the refusal of a parameter's value."""
        own = self.parameters[name]
        return ParameterFileError(f"{self.file}: line {own.line}: {name}: found {own.value:g}; allowed: {allowed}")


def read_parameters(path: Path) -> ParameterFile:
    """Return the parameters of a file.

    Raises:
        ParameterFileError: it can't be read, or a line is neither a parameter nor a comment.
    """
    try:
        raw = read_bounded(path, MAX_BYTES)
    except OSError as error:
        raise ParameterFileError(f"{path}: {error.strerror or error}") from error
    return parse(raw.decode("utf-8-sig", "replace"), str(path))


def parse(text: str, file: str) -> ParameterFile:
    """Return the parameters in a file's text; `file` names it in messages.

    Raises:
        ParameterFileError: a line is neither a parameter nor a comment, or there are none, or too many.
    """
    found, directives = dict[str, Parameter](), list[str]()
    for line, row in enumerate(text.splitlines(), 1):
        cells = [each for each in SEPARATORS.split(row.partition("#")[0].strip()) if each]
        if not cells or cells[0].startswith("//"):
            continue
        if cells[0].startswith("@"):
            directives.append(f"line {line}: {' '.join(cells)[:60]}")
            continue
        name, parameter = _parameter(cells, f"{file}: line {line}", line)
        if len(name) > MAX_LETTERS:
            directives.append(f"line {line}: {name}, longer than a parameter's name")
            continue
        found[name] = parameter
        if len(found) > MAX_PARAMETERS:
            raise ParameterFileError(f"{file}: line {line}: found more than {MAX_PARAMETERS} parameters")
    if not found:
        raise ParameterFileError(f"{file}: found no parameter; allowed: lines with {ALLOWED}")
    return ParameterFile(file, found, tuple(directives))


def _parameter(cells: list[str], where: str, line: int) -> tuple[str, Parameter]:
    kind: int | None = None
    if len(cells) >= 4 and cells[0].isdecimal() and cells[1].isdecimal():
        kind = int(cells[4]) if len(cells) > 4 and cells[4].isdecimal() and len(cells[4]) < 4 else None
        cells = cells[2:4]
    if len(cells) < 2 or NAME.fullmatch(cells[0].upper()) is None:
        raise ParameterFileError(f"{where}: found {' '.join(cells)[:60]!r}; allowed: {ALLOWED}")
    value = _number(cells[1])
    if not abs(value) <= MAX_VALUE:
        raise ParameterFileError(f"{where}: {cells[0][:16]}: found {cells[1][:40]!r}; allowed: a number")
    return cells[0].upper(), Parameter(value, line, kind)


def _number(text: str) -> float:
    """Return a value; NaN for what is none. Masks are also written as hexadecimal numbers."""
    try:
        return float(int(text, 16)) if text.lower().startswith("0x") and len(text) <= 10 else float(text)
    except ValueError:
        return math.nan
