"""The axis of slots behind a multirotor: its course in flight, but not where a gust pushes it while it hovers."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight_model.slot import hovering_course, slot_axis

angles = st.floats(-3.1, 3.1)


@given(angles, angles)
def test_in_flight_the_axis_is_the_course(nose_rad, course_rad):
    velocity_mps = 5.0 * math.cos(course_rad), 5.0 * math.sin(course_rad)
    assert slot_axis(nose_rad, *velocity_mps) == hovering_course(nose_rad, *velocity_mps)
    assert abs(math.remainder(slot_axis(course_rad, *velocity_mps) - course_rad, math.tau)) < 1e-9


@given(angles, angles, st.floats(0.0, 1.5))
def test_below_walking_speed_the_axis_stays_near_the_nose(nose_rad, course_rad, speed_mps):
    turned_rad = slot_axis(nose_rad, speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad)) - nose_rad
    assert abs(math.remainder(turned_rad, math.tau)) < math.asin(1.5 / 5.0)


@given(angles, st.floats(0.5, 4.0))
def test_the_axis_is_continuous_in_speed(nose_rad, speed_mps):
    to_side = nose_rad + math.pi / 3
    one, other = (
        slot_axis(nose_rad, each * math.cos(to_side), each * math.sin(to_side))
        for each in (speed_mps, speed_mps + 1e-6)
    )
    assert math.remainder(one - other, math.tau) == pytest.approx(0.0, abs=1e-4)
