"""Ground heights from elevation files: SRTM tiles (.hgt) by numpy, GeoTIFF and other formats by rasterio (an extra)."""

from __future__ import annotations

import importlib
import re
from math import radians
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flight_model.arrays import Array
from flight_model.earth import GeodeticOrigin

HGT_NAME = re.compile(r"^([NS])(\d{2})([EW])(\d{3})$", re.IGNORECASE)
HGT_VOID = -32768
MARGIN_M = 10_000.0
"""How far around the waypoints a file is read."""
WGS_84 = "EPSG:4326"
ALLOWED = "a .hgt tile (N35E125.hgt), or a GeoTIFF with a coordinate system"


class ElevationError(Exception):
    """An elevation file that can't be used; the message says what was found."""


class Raster(NamedTuple):
    """Elevations, m above sea level, NaN where void; row 0 is the northernmost. Positions are those of the values."""

    elevation_m: Array
    north_deg: float
    west_deg: float
    step_lat_deg: float
    step_lon_deg: float


class ElevationGrid:
    """Ground heights by bilinear interpolation of a raster in latitude and longitude."""

    def __init__(self, raster: Raster, origin: GeodeticOrigin) -> None:
        """Take the raster, and the origin of north, east and height."""
        self._raster = raster
        self._origin = origin

    def height(self, north_m: Array, east_m: Array) -> Array:
        """Return the height above the origin; NaN outside the file, and beside a void."""
        (north_west, north_east, south_west, south_east), down, right = self._cell(north_m, east_m)
        upper = north_west + right * (north_east - north_west)
        lower = south_west + right * (south_east - south_west)
        return upper + down * (lower - upper) - self._origin.alt_m

    def _cell(self, north_m: Array, east_m: Array) -> tuple[tuple[Array, ...], Array, Array]:
        """Return the four values around each point, and its position in the cell, down and right, 0 to 1."""
        raster = self._raster
        lat_rad, lon_rad = self._origin.places(north_m, east_m)
        down = (raster.north_deg - np.degrees(lat_rad)) / raster.step_lat_deg
        right = (np.degrees(lon_rad) - raster.west_deg) / raster.step_lon_deg
        rows, columns = raster.elevation_m.shape
        row = np.clip(np.floor(down), 0, rows - 2).astype(np.intp)
        column = np.clip(np.floor(right), 0, columns - 2).astype(np.intp)
        inside = (down >= 0) & (down <= rows - 1) & (right >= 0) & (right <= columns - 1)
        values = raster.elevation_m
        corners = (values[row, column], values[row, column + 1], values[row + 1, column], values[row + 1, column + 1])
        return tuple(np.where(inside, corner, np.nan) for corner in corners), down - row, right - column


def read_elevation(file: str, lat_deg: float, lon_deg: float, alt_m: float, around_m: Array) -> ElevationGrid:
    """Return the ground of a file up to `MARGIN_M` around points (n, 2), m north and east.

    Raises:
        ElevationError: the file can't be read or isn't georeferenced, or rasterio isn't installed.
    """
    path, origin = Path(file), GeodeticOrigin(radians(lat_deg), radians(lon_deg), alt_m)
    if path.suffix.lower() == ".hgt":
        return ElevationGrid(_read_hgt(path), origin)
    corners = np.array([around_m.min(axis=0) - MARGIN_M, around_m.max(axis=0) + MARGIN_M])
    lat_rad, lon_rad = origin.places(*corners.T)
    (south, north), (west, east) = np.degrees(lat_rad).tolist(), np.degrees(lon_rad).tolist()
    return ElevationGrid(_read_geotiff(path, (west, south, east, north)), origin)


def _read_hgt(path: Path) -> Raster:
    """Return an SRTM tile: a square of big-endian 16-bit metres, named by its south-west corner."""
    try:
        values = np.fromfile(path, dtype=">i2").astype(np.float64)
    except OSError as error:
        raise ElevationError(f"found {path}: {error.strerror}") from error
    named = HGT_NAME.match(path.stem)
    if named is None:
        raise ElevationError(f"found {path.name}, which doesn't say where the tile lies")
    side = round(values.size**0.5)
    if side < 2 or side * side != values.size:
        raise ElevationError(f"found {path.name} with {values.size} values, which make no square")
    south = int(named[2]) * (1 if named[1].upper() == "N" else -1)
    west = int(named[4]) * (1 if named[3].upper() == "E" else -1)
    values[values == HGT_VOID] = np.nan
    return Raster(values.reshape(side, side), south + 1.0, float(west), 1.0 / (side - 1), 1.0 / (side - 1))


def _read_geotiff(path: Path, bounds_deg: tuple[float, float, float, float]) -> Raster:
    """Return the part of a file within west, south, east, north; other projections are warped to WGS 84."""
    try:
        rasterio: Any = importlib.import_module("rasterio")
        vrt: Any = importlib.import_module("rasterio.vrt")
        windows: Any = importlib.import_module("rasterio.windows")
    except ImportError as error:
        found = f"found {path.name}, and rasterio isn't installed: pip install 'gcs-formation[terrain]'"
        raise ElevationError(found) from error
    try:
        with rasterio.open(path) as file:
            if file.crs is None:
                raise ElevationError(f"found {path.name} without a coordinate system")
            with vrt.WarpedVRT(file, crs=WGS_84, resampling=rasterio.enums.Resampling.bilinear) as warped:
                dataset: Any = file if file.crs.is_geographic else warped
                whole = windows.Window(0, 0, dataset.width, dataset.height)
                wanted = windows.from_bounds(*bounds_deg, dataset.transform).round_offsets().round_lengths()
                window = wanted.intersection(whole)
                values = dataset.read(1, window=window, masked=True).astype(np.float64).filled(np.nan)
                place: Any = dataset.window_transform(window)
    except (rasterio.errors.RasterioError, windows.WindowError) as error:
        raise ElevationError(f"found {path}: {error}") from error
    if min(values.shape) < 2 or place.b or place.d or place.e >= 0:
        raise ElevationError(f"found {path.name} without values in rows from north to south there")
    return Raster(values, place.f + place.e / 2, place.c + place.a / 2, -place.e, place.a)
