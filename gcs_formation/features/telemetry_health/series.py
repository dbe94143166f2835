"""Health by quantity and vehicle in a flight's time series: whether each was accepted at each tick."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from airlink.telemetry_faults import QUANTITIES
from flight_model.arrays import Array

HEALTHY: Final = "healthy_"
"""Begins the names of the columns; they are booleans."""


def spells(events: Iterable[Mapping[str, Any]]) -> dict[tuple[str, str], list[tuple[float, float]]]:
    """Return from when until when each vehicle's quantities weren't accepted, s; the last may have no end, infinite.

    Args:
        events: of a run, those of kind `health` among them.
    """
    found = dict[tuple[str, str], list[tuple[float, float]]]()
    for event in events:
        if event.get("kind") != "health":
            continue
        each = found.setdefault((str(event["vehicle"]), str(event["quantity"])), [])
        lasts = bool(each) and each[-1][1] == np.inf
        if event["healthy"] and lasts:
            each[-1] = each[-1][0], float(event["t_s"])
        elif not event["healthy"] and not lasts:
            each.append((float(event["t_s"]), np.inf))
    return found


def health_columns(events: Iterable[Mapping[str, Any]], vehicles: Sequence[str]) -> Callable[[Array], dict[str, Array]]:
    """Return what makes columns `healthy_QUANTITY`, (T, V), of times, (T,): false while it wasn't accepted.

    Args:
        events: of the run; without any of kind `health` there are no columns.
        vehicles: the V vehicles, as events name them.
    """
    found = spells(events)
    return lambda time_s: _columns(time_s, found, vehicles) if found else {}


def _columns(
    time_s: Array, found: Mapping[tuple[str, str], list[tuple[float, float]]], vehicles: Sequence[str]
) -> dict[str, Array]:
    columns = {f"{HEALTHY}{each}": np.ones((time_s.size, len(vehicles)), bool) for each in QUANTITIES}
    for (vehicle, quantity), each in found.items():
        for from_s, to_s in each:
            columns[f"{HEALTHY}{quantity}"][(time_s >= from_s) & (time_s < to_s), vehicles.index(vehicle)] = False
    return columns
