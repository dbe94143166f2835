"""The data that the page's own plots draw: every extreme of the errors, the tracks thinned out."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from airlink.identity import VehicleId
from formation_scenario import ground_of
from gcs_formation.arrays import Array
from gcs_formation.record.timeseries import GROUND
from gcs_formation.report.downsample import Indices, evenly, extremes
from gcs_formation.report.error_figure import transient_end_s
from gcs_formation.report.geometry import heading_rad, path_m
from gcs_formation.report.gusts import gusts
from gcs_formation.report.lines import Group, everyone
from gcs_formation.report.marks import marks
from gcs_formation.report.run_data import RunData
from gcs_formation.report.style import FOLLOWERS

ERROR_POINTS = 80_000
TRACK_NUMBERS = 100_000
"""What all series together may have; a page of 100 vehicles is then below 2 MB of data."""
FEWEST_BUCKETS, MOST_BUCKETS = 50, 1500
MOST_TRACK_POINTS = 1500
PATH_POINTS = 400
GROUND_CELLS = 120
"""Along the longer side of the ground that is shown."""
GROUND_AROUND_M = 1000.0
ERROR_DIGITS, PLACE_DIGITS, ANGLE_DIGITS, TIME_DIGITS = 4, 1, 3, 2


def embedded(run: RunData) -> dict[str, Any]:
    """Return the data of the page's plots, ready for JSON; times are mission times in s, unknown values None."""
    group = everyone(run)
    names = list(group.vehicles)
    return {
        "begun": run.begun,
        "flown_s": _rounded(run.time_s[[0, -1]], TIME_DIGITS),
        "steady_s": transient_end_s(run),
        "vehicles": [_vehicle(run, vehicle) for vehicle in names],
        "worst": [names.index(vehicle) for vehicle in run.worst_first()],
        "errors": _errors(run, group),
        "tracks": _tracks(run, group),
        "path": _path(run),
        "ground": _ground(run),
        "bounds": _bounds(run),
        "marks": [{"t": round(mark.time_s, TIME_DIGITS), "label": mark.label} for mark in marks(run)],
    }


def as_script(data: dict[str, Any]) -> str:
    """Return JSON in which nothing can end the script element around it."""
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _vehicle(run: RunData, vehicle: VehicleId) -> dict[str, Any]:
    if vehicle == run.leader:
        return {"name": str(vehicle), "role": "leader", "colour": None}
    return {
        "name": str(vehicle),
        "role": "follower",
        "colour": FOLLOWERS[run.followers.index(vehicle) % len(FOLLOWERS)],
    }


def _errors(run: RunData, group: Group) -> list[dict[str, Any]]:
    """Return each follower's errors at their extremes, with the times of these."""
    count = max(len(run.followers), 1)
    buckets = int(np.clip(ERROR_POINTS // (6 * count), FEWEST_BUCKETS, MOST_BUCKETS))
    time_s = run.whole_time_s
    found: list[dict[str, Any]] = []
    for index, vehicle in enumerate(group.vehicles):
        if vehicle not in run.followers:
            continue
        error_m = run.whole.error(vehicle)
        axes = zip("xyz", error_m.T, strict=True)
        series = {axis: _series(time_s, values, extremes(values, buckets)) for axis, values in axes}
        found.append({"vehicle": index, **series})
    return found


def _bounds(run: RunData) -> list[dict[str, Any]]:
    """Return the bounds on errors after gusts that act on followers only, and the least errors possible."""
    return [
        {
            "axis": error.axis,
            "from": round(gust.at_s, TIME_DIGITS),
            "to": round(gust.to_s, TIME_DIGITS),
            "allowed": round(error.allowed_m, ERROR_DIGITS),
            "least": round(error.least_m, ERROR_DIGITS),
        }
        for gust in gusts(run)
        for error in gust.errors
    ]


def _series(time_s: Array, values: Array, kept: Indices) -> dict[str, Any]:
    return {"t": _rounded(time_s[kept], TIME_DIGITS), "v": _rounded(values[kept], ERROR_DIGITS)}


def _tracks(run: RunData, group: Group) -> dict[str, Any]:
    points = min(MOST_TRACK_POINTS, TRACK_NUMBERS // (5 * len(group.vehicles)))
    kept = evenly(run.clock_s.size, points)
    return {
        "t": _rounded(run.whole_time_s[kept], TIME_DIGITS),
        "vehicles": [_track(run, vehicle, kept) for vehicle in group.vehicles],
    }


def _track(run: RunData, vehicle: VehicleId, kept: Indices) -> dict[str, Any]:
    north, east, height = run.whole.place(vehicle)[kept].T
    heading = heading_rad(run.whole, vehicle)[kept]
    known = np.isfinite(heading)
    heading[known] = np.unwrap(heading[known])
    return {
        "north": _rounded(north, PLACE_DIGITS),
        "east": _rounded(east, PLACE_DIGITS),
        "height": _rounded(height, PLACE_DIGITS),
        "below": _rounded(run.whole.vehicles[vehicle][GROUND[0]][kept], PLACE_DIGITS),
        "heading": _rounded(heading, ANGLE_DIGITS),
    }


def _path(run: RunData) -> dict[str, Any]:
    path = path_m(run)
    north, east, _ = path[evenly(len(path), PATH_POINTS)].T
    return {"north": _rounded(north, PLACE_DIGITS), "east": _rounded(east, PLACE_DIGITS)}


def _ground(run: RunData) -> dict[str, Any] | None:
    """Return the terrain's heights on a grid around the tracks, rows from south to north; None without terrain."""
    if run.scenario.terrain is None:
        return None
    places = np.concatenate([run.flown.place(vehicle)[:, :2] for vehicle in run.flown.vehicles])
    known = places[np.isfinite(places).all(axis=1)]
    known = known if known.size else np.zeros((1, 2))
    low, high = known.min(axis=0) - GROUND_AROUND_M, known.max(axis=0) + GROUND_AROUND_M
    cell_m = float((high - low).max()) / GROUND_CELLS
    north, east = (np.arange(least, most, cell_m) for least, most in zip(low, high, strict=True))
    height = ground_of(run.scenario).height(*np.meshgrid(north, east, indexing="ij"))
    return {
        "south": round(float(low[0]), PLACE_DIGITS),
        "west": round(float(low[1]), PLACE_DIGITS),
        "cell": round(cell_m, 3),
        "columns": int(east.size),
        "height": _rounded(height.ravel(), 0),
    }


def _rounded(values: Array, digits: int) -> list[float | None]:
    # Adding 0 turns -0.0 into 0.0, which is shorter and looks better.
    return [value if np.isfinite(value) else None for value in (np.round(values, digits) + 0.0).tolist()]
