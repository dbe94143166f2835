import math

import numpy as np
import pytest

from gcs_formation.report.gusts import allowed_gust_error_m, gust_acts_s, min_gust_error_m, response_s


def test_a_vehicle_is_carried_for_the_round_trip_and_then_brakes():
    """0.6 m/s for 0.7 s are 0.42 m, and 0.36 / 3 = 0.12 m more until 1.5 m/s^2 have stopped it."""
    assert min_gust_error_m([0.6, -0.6], 0.7, [1.5, 5.5]) == pytest.approx([0.54, 0.42 + 0.36 / 11])
    assert allowed_gust_error_m(0.6, 0.7, 1.5) == pytest.approx(0.86)


def test_the_papers_error_along_x_is_out_of_reach_beyond_a_sixth_of_a_second():
    assert min_gust_error_m(0.6, 1 / 6, 1.5) == pytest.approx(0.22)


@pytest.mark.parametrize(
    ("begun_s", "found_s"),
    [
        (4.02, 0.10),  # the sample of 4.04 shows it; the setpoint of 4.1 acts at 4.12
        (4.05, 0.17),  # that sample was a moment too early
        (4.042, 0.178),  # nearly the worst phase: a telemetry period plus everything else
        (9.0, math.nan),
    ],
)
def test_the_response_to_a_gust_depends_on_when_it_begins(begun_s, found_s):
    tick_s = np.arange(3.8, 5.0, 0.1)
    stamp_s = np.where(tick_s < 3.85, np.nan, tick_s - 0.06)
    assert response_s(begun_s, tick_s, stamp_s, 0.02) == pytest.approx(found_s, nan_ok=True)


def test_a_vehicle_meets_a_gust_in_its_next_pass_of_a_50th_of_a_second():
    assert [gust_acts_s(at_s, 0.0) for at_s in (4.0, 4.001, 4.02, 4.03)] == pytest.approx([4.02, 4.04, 4.04, 4.06])


@pytest.mark.parametrize(("up_s", "zero_s"), [(0.013, 0.02), (0.0199, 0.04), (0.0201, 0.04), (0.1, 0.12), (0.3, 0.32)])
def test_its_mission_time_begins_in_the_first_pass_after_the_message_has_arrived(up_s, zero_s):
    """As emulated vehicles were seen to begin theirs, with these delays of the uplink."""
    assert gust_acts_s(4.0, up_s) == pytest.approx(4.0 + zero_s)
