"""What a vehicle sends unasked and on request, its time stamps, and its rates."""

import importlib
import math
from collections import Counter
from itertools import pairwise

import pytest

from formation_scenario.surroundings import Fault
from formation_scenario.vehicles import VehicleClock
from sim_vehicles.inertial.imu import InertialSensors
from tests.sim_vehicles.inertial.keys import inertial_keys

mavlink = importlib.import_module("pymavlink.dialects.v20.ardupilotmega")
INTERVAL, REQUEST = 511, 512
UNASKED = {
    "HEARTBEAT",
    "SYS_STATUS",
    "SYSTEM_TIME",
    "GPS_RAW_INT",
    "ATTITUDE",
    "LOCAL_POSITION_NED",
    "GLOBAL_POSITION_INT",
    "NAV_CONTROLLER_OUTPUT",
    "VFR_HUD",
    "WIND",
    "EKF_STATUS_REPORT",
    "MISSION_CURRENT",
    "BATTERY_STATUS",
}


def counts(air, seconds):
    before = len(air.ground.received)
    air.run(seconds)
    return Counter(message.get_type() for _, message in air.ground.received[before:])


def test_everything_that_clients_wait_for_comes_at_1_hz_unasked(flying):
    received = counts(flying, 10.0)
    assert {name: received[name] for name in UNASKED} == dict.fromkeys(UNASKED, 10)


@pytest.mark.parametrize("hz", [1, 2, 5, 10, 25, 50])
def test_intervals_are_kept_exactly(flying, hz):
    assert flying.command_long(INTERVAL, 33, 1e6 / hz) == 0
    assert flying.command_int(INTERVAL, 30, 1e6 / hz) == 0
    received = counts(flying, 10.0)
    assert (received["GLOBAL_POSITION_INT"], received["ATTITUDE"]) == (10 * hz, 10 * hz)


def test_interval_minus_1_stops_a_message_and_0_brings_the_default_back(flying):
    assert flying.command_long(INTERVAL, 30, -1) == 0
    assert counts(flying, 5.0)["ATTITUDE"] == 0
    assert flying.command_long(INTERVAL, 30, 0) == 0
    assert counts(flying, 5.0)["ATTITUDE"] == 5


def test_extended_state_comes_when_asked_for_and_says_in_the_air(flying):
    assert flying.command_long(INTERVAL, 245, 1e6) == 0
    assert counts(flying, 5.0)["EXTENDED_SYS_STATE"] == 5
    assert flying.ground.of("EXTENDED_SYS_STATE")[-1].landed_state == 2


@pytest.mark.parametrize("hz", [4, 10])
def test_request_data_stream_sets_all_rates_but_the_heartbeat_s(flying, hz):
    flying.ground.send(flying.ground.dialect.request_data_stream_encode(1, 0, 0, hz, 1))
    flying.run(0.5)
    received = counts(flying, 12.0)
    assert received["HEARTBEAT"] == 12
    assert all(abs(received[name] - 12 * hz) <= 4 for name in UNASKED - {"HEARTBEAT"})


def test_messages_of_one_turn_carry_one_time(flying):
    for message_id in (30, 33):  # both in one cycle, so that they're in phase
        flying.ground.send(flying.ground.dialect.command_long_encode(1, 1, INTERVAL, 0, message_id, 1e5, 0, 0, 0, 0, 0))
    flying.run(0.1)
    flying.ground.received.clear()
    flying.run(5.0)
    stamps = [
        {message.time_boot_ms for _, message in flying.ground.received if message.get_type() == name}
        for name in ("ATTITUDE", "GLOBAL_POSITION_INT")
    ]
    assert len(stamps[0]) == 50
    assert stamps[0] == stamps[1]


def test_one_frame_a_datagram_and_no_gap_in_the_numbers(flying):
    flying.run(5.0)
    sequences = [message.get_seq() for _, message in flying.ground.received]
    assert all((b - a) % 256 == 1 for a, b in pairwise(sequences))
    assert len(flying.sent) == len(sequences)


def test_timesync_echoes_ts1_and_gives_nanoseconds_since_boot(flying):
    for k in range(20):
        flying.ground.send(flying.ground.dialect.timesync_encode(0, 7_000_000_001 + k))
        flying.run(0.02)
        answer = flying.ground.of("TIMESYNC")[-1]
        assert answer.ts1 == 7_000_000_001 + k
        assert answer.tc1 == pytest.approx(flying.seconds * 1e9, abs=1)


def test_it_asks_for_the_time_itself_every_10_s(make_air):
    air = make_air()
    air.run(45.0)
    asked = [round(seconds) for seconds, message in air.ground.received if message.get_type() == "TIMESYNC"]
    assert asked == [10, 20, 30, 40]
    assert {message.tc1 for message in air.ground.of("TIMESYNC")} == {0}


@pytest.mark.parametrize(("offset_s", "drift"), [(0.0, 0.0), (100.25, 0.0), (0.0, 0.015), (3.5, -0.015)])
def test_every_stamp_is_the_vehicle_s_own_clock(make_air, offset_s, drift):
    air = make_air(clock=VehicleClock(offset_s=offset_s, drift_ppm=1e6 * drift))
    air.run(100.0)
    last = {message.get_type(): (seconds, message) for seconds, message in air.ground.received}
    for name in ("ATTITUDE", "GLOBAL_POSITION_INT", "SYSTEM_TIME"):
        seconds, message = last[name]
        assert message.time_boot_ms / 1e3 == pytest.approx(seconds * (1 + drift) + offset_s, abs=6e-4)
    air.ground.send(air.ground.dialect.timesync_encode(0, 5))
    air.run(0.02)
    assert air.ground.of("TIMESYNC")[-1].tc1 / 1e9 == pytest.approx(air.seconds * (1 + drift) + offset_s, abs=1e-6)


def test_a_restarted_clock_begins_at_zero(make_air):
    air = make_air(clock=VehicleClock(offset_s=100.0))
    air.run(10.0)
    air.fleet.vehicles[0].inject(Fault(at_s=0.0, kind="restart"), air.fleet.next_timer(), ends=False)
    air.run(5.0)
    assert air.ground.of("SYSTEM_TIME")[-1].time_boot_ms / 1e3 == pytest.approx(5.0, abs=1.1)


def test_positions_reported_are_the_true_ones_to_their_resolution(flying):
    flying.command_int(43002, 1, 60.0, 5.0)
    flying.run(60.0)
    flying.command_long(INTERVAL, 33, 20_000)
    flying.command_long(INTERVAL, 32, 20_000)
    flying.run(0.1)
    reported, local = flying.ground.of("GLOBAL_POSITION_INT")[-1], flying.ground.of("LOCAL_POSITION_NED")[-1]
    lat, lon = math.radians(reported.lat / 1e7), math.radians(reported.lon / 1e7)
    north, east, down = flying.fleet.origin.to_ned(lat, lon, reported.alt / 1e3)
    true = [flying.state(name) for name in ("north_m", "east_m", "height_m")]
    assert [north, east] == pytest.approx(true[:2], abs=0.012)
    assert -down == pytest.approx(true[2], abs=6e-4)
    assert [local.x, local.y, -local.z] == pytest.approx(true, abs=1e-3)
    assert reported.hdg == pytest.approx(6000, abs=1)
    assert (reported.vx / 100, reported.vy / 100) == pytest.approx((11.0, 22 * math.sin(math.pi / 3)), abs=0.011)


def test_bank_and_pitch_are_those_of_the_flight(flying):
    flying.command_int(43002, 1, 170.0, 10.0)
    flying.command_int(43001, z=160.0)
    flying.command_long(INTERVAL, 30, 20_000)
    flying.run(6.0)
    reported = flying.ground.of("ATTITUDE")[-1]
    assert reported.roll == pytest.approx(math.atan(0.25 * 22 / 9.80665), rel=1e-3)
    assert reported.yawspeed == pytest.approx(0.25, rel=1e-3)
    assert reported.pitch == pytest.approx(math.asin(3 / 22), rel=1e-3)


def test_wind_is_reported_as_where_it_comes_from(make_air):
    air = make_air(wind_mps=(0.0, 8.0, 0.0))
    air.run(3.0)
    reported = air.ground.of("WIND")[-1]
    assert reported.speed == pytest.approx(8.0)
    assert reported.direction % 360 == pytest.approx(270.0)
    assert air.ground.of("VFR_HUD")[-1].airspeed == pytest.approx(22.0)
    assert air.ground.of("VFR_HUD")[-1].groundspeed == pytest.approx(math.hypot(22, 8), abs=1e-3)


def test_request_message_brings_what_it_has_and_fails_for_the_rest(flying):
    for message_id, name in ((33, "GLOBAL_POSITION_INT"), (1, "SYS_STATUS"), (245, "EXTENDED_SYS_STATE")):
        before = len(flying.ground.of(name))
        assert flying.command_long(REQUEST, message_id) == 0
        assert len(flying.ground.of(name)) > before
    assert flying.command_long(REQUEST, 77777) == 4


def test_both_messages_tell_of_the_same_battery(flying):
    flying.run(1.0)
    status, battery = flying.ground.of("SYS_STATUS")[-1], flying.ground.of("BATTERY_STATUS")[-1]
    assert battery.voltages == [status.voltage_battery, *[65535] * 9]
    assert battery.current_battery == status.current_battery
    assert battery.battery_remaining == status.battery_remaining


SENSORS = InertialSensors((1e-2, 5e-3, -5e-3), (2e-5, -1e-5, 1e-5), 2e-4, 6e-6)
BY_INERTIA = inertial_keys(SENSORS, airspeed_sigma_mps=0.0)
AIDED = inertial_keys(SENSORS, airspeed_sigma_mps=0.0, aiding="gnss")
GOOD = 831


@pytest.mark.parametrize("keys", [BY_INERTIA, AIDED], ids=["by inertia alone", "aided by GNSS"])
def test_a_vehicle_that_navigates_by_inertia_tells_of_its_receiver_and_of_its_filter(make_air, keys):
    """Gyroscopes of several degrees per hour and accelerometers of a milli-g: useless after minutes without aiding."""
    air = make_air(navigation=keys)
    air.run(200.0)
    fix, ekf, status = (air.ground.of(name)[-1] for name in ("GPS_RAW_INT", "EKF_STATUS_REPORT", "SYS_STATUS"))
    gps_works = bool(status.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_SENSOR_GPS)
    roll = air.ground.of("ATTITUDE")[-1].roll
    if keys is BY_INERTIA:
        assert (fix.fix_type, fix.satellites_visible, fix.eph, gps_works) == (1, 0, 65535, False)
        assert ekf.flags & GOOD == GOOD & ~(16 | 512 | 32)
        assert abs(roll) > 1e-3
    else:
        assert (fix.fix_type, gps_works, ekf.flags & GOOD) == (3, True, GOOD)
        assert 0.0 < ekf.pos_horiz_variance < 1.0
        assert 0.0 < abs(roll) < 1e-2
