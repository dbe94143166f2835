"""What is exported is read back as the same line over the ground."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight_model.earth import GeodeticOrigin
from formation_scenario.mission_files import MissionFileError, read_mission, route_of
from formation_scenario.mission_files.export import TOLERANCE_M, WRITERS, NamedPath, export
from formation_scenario.mission_files.thinning import thinned

ORIGIN = GeodeticOrigin(math.radians(47.4), math.radians(8.54), 488.0)
TURNS = np.linspace(0.0, 3 * math.pi, 2000)
SPIRAL = np.stack((900.0 * np.cos(TURNS), 900.0 * np.sin(TURNS), 100.0 + 5.0 * TURNS), axis=1)


def away_m(points_m, line_m):
    """Greatest distance of points from a polyline, by brute force."""
    begin, along = line_m[:-1], np.diff(line_m, axis=0)
    share = np.einsum("psi,si->ps", points_m[:, None] - begin, along) / (along**2).sum(axis=1)
    nearest = begin + np.clip(share, 0.0, 1.0)[..., None] * along
    return np.linalg.norm(points_m[:, None] - nearest, axis=2).min(axis=1).max()


@pytest.mark.parametrize("suffix", [each for each in WRITERS if each != ".csv"])
def test_an_exported_path_is_read_back_where_it_was(tmp_path, suffix):
    file = tmp_path / f"path{suffix}"
    export(file, [NamedPath("leader", SPIRAL)], ORIGIN)
    mission = read_mission(file)
    found = []
    for point in route_of(mission).points:
        above_sea_m = point.height_m + (488.0 if point.datum == "home" else 0.0)
        north, east, down = ORIGIN.to_ned(math.radians(point.lat_deg), math.radians(point.lon_deg), above_sea_m)
        found.append((north, east, -down))
    assert away_m(SPIRAL, np.array(found)) < TOLERANCE_M + 0.01
    assert len(found) < 300
    if suffix in (".plan", ".waypoints"):
        assert mission.home == pytest.approx((47.4, 8.54, 488.0))


def test_a_line_for_each_path_where_the_format_has_lines(tmp_path):
    paths = [NamedPath("leader", SPIRAL), NamedPath("2 <&>", SPIRAL + 30.0)]
    for suffix in (".kml", ".gpx", ".geojson"):
        export(tmp_path / f"paths{suffix}", paths, ORIGIN)
        assert "not flown" in read_mission(tmp_path / f"paths{suffix}").remarks[0]
    export(tmp_path / "paths.csv", paths, ORIGIN)
    rows = (tmp_path / "paths.csv").read_text().splitlines()
    assert rows[0] == "path,lat_deg,lon_deg,alt_m"
    assert {row.split(",")[0] for row in rows[1:]} == {"leader", "2 <&>"}


def test_what_cannot_be_exported_is_said(tmp_path):
    with pytest.raises(MissionFileError, match="found 2 paths; allowed: one in a mission"):
        export(tmp_path / "a.plan", [NamedPath("1", SPIRAL), NamedPath("2", SPIRAL)], ORIGIN)
    with pytest.raises(MissionFileError, match=r"found a file '.shp'; allowed: .plan, .waypoints"):
        export(tmp_path / "a.shp", [NamedPath("1", SPIRAL)], ORIGIN)
    with pytest.raises(MissionFileError, match="No such file or directory"):
        export(tmp_path / "none" / "a.kml", [NamedPath("1", SPIRAL)], ORIGIN)


points = st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(0.0, 300.0))


@given(st.lists(points, min_size=2, max_size=40, unique=True), st.floats(0.1, 500.0))
def test_thinning_keeps_the_ends_and_stays_within_its_tolerance(line, tolerance_m):
    whole = np.array(line)
    kept = thinned(whole, tolerance_m)
    assert kept[0].tolist() == whole[0].tolist()
    assert kept[-1].tolist() == whole[-1].tolist()
    assert away_m(whole, kept) <= tolerance_m * (1.0 + 1e-6) + 1e-6
