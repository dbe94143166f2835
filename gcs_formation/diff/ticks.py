"""The rows of two time series, vehicle by vehicle and tick by tick: the first that differs in each column."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow.parquet as pq

from flight_model.arrays import Array, wrap
from formation_scenario.bounded_read import require_file
from gcs_formation.diff.difference import Difference, Tolerance

KEYS: Final = ("network", "vehicle")
ANGLE: Final = "_rad"
"""Ends the name of a column of angles, of which whole turns are no difference."""
_Columns = dict[str, Array]


def series_differences(one: Path, other: Path, allowed: Tolerance) -> Iterator[Difference]:
    """Yield columns that one run lacks, counts of rows, and for each column the first row beyond the tolerance.

    Raises:
        OSError: a series can't be read.
        ValueError: it isn't Parquet.
    """
    for each in (one, other):
        require_file(each)
    first, second = _read(one), _read(other)
    for name in dict.fromkeys([*first, *second]):
        if (name in first) != (name in second):
            yield Difference(
                one.name, name, None, *("there" if name in each else "missing" for each in (first, second))
            )
    shared = [name for name in first if name in second and name not in KEYS]
    for vehicle in sorted(_vehicles(first) | _vehicles(second)):
        a, b = _rows(first, vehicle, shared), _rows(second, vehicle, shared)
        counts = len(a["t_s"]), len(b["t_s"])
        if counts[0] != counts[1]:
            yield Difference(one.name, f"rows of vehicle {_text(vehicle)}", None, *counts)
        yield from _columns(one.name, vehicle, {name: (a[name], b[name]) for name in shared}, allowed)


def _columns(
    part: str, vehicle: tuple[int, int], pairs: dict[str, tuple[Array, Array]], allowed: Tolerance
) -> Iterator[Difference]:
    length = min(len(pairs["t_s"][0]), len(pairs["t_s"][1]))
    times_s = pairs["t_s"][0][:length]
    for name, (one, other) in pairs.items():
        a, b = one[:length], other[:length]
        differs = _differs(name, a, b, allowed)
        if not differs.any():
            continue
        row = int(np.argmax(differs))
        count = int(differs.sum())
        location = f"{name} of vehicle {_text(vehicle)}, in {count} of {length} ticks"
        if a.dtype.kind == "f" and count > 1:
            location += f", at most {_greatest(name, a, b):.3g}"
        yield Difference(part, location, float(times_s[row]), *(_plain(each[row]) for each in (a, b)))


def _differs(name: str, one: Array, other: Array, allowed: Tolerance) -> Array:
    if one.dtype.kind != "f" or other.dtype.kind != "f":
        return one != other
    same = (one == other) | (np.isnan(one) & np.isnan(other))
    if allowed.maximum is None:
        return ~same
    with np.errstate(invalid="ignore"):
        return ~same & ~(_difference(name, one, other) <= allowed.maximum)


def _difference(name: str, one: Array, other: Array) -> Array:
    difference = wrap(one - other) if name.endswith(ANGLE) else one - other
    return np.abs(difference)


def _greatest(name: str, one: Array, other: Array) -> float:
    """Return the greatest difference of numbers that both runs have; NaN if there is none."""
    both = np.isfinite(one) & np.isfinite(other)
    return float(_difference(name, one[both], other[both]).max()) if both.any() else math.nan


def _read(path: Path) -> _Columns:
    table = pq.read_table(path)
    return {name: table[name].to_numpy() for name in table.column_names}


def _vehicles(columns: _Columns) -> set[tuple[int, int]]:
    return set(zip(*(columns[key].tolist() for key in KEYS), strict=True))


def _rows(columns: _Columns, vehicle: tuple[int, int], names: list[str]) -> _Columns:
    mine = (columns["network"] == vehicle[0]) & (columns["vehicle"] == vehicle[1])
    return {name: columns[name][mine] for name in names}


def _plain(value: object) -> object:
    """Return a value of a column as Python's own."""
    return value.item() if isinstance(value, np.generic) else value


def _text(vehicle: tuple[int, int]) -> str:
    network, system = vehicle
    return str(system) if network == 1 else f"{network}:{system}"
