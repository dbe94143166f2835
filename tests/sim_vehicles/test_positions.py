"""Emulated multirotors fly to positions in every frame, as ArduCopter 4.7 and PX4 1.17 did."""

from __future__ import annotations

import math

import pytest

from sim_vehicles.autopilot.modes_and_failsafe import CopterMode, Px4Mode
from tests.sim_vehicles.conftest import mavlink
from tests.sim_vehicles.test_copter import MODEL
from tests.sim_vehicles.test_px4 import COPTER

ACCEPTED, DENIED, UNSUPPORTED, FAILED, WRONG_FRAME = 0, 2, 3, 4, 9
POSITION_ALONE, POSITION_AND_VELOCITY, VELOCITY_ONLY = 0xDF8, 0xDC0, 0xDC7
LOCAL, OFFSET, BODY, BODY_OFFSET = 1, 7, 8, 9
REPOSITION, CHANGE_MODE = 192, 1.0
LAT, LON, E7_PER_M = 350000000, 1250000000, 90.15
"""Metres in a degree of latitude, 110.9 km; home is at 35° N."""


class Flier:
    """Sends setpoints to one emulated multirotor that hovers at 100 m."""

    def __init__(self, air):
        self.air = air
        self.vehicle = air.fleet.vehicles[0]

    def command(self, *position, mask=POSITION_ALONE, frame=LOCAL, velocity=(0.0, 0.0, 0.0), yaw=0.0):
        fields = (0, 1, 1, frame, mask, *position, *velocity, 0, 0, 0, yaw, 0)
        self.air.ground.send(mavlink.MAVLink_set_position_target_local_ned_message(*fields))

    def command_globally(self, north_m, alt_m, *, frame=6):
        fields = (0, 1, 1, frame, POSITION_ALONE, LAT + round(north_m * E7_PER_M), LON, alt_m, *[0.0] * 8)
        self.air.ground.send(mavlink.MAVLink_set_position_target_global_int_message(*fields))

    @property
    def position(self):
        motion = self.air.fleet.bodies[0].motion
        return motion.north_m, motion.east_m, motion.height_m

    @property
    def nose_deg(self):
        return math.degrees(self.air.fleet.bodies[0].shown().heading_rad) % 360

    @property
    def texts(self):
        return [each.text for each in self.air.ground.of("STATUSTEXT")]


@pytest.fixture
def copter(make_air):
    """Return an ArduCopter in GUIDED that hovers 100 m over its home, which is 10 m above sea level."""
    flier = Flier(make_air(model=MODEL, origin_alt_m=10.0))
    flier.air.run(4.0)
    flier.command(0.0, 0.0, -100.0, mask=POSITION_ALONE & ~0x400)  # speeds up the climb
    flier.air.run(40.0)
    return flier


@pytest.fixture
def px4(make_air):
    """Return a PX4 multirotor that hovers likewise, in OFFBOARD by a stream of zero velocities."""
    flier = Flier(make_air(model=COPTER, origin_alt_m=10.0))
    flier.air.ground.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    for _ in range(40):
        flier.command(0.0, 0.0, 0.0, mask=VELOCITY_ONLY)
        flier.air.run(0.1)
    flier.air.ground.send(mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, 6, 0, 0, 0, 0, 0))
    flier.air.run(0.1)
    assert flier.vehicle.mode is Px4Mode.OFFBOARD
    return flier


def test_commanded_once_it_flies_to_a_position_and_stays_with_its_nose_ahead(copter):
    copter.command(30.0, 40.0, -80.0)
    copter.air.run(40.0)
    assert copter.position == pytest.approx((30.0, 40.0, 80.0), abs=0.2)
    assert copter.nose_deg == pytest.approx(53.1, abs=2.0)
    copter.air.run(20.0)
    assert copter.position == pytest.approx((30.0, 40.0, 80.0), abs=0.1)
    assert copter.vehicle.pilot.mode is CopterMode.GUIDED


def test_a_position_with_a_velocity_is_flown_to_and_a_velocity_ends_it(copter):
    copter.command(30.0, 0.0, -100.0, mask=POSITION_AND_VELOCITY, velocity=(1.0, 0.0, 0.0))
    copter.air.run(25.0)
    assert copter.position == pytest.approx((30.0, 0.0, 100.0), abs=0.2)
    for _ in range(30):
        copter.command(0.0, 0.0, 0.0, mask=VELOCITY_ONLY, velocity=(0.0, 2.0, 0.0))
        copter.air.run(0.1)
    assert copter.position[1] > 2.0


@pytest.mark.parametrize(
    ("frame", "north_m", "east_m"), [(OFFSET, 20.0, 5.0), (BODY, -5.0, 20.0), (BODY_OFFSET, -5.0, 20.0)]
)
def test_positions_from_where_it_is_and_from_its_nose(copter, frame, north_m, east_m):
    copter.command(10.0, 0.0, -100.0, mask=POSITION_ALONE & ~0x400, yaw=math.pi / 2)
    copter.air.run(15.0)
    copter.command(20.0, 5.0, -10.0, frame=frame)
    copter.air.run(25.0)
    assert copter.position == pytest.approx((10.0 + north_m, east_m, 110.0), abs=0.5)


@pytest.mark.parametrize("frame", [BODY, BODY_OFFSET])
def test_velocities_of_the_nose(copter, frame):
    copter.command(0.0, 0.0, -100.0, mask=POSITION_ALONE & ~0x400, yaw=math.pi / 2)
    copter.air.run(5.0)
    for _ in range(50):
        copter.command(
            0.0, 0.0, 0.0, mask=VELOCITY_ONLY & ~0x400, velocity=(2.0, 0.0, 0.0), yaw=math.pi / 2, frame=frame
        )
        copter.air.run(0.1)
    assert copter.position[1] > 5.0
    assert abs(copter.position[0]) < 0.3


@pytest.mark.parametrize(("frame", "alt_m"), [(0, 90.0), (5, 90.0), (3, 80.0), (6, 80.0), (11, 80.0)])
def test_positions_by_latitude_in_every_frame(copter, frame, alt_m):
    copter.command_globally(30.0, alt_m, frame=frame)
    copter.air.run(25.0)
    assert copter.position == pytest.approx((30.0, 0.0, 80.0), abs=0.3)


@pytest.mark.parametrize("z", [math.nan, math.inf])
def test_a_position_that_isnt_finite_stops_it(copter, z):
    copter.command(30.0, 0.0, -100.0)
    copter.air.run(2.0)
    copter.command(60.0, 0.0, z)
    copter.air.run(10.0)
    assert copter.position[0] < 20.0


def test_reposition_by_integers_from_any_mode(copter):
    position = {"x": LAT + round(20.0 * E7_PER_M), "y": LON, "z": 95.0}
    assert copter.air.command_long(REPOSITION, -1, CHANGE_MODE, 0, 0, 35.0001, 125.0, 95.0) == UNSUPPORTED
    copter.air.set_mode(5)
    assert copter.air.command_int(REPOSITION, -1, 0, 0, math.nan, frame=6, **position) in {DENIED, FAILED}
    assert copter.air.command_int(REPOSITION, -1, CHANGE_MODE, 0, math.nan, frame=6, **position) == ACCEPTED
    assert copter.air.command_int(REPOSITION, -1, CHANGE_MODE, 0, math.nan, frame=6, x=0, y=0, z=95.0) == DENIED
    copter.air.run(25.0)
    assert copter.position == pytest.approx((20.0, 0.0, 95.0), abs=0.3)


def test_an_item_marked_as_current_is_flown_to(copter):
    item = (1, 1, 0, 3, 16, 2, 1, 0, 0, 0, 0, 35.0002, 125.0, 95.0)
    copter.air.ground.send(mavlink.MAVLink_mission_item_message(*item))
    copter.air.run(25.0)
    assert copter.air.ground.of("MISSION_ACK")[-1].type == ACCEPTED
    assert copter.position == pytest.approx((22.2, 0.0, 95.0), abs=0.5)


@pytest.mark.parametrize("globally", [False, True])
def test_a_px4_flies_to_positions_that_it_is_commanded_again_and_again(px4, globally):
    for _ in range(250):
        px4.command_globally(30.0, 80.0) if globally else px4.command(30.0, 0.0, -80.0)
        px4.air.run(0.1)
    assert px4.position == pytest.approx((30.0, 0.0, 80.0), abs=0.3)


@pytest.mark.parametrize(
    ("commanded", "text"),
    [
        ({"frame": BODY_OFFSET}, "SET_POSITION_TARGET_LOCAL_NED coordinate frame 9 unsupported"),
        ({"frame": BODY}, "SET_POSITION_TARGET_LOCAL_NED invalid"),
    ],
)
def test_a_px4_says_which_positions_it_doesnt_take(px4, commanded, text):
    px4.command(30.0, 0.0, -80.0, **commanded)
    px4.air.run(0.1)
    assert text in "".join(px4.texts)


def test_a_px4_takes_three_frames_of_latitude(px4):
    px4.command_globally(30.0, 80.0, frame=3)
    px4.air.run(0.1)
    assert "SET_POSITION_TARGET_GLOBAL_INT invalid coordinate frame 3" in "".join(px4.texts)


def test_a_px4_is_repositioned_in_hold(px4):
    position = {"x": LAT + round(20.0 * E7_PER_M), "y": LON, "z": 105.0}
    assert px4.air.command_int(REPOSITION, -1, CHANGE_MODE, 0, math.nan, frame=6, **position) == WRONG_FRAME
    assert px4.air.command_int(REPOSITION, -1, CHANGE_MODE, 0, math.nan, frame=5, **position) == ACCEPTED
    px4.air.run(40.0)
    assert px4.vehicle.mode is Px4Mode.HOLD
    assert px4.position == pytest.approx((20.0, 0.0, 95.0), abs=0.3)
