"""What a vehicle sends is kept only if it can be true."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink import mavlink as m
from airlink.messages.system import Statustext
from airlink.messages.telemetry import Attitude, GlobalPositionInt, HomePosition, VfrHud
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


def home(lat_deg, lon_deg, alt_m=20.0):
    return HomePosition(math.radians(lat_deg), math.radians(lon_deg), alt_m, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0))


IMPOSSIBLE_HOMES = {
    "nowhere": (0.0, 0.0),
    "beyond_the_poles": (214.7, 125.0),
    "at_the_pole": (90.0, 125.0),
    "round_the_earth": (35.0, 214.7),
    "not_a_number": (math.nan, 125.0),
    "in_space": (35.0, 125.0, 100.1e3),
    "below_the_crust": (35.0, 125.0, -100.1e3),
    "on_another_continent": (44.1, 125.0),  # 1010 km north
}


@pytest.mark.parametrize("where", IMPOSSIBLE_HOMES.values(), ids=IMPOSSIBLE_HOMES)
def test_a_home_that_cannot_be_is_counted_and_leaves_the_last_one(telemetry, where):
    telemetry.store(position(30.0))
    telemetry.store(home(35.001, 125.0))
    before = telemetry.home_m, telemetry.home_height_m
    assert before == (pytest.approx((110.95, 0.0), abs=0.1), pytest.approx(0.0))
    telemetry.store(home(*where))
    assert (telemetry.home_m, telemetry.home_height_m) == before
    assert telemetry.implausible == 1


@pytest.mark.parametrize("lat_deg", [35.0, 43.9, 26.1])
def test_a_home_is_at_most_1000_km_away(telemetry, lat_deg):
    telemetry.store(home(lat_deg, 125.0))
    assert telemetry.home_m == pytest.approx(((lat_deg - 35.0) * 110.95e3, 0.0), rel=2e-3)
    assert telemetry.implausible == 0


def test_a_home_at_0_0_is_none_and_before_the_first_position_no_error_either(telemetry):
    telemetry.store(home(0.0, 0.0))
    assert telemetry.home_m is None
    assert telemetry.implausible == 0


def chunk(number, text="x" * 50, *, text_id=7):
    return Statustext(4, text, text_id, number)


def test_a_text_without_an_end_is_dropped_as_its_chunks_begin_again(telemetry):
    longest = 0
    for number in range(3000):
        telemetry.store(chunk(number % 256))
        longest = max(longest, len(telemetry._chunks[1]))
    assert telemetry.texts_reported == 0
    assert longest == 256 * 50


def test_chunks_with_one_number_do_not_add_up(telemetry):
    for _ in range(1000):
        telemetry.store(chunk(0))
    telemetry.store(chunk(1, "end"))
    assert list(telemetry.texts) == ["x" * 50 + "end"]


def test_what_came_before_a_missing_chunk_is_no_part_of_the_text(telemetry):
    for each in (chunk(0, "a" * 50), chunk(1, "b" * 50), chunk(3, "d" * 50), chunk(4, "end")):
        telemetry.store(each)
    assert list(telemetry.texts) == ["d" * 50 + "end"]


def test_the_end_of_a_text_is_not_that_of_another_whose_end_is_missing(telemetry):
    for each in (chunk(0, "a" * 50), chunk(1, "b" * 50, text_id=8), chunk(2, "end", text_id=8), chunk(1, "late")):
        telemetry.store(each)
    assert list(telemetry.texts) == ["b" * 50 + "end", "late"]
