"""From a vehicle's messages to the law's input: one state at one instant."""

from __future__ import annotations

import math

import pytest

from airlink.clock import NANOSECONDS, Instant, seconds_between
from airlink.endpoint import Address, VehicleId
from airlink.frame import Frame
from airlink.messages import Message
from airlink.messages.system import Timesync
from airlink.messages.telemetry import Attitude, GlobalPositionInt, VfrHud
from gcs_formation.estimation.airspeed import AirspeedScale
from gcs_formation.link.link_health import Connection
from gcs_formation.link.round_trips import RoundTrips
from gcs_formation.link.source_binding import SourceBinding
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.sampler import EXTRAPOLATED_S, Sampler
from gcs_formation.vehicle.telemetry import MAX_STAMP_DIFFERENCE_S, Telemetry
from gcs_formation.vehicle.vehicle import Vehicle
from tests.gcs_formation.vehicle.conftest import ORIGIN, position

STAMP_S, TURN_RADPS = 50.0, 0.2
OTHER = "its TIMESYNC tells another time than the stamps of its positions"
HERE = Address("127.0.0.1", 40000)
NOW = Instant(0)


def hand_over(vehicle: Vehicle, telemetry: Telemetry) -> None:
    """Give a vehicle the content of `telemetry`."""
    vehicle.telemetry = telemetry
    parts = vehicle.autopilot, vehicle.round_trips, vehicle.source_binding
    vehicle.sampler = Sampler(telemetry, *parts, None)


def answers(vehicle: Vehicle, time_s: float, now: Instant) -> None:
    """Let a vehicle whose clock shows `time_s` answer at once, after the mean wait for its loop."""
    vehicle.clock.observe(now, round((time_s + vehicle.clock.loop_s / 4) * NANOSECONDS), now)


@pytest.fixture
def vehicle(tell, telemetry) -> Vehicle:
    """Return a vehicle whose clock is 50 s ahead of ours, and that has sent everything but a current attitude."""
    made = Vehicle(VehicleId(1, 7), 0, ArduPlane(7, ORIGIN, 0.25), Connection(0), 10.0)
    tell(0, armed=True, above_home_m=100.0)
    hand_over(made, telemetry)
    answers(made, STAMP_S, NOW)
    telemetry.store(position(100.0, STAMP_S))
    telemetry.airspeed_stamp_s = STAMP_S
    return made


def turns(vehicle: Vehicle, heading_rad: float, stamp_s: float) -> None:
    vehicle.telemetry.store(Attitude(stamp_s, 0.0, 0.0, heading_rad, 0.0, 0.0, TURN_RADPS))


@pytest.mark.parametrize("apart_s", [-0.08, 0.0, 0.1])
def test_the_heading_is_that_of_the_position_s_instant_whichever_came_first(vehicle: Vehicle, apart_s: float) -> None:
    """At 0.2 rad/s and 22 m/s a heading that is 0.1 s old is that of a slot 0.6 m away, 30 m aside."""
    turns(vehicle, 1.0 + TURN_RADPS * apart_s, STAMP_S + apart_s)
    sample = vehicle.sampler.new(NOW, flew=vehicle.flew)
    assert sample is not None
    assert sample.heading_rad == pytest.approx(1.0)
    assert seconds_between(sample.stamp, NOW) == pytest.approx(0.0, abs=1e-6)
    assert vehicle.sampler.new(NOW, flew=vehicle.flew) is None, "once"


@pytest.mark.parametrize("apart_s", [-MAX_STAMP_DIFFERENCE_S - 0.1, MAX_STAMP_DIFFERENCE_S + 0.1])
def test_an_attitude_of_another_time_is_paired_with_no_position(vehicle: Vehicle, apart_s: float) -> None:
    turns(vehicle, 1.0, STAMP_S + apart_s)
    assert vehicle.sampler.new(NOW, flew=vehicle.flew) is None
    assert vehicle.telemetry.implausible == 1


@pytest.mark.parametrize(("late_s", "taken"), [(-2.1, False), (-1.9, True), (9.9, True), (10.1, False)])
def test_a_stamp_of_the_future_or_of_long_ago_is_no_sample(vehicle: Vehicle, late_s: float, taken: bool) -> None:
    turns(vehicle, 1.0, STAMP_S)
    sample = vehicle.sampler.new(Instant(round(late_s * NANOSECONDS)), flew=vehicle.flew)
    assert (sample is not None) is taken


@pytest.mark.parametrize("late_s", [-2.1, -1.9, 9.9, 10.1])
def test_while_it_is_no_sample_it_is_said_why(vehicle: Vehicle, late_s: float) -> None:
    turns(vehicle, 1.0, STAMP_S)
    now = Instant(round(late_s * NANOSECONDS))
    why = vehicle.sampler.why_unknown(now)
    assert (why is None) is (vehicle.sampler.new(now, flew=vehicle.flew) is not None)
    assert why in (None, f"{OTHER}: {50 + late_s:.0f} s, where the newest is of 50 s")


def test_what_is_not_of_one_time_is_said_too_and_of_nothing_nothing_is_said(vehicle: Vehicle) -> None:
    turns(vehicle, 1.0, STAMP_S - MAX_STAMP_DIFFERENCE_S - 0.1)
    assert vehicle.sampler.why_unknown(NOW) == "its position, attitude and airspeed aren't of one time"
    vehicle.telemetry.store(Attitude(STAMP_S, 0.0, 0.0, math.nan, 0.0, 0.0, 0.0))
    assert vehicle.sampler.why_unknown(NOW) == "it tells no attitude: ATTITUDE's yaw is NaN"
    vehicle.telemetry.airspeed_mps = math.nan
    assert vehicle.sampler.why_unknown(NOW) == "it has reported no airspeed in VFR_HUD"
    vehicle.telemetry.motion = None
    assert vehicle.sampler.why_unknown(NOW) is None
    vehicle.source_binding.rule(vehicle.telemetry.attitude, 0, HERE, NOW)
    assert vehicle.sampler.why_unknown(NOW) is None
    vehicle.source_binding.rule(Attitude(5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0, HERE, NOW)
    assert (vehicle.sampler.why_unknown(NOW) or "").endswith(": 50 s, where the newest is of 5 s")


@pytest.mark.parametrize(
    ("turn_radps", "hovers"), [(0.0, False), (TURN_RADPS, False), (-TURN_RADPS, False), (1.0, True)]
)
def test_a_place_is_carried_on_along_its_turn_and_a_multirotors_straight_on(
    vehicle: Vehicle, turn_radps: float, hovers: bool
) -> None:
    """On a circle of 22 m/s at 0.2 rad/s, a second later, it is 2.2 m beside the tangent, 22 m on."""
    motion = vehicle.telemetry.motion
    assert motion is not None
    motion.north_mps, motion.east_mps, motion.climb_mps = 0.0, 22.0, 1.0
    vehicle.telemetry.hovers = hovers
    vehicle.telemetry.store(Attitude(STAMP_S, 0.0, 0.0, math.pi / 2, 0.0, 0.0, turn_radps))
    for age_s in (0.0, 0.3, 1.0, EXTRAPOLATED_S):
        state, found_s = vehicle.sampler.extrapolated(Instant(round(age_s * NANOSECONDS))) or (None, math.nan)
        assert state is not None
        assert found_s == pytest.approx(age_s, abs=1e-6)
        turn = 0.0 if hovers else turn_radps
        along_m = 22.0 * (math.sin(turn * age_s) / turn if turn else age_s)
        right_m = 22.0 * ((1.0 - math.cos(turn * age_s)) / turn if turn else 0.0)
        assert state.north_m == pytest.approx(motion.north_m - right_m, abs=1e-4)
        assert state.east_m == pytest.approx(motion.east_m + along_m, abs=1e-4)
        assert state.height_m == pytest.approx(motion.height_m + age_s, abs=1e-4)


def test_where_one_is_that_was_last_heard_long_ago_isnt_known(vehicle: Vehicle, telemetry: Telemetry) -> None:
    state, age_s = vehicle.sampler.extrapolated(Instant(round((EXTRAPOLATED_S + 0.1) * NANOSECONDS))) or (None, 0.0)
    assert state is not None
    assert math.isnan(state.north_m)
    assert age_s == pytest.approx(EXTRAPOLATED_S + 0.1)
    vehicle.round_trips.clock.samples = 0
    assert vehicle.sampler.extrapolated(NOW) is None


def test_a_reading_in_thin_air_is_a_higher_true_airspeed(vehicle: Vehicle) -> None:
    """At 3000 m air has 0.742 of its density at sea level (ICAO Doc 7488); at rest it shows no scale."""
    vehicle.telemetry.armed = False
    vehicle.autopilot.airspeed_scale = AirspeedScale(3000.0, 14.0, 29.0)
    turns(vehicle, 1.0, STAMP_S)
    sample = vehicle.sampler.new(NOW, flew=vehicle.flew)
    assert sample is not None
    assert sample.airspeed_mps == vehicle.sampler.airspeed_mps == pytest.approx(22.0 / math.sqrt(0.7422), rel=1e-3)


def test_before_its_clock_is_known_there_is_no_sample(tell, telemetry) -> None:
    made = Vehicle(VehicleId(1, 7), 0, ArduPlane(7, ORIGIN, 0.25), Connection(0), 10.0)
    tell(0, armed=True, above_home_m=100.0)
    hand_over(made, telemetry)
    assert made.sampler.new(NOW, flew=made.flew) is None
    assert (made.sampler.why_unknown(NOW) or "").startswith("it answers no TIMESYNC")
    made.clock.observe(NOW, NANOSECONDS, NOW)
    sample = made.sampler.new(NOW, flew=made.flew)
    assert sample is not None
    assert (sample.north_m, sample.height_m) == pytest.approx((0.0, 100.0), abs=0.01)
    assert math.isclose(sample.heading_rad, 0.5)


def test_a_place_of_zero_and_zero_is_no_error_before_the_first_fix_and_counted_after_it() -> None:
    nowhere = GlobalPositionInt(STAMP_S, 0.0, 0.0, 100.0, 100.0, 0.0, 0.0, 0.0, 0.0)
    telemetry = Telemetry(ORIGIN)
    telemetry.store(nowhere)
    assert (telemetry.motion, telemetry.implausible) == (None, 0)
    telemetry.store(position(100.0, STAMP_S))
    known = telemetry.motion
    telemetry.store(nowhere)
    assert (telemetry.motion, telemetry.implausible) == (known, 1)


@pytest.mark.parametrize("turns_before", [0, 2])
def test_a_vehicle_flies_on_while_its_stamps_begin_again(vehicle: Vehicle, turns_before: int) -> None:
    """From 2 s before it to 3 s after; positions at 10 Hz take 20 ms, and attitudes are 50 ms older."""
    turn_ms = 2**32
    vehicle.telemetry.invalidate()
    vehicle.round_trips = RoundTrips(0.02)
    vehicle.clock = vehicle.round_trips.clock
    vehicle.source_binding = SourceBinding(vehicle.connection, vehicle.clock)
    hand_over(vehicle, vehicle.telemetry)
    for number in range(50):
        now = Instant(number * NANOSECONDS // 10)
        stamp_ms = (turns_before + 1) * turn_ms - 2000 + 100 * number - 20
        messages: list[Message] = [
            Attitude((stamp_ms - 50) % turn_ms / 1e3, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
            position(100.0, stamp_ms % turn_ms / 1e3),
            VfrHud(22.0, 22.0, 1.0, 50, 100.0, 0.0),
        ]
        if number % 5 == 0:
            asked = vehicle.round_trips.request(Instant(now - NANOSECONDS // 25))
            messages.append(Timesync((stamp_ms + 5) * 1_000_000, asked.ts1_ns))  # half of the mean wait later
        for each in messages:
            assert vehicle.source_binding.rule(each, 0, HERE, now)[0]
            vehicle.receive(Frame(7, 1, 0, 0, 2, each, b""), now)
        sample = vehicle.sampler.new(now, flew=vehicle.flew)
        if number > 0:  # before its first answer their number of rounds is unknown
            assert sample is not None
            assert seconds_between(sample.stamp, now) == pytest.approx(0.02, abs=0.001)
            assert vehicle.jitter.jitter_s < 1e-3 or number == 1
    assert (vehicle.restarts, vehicle.telemetry.implausible) == (0, 1 if turns_before else 0)
