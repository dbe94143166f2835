"""The height of the ground, from files or hills, and the leader's path raised clear of it."""

from __future__ import annotations

import importlib
import re
from collections.abc import Sequence
from math import radians
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, overload

import numpy as np

from flight_model.arrays import Array
from flight_model.curve import PathPoint
from flight_model.earth import GeodeticOrigin
from flight_model.offset_curve import STEP_M
from flight_model.path import FlightPath, PathPoints
from flight_model.path_offsets import Bounds, ClearanceOffset, min_offset, sample_distances
from formation_scenario.bounded_read import read_bounded, require_file
from formation_scenario.fields import FileError
from formation_scenario.named_files import read_path
from formation_scenario.surroundings import Hill, Terrain

HGT_NAME = re.compile(r"^([NS])(\d{2})([EW])(\d{3})$", re.IGNORECASE)
HGT_VOID = -32768
MAX_HGT_BYTES = 100_000_000
"""Nearly four times a tile of one arc-second."""
MARGIN_M = 10_000.0
"""Distance around the waypoints for which a file is read."""
WGS_84 = "EPSG:4326"
ALLOWED = "a .hgt tile (N35E125.hgt), or a GeoTIFF with a coordinate system"
LEADER_SHARE = 0.7
"""Share of the climb limit that the raised path uses; followers and disturbances need the rest."""
ROUNDING_M = 1e-6
"""Allowance for rounding in upper bounds."""
FOLLOWER_SHARE = 0.85
"""Share of the climb limit that the path and a follower's own offset use together."""


class ElevationGrid(NamedTuple):
    """Ground heights by bilinear interpolation of elevations in latitude and longitude.

    Elevations are in m above sea level, NaN where void; row 0 is the northernmost. Positions are those of the values.
    """

    elevation_m: Array
    north_deg: float
    west_deg: float
    step_lat_deg: float
    step_lon_deg: float
    origin: GeodeticOrigin
    """Origin of north, east and height."""

    def height(self, north_m: Array, east_m: Array) -> Array:
        """Return the height above the origin; NaN outside the file, and beside a void."""
        (north_west, north_east, south_west, south_east), down, right = self._cell(north_m, east_m)
        upper = north_west + right * (north_east - north_west)
        lower = south_west + right * (south_east - south_west)
        return upper + down * (lower - upper) - self.origin.alt_m

    def bound_m(self, north_m: Array, east_m: Array, around_m: float) -> Array:
        """Return an upper bound of the heights within `around_m` of each point (n,): the highest value there."""
        rows, columns = self.elevation_m.shape
        up, left = self._at(north_m + around_m, east_m - around_m)
        down, right = self._at(north_m - around_m, east_m + around_m)
        first_row, last_row = np.clip(np.floor(up), 0, rows), np.clip(np.ceil(down) + 1, 0, rows)
        first, last = np.clip(np.floor(left), 0, columns), np.clip(np.ceil(right) + 1, 0, columns)
        windows = np.stack((first_row, last_row, first, last), axis=1).astype(np.intp).tolist()
        near = [np.nan_to_num(self.elevation_m[a:b, c:d], nan=-np.inf) for a, b, c, d in windows]
        highest = [values.max(initial=-np.inf) for values in near]
        return np.array(highest) - self.origin.alt_m + ROUNDING_M

    def _at(self, north_m: Array, east_m: Array) -> tuple[Array, Array]:
        """Return positions as rows from the top and columns from the left."""
        lat_rad, lon_rad = self.origin.positions(north_m, east_m)
        down = (self.north_deg - np.degrees(lat_rad)) / self.step_lat_deg
        return down, (np.degrees(lon_rad) - self.west_deg) / self.step_lon_deg

    def _cell(self, north_m: Array, east_m: Array) -> tuple[tuple[Array, ...], Array, Array]:
        """Return the four values around each point, and its position in the cell, down and right, 0 to 1."""
        values = self.elevation_m
        down, right = self._at(north_m, east_m)
        rows, columns = values.shape
        row = np.clip(np.floor(down), 0, rows - 2).astype(np.intp)
        column = np.clip(np.floor(right), 0, columns - 2).astype(np.intp)
        inside = (down >= 0) & (down <= rows - 1) & (right >= 0) & (right <= columns - 1)
        corners = (values[row, column], values[row, column + 1], values[row + 1, column], values[row + 1, column + 1])
        return tuple(np.where(inside, corner, np.nan) for corner in corners), down - row, right - column


def read_elevation(path: Path, origin: GeodeticOrigin, around_m: Array) -> ElevationGrid:
    """Return the ground of a file up to `MARGIN_M` around points (n, 2), m north and east.

    Raises:
        FileError: the file can't be read or isn't georeferenced, or rasterio isn't installed.
    """
    if path.suffix.lower() == ".hgt":
        return _read_hgt(path, origin)
    corners = np.array([around_m.min(axis=0) - MARGIN_M, around_m.max(axis=0) + MARGIN_M])
    lat_rad, lon_rad = origin.positions(*corners.T)
    (south, north), (west, east) = np.degrees(lat_rad).tolist(), np.degrees(lon_rad).tolist()
    return _read_geotiff(path, (west, south, east, north), origin)


def _read_hgt(path: Path, origin: GeodeticOrigin) -> ElevationGrid:
    """Return an SRTM tile: a square of big-endian 16-bit metres, named by its south-west corner."""
    try:
        raw = read_bounded(path, MAX_HGT_BYTES)
        values = np.frombuffer(raw[: len(raw) // 2 * 2], dtype=">i2").astype(np.float64)
    except OSError as error:
        raise FileError(f"found {path}: {error.strerror}") from error
    named = HGT_NAME.match(path.stem)
    if named is None:
        raise FileError(f"found {path.name}, which doesn't say where the tile lies")
    side = round(values.size**0.5)
    if side < 2 or side * side != values.size:
        raise FileError(f"found {path.name} with {values.size} values, which make no square")
    south = int(named[2]) * (1 if named[1].upper() == "N" else -1)
    west = int(named[4]) * (1 if named[3].upper() == "E" else -1)
    values[values == HGT_VOID] = np.nan
    step_deg = 1.0 / (side - 1)
    return ElevationGrid(values.reshape(side, side), south + 1.0, float(west), step_deg, step_deg, origin)


def _read_geotiff(path: Path, bounds_deg: tuple[float, float, float, float], origin: GeodeticOrigin) -> ElevationGrid:
    """Return the part of a file within west, south, east, north; other projections are warped to WGS 84."""
    try:
        require_file(path)
    except OSError as error:
        raise FileError(f"found {path}: {error.strerror}") from error
    try:
        rasterio: Any = importlib.import_module("rasterio")
        vrt: Any = importlib.import_module("rasterio.vrt")
        windows: Any = importlib.import_module("rasterio.windows")
    except ImportError as error:
        found = f"found {path.name}, and rasterio isn't installed: pip install 'gcs-formation[terrain]'"
        raise FileError(found) from error
    try:
        with rasterio.open(read_path(path)) as file:
            for part in file.files:  # a file beside it with its scale, or those that a .vrt joins
                read_path(Path(part))
            if file.crs is None:
                raise FileError(f"found {path.name} without a coordinate system")
            with vrt.WarpedVRT(file, crs=WGS_84, resampling=rasterio.enums.Resampling.bilinear) as warped:
                dataset: Any = file if file.crs.is_geographic else warped
                whole = windows.Window(0, 0, dataset.width, dataset.height)
                wanted = windows.from_bounds(*bounds_deg, dataset.transform).round_offsets().round_lengths()
                window = wanted.intersection(whole)
                values = dataset.read(1, window=window, masked=True).astype(np.float64).filled(np.nan)
                transform: Any = dataset.window_transform(window)
    except (rasterio.errors.RasterioError, windows.WindowError) as error:
        raise FileError(f"found {path}: {error}") from error
    if min(values.shape) < 2 or transform.b or transform.d or transform.e >= 0:
        raise FileError(f"found {path.name} without values in rows from north to south there")
    return ElevationGrid(
        values, transform.f + transform.e / 2, transform.c + transform.a / 2, -transform.e, transform.a, origin
    )


class Hills:
    """Level ground with hills, which add up, by the formulas of `surroundings.Hill`."""

    def __init__(self, base_m: float, hills: Sequence[Hill]) -> None:
        self._base_m = base_m
        rows = [(each.north_m, each.east_m, each.height_m, each.radius_m, each.length_m / 2.0) for each in hills]
        columns = np.array(rows, dtype=np.float64).reshape(-1, 5).T.copy()
        self._north_m, self._east_m, self._height_m, self._radius_m, self._half_m = columns
        bearing = np.array([radians(hill.bearing_deg) for hill in hills])
        self._cosine, self._sine = np.cos(bearing), np.sin(bearing)
        self._round = np.flatnonzero([hill.shape == "cosine" for hill in hills])
        """Indices of the hills with the shape `cosine`."""

    def height(self, north_m: Array, east_m: Array) -> Array:
        """Return the ground's height, m above the scenario's origin; arrays of m have any common shape."""
        return self._base_m + self._share(self._squared_m2(north_m, east_m) / self._radius_m**2) @ self._height_m

    def bound_m(self, north_m: Array, east_m: Array, around_m: float) -> Array:
        """Return an upper bound of the heights within `around_m` of each point (n,), which is fast to compute.

        As heights decrease with the distance from crest lines, each hill is taken at its nearest possible distance and
        each hollow at its farthest.
        """
        away_m = np.sqrt(self._squared_m2(north_m, east_m))
        nearest_m = np.where(self._height_m > 0.0, np.maximum(away_m - around_m, 0.0), away_m + around_m)
        return self._base_m + self._share((nearest_m / self._radius_m) ** 2) @ self._height_m + ROUNDING_M

    def _squared_m2(self, north_m: Array, east_m: Array) -> Array:
        """Return the squared distances from the crest lines (..., H)."""
        north, east = north_m[..., None] - self._north_m, east_m[..., None] - self._east_m
        along = north * self._cosine + east * self._sine
        across = east * self._cosine - north * self._sine
        beyond = np.maximum(np.abs(along) - self._half_m, 0.0)  # distance beyond the ends of the crest line
        return beyond**2 + across**2

    def _share(self, squared: Array) -> Array:
        """Return the share of each hill's height at squared distances relative to its radius, (..., H)."""
        share = np.exp(-squared / 2)
        if self._round.size:
            share[..., self._round] = np.cos(np.pi / 2 * np.sqrt(np.minimum(squared[..., self._round], 1.0))) ** 2
        return share


Ground: TypeAlias = Hills | ElevationGrid


def ground_of(terrain: Terrain | None, origin: GeodeticOrigin, waypoints_m: Array) -> Ground:
    """Return the ground around waypoints (n, 3); without terrain, a plain at the origin's height.

    Raises:
        FileError: the elevation file can't be read.
    """
    if terrain is None:
        return Hills(0.0, ())
    if terrain.file is None:
        return Hills(terrain.base_m, terrain.hills)
    return read_elevation(Path(terrain.file), origin, waypoints_m[:, :2])


class ClearPath(FlightPath):
    """A path with a clearance offset, which is 0 at the path's start; the straight run-in before it is level."""

    def __init__(self, written: FlightPath, clearance_offset: ClearanceOffset) -> None:
        """Take the path as written, and the offset from 0 to its length."""
        vars(self).update(vars(written))  # the same curve, without fitting it again
        self.clearance_offset = clearance_offset

    @overload
    def at(self, s: float) -> PathPoint: ...
    @overload
    def at(self, s: Array) -> PathPoints: ...
    def at(self, s: float | Array) -> PathPoint | PathPoints:
        """Return the raised path at an arc length in m, or at an array of them."""
        if not isinstance(s, np.ndarray):
            up_m, *changes = self.clearance_offset.at_one(min(max(s, 0.0), self.length_m))
            return super().at(s).raised(up_m, *(changes if 0.0 <= s <= self.length_m else (0.0, 0.0)))
        inside, points = np.clip(s, 0.0, self.length_m), super().at(s)
        offset_m, slope, curvature = self.clearance_offset.at(inside)
        on_path = s == inside
        return points._replace(
            height_m=points.height_m + offset_m,
            slope=points.slope + np.where(on_path, slope, 0.0),
            slope_rate_1pm=points.slope_rate_1pm + np.where(on_path, curvature, 0.0),
        )


def with_clearance(written: FlightPath, ground: Ground, clearance_m: float, bounds: Bounds) -> ClearPath:
    """Return a path raised to `clearance_m` above the ground, as far as `bounds` allow."""
    distances_m = sample_distances(0.0, max(1, int(np.ceil(written.length_m / STEP_M))))
    points = written.at(distances_m)
    needed = ground.height(points.north_m, points.east_m) + clearance_m - points.height_m
    return ClearPath(written, min_offset(0.0, needed, points.slope, bounds, np.zeros(3)))
