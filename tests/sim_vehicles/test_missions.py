"""Missions written, read and flown by pymavlink; the answers are those of ArduPlane 4.7 (SITL) to the same messages."""

import importlib
import math

import pytest

from airlink.endpoint import Address, VehicleId
from formation_scenario.surroundings import Fault

dialect = importlib.import_module("pymavlink.dialects.v20.ardupilotmega")
OK, ERROR, BAD_FRAME, UNSUPPORTED, NO_SPACE, BAD_SEQUENCE, DENIED, CANCELLED = 0, 1, 2, 3, 4, 13, 14, 15
WAYPOINT, UNLIMITED, TURNS, TIME, RTL_ITEM, LAND, TAKEOFF, JUMP, SPEED = 16, 17, 18, 19, 20, 21, 22, 177, 178
TO_HEIGHT, DELAY, LAND_START, TAG, TO_TAG = 31, 112, 189, 600, 601
SET_CURRENT, START, ARM = 224, 300, 400
AUTO, RTL, LOITER, GUIDED = 10, 11, 12, 15
NONE, NOT_STARTED, ACTIVE, COMPLETE = 1, 2, 3, 5
HOME = (0, 0, WAYPOINT, 350000000, 1250000000, 0.0)


def item(seq, command=WAYPOINT, lat=35.01, lon=125.0, z=110.0, frame=3, params=(0, 0, 0, 0), current=0):
    position = round(lat * 1e7), round(lon * 1e7), z
    return dialect.MAVLink_mission_item_int_message(1, 1, seq, frame, command, current, 1, *params, *position)


def float_item(seq, command=WAYPOINT, lat=35.01, lon=125.0, z=110.0, frame=3, current=0):
    return dialect.MAVLink_mission_item_message(1, 1, seq, frame, command, current, 1, 0, 0, 0, 0, lat, lon, z)


def count(number, kind=0):
    return dialect.MAVLink_mission_count_message(1, 1, number, kind)


def ask(air, message, seconds=0.1, peer=None):
    """Send a message; return the answers of the mission protocol, as (name, number or result)."""
    peer = peer or air.ground
    before = len(peer.received)
    peer.send(message)
    air.run(seconds)
    return [answer for _, each in peer.received[before:] if (answer := reported(each)) is not None]


def reported(message):
    fields = {"MISSION_REQUEST": "seq", "MISSION_ACK": "type", "MISSION_COUNT": "count"}
    name = message.get_type()
    return (name, getattr(message, fields[name])) if name in fields else None


def upload(air, *items):
    """Upload items after home; return the answer to the last one."""
    answers = ask(air, count(1 + len(items)))
    for number, each in enumerate([item(0), *items]):
        assert answers == [("MISSION_REQUEST", number)]
        answers = ask(air, each)
    return answers


def read(air, seq, *, floats=False):
    kind = "mission_request" if floats else "mission_request_int"
    air.ground.send(getattr(dialect, f"MAVLink_{kind}_message")(1, 1, seq))
    air.run(0.1)
    return air.ground.of("MISSION_ITEM" if floats else "MISSION_ITEM_INT")[-1]


def listed(air):
    return ask(air, dialect.MAVLink_mission_request_list_message(1, 1))


def current(air):
    air.run(1.0)
    last = air.ground.of("MISSION_CURRENT")[-1]
    return last.seq, last.mission_state


def mode(air):
    return air.ground.of("HEARTBEAT")[-1].custom_mode


def test_what_was_written_is_read_back_with_home_first(flying):
    assert upload(flying, item(1), item(2, TURNS, params=(2, 0, -50, 1)), item(3, RTL_ITEM)) == [("MISSION_ACK", OK)]
    assert listed(flying) == [("MISSION_COUNT", 4)]
    home, first, circle, back = (read(flying, seq) for seq in range(4))
    assert (home.seq, home.frame, home.command, home.x, home.y, home.z) == HOME
    assert (first.x, first.y, first.z, first.frame, first.autocontinue) == (350100000, 1250000000, 110.0, 3, 1)
    assert (circle.param1, circle.param3, circle.param4) == (2.0, -50.0, 1.0)
    assert (back.frame, back.x, back.y, back.z) == (0, 0, 0, 0.0)
    assert {each.target_system for each in (home, first, circle, back)} == {255}


@pytest.mark.parametrize(
    ("sent", "kept"),
    [((30, 1, -60, 1), (30, 0, -1, 1)), ((30, 0, 60, 0), (30, 0, 1, 0)), ((0.5, 0, 0, 1), (0, 0, 1, 1))],
)
def test_of_a_circle_for_a_time_whole_seconds_and_its_direction_are_kept(flying, sent, kept):
    upload(flying, item(1, TIME, params=sent))
    back = read(flying, 1)
    assert (back.param1, back.param2, back.param3, back.param4) == kept


def test_items_with_floats_are_written_and_read_by_those_who_ask_for_them(flying):
    assert ask(flying, count(2)) == [("MISSION_REQUEST", 0)]
    assert ask(flying, float_item(0)) == [("MISSION_REQUEST", 1)]
    old = float_item(1).pack(flying.ground.dialect, force_mavlink1=True)
    flying.ground.send_bytes(old)
    flying.run(0.1)
    assert flying.ground.of("MISSION_ACK")[-1].type == OK
    assert read(flying, 1).x == pytest.approx(350100000, abs=40)
    floats = read(flying, 1, floats=True)
    assert (floats.x, floats.y) == pytest.approx((35.01, 125.0), abs=1e-5)


@pytest.mark.parametrize(
    ("command", "sent", "kept"),
    [
        (WAYPOINT, (3.7, 300, 300, 45), (0, 255, 255, 0)),
        (WAYPOINT, (0, 9, 5, 0), (0, 9, 5, 0)),
        (UNLIMITED, (0, 0, -70, 0), (0, 0, -70, 0)),
        (TURNS, (2.5, 0, 300, 0), (2, 0, 300, 0)),
        (TURNS, (0.5, 0, -60, 1), (0.5, 0, -60, 1)),
        (LAND, (20, 0, 0, 0), (20, 0, 0, 1)),
        (LAND, (1, 1, 0, math.nan), (1, 0, 0, 1)),
        (TO_HEIGHT, (1, -60, 0, 1), (0, -60, 0, 1)),
        (93, (1, 1, 0, 0), (1, 1, 0, 0)),
        (DELAY, (1.5, 1, 0, 0), (1.5, 0, 0, 0)),
        (115, (90, 10, 1, 0), (90, 10, 1, 0)),
        (183, (5, 1500, 1, 1), (5, 1500, 0, 0)),
        (LAND_START, (1, 1, 0, 0), (0, 0, 0, 0)),
        (201, (3, 1, 0, 0), (3, 0, 0, 0)),
        (206, (25.5, 0, 1, 0), (25.5, 0, 1, 0)),
        (TAG, (7, 1, 0, 0), (7, 0, 0, 0)),
        (TO_TAG, (7, 2, 0, 0), (7, 2, 0, 0)),
        (2000, (0, 1, 1, 0), (0, 1, 1, 0)),
    ],
)
def test_of_any_item_what_fits_is_kept(flying, command, sent, kept):
    assert upload(flying, item(1, command, params=sent)) == [("MISSION_ACK", OK)]
    back = read(flying, 1)
    assert (back.command, back.param1, back.param2, back.param3, back.param4) == (command, *kept)


def test_an_item_without_a_position_may_have_any_frame(flying):
    assert upload(flying, item(1, frame=2), item(2, 183, frame=2), item(3, SPEED, frame=1)) == [("MISSION_ACK", OK)]
    assert [read(flying, seq).frame for seq in (1, 2, 3)] == [0, 0, 0]


@pytest.mark.parametrize(("sent", "back"), [(0, 0), (5, 0), (3, 3), (6, 3), (10, 10), (11, 10)])
def test_frames_come_back_without_their_integer_variants(flying, sent, back):
    upload(flying, item(1, frame=sent))
    assert read(flying, 1).frame == back


@pytest.mark.parametrize(
    ("refused", "result"),
    [
        (item(1, 9999), UNSUPPORTED),
        (item(1, frame=1), BAD_FRAME),
        (item(1, lat=95.0), 10),
        (item(1, lon=181.0), 11),
        (item(1, z=math.nan), 12),
        (item(1, z=1e9), 12),
        (item(1, params=(math.nan, 0, 0, 0)), 6),
        (item(1, params=(0, 0, 0, math.nan)), OK),
        (item(1, TURNS, params=(1, 0, 0, math.nan)), 9),
        (float_item(1, lat=math.inf), 10),
    ],
)
def test_an_item_that_cannot_be_flown_ends_the_upload_with_its_reason(flying, refused, result):
    assert upload(flying, refused) == [("MISSION_ACK", result)]
    if result != OK:
        assert ask(flying, item(1)) == [("MISSION_ACK", ERROR)]


def test_an_item_out_of_turn_is_refused_and_the_upload_goes_on(flying):
    ask(flying, count(2))
    assert ask(flying, item(1)) == [("MISSION_ACK", BAD_SEQUENCE)]
    assert ask(flying, item(0)) == [("MISSION_REQUEST", 1)]


def test_an_item_that_does_not_come_is_asked_for_every_second_and_given_up_after_8(flying):
    answers = ask(flying, count(2), seconds=9.0)
    assert answers == [("MISSION_REQUEST", 0)] * 8 + [("MISSION_ACK", CANCELLED)]
    assert ask(flying, item(0)) == [("MISSION_ACK", ERROR)]


def test_an_upload_is_none_elses(flying):
    other = flying.peer(Address("127.0.0.1", 15000), system=250)
    ask(flying, count(2))
    for message in (count(3), item(0), dialect.MAVLink_mission_clear_all_message(1, 1)):
        assert ask(flying, message, peer=other) == [("MISSION_ACK", DENIED)]
    assert ask(flying, count(3)) == [("MISSION_REQUEST", 0)]  # restarted by its owner


def test_what_there_is_not_is_out_of_sequence(flying):
    upload(flying, item(1))
    asked = dialect.MAVLink_mission_request_int_message(1, 1, 2)
    assert ask(flying, asked) == [("MISSION_COUNT", 2), ("MISSION_ACK", BAD_SEQUENCE)]
    assert ask(flying, dialect.MAVLink_mission_request_message(1, 1, 2)) == [("MISSION_ACK", BAD_SEQUENCE)]


def test_more_than_there_is_room_for_is_refused(flying):
    assert ask(flying, count(656)) == [("MISSION_ACK", NO_SPACE)]


def test_a_part_is_written_again(flying):
    upload(flying, item(1), item(2))
    assert ask(flying, dialect.MAVLink_mission_write_partial_list_message(1, 1, 2, 2)) == [("MISSION_REQUEST", 2)]
    assert ask(flying, item(2, z=60.0)) == [("MISSION_ACK", OK)]
    assert (read(flying, 1).z, read(flying, 2).z) == (110.0, 60.0)
    assert ask(flying, dialect.MAVLink_mission_write_partial_list_message(1, 1, 2, 9)) == [("MISSION_ACK", ERROR)]


@pytest.mark.parametrize("clear", [dialect.MAVLink_mission_clear_all_message(1, 1), count(0)])
def test_a_mission_is_cleared(flying, clear):
    assert listed(flying) == [("MISSION_COUNT", 1)]
    upload(flying, item(1))
    assert ask(flying, clear) == [("MISSION_ACK", OK)]
    assert listed(flying) == [("MISSION_COUNT", 0)]
    assert current(flying) == (0, NONE)


def test_of_a_cleared_mission_home_is_still_reported(flying):
    ask(flying, dialect.MAVLink_mission_clear_all_message(1, 1))
    home = read(flying, 0)
    assert (home.seq, home.frame, home.command, home.x, home.y, home.z) == HOME
    assert read(flying, 0, floats=True).x == pytest.approx(35.0, abs=1e-5)


@pytest.mark.parametrize("kind", [1, 2])
def test_lists_of_fences_and_rally_points_are_empty_and_stay_so(flying, kind):
    assert ask(flying, count(5, kind)) == [("MISSION_ACK", UNSUPPORTED)]
    assert ask(flying, dialect.MAVLink_mission_request_list_message(1, 1, kind)) == [("MISSION_COUNT", 0)]
    assert flying.ground.of("MISSION_COUNT")[-1].mission_type == kind
    assert ask(flying, dialect.MAVLink_mission_clear_all_message(1, 1, kind)) == [("MISSION_ACK", OK)]
    assert ask(flying, dialect.MAVLink_mission_ack_message(1, 1, OK, kind)) == []
    assert ask(flying, dialect.MAVLink_mission_request_list_message(1, 1, 77)) == [("MISSION_ACK", UNSUPPORTED)]


def test_the_current_item_is_set_by_a_message_and_by_a_command(flying):
    upload(flying, item(1), item(2), item(3))
    assert current(flying) == (0, NOT_STARTED)
    flying.ground.send(dialect.MAVLink_mission_set_current_message(1, 1, 3))
    flying.run(0.02)
    assert flying.ground.of("MISSION_CURRENT")[-1].seq == 3
    before = len(flying.ground.of("MISSION_CURRENT"))
    assert flying.command_long(SET_CURRENT, 2) == OK
    assert flying.ground.of("MISSION_CURRENT")[before].seq == 2
    for wrong in (77, -1, math.nan):
        assert flying.command_long(SET_CURRENT, wrong) == 2
    flying.ground.send(dialect.MAVLink_mission_set_current_message(1, 1, 99))
    assert current(flying)[0] == 2
    assert flying.command_long(SET_CURRENT, 0) == OK
    assert current(flying)[0] == 1


def test_a_mission_is_flown_from_the_ground_to_its_end_and_home(parked):
    upload(
        parked,
        item(1, TAKEOFF, z=60.0),
        item(2, lat=35.008, lon=125.0, z=80.0),
        item(3, SPEED, params=(0, 26, -1, 0)),
        item(4, lat=35.008, lon=125.008, z=90.0),
        item(5, TURNS, lat=35.008, lon=125.008, z=90.0, params=(1, 0, 0, 0)),
        item(6, RTL_ITEM),
    )
    assert parked.command_long(START) == OK
    assert parked.command_long(ARM, 1) == OK
    parked.run_until(lambda: current(parked) == (2, ACTIVE), limit_s=60.0)
    assert parked.state("height_m") == pytest.approx(60.0, abs=4.0)
    parked.run_until(lambda: current(parked)[0] == 5, limit_s=120.0)
    assert parked.state("airspeed_mps") == pytest.approx(26.0, abs=0.1)
    north, east, _ = parked.fleet.origin.to_ned(math.radians(35.008), math.radians(125.008), 0.0)
    assert math.hypot(parked.state("north_m") - north, parked.state("east_m") - east) < 90.0 + 26.0
    parked.run_until(lambda: mode(parked) == RTL, limit_s=120.0)
    assert [each.seq for each in parked.ground.of("MISSION_ITEM_REACHED")] == [1, 2, 4, 5]
    assert current(parked) == (6, NOT_STARTED)


def test_the_distance_left_to_an_item_and_to_a_circle_s_centre_is_reported(flying):
    upload(flying, item(1, lat=35.0, lon=125.02))
    flying.set_mode(AUTO)
    flying.run(20.0)
    output = flying.ground.of("NAV_CONTROLLER_OUTPUT")[-1]
    _, east, _ = flying.fleet.origin.to_ned(math.radians(35.0), math.radians(125.02), 0.0)
    north_m, east_m = flying.state("north_m"), flying.state("east_m")
    assert output.wp_dist == pytest.approx(math.hypot(north_m, east - east_m), abs=23.0)
    assert output.target_bearing == pytest.approx(math.degrees(math.atan2(east - east_m, -north_m)), abs=3.0)
    assert output.xtrack_error == pytest.approx(north_m, abs=15.0)
    flying.set_mode(LOITER)
    flying.run(40.0)
    circle, output = flying.fleet.bodies[0].steering, flying.ground.of("NAV_CONTROLLER_OUTPUT")[-1]
    assert output.wp_dist == pytest.approx(circle.radius_m, rel=0.1)
    assert output.xtrack_error == pytest.approx(output.wp_dist - circle.radius_m, abs=1.0)
    heading = flying.ground.of("VFR_HUD")[-1].heading
    # To the right, on a clockwise circle.
    assert (output.target_bearing - heading) % 360 == pytest.approx(90.0, abs=10.0)


def test_a_mission_that_is_left_goes_on_with_the_item_that_was_under_way(flying):
    upload(flying, item(1, lat=35.003), item(2, lat=35.02), item(3, UNLIMITED, lat=35.012))
    assert flying.set_mode(AUTO) == OK
    flying.run_until(lambda: current(flying)[0] == 2, limit_s=60.0)
    flying.set_mode(LOITER)
    assert current(flying) == (2, NOT_STARTED)
    assert flying.command_long(START, 2, 2) == 2
    assert flying.command_long(START) == OK
    assert current(flying) == (2, ACTIVE)
    flying.ground.send(dialect.MAVLink_mission_set_current_message(1, 1, 3))
    flying.run(120.0)
    north, east, _ = flying.fleet.origin.to_ned(math.radians(35.012), math.radians(125.0), 0.0)
    distance = math.hypot(flying.state("north_m") - north, flying.state("east_m") - east)
    assert distance == pytest.approx(flying.fleet.bodies[0].steering.radius_m, rel=0.1)
    assert mode(flying) == AUTO


@pytest.mark.slow
def test_a_jump_is_flown_as_often_as_it_says(flying):
    upload(
        flying, item(1, lat=35.004), item(2, lat=35.0), item(3, JUMP, params=(1, 2, 0, 0)), item(4, TIME, lat=0, lon=0)
    )
    flying.set_mode(AUTO)
    flying.run_until(lambda: mode(flying) == RTL, limit_s=400.0)
    assert [each.seq for each in flying.ground.of("MISSION_ITEM_REACHED")] == [1, 2] * 3 + [4]


def test_a_mission_that_only_jumps_has_ended(flying):
    upload(flying, item(1, JUMP, params=(1, -1, 0, 0)))
    flying.set_mode(AUTO)
    flying.run(1.0)
    assert mode(flying) == RTL


def test_a_jump_to_a_tag_that_there_is_not_ends_the_mission(flying):
    upload(flying, item(1, lat=35.004), item(2, TO_TAG, params=(8, 1, 0, 0)), item(3, TAG, params=(7, 0, 0, 0)))
    flying.set_mode(AUTO)
    flying.run_until(lambda: mode(flying) == RTL, limit_s=60.0)
    assert current(flying) == (2, COMPLETE)


def test_it_circles_until_it_is_at_the_height_at_the_radius_and_side_that_the_item_asks_for(flying):
    upload(flying, item(1, TO_HEIGHT, lat=35.004, z=160.0, params=(0, -130, 0, 0)), item(2, lat=35.03, z=160.0))
    flying.set_mode(AUTO)
    flying.run(5.0)
    assert flying.fleet.bodies[0].steering.radius_m == -130.0
    flying.run_until(lambda: current(flying)[0] == 2, limit_s=120.0)
    assert flying.state("height_m") == pytest.approx(160.0, abs=6.0)


def test_a_mission_with_a_landing_ends_on_the_ground_at_its_position_disarmed_and_in_auto(parked):
    upload(
        parked,
        item(1, TAKEOFF, z=60.0),
        item(2, DELAY, params=(1, 0, 0, 0), frame=2),
        item(3, lat=35.012, lon=125.0, z=60.0),
        item(4, LAND_START),
        item(5, LAND, lat=35.004, lon=125.0, z=0.0),
    )
    parked.command_long(START)
    parked.command_long(ARM, 1)
    parked.run_until(lambda: current(parked)[0] == 5, limit_s=120.0)
    parked.run_until(lambda: parked.state("height_m") == 0.0, limit_s=300.0)
    parked.run(30.0)
    north, _, _ = parked.fleet.origin.to_ned(math.radians(35.004), math.radians(125.0), 0.0)
    assert math.hypot(parked.state("north_m") - north, parked.state("east_m")) < 50.0
    beat = parked.ground.of("HEARTBEAT")[-1]
    assert (beat.custom_mode, beat.base_mode & 128) == (AUTO, 0)
    assert [each.seq for each in parked.ground.of("MISSION_ITEM_REACHED")] == [1, 3]


def test_the_mode_that_flies_missions_is_reported_and_the_last_item_stays_the_current_one(flying):
    upload(flying, item(1, lat=35.004))
    assert flying.ground.of("MISSION_CURRENT")[-1].mission_mode == 0
    flying.set_mode(AUTO)
    flying.run(2.0)
    assert flying.ground.of("MISSION_CURRENT")[-1].mission_mode == 1
    flying.run_until(lambda: mode(flying) == RTL, limit_s=60.0)
    assert current(flying) == (1, COMPLETE)
    assert flying.ground.of("MISSION_CURRENT")[-1].mission_mode == 0
    flying.run(20.0)
    flying.set_mode(AUTO)
    assert current(flying) == (1, ACTIVE)


def test_a_shorter_mission_written_while_an_item_is_flown_lets_that_be_flown_to_its_end(flying):
    upload(flying, item(1, lat=35.001), item(2, lat=35.002), item(3, lat=35.015))
    flying.set_mode(AUTO)
    flying.run_until(lambda: current(flying)[0] == 3, limit_s=60.0)
    upload(flying, item(1, lat=35.001))
    assert current(flying) == (3, ACTIVE)
    assert mode(flying) == AUTO
    flying.run_until(lambda: mode(flying) == RTL, limit_s=120.0)
    north, _, _ = flying.fleet.origin.to_ned(math.radians(35.015), math.radians(125.0), 0.0)
    assert flying.state("north_m") == pytest.approx(north, abs=120.0)


def test_a_mission_that_is_flown_cannot_be_cleared(flying):
    clear = dialect.MAVLink_mission_clear_all_message(1, 1)
    upload(flying, item(1, lat=35.03))
    flying.set_mode(AUTO)
    flying.run(5.0)
    assert ask(flying, clear) == [("MISSION_ACK", ERROR)]
    assert mode(flying) == AUTO
    assert listed(flying) == [("MISSION_COUNT", 2)]
    flying.set_mode(LOITER)
    assert ask(flying, clear) == [("MISSION_ACK", OK)]
    assert listed(flying) == [("MISSION_COUNT", 0)]


def test_a_mission_replaced_by_none_while_it_is_flown_leads_home(flying):
    upload(flying, item(1, lat=35.03))
    flying.set_mode(AUTO)
    flying.run(5.0)
    assert mode(flying) == AUTO
    ask(flying, count(0))
    assert mode(flying) == RTL


@pytest.mark.parametrize("make", [item, float_item])
def test_an_item_marked_as_current_is_flown_to_at_once_in_guided_only(flying, make):
    flying.set_mode(LOITER)
    assert ask(flying, make(0, lat=35.005, lon=125.005, z=120.0, current=2)) == [("MISSION_ACK", ERROR)]
    flying.set_mode(GUIDED)
    assert ask(flying, make(0, lat=35.005, lon=125.005, z=120.0, current=2)) == [("MISSION_ACK", OK)]
    flying.run(150.0)
    north, east, _ = flying.fleet.origin.to_ned(math.radians(35.005), math.radians(125.005), 0.0)
    distance = math.hypot(flying.state("north_m") - north, flying.state("east_m") - east)
    assert distance == pytest.approx(flying.fleet.bodies[0].steering.radius_m, rel=0.1)
    assert flying.state("height_m") == pytest.approx(120.0, abs=0.01)
    assert ask(flying, make(0, z=140.0, current=3)) == [("MISSION_ACK", OK)]
    flying.run(30.0)
    assert flying.state("height_m") == pytest.approx(140.0, abs=0.1)
    assert listed(flying) == [("MISSION_COUNT", 1)]


def test_the_items_outlast_a_restart_and_the_upload_does_not(make_air):
    air = make_air(faults=((Fault(at_s=2.0, kind="restart"), frozenset({VehicleId(1, 1)})),))
    air.run(0.1)
    upload(air, item(1))
    ask(air, count(2))
    air.send_mission_time(1.0)
    air.run(4.0)
    assert listed(air) == [("MISSION_COUNT", 2)]
