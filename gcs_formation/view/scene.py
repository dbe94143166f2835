"""What doesn't move on the page: the planned path, the fence, the ground, and the limits of bars."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from flight_model.arrays import Array
from flight_model.earth import GeodeticOrigin
from flight_model.path import PathError
from formation_scenario import Scenario
from gcs_formation.budget.traffic import BYTES_PER_KBIT, USABLE, rates_of
from gcs_formation.stability import scenario_delay_margin

POINTS = 600
"""Points of the path."""
GROUND_CELLS = 120
"""Cells of the ground along its longer side."""
AROUND_M = 1000.0
DIGITS = 1


def scene(scenario: Scenario) -> dict[str, Any]:
    """Return what a scenario says, for JSON: metres north and east of the origin, heights above it."""
    points, safety = _path(scenario), scenario.safety
    fence = scenario.fence
    areas = () if fence is None or fence.sides is None else fence.sides.areas
    return {
        "name": scenario.name,
        "shape": scenario.formation.shape,
        "spacing_m": scenario.formation.spacing_m,
        "frame": scenario.formation.frame,
        "leader": None if scenario.leader is None else str(scenario.leader.vehicle_id),
        "duration_s": scenario.duration_s,
        "rate_hz": scenario.law.rate_hz,
        "speed_mps": scenario.path.begin_mps,
        "separation_m": safety.separation_m,
        "avoidance_m": safety.kept_m,
        "origin": degrees(scenario.origin.geodetic),
        "radios": list(_radios(scenario)),
        "delay_margin_s": _finite(scenario_delay_margin(scenario)),
        "path": [] if points is None else rounded(points),
        "waypoints": rounded(np.array(scenario.path.waypoints_m)),
        "fence": [{"inside": each.inclusion, "corners": rounded(each.shape.edge_m())} for each in areas],
        "heights": [None, None] if fence is None else [_finite(each) for each in fence.heights_m],
        "ground": None if points is None else ground(scenario, points[:, :2].min(axis=0), points[:, :2].max(axis=0)),
    }


def degrees(origin: GeodeticOrigin) -> list[float]:
    """Return latitude and longitude of where positions count from, degrees: to lay a map beneath them."""
    return [float(np.rad2deg(each)) for each in (origin.lat_rad, origin.lon_rad)]


def _radios(scenario: Scenario) -> Iterator[dict[str, Any]]:
    """Yield the radios whose rate the scenario says: who shares it, kbit/s each way, and the share that may be used."""
    for index, vehicles in scenario.channel_members():
        rates = rates_of(scenario.links.channels[index])
        if rates is not None and vehicles:
            yield {
                "vehicles": [str(vehicle.vehicle_id) for vehicle in vehicles],
                "up_kbps": round(rates.up / BYTES_PER_KBIT, 3),
                "down_kbps": round(rates.down / BYTES_PER_KBIT, 3),
                "half_duplex": rates.half_duplex,
                "usable": USABLE,
            }


def _path(scenario: Scenario) -> Array | None:
    """Return points of the path (N, 3): north, east, height; None if it can't be flown any more."""
    try:
        path = scenario.leader_path
    except PathError:
        return None
    points = path.at(np.linspace(0.0, path.length_m, POINTS))
    return np.stack([points.north_m, points.east_m, points.height_m], axis=1)


def ground(scenario: Scenario, low: Array, high: Array) -> dict[str, Any] | None:
    """Return the terrain's heights on a grid around a rectangle, rows from south to north; None without terrain."""
    if scenario.terrain is None:
        return None
    low, high = low - AROUND_M, high + AROUND_M
    cell_m = float((high - low).max()) / GROUND_CELLS
    north, east = (np.arange(low_m, high_m, cell_m) for low_m, high_m in zip(low, high, strict=True))
    height = scenario.ground.height(*np.meshgrid(north, east, indexing="ij"))
    return {
        "south": round(float(low[0]), DIGITS),
        "west": round(float(low[1]), DIGITS),
        "cell": round(cell_m, 3),
        "columns": int(east.size),
        "height": [_finite(value, 0) for value in height.ravel().tolist()],
    }


def rounded(points: Array) -> list[list[float]]:
    """Return points to a decimetre."""
    found: list[list[float]] = (np.round(points, DIGITS) + 0.0).tolist()
    return found


def _finite(value: float, digits: int = 6) -> float | None:
    return round(float(value), digits) if np.isfinite(value) else None
