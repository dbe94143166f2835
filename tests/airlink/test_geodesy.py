"""The mapping between geodetic coordinates and NED, against WGS-84 itself."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight_model.earth import GeodeticOrigin

SEMI_MAJOR_M, FLATTENING = 6378137.0, 1 / 298.257223563
ECCENTRICITY_SQUARED = FLATTENING * (2 - FLATTENING)

origins = st.builds(
    GeodeticOrigin,
    st.floats(-70, 70).map(math.radians),
    st.floats(-180, 180).map(math.radians),
    st.floats(-100, 4000),
)
positions = st.tuples(st.floats(-20_000, 20_000), st.floats(-20_000, 20_000), st.floats(-1000, 100))


def earth_fixed(lat_rad, lon_rad, alt_m):
    normal = SEMI_MAJOR_M / math.sqrt(1 - ECCENTRICITY_SQUARED * math.sin(lat_rad) ** 2)
    across = (normal + alt_m) * math.cos(lat_rad)
    up = (normal * (1 - ECCENTRICITY_SQUARED) + alt_m) * math.sin(lat_rad)
    return across * math.cos(lon_rad), across * math.sin(lon_rad), up


@given(origins, positions)
def test_going_out_and_back_ends_within_a_micrometre(origin, position):
    assert origin.to_ned(*origin.from_ned(*position)) == pytest.approx(position, abs=1e-6)


@given(origins)
def test_the_origin_maps_to_nothing(origin):
    assert origin.to_ned(origin.lat_rad, origin.lon_rad, origin.alt_m) == pytest.approx((0, 0, 0), abs=1e-9)


@given(st.floats(-70, 70).map(math.radians), st.floats(0, math.tau), st.floats(10, 1000))
def test_distances_from_the_origin_are_true_to_a_millimetre_a_kilometre(lat_rad, bearing, distance):
    origin = GeodeticOrigin(lat_rad, math.radians(125), 0.0)
    position = origin.from_ned(distance * math.cos(bearing), distance * math.sin(bearing), 0.0)
    true = math.dist(earth_fixed(origin.lat_rad, origin.lon_rad, 0.0), earth_fixed(*position))
    assert true == pytest.approx(distance, rel=1e-6)


def test_degrees_have_their_lengths_at_35_north():
    origin = GeodeticOrigin(math.radians(35), math.radians(125), 1.0)
    north, _, _ = origin.to_ned(math.radians(35) + 1e-6, math.radians(125), 1.0)
    _, east, down = origin.to_ned(math.radians(35), math.radians(125) + 1e-6, 11.0)
    assert north == pytest.approx(6.3564267, abs=2e-6)
    assert east == pytest.approx(6.3851722 * math.cos(math.radians(35)), abs=2e-6)
    assert down == -10.0


def test_the_date_line_is_no_border():
    origin = GeodeticOrigin(0.0, math.radians(179.999), 0.0)
    _, east, _ = origin.to_ned(0.0, math.radians(-179.999), 0.0)
    assert east == pytest.approx(SEMI_MAJOR_M * math.radians(0.002), abs=1e-3)
    assert -math.pi <= origin.from_ned(0.0, 1000.0, 0.0)[1] < 0


@given(origins, positions)
def test_many_positions_are_mapped_as_each_by_itself(origin, position):
    north_m, east_m, _ = position
    lat_rad, lon_rad, _ = origin.from_ned(north_m, east_m, 0.0)
    lats_rad, lons_rad = origin.positions(np.array([north_m, 0.0]), np.array([east_m, 0.0]))
    assert lats_rad == pytest.approx([lat_rad, origin.lat_rad], abs=1e-12)
    assert math.remainder(lons_rad[0] - lon_rad, math.tau) == pytest.approx(0.0, abs=1e-12)
