import math
from typing import Any

import numpy as np
import pytest

from flight_model.earth import GeodeticOrigin
from formation_scenario.fields import FileError
from formation_scenario.surroundings import Hill
from formation_scenario.terrain import ElevationGrid, Hills, read_elevation

ORIGIN = GeodeticOrigin(math.radians(35.5), math.radians(125.5), 20.0)
NEAR = np.array([[0.0, 0.0], [500.0, 500.0]])


def hill(**keys: Any) -> Hill:
    plain: dict[str, Any] = {"north_m": 100.0, "east_m": 50.0, "height_m": 80.0, "radius_m": 200.0}
    return Hill(**plain | keys)


def height(ground, north: float, east: float) -> float:
    return float(ground.height(np.array([north]), np.array([east]))[0])


def plane(north_deg: float, west_deg: float, step_deg: float, rows: int, columns: int) -> np.ndarray:
    """Return elevations that rise 1000 m per degree northwards and 500 m eastwards, from 100 m at 35.5, 125.5."""
    lat = north_deg - step_deg * np.arange(rows)[:, None]
    lon = west_deg + step_deg * np.arange(columns)
    return 100.0 + 1000.0 * (lat - 35.5) + 500.0 * (lon - 125.5)


def test_hills_have_the_heights_of_their_formulas():
    gaussian = Hills(10.0, [hill()])
    assert height(gaussian, 100.0, 50.0) == pytest.approx(90.0)
    assert height(gaussian, 300.0, 50.0) == pytest.approx(10.0 + 80.0 * math.exp(-0.5))
    cosine = Hills(0.0, [hill(shape="cosine")])
    assert height(cosine, 200.0, 50.0) == pytest.approx(40.0)
    assert height(cosine, 100.0, 250.0) == pytest.approx(0.0)
    assert height(Hills(0.0, [hill(), hill(height_m=-30.0)]), 100.0, 50.0) == pytest.approx(50.0)


def test_a_ridge_is_level_along_its_crest_and_a_hill_across_it_and_beyond_its_ends():
    ridge = Hills(0.0, [hill(length_m=600.0, bearing_deg=90.0)])
    single = Hills(0.0, [hill()])
    assert height(ridge, 100.0, 350.0) == pytest.approx(80.0)
    assert height(ridge, 220.0, -250.0) == pytest.approx(height(single, 220.0, 50.0))
    assert height(ridge, 100.0, 450.0) == pytest.approx(height(single, 100.0, 150.0))


def test_a_raster_is_bilinear_in_latitude_and_longitude_and_counts_from_the_origin():
    ground = ElevationGrid(plane(35.51, 125.49, 0.001, 21, 21), 35.51, 125.49, 0.001, 0.001, ORIGIN)
    assert height(ground, 0.0, 0.0) == pytest.approx(80.0, abs=1e-6)
    lat, lon, _ = ORIGIN.from_ned(456.0, -321.0, 0.0)
    expected = 80.0 + 1000.0 * (math.degrees(lat) - 35.5) + 500.0 * (math.degrees(lon) - 125.5)
    assert height(ground, 456.0, -321.0) == pytest.approx(expected, abs=1e-6)
    assert math.isnan(height(ground, 5000.0, 0.0))


def test_an_hgt_tile_is_placed_by_its_name_and_its_voids_are_unknown(tmp_path):
    values = np.round(plane(36.0, 125.0, 0.01, 101, 101)).astype(">i2")
    values[50, 51] = -32768
    values.tofile(tmp_path / "N35E125.hgt")
    ground = read_elevation(tmp_path / "N35E125.hgt", ORIGIN, NEAR)
    assert height(ground, 0.0, -1.0) == pytest.approx(80.0, abs=0.1)
    east_of_it = ORIGIN.to_ned(math.radians(35.5), math.radians(125.52), 0.0)[1]
    assert height(ground, 0.0, east_of_it) == pytest.approx(90.0, abs=0.1)
    assert math.isnan(height(ground, 1.0, 300.0))


@pytest.mark.parametrize(("name", "count", "said"), [("tile.hgt", 9, "where the tile lies"), ("N35E125.hgt", 8, "8")])
def test_a_tile_without_a_position_or_that_is_no_square_is_refused(tmp_path, name, count, said):
    np.zeros(count, dtype=">i2").tofile(tmp_path / name)
    with pytest.raises(FileError, match=said):
        read_elevation(tmp_path / name, ORIGIN, NEAR)


def write_geotiff(path, values, crs, transform) -> None:
    rasterio = pytest.importorskip("rasterio")
    rows, columns = values.shape
    keys = {"driver": "GTiff", "count": 1, "dtype": "float32", "nodata": -9999.0}
    with rasterio.open(path, "w", height=rows, width=columns, crs=crs, transform=transform, **keys) as file:
        file.write(values.astype(np.float32), 1)


def test_a_geotiff_has_its_values_at_the_centres_of_pixels(tmp_path):
    affine = pytest.importorskip("affine")
    values = plane(35.6, 125.4, 0.001, 201, 201)
    values[95, 120] = -9999.0
    corner = affine.Affine(0.001, 0.0, 125.4 - 0.0005, 0.0, -0.001, 35.6 + 0.0005)
    write_geotiff(tmp_path / "a.tif", values, "EPSG:4326", corner)
    ground = read_elevation(tmp_path / "a.tif", ORIGIN, NEAR)
    assert height(ground, 0.0, 0.0) == pytest.approx(80.0, abs=1e-3)
    lat, lon, _ = ORIGIN.from_ned(3456.0, -321.0, 0.0)
    expected = 80.0 + 1000.0 * (math.degrees(lat) - 35.5) + 500.0 * (math.degrees(lon) - 125.5)
    assert height(ground, 3456.0, -321.0) == pytest.approx(expected, abs=1e-3)
    void = ORIGIN.to_ned(math.radians(35.505), math.radians(125.52), 0.0)
    assert math.isnan(height(ground, *void[:2]))


def test_a_geotiff_in_another_projection_is_warped(tmp_path):
    affine = pytest.importorskip("affine")
    warp = pytest.importorskip("rasterio.warp")
    (east,), (north,) = warp.transform("EPSG:4326", "EPSG:32651", [125.5], [35.5])
    values = 100.0 + 0.1 * np.arange(400)[None, :] * 10.0 + np.zeros((400, 1))
    corner = affine.Affine(10.0, 0.0, east - 2005.0, 0.0, -10.0, north + 2005.0)
    write_geotiff(tmp_path / "utm.tif", values, "EPSG:32651", corner)
    ground = read_elevation(tmp_path / "utm.tif", ORIGIN, NEAR)
    for east_m in (0.0, 1000.0):
        lat, lon, _ = ORIGIN.from_ned(300.0, east_m, 0.0)
        (column,), _ = warp.transform("EPSG:4326", "EPSG:32651", [math.degrees(lon)], [math.degrees(lat)])
        assert height(ground, 300.0, east_m) == pytest.approx(80.0 + 200.0 + 0.1 * (column - east), abs=0.5)


def test_many_positions_on_the_earth_are_those_of_one_by_one():
    north, east = np.array([0.0, 4000.0, -20_000.0]), np.array([0.0, -7000.0, 30_000.0])
    for i, (lat, lon) in enumerate(zip(*ORIGIN.positions(north, east), strict=True)):
        assert (lat, lon) == pytest.approx(ORIGIN.from_ned(north[i], east[i], 0.0)[:2], abs=1e-14)


def test_a_tile_that_is_not_there_is_missed_before_its_name_is_judged(tmp_path):
    with pytest.raises(FileError, match="No such file"):
        read_elevation(tmp_path / "tile.hgt", ORIGIN, NEAR)
