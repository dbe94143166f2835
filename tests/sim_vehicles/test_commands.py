"""What an ArduPlane accepts and refuses when pymavlink asks."""

import math

import pytest

from airlink.endpoint import Address

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
SPEED, ALTITUDE, HEADING = 43000, 43001, 43002
SET_MODE, ARM, TAKEOFF, INTERVAL, REQUEST = 176, 400, 22, 511, 512
MANUAL, AUTO, RTL, LOITER, GUIDED = 0, 10, 11, 12, 15


@pytest.mark.parametrize(
    ("params", "result"),
    [
        ((0, 25.0), ACCEPTED),
        ((0, 16.0), ACCEPTED),
        ((0, 28.0), ACCEPTED),
        ((0, 15.9), FAILED),
        ((0, 28.1), FAILED),
        ((0, -1.0), FAILED),
        ((1, 22.0), DENIED),
        ((0, math.nan), DENIED),
        ((0, math.inf), DENIED),
        ((0, 22.0, math.nan), DENIED),
        ((math.nan, 22.0), DENIED),
    ],
)
def test_change_speed_takes_airspeed_inside_the_limits_only(flying, params, result):
    assert flying.command_int(SPEED, *params) == result
    assert flying.command_long(SPEED, *params) == result


@pytest.mark.parametrize("frame", [0, 5, 3, 6, 10, 11])
def test_change_altitude_takes_global_frames(flying, frame):
    assert flying.command_int(ALTITUDE, frame=frame, z=110.0) == ACCEPTED


@pytest.mark.parametrize("frame", [1, 2, 4, 7, 8, 9, 12, 21, 255])
def test_change_altitude_refuses_other_frames(flying, frame):
    assert flying.command_int(ALTITUDE, frame=frame, z=110.0) == DENIED


@pytest.mark.parametrize("z", [0.0, -1.0, math.nan, math.inf])
def test_change_altitude_refuses_dangerous_heights(flying, z):
    assert flying.command_int(ALTITUDE, z=z) == DENIED
    assert flying.command_long(ALTITUDE, 0, 0, 0, 0, 0, 0, z) == DENIED


@pytest.mark.parametrize(
    ("params", "result"),
    [
        ((0, 0.0), ACCEPTED),
        ((1, 359.9), ACCEPTED),
        ((2, 0.0), ACCEPTED),
        ((3, 90.0), DENIED),
        ((1, 360.0), DENIED),
        ((1, -0.1), DENIED),
        ((1, math.nan), DENIED),
        ((0, 90.0, math.nan), DENIED),
        ((math.nan, 90.0), DENIED),
    ],
)
def test_change_heading_takes_degrees_below_a_full_turn(flying, params, result):
    assert flying.command_int(HEADING, *params) == result
    assert flying.command_long(HEADING, *params) == result


@pytest.mark.parametrize("mode", [MANUAL, AUTO, RTL, LOITER])
def test_setpoints_fail_outside_guided(flying, mode):
    assert flying.set_mode(mode) == ACCEPTED
    assert flying.command_int(SPEED, 0, 25.0) == FAILED
    assert flying.command_int(ALTITUDE, z=120.0) == FAILED
    assert flying.command_int(HEADING, 1, 90.0, 5.0) == FAILED


def test_a_refused_setpoint_changes_nothing(flying):
    flying.command_int(SPEED, 0, 25.0)
    flying.command_int(HEADING, 1, 0.0, 5.0)
    flying.command_int(ALTITUDE, z=110.0)
    flying.command_int(SPEED, 0, 29.0)
    flying.command_int(SPEED, 0, math.nan)
    flying.command_int(HEADING, 1, 360.0, 5.0)
    flying.command_int(ALTITUDE, z=math.nan)
    flying.run(60.0)
    assert flying.state("airspeed_mps") == pytest.approx(25.0, abs=1e-3)
    assert flying.state("heading_rad") == pytest.approx(0.0, abs=1e-9)
    assert flying.state("height_m") == pytest.approx(110.0, abs=1e-3)


@pytest.mark.parametrize("component", [0, 1, 77])
def test_target_system_zero_and_any_component_are_executed(flying, component):
    assert flying.command_int(SPEED, 0, 25.0, target=0, component=component) == ACCEPTED
    assert flying.command_long(SPEED, 0, 25.0, target=1, component=component) == ACCEPTED


def test_a_foreign_target_system_gets_no_answer(flying):
    assert flying.command_int(SPEED, 0, 25.0, target=2) is None
    flying.run(20.0)
    assert flying.fleet.bodies[0].steering.speed_mps == 22.0


def test_each_command_is_acknowledged_singly_to_its_sender(flying):
    other = flying.peer(Address("127.0.0.1", 15000), system=250, component=191)
    assert flying.command_int(SPEED, 0, 25.0, peer=other) == ACCEPTED
    (answer,) = other.of("COMMAND_ACK")
    assert (answer.target_system, answer.target_component) == (250, 191)
    mine = len(flying.ground.of("COMMAND_ACK"))
    for _ in range(20):
        assert flying.command_int(HEADING, 1, 10.0, 5.0) == ACCEPTED
    assert len(flying.ground.of("COMMAND_ACK")) == mine + 20
    assert {(a.target_system, a.target_component) for a in flying.ground.of("COMMAND_ACK")} == {(255, 190)}


def test_a_companion_computer_with_the_same_system_id_is_obeyed_and_its_own_frames_are_not(flying):
    companion = flying.peer(Address("127.0.0.1", 15000), system=1, component=191)
    assert flying.command_long(SET_MODE, 1, LOITER, peer=companion) == ACCEPTED
    (answer,) = companion.of("COMMAND_ACK")
    assert (answer.target_system, answer.target_component) == (1, 191)
    itself = flying.peer(Address("127.0.0.1", 15001), system=1, component=1)
    assert flying.command_long(SET_MODE, 1, RTL, peer=itself) is None


@pytest.mark.parametrize("command", [12345, 65535, 21])
def test_unknown_commands_are_unsupported(flying, command):
    assert flying.command_long(command) == UNSUPPORTED
    assert flying.command_int(command) == UNSUPPORTED


def test_take_off_command_fails_on_a_plane(parked):
    assert parked.command_long(TAKEOFF, 0, 0, 0, 0, 0, 0, 50.0) == FAILED


@pytest.mark.parametrize("number", [99, 15.5, -1, math.nan, 16])
def test_unknown_modes_fail(flying, number):
    assert flying.set_mode(number) == FAILED
    flying.run(2.0)
    assert flying.ground.of("HEARTBEAT")[-1].custom_mode == GUIDED


def test_a_mode_that_there_is_not_is_remarked_on(flying):
    assert flying.set_mode(99) == FAILED
    flying.ground.send(flying.ground.dialect.set_mode_encode(1, 1, 98))
    flying.run(0.1)
    said = [(each.severity, each.text) for each in flying.ground.of("STATUSTEXT")]
    assert said == [(4, "No such mode 99"), (4, "No such mode 98")]


def test_a_change_of_mode_is_reported_by_a_heartbeat_at_once(flying):
    before = len(flying.ground.of("HEARTBEAT"))
    assert flying.set_mode(LOITER) == ACCEPTED
    assert flying.ground.of("HEARTBEAT")[before:][0].custom_mode == LOITER


def test_the_old_set_mode_message_changes_the_mode(flying):
    flying.ground.send(flying.ground.dialect.set_mode_encode(1, 1, RTL))
    flying.run(0.1)
    assert flying.ground.of("HEARTBEAT")[-1].custom_mode == RTL


def test_mission_start_without_a_mission_is_accepted_and_returns_to_launch(flying):
    assert flying.command_long(300) == ACCEPTED
    assert flying.ground.of("HEARTBEAT")[-1].custom_mode == RTL


def test_disarming_in_flight_fails(flying):
    assert flying.command_long(ARM, 0) == FAILED
    assert flying.ground.of("HEARTBEAT")[-1].base_mode & 128


def test_arming_before_the_estimator_is_ready_fails_with_its_reason(make_air):
    air = make_air(in_air=False)
    air.run(1.5)
    assert air.command_long(ARM, 1) == FAILED
    assert air.ground.of("STATUSTEXT")[-1].text.startswith("PreArm: ")
    air.run(3.0)
    assert air.command_long(ARM, 1) == ACCEPTED
    assert air.ground.of("STATUSTEXT")[-1].text == "Throttle armed"
    assert air.command_long(ARM, 0) == ACCEPTED
    assert air.ground.of("STATUSTEXT")[-1].text == "Throttle disarmed"


def test_old_speed_and_height_commands_do_nothing_after_setpoints_and_again_after_leaving_guided(flying):
    flying.command_int(SPEED, 0, 25.0)
    flying.command_int(ALTITUDE, z=110.0)
    assert flying.command_long(178, 0, 18.0) == ACCEPTED
    assert flying.command_long(186, 150.0, 3) == ACCEPTED
    assert (flying.fleet.bodies[0].steering.speed_mps, flying.fleet.bodies[0].steering.height_m) == (25.0, 110.0)
    flying.set_mode(LOITER)
    flying.set_mode(GUIDED)
    assert flying.command_long(178, 0, 18.0) == ACCEPTED
    assert flying.command_long(186, 150.0, 3) == ACCEPTED
    assert (flying.fleet.bodies[0].steering.speed_mps, flying.fleet.bodies[0].steering.height_m) == (18.0, 150.0)


@pytest.mark.parametrize("mode", [MANUAL, RTL, LOITER])
def test_the_old_speed_command_fails_outside_guided_and_auto(flying, mode):
    flying.set_mode(mode)
    assert flying.command_long(178, 0, 22.0) == FAILED
    assert flying.command_long(178, 1, 25.0) == FAILED


@pytest.mark.parametrize(
    ("params", "result", "flown_mps"),
    [
        ((0, 25.0), ACCEPTED, 25.0),
        ((0, 99.0), FAILED, 20.0),
        ((0, -1.0), FAILED, 20.0),
        ((0, -2.0), ACCEPTED, 22.0),
        ((1, 24.0), ACCEPTED, 24.0),
        ((1, 5.0), ACCEPTED, 20.0),
        ((1, 99.0), ACCEPTED, 28.0),
        ((2, 3.0), FAILED, 20.0),
        ((9, 22.0), FAILED, 20.0),
    ],
)
def test_the_old_speed_command_takes_airspeeds_within_limits_and_any_ground_speed(flying, params, result, flown_mps):
    assert flying.command_long(178, 0, 20.0) == ACCEPTED
    assert flying.command_long(178, *params, -1) == result
    assert flying.fleet.bodies[0].steering.speed_mps == flown_mps


def test_reposition_changes_the_mode_when_asked_and_circles_the_position(flying):
    flying.set_mode(LOITER)
    position = {"x": round(35.005e7), "y": round(125.005e7), "z": 120.0, "frame": 3}
    assert flying.command_int(192, -1, 0, 0, 0, **position) in {DENIED, FAILED}
    assert flying.command_int(192, -1, 1, 0, 0, **position) == ACCEPTED
    assert flying.ground.of("HEARTBEAT")[-1].custom_mode == GUIDED
    flying.run(150.0)
    north, east, _ = flying.fleet.origin.to_ned(math.radians(35.005), math.radians(125.005), 0.0)
    distance = math.hypot(flying.state("north_m") - north, flying.state("east_m") - east)
    assert distance == pytest.approx(flying.fleet.bodies[0].steering.radius_m, rel=0.1)
    assert flying.state("height_m") == pytest.approx(120.0, abs=0.01)


def test_reposition_has_a_radius_that_stays_until_the_mode_changes_and_a_side(flying):
    position = {"x": round(35.005e7), "y": round(125e7), "z": 120.0, "frame": 3}
    for radius_m, side, flown_m in (
        (0, 0, 115.0),
        (150, math.nan, 150.0),
        (0, 0, 150.0),
        (-120, 0, 150.0),
        (0, 1, -150.0),
        (180, 0, 180.0),
    ):
        assert flying.command_int(192, -1, 1, radius_m, side, **position) == ACCEPTED
        assert flying.fleet.bodies[0].steering.radius_m == flown_m
    flying.set_mode(LOITER)
    flying.command_int(192, -1, 1, 0, 0, **position)
    assert flying.fleet.bodies[0].steering.radius_m == 115.0


def test_the_arrival_at_a_position_is_reported_once(flying):
    flying.command_int(192, -1, 1, 0, 0, x=round(35.005e7), y=round(125e7), z=100.0, frame=3)
    flying.run(5.0)
    assert flying.ground.of("MISSION_ITEM_REACHED") == []
    flying.run(60.0)
    assert [each.seq for each in flying.ground.of("MISSION_ITEM_REACHED")] == [0]


def test_of_setpoints_of_position_the_height_alone_is_flown_and_only_in_guided(flying):
    steering, dialect = flying.fleet.bodies[0].steering, flying.ground.dialect
    centre = steering.centre_north_m, steering.centre_east_m

    def command_global(frame, mask, alt):
        position = round(35.01e7), round(125.01e7), alt
        flying.ground.send(
            dialect.set_position_target_global_int_encode(0, 1, 1, frame, mask, *position, 0, 0, 0, 0, 0, 0, 0, 0)
        )
        flying.run(0.1)
        return steering.height_m

    def command_local(frame, down):
        position = 500.0, 500.0, down
        flying.ground.send(
            dialect.set_position_target_local_ned_encode(0, 1, 1, frame, 0xDF8, *position, 0, 0, 0, 0, 0, 0, 0, 0)
        )
        flying.run(0.1)
        return steering.height_m

    assert command_global(6, 0xFFFB, 90.0) == 90.0
    assert command_global(6, 0xDF8, 70.0) == 70.0
    assert command_global(6, 0xFFFF, 50.0) == 70.0
    assert command_global(1, 0xFFFB, 50.0) == 70.0
    assert flying.ground.of("STATUSTEXT")[-1].text.startswith("Invalid coord frame in SET_POSTION_TARGET")
    assert command_local(1, -130.0) == 70.0
    assert command_local(7, -20.0) == 90.0
    assert flying.ground.of("STATUSTEXT")[-1].text == "Change alt to 90.0"
    assert (steering.centre_north_m, steering.centre_east_m) == centre
    flying.command_int(ALTITUDE, z=110.0, frame=3)
    assert command_global(6, 0xFFFB, 60.0) == 110.0
    flying.set_mode(LOITER)
    height_m = steering.height_m
    assert command_global(6, 0xFFFB, 60.0) == height_m


@pytest.mark.parametrize(
    ("command", "result"),
    [*((payload, ACCEPTED) for payload in (181, 183, 184, 195, 197, 201, 203)), (191, FAILED), (207, FAILED)],
)
def test_commands_to_a_payload_are_accepted_and_those_it_has_nothing_for_fail(flying, command, result):
    assert flying.command_long(command, 1) == result


def test_a_throttle_is_accepted_with_no_speed(flying):
    assert flying.command_long(178, 0, -1, 50) == ACCEPTED
    assert flying.command_long(178, 0, -1, -1) == FAILED
    assert flying.fleet.bodies[0].steering.speed_mps == 22.0


def test_reposition_by_floats_is_unsupported(flying):
    flying.set_mode(LOITER)
    assert flying.command_long(192, -1, 1, 0, 0, 35.005, 125.005, 120.0) == UNSUPPORTED
    assert flying.ground.of("HEARTBEAT")[-1].custom_mode == LOITER


def test_reposition_while_booting_is_refused(make_air):
    air = make_air(in_air=False)
    air.run(0.1)
    assert air.command_int(192, -1, 1, x=round(35e7), y=round(125e7), z=100.0) in {DENIED, FAILED}
    air.run(1.0)
    assert GUIDED not in {beat.custom_mode for beat in air.ground.of("HEARTBEAT")}


def test_change_speed_keeps_to_the_acceleration_it_is_given(flying):
    assert flying.command_int(SPEED, 0, 28.0, 0.1) == ACCEPTED
    flying.run(5.0)
    assert flying.state("airspeed_mps") - 22 == pytest.approx(0.5, abs=0.01)


def test_reposition_to_an_impossible_latitude_is_denied(flying):
    assert flying.command_int(192, -1, 1, 0, 0, x=round(95e7), y=round(125e7), z=100.0) == DENIED


def test_reposition_after_setpoints_leaves_the_height_alone(flying):
    flying.command_int(ALTITUDE, z=110.0)
    assert flying.command_int(192, -1, 1, 0, 0, x=round(35.005e7), y=round(125e7), z=150.0) == ACCEPTED
    assert flying.fleet.bodies[0].steering.height_m == 110.0


def test_version_and_home_are_sent_on_request(flying):
    for command, params, name in ((520, (1,), "AUTOPILOT_VERSION"), (REQUEST, (148,), "AUTOPILOT_VERSION")):
        before = len(flying.ground.of(name))
        assert flying.command_long(command, *params) == ACCEPTED
        assert len(flying.ground.of(name)) == before + 1
    assert flying.ground.of("AUTOPILOT_VERSION")[0].flight_sw_version >> 24 == 4
    assert flying.ground.of("AUTOPILOT_VERSION")[0].capabilities == 62319
    for asked in ((410,), (REQUEST, 242)):
        assert flying.command_long(*asked) == ACCEPTED
    home = flying.ground.of("HOME_POSITION")
    assert len(home) == 2
    assert (home[0].latitude, home[0].longitude, home[0].altitude) == (350000000, 1250000000, 0)


@pytest.mark.parametrize("message_id", [65535, -5, 77777, math.nan])
def test_intervals_of_unknown_messages_are_denied(flying, message_id):
    assert flying.command_long(INTERVAL, message_id, 100_000) == DENIED


def test_intervals_faster_than_the_main_loop_are_denied(flying):
    assert flying.command_long(INTERVAL, 30, 1000) == DENIED
    assert flying.command_long(INTERVAL, 30, 20_000) == ACCEPTED


def test_ping_is_never_answered(flying):
    flying.ground.send(flying.ground.dialect.ping_encode(1, 1, 0, 0))
    flying.run(2.0)
    assert not flying.ground.of("PING")


def test_a_position_of_zeros_is_denied(flying):
    assert flying.command_int(192, -1, 1, 0, 0, x=0, y=0, z=100.0) == DENIED


def test_heights_that_centimetres_of_32_bits_do_not_hold_are_denied(flying):
    assert flying.command_int(ALTITUDE, z=1e30) == DENIED
    assert flying.command_int(ALTITUDE, z=-3e7) == DENIED
    assert flying.command_long(186, 1e30, 3) == DENIED
    assert flying.command_int(192, -1, 1, 0, 0, x=1, y=1, z=1e30) == DENIED


@pytest.mark.parametrize(("z", "result"), [(83000.0, ACCEPTED), (83001.0, DENIED), (1e6, DENIED), (math.nan, DENIED)])
def test_a_position_is_at_most_83_km_high(flying, z, result):
    assert flying.command_int(192, -1, 1, 0, 0, x=round(35.005e7), y=round(125e7), z=z) == result


@pytest.mark.parametrize("value", [2.0, -1.0, math.nan, math.inf])
def test_neither_arm_nor_disarm_is_unsupported(flying, value):
    assert flying.command_long(ARM, value) == UNSUPPORTED


def test_disarming_by_force_in_flight_brings_it_down(flying):
    assert flying.command_long(ARM, 0, 21196) == ACCEPTED
    flying.run(1.0)
    assert [flying.state(name) for name in ("height_m", "airspeed_mps", "climb_mps")] == [0.0, 0.0, 0.0]


def test_the_acceleration_of_a_speed_setpoint_bounds_the_change_of_speed(flying):
    assert flying.command_int(SPEED, 0, 27.0, 0.5) == ACCEPTED
    flying.run(4.0)
    assert flying.state("airspeed_mps") == pytest.approx(24.0, abs=0.02)


def test_a_speed_setpoint_that_it_has_already_does_not_change_the_acceleration(flying):
    flying.command_int(SPEED, 0, 27.0, 0.5)
    assert flying.command_int(SPEED, 0, 27.0, 1.5) == ACCEPTED
    flying.run(4.0)
    assert flying.state("airspeed_mps") == pytest.approx(24.0, abs=0.02)


def test_a_cancelled_heading_circles_where_guided_was_entered(flying):
    flying.set_mode(LOITER)
    flying.set_mode(GUIDED)
    entry = flying.state("north_m"), flying.state("east_m")
    flying.command_int(HEADING, 1, 90.0, 5.0)
    flying.run(30.0)
    assert flying.command_int(HEADING, 2, 0.0) == ACCEPTED
    flying.run(120.0)
    distance = math.hypot(flying.state("north_m") - entry[0], flying.state("east_m") - entry[1])
    assert distance == pytest.approx(flying.fleet.bodies[0].steering.radius_m, abs=3.0)


def test_the_interval_of_a_message_is_reported(flying):
    for message_id, interval_us in ((33, 1_000_000), (30, 50_000), (242, -1), (7777, 0)):
        if message_id == 30:
            flying.command_long(INTERVAL, message_id, interval_us)
        assert flying.command_long(510, message_id) == (ACCEPTED if interval_us else FAILED)
        reported = flying.ground.of("MESSAGE_INTERVAL")[-1]
        assert (reported.message_id, reported.interval_us) == (message_id, interval_us)


@pytest.mark.parametrize("interval_us", [-2.0, -math.inf, math.inf, math.nan, 1.0])
def test_intervals_that_are_none_are_denied(flying, interval_us):
    assert flying.command_long(INTERVAL, 30, interval_us) == DENIED


def test_arming_tells_where_home_is(parked):
    assert parked.command_long(ARM, 1) == ACCEPTED
    assert parked.ground.of("HOME_POSITION")[-1].latitude == 350000000


def test_the_old_set_mode_message_without_its_flag_changes_nothing(flying):
    flying.ground.send(flying.ground.dialect.set_mode_encode(1, 0, RTL))
    flying.run(0.1)
    assert flying.ground.of("HEARTBEAT")[-1].custom_mode == GUIDED


def test_mavlink_1_is_answered_in_mavlink_2(flying):
    message = flying.ground.dialect.command_long_encode(1, 1, 520, 0, 1, 0, 0, 0, 0, 0, 0)
    flying.ground.send_bytes(message.pack(flying.ground.dialect, force_mavlink1=True))
    flying.run(0.02)
    assert flying.ground.of("COMMAND_ACK")[-1].get_msgbuf()[0] == 0xFD
