"""The parameter protocol, and the effects of parameters, tested with pymavlink."""

import math

import pytest

TYPES = {
    "AIRSPEED_CRUISE": 9,
    "AIRSPEED_MIN": 4,
    "ARMING_CHECK": 6,
    "FS_GCS_ENABL": 2,
    "RTL_ALTITUDE": 9,
    "TKOFF_ALT": 4,
}
ACCEPTED, FAILED = 0, 4
ARM, SET_MODE, SPEED = 400, 176, 43000
RTL, LOITER, TAKEOFF, GUIDED = 11, 12, 13, 15


def reported(air):
    return air.ground.of("PARAM_VALUE")


def ask(air, name=b"", index=-1):
    before = len(reported(air))
    air.ground.send(air.ground.dialect.param_request_read_encode(1, 1, name, index))
    air.run(0.1)
    return reported(air)[before:]


def put(air, name, value, kind=9):
    before = len(reported(air))
    air.ground.send(air.ground.dialect.param_set_encode(1, 1, name, value, kind))
    air.run(0.1)
    return reported(air)[before:]


def test_the_list_has_every_index_once_at_one_a_turn(flying):
    flying.ground.send(flying.ground.dialect.param_request_list_encode(1, 1))
    flying.run(2.0)
    values = reported(flying)
    assert [value.param_index for value in values] == list(range(values[0].param_count))
    assert {value.param_count for value in values} == {len(values)}
    assert TYPES.items() <= {value.param_id: value.param_type for value in values}.items()
    times = [seconds for seconds, message in flying.ground.received if message.get_type() == "PARAM_VALUE"]
    assert len(set(times)) == len(times)


def test_a_list_asked_for_again_begins_again(flying):
    for _ in range(2):
        flying.ground.send(flying.ground.dialect.param_request_list_encode(1, 1))
        flying.run(0.06)
    flying.run(2.0)
    indices = [value.param_index for value in reported(flying)]
    assert indices == [0, 1, 2, *range(reported(flying)[0].param_count)]


def test_one_is_read_by_name_or_by_index(flying):
    (by_name,) = ask(flying, b"TKOFF_ALT")
    assert (by_name.param_value, by_name.param_type, by_name.param_index) == (50.0, 4, 65535)
    (by_index,) = ask(flying, index=0)
    assert by_index.param_index == 0


@pytest.mark.parametrize(("name", "index"), [(b"NONE", -1), (b"tkoff_alt", -1), (b"", 999)])
def test_what_there_is_not_is_answered_by_silence(flying, name, index):
    assert ask(flying, name, index) == []


@pytest.mark.parametrize("kind", [4, 9])
def test_setting_tells_the_new_value_in_the_parameter_s_own_type(flying, kind):
    (value,) = put(flying, b"TKOFF_ALT", 70.0, kind)
    assert (value.param_value, value.param_type, value.param_index) == (70.0, 4, 65535)
    assert ask(flying, b"TKOFF_ALT")[0].param_value == 70.0


@pytest.mark.parametrize(
    ("name", "sent", "stored"),
    [
        (b"TKOFF_ALT", 60.7, 60.0),
        (b"TKOFF_ALT", -3.0, -3.0),
        (b"TKOFF_ALT", 500.0, 500.0),
        (b"TKOFF_ALT", 1e9, 32767.0),
        (b"AIRSPEED_CRUISE", 500.0, 500.0),
        (b"AIRSPEED_CRUISE", 1.0, 1.0),
        (b"WP_LOITER_RAD", -80.0, -80.0),
        (b"FS_LONG_ACTN", 5.0, 5.0),
        (b"FS_GCS_ENABL", 9.0, 9.0),
        (b"FS_GCS_ENABL", 200.0, 127.0),
        (b"RTL_ALTITUDE", -1.0, -1.0),
    ],
)
def test_what_is_sent_is_stored_and_reported_and_integers_saturate_at_their_width_alone(flying, name, sent, stored):
    assert put(flying, name, sent)[0].param_value == stored
    assert ask(flying, name)[0].param_value == stored


def test_a_negative_radius_is_circled_anticlockwise(flying):
    put(flying, b"WP_LOITER_RAD", -130.0)
    flying.set_mode(LOITER)
    flying.run(60.0)
    north_m, east_m = flying.state("north_m"), flying.state("east_m")
    before_rad = flying.state("heading_rad")
    flying.run(5.0)
    assert flying.state("heading_rad") - before_rad == pytest.approx(-5 * 22 / 130, rel=0.1)
    circle = flying.fleet.bodies[0].steering
    assert math.hypot(north_m - circle.centre_north_m, east_m - circle.centre_east_m) == pytest.approx(130.0, abs=5.0)


def test_a_return_at_a_negative_height_keeps_its_own(flying):
    put(flying, b"RTL_ALTITUDE", -1.0)
    flying.set_mode(RTL)
    flying.run(30.0)
    assert flying.state("height_m") == pytest.approx(100.0, abs=0.5)


@pytest.mark.parametrize(("name", "value"), [(b"NONE", 1.0), (b"TKOFF_ALT", math.nan), (b"TKOFF_ALT", math.inf)])
def test_setting_nonsense_is_answered_by_silence_and_changes_nothing(flying, name, value):
    assert put(flying, name, value) == []
    assert ask(flying, b"TKOFF_ALT")[0].param_value == 50.0


def test_the_system_id_stays_until_a_reboot_that_never_comes(flying):
    assert put(flying, b"MAV_SYSID", 7.0)[0].param_value == 1.0


def test_airspeed_limits_bound_what_is_accepted(flying):
    put(flying, b"AIRSPEED_MAX", 24.0)
    assert flying.command_int(SPEED, 0, 25.0) == FAILED
    assert flying.command_int(SPEED, 0, 24.0) == ACCEPTED


def test_take_off_ends_at_its_height(parked):
    put(parked, b"TKOFF_ALT", 30.0)
    parked.set_mode(TAKEOFF)
    parked.command_long(ARM, 1)
    parked.run(60.0)
    assert parked.state("height_m") == pytest.approx(30.0, abs=0.1)


@pytest.mark.slow
def test_circles_have_the_radius_asked_for_unless_the_turn_rate_forbids_it(flying):
    for asked, flown in ((200.0, 200.0), (10.0, 1.05 * 22 / 0.25)):
        put(flying, b"WP_LOITER_RAD", asked)
        flying.set_mode(GUIDED)
        flying.set_mode(LOITER)
        centre = flying.state("north_m"), flying.state("east_m")
        flying.run(150.0)
        distance = math.hypot(flying.state("north_m") - centre[0], flying.state("east_m") - centre[1])
        assert distance == pytest.approx(flown, abs=3.0)


def test_return_to_launch_flies_at_its_height(flying):
    put(flying, b"RTL_ALTITUDE", 130.0)
    flying.set_mode(RTL)
    flying.run(60.0)
    assert flying.state("height_m") == pytest.approx(130.0, abs=0.1)


def test_without_arming_checks_it_arms_before_it_is_ready(make_air):
    air = make_air(in_air=False)
    air.run(1.5)
    assert air.command_long(ARM, 1) == FAILED
    put(air, b"ARMING_CHECK", 0.0)
    assert air.command_long(ARM, 1) == ACCEPTED


def beat(air, seconds, system=255):
    for _ in range(seconds):
        peer = air.ground if system == 255 else air.peer(("127.0.0.1", 15999), system=system)
        peer.send(peer.dialect.heartbeat_encode(6, 8, 0, 0, 4))
        air.run(1.0)


def test_the_ground_station_failsafe_is_off_by_default(flying):
    beat(flying, 3)
    flying.run(30.0)
    assert flying.ground.of("HEARTBEAT")[-1].custom_mode == GUIDED


def test_with_the_failsafe_on_it_returns_5_s_after_the_last_heartbeat_and_stays_in_that_mode(flying):
    put(flying, b"FS_GCS_ENABL", 1)
    put(flying, b"FS_LONG_ACTN", 1)
    beat(flying, 3)
    last = flying.seconds - 1.0
    flying.run_until(lambda: flying.ground.of("HEARTBEAT")[-1].custom_mode == RTL, limit_s=60.0)
    assert flying.seconds - last == pytest.approx(5.0, abs=0.1)
    flying.run(1.0)
    assert flying.ground.of("HEARTBEAT")[-1].system_status == 5
    assert flying.command_int(SPEED, 0, 25.0) == FAILED
    beat(flying, 3)
    assert [getattr(flying.ground.of("HEARTBEAT")[-1], name) for name in ("custom_mode", "system_status")] == [RTL, 4]
    assert flying.set_mode(GUIDED) == ACCEPTED


def test_heartbeats_of_another_system_do_not_hold_off_the_failsafe(flying):
    put(flying, b"FS_GCS_ENABL", 1)
    put(flying, b"FS_LONG_ACTN", 1)
    beat(flying, 1)
    beat(flying, 8, system=250)
    assert flying.ground.of("HEARTBEAT")[-1].custom_mode == RTL
