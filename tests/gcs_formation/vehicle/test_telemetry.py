"""What a vehicle sends is kept only if it can be true."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink import mavlink as m
from airlink.messages.telemetry import Attitude, GlobalPositionInt, VfrHud
from gcs_formation.vehicle.telemetry import Telemetry
from tests.gcs_formation.vehicle.conftest import ORIGIN, heartbeat, position

ANYTHING = st.floats(allow_nan=True, allow_infinity=True)


@given(st.tuples(*(ANYTHING,) * 9))
def test_whatever_a_position_message_holds_only_finite_motion_is_kept(fields):
    telemetry = Telemetry(ORIGIN)
    telemetry.store(GlobalPositionInt(*fields))
    motion = telemetry.motion
    if motion is not None:
        place = motion.north_m, motion.east_m, motion.height_m, motion.above_home_m
        assert all(map(math.isfinite, (motion.stamp_s, *place, motion.north_mps, motion.east_mps, motion.climb_mps)))


@given(st.tuples(*(ANYTHING,) * 7))
def test_whatever_an_attitude_message_holds_only_an_attitude_is_kept(fields):
    telemetry = Telemetry(ORIGIN)
    telemetry.store(Attitude(*fields))
    kept = telemetry.attitude
    assert kept is None or (math.isfinite(kept.time_boot_s) and abs(kept.yaw_rad) <= 2 * math.pi)


def test_an_airspeed_that_is_no_longer_a_number_is_a_reading_of_0_which_no_flight_explains(telemetry):
    telemetry.store(VfrHud(22.0, 22.0, 0.0, 50, 100.0, 0.0))
    telemetry.store(VfrHud(math.nan, 22.0, 0.0, 50, 100.0, 0.0))
    assert telemetry.airspeed_mps == 0.0
    assert telemetry.implausible == 1


@pytest.mark.parametrize("airspeed_mps", [math.inf, -1.0, 1e30])
def test_an_impossible_airspeed_leaves_the_last_one(telemetry, airspeed_mps):
    telemetry.store(VfrHud(22.0, 22.0, 0.0, 50, 100.0, 0.0))
    telemetry.store(VfrHud(airspeed_mps, 22.0, 0.0, 50, 100.0, 0.0))
    assert telemetry.airspeed_mps == 22.0


def test_latitude_and_longitude_0_are_an_autopilot_without_a_fix(telemetry):
    telemetry.store(GlobalPositionInt(1.0, 0.0, 0.0, 584.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert telemetry.motion is None


def test_an_unknown_heading_doesnt_cost_the_position(telemetry):
    telemetry.store(position(30.0).but(hdg_rad=math.nan))
    assert telemetry.motion is not None
    assert telemetry.motion.height_m == pytest.approx(30.0, abs=1e-6)


def test_velocity_down_becomes_climb_and_height_counts_from_the_origin(telemetry):
    telemetry.store(position(100.0).but(vz_mps=-2.5, relative_alt_m=80.0))
    assert telemetry.motion.climb_mps == 2.5
    assert telemetry.motion.height_m == pytest.approx(100.0, abs=1e-6)
    assert telemetry.motion.above_home_m == 80.0


def test_after_a_restart_nothing_is_known(telemetry, tell):
    tell(m.PLANE_MODE_GUIDED, armed=True, above_home_m=100.0)
    assert telemetry.complete
    assert telemetry.armed
    telemetry.invalidate()
    assert not telemetry.complete
    assert not telemetry.armed
    assert telemetry.custom_mode is None


def test_armed_is_the_safety_bit_of_the_heartbeat(telemetry):
    telemetry.store(heartbeat(m.PLANE_MODE_MANUAL, armed=False))
    assert not telemetry.armed
    telemetry.store(heartbeat(m.PLANE_MODE_MANUAL, armed=True))
    assert telemetry.armed


def lacking_after(telemetry, position_of, *, seconds):
    """Tell attitudes at 10 Hz, and what positions there are, from 1 s on; return when a quantity was first lacking."""
    for tick in range(round(10 * seconds)):
        time_s = 1.0 + tick / 10
        message = position_of(tick, time_s)
        for each in (Attitude(time_s, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0), *(() if message is None else (message,))):
            telemetry.store(each)
        if telemetry.lacking:
            return telemetry.lacking, time_s - 1.0
    return "", seconds


def test_positions_that_stop_coming_are_lacking_after_a_second_and_a_quarter(telemetry):
    found, after_s = lacking_after(telemetry, lambda tick, s: position(50.0, s) if tick <= 10 else None, seconds=5)
    assert (found, after_s) == ("position", pytest.approx(1.0 + 1.25, abs=0.06))


def test_positions_at_0_0_in_a_row_are_lacking_at_once_and_single_ones_are_not(telemetry):
    nowhere = position(50.0, 1.0).but(lat_rad=0.0, lon_rad=0.0)

    def told(tick, s):
        return nowhere.but(time_boot_s=s) if tick in (3, 4, 5, 6, 7) or tick > 10 else position(50.0, s)

    found, after_s = lacking_after(telemetry, told, seconds=5)
    assert (found, after_s) == ("position", pytest.approx(1.0 + 0.6))


def test_one_position_in_three_that_arrives_is_not_lacking(telemetry):
    assert lacking_after(telemetry, lambda tick, s: None if tick % 3 else position(50.0, s), seconds=20)[0] == ""


def told_at(telemetry, *, airspeeds_s, seconds):
    """Tell positions at 10 Hz and airspeeds at these times; return when the airspeed was first lacking, or infinity."""
    telemetry.store(Attitude(0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0))
    for tick in range(round(10 * seconds)):
        time_s = tick / 10
        telemetry.store(position(50.0, time_s))
        telemetry.store(Attitude(time_s, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0))
        if any(abs(each - time_s) < 0.01 for each in airspeeds_s):
            telemetry.store(VfrHud(22.0, 22.0, 0.0, 50, 100.0, 0.0))
        if telemetry.lacking:
            assert telemetry.lacking == "airspeed"
            return time_s
    return math.inf


@pytest.mark.parametrize("every_s", [1.0, 0.1])
def test_airspeeds_that_stop_are_lacking_after_4_of_their_intervals_or_a_second_and_a_half(telemetry, every_s):
    airspeeds_s = [every_s * number for number in range(round(5 / every_s) + 1)]
    at_s = told_at(telemetry, airspeeds_s=airspeeds_s, seconds=12)
    assert at_s - 5.0 == pytest.approx(max(4.0 * every_s, 1.5) + 0.1)
    assert telemetry.airspeed_mps == 0.0


def test_an_airspeed_at_the_rate_before_any_request_is_not_lacking_where_one_is_lost(telemetry):
    assert told_at(telemetry, airspeeds_s=[0.1, 1.0, 3.0, 3.1, 3.2, 3.3, 4.0, 4.1], seconds=5) == math.inf
    assert telemetry.airspeed_mps == 22.0


def test_a_restart_begins_the_count_again(telemetry):
    assert told_at(telemetry, airspeeds_s=[0.1, 0.2], seconds=9) < 5.0
    telemetry.invalidate()
    assert telemetry.lacking == ""
    assert told_at(telemetry, airspeeds_s=[0.5, 3.5], seconds=4) == math.inf
