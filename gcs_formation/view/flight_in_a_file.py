"""The page's parts in a file that needs no server: what a report holds of a flight, and the scripts that show it."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from itertools import pairwise
from typing import Any

import numpy as np

from flight_model.arrays import Array, Indices
from gcs_formation.view.recording import COLUMN, ERROR, Recording, Rows, State, Times, chosen, described, packed

SCRIPTS = (
    *("vendor/uplot.min.js", "vendor/three.min.js", "data.js", "look.js", "clock.js", "texts.js", "picture.js"),
    *("camera.js", "tiles.js", "plan.js", "space.js", "markers.js", "plots.js", "panels.js", "links.js"),
    *("orders.js", "timebar.js", "page.js"),
)
STYLES = ("vendor/uplot.min.css", "view.css")
MAX_ROWS = 10_000
"""Rows in a file: with their 140 bytes each, and a third more as text, they stay below 1.9 MB."""


@dataclass(frozen=True)
class WholeFlight:
    """A recording that is in memory."""

    vehicles: Sequence[str]
    times: Times
    table: Rows
    events: Sequence[Mapping[str, Any]]
    phases: Sequence[str]
    still: Mapping[str, Any]
    state: State = "ended"
    generation: int = 0

    def rows(self, ticks: Indices) -> Rows:
        """Return the rows of some ticks."""
        return self.table[ticks]

    def scene(self) -> Mapping[str, Any]:
        """Return what doesn't move."""
        return self.still

    def poll(self, wall_s: float) -> None:
        """Do nothing: it is whole."""


def telling(recording: Recording, rows: int = MAX_ROWS) -> Indices:
    """Return few ticks that tell most: evenly spaced ones, and those at which a vehicle's error is largest nearby."""
    count, vehicles = recording.times.time_s.size, len(recording.vehicles)
    even = chosen(count, vehicles, 0, count, rows // 2)
    if even.size == count:
        return even
    error: Array = np.abs(recording.rows(np.arange(count))[:, :, [COLUMN[name] for name in ERROR]]).astype(np.float64)
    worst = np.where(np.isfinite(error), error, -1.0).max(axis=(1, 2))
    largest = [begin + int(np.argmax(worst[begin:end])) for begin, end in pairwise(even)]
    return np.unique(np.concatenate([even, np.array(largest, dtype=np.intp)]))


def embedded(recording: Recording) -> dict[str, Any]:
    """Return what a file's page reads instead of asking a server, for JSON."""
    ticks = packed(recording, telling(recording))
    return {
        "meta": described(recording) | {"orders": False},
        "events": list(recording.events),
        "ticks": b64encode(ticks).decode("ascii"),
    }


def script() -> str:
    """Return all scripts of the page, one after another."""
    return "\n".join(_part(name) for name in SCRIPTS)


def style() -> str:
    """Return all its styles."""
    return "\n".join(_part(name) for name in STYLES)


def _part(name: str) -> str:
    directory = files("gcs_formation.view") / "static"
    for folder in name.split("/"):
        directory /= folder
    return directory.read_text(encoding="utf-8")
