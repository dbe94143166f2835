"""What integrators, limits and gusts do to a follower's setpoints: speed, heading and height, one at a time."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.slot import Slot, Vector3
from formation_scenario.fields import Frame
from gcs_formation.control.follower import FollowerController, swing_share
from gcs_formation.control.follower_loops import LawInput
from gcs_formation.control.outside import Feedback
from gcs_formation.control.setpoint import AS_DECIDED, Envelope, LeaderMotion, Mixer, Replaced, centroid
from tests.gcs_formation.control.law_ticks import parameters

DT_S = 0.1
WINDUP_S = 2.0
SPEED_MPS, HEADING_RAD = 22.0, 0.6
MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)
MIXER = Mixer(k_v=0.3, k_x=0.8, k_psi=0.25, k_y=0.04, k_z=0.7)
PLACE_M = -30.0, 20.0, 4.0
NOTHING = 0.0, 0.0, 0.0


def controller(
    kp: Vector3 = NOTHING, ki: Vector3 = NOTHING, kd: Vector3 = NOTHING, frame: Frame = "leader_heading"
) -> FollowerController:
    """Return a law without a limit of its corrections' growth."""
    plain = parameters(np.array(kp), np.array(ki), np.array(kd), frame)
    return FollowerController(replace(plain, mixer=MIXER, slew=(1e3, 1e3)))


def pair(
    error_m: Vector3 = NOTHING,
    faster_mps: float = 0.0,
    turned_rad: float = 0.0,
    climb_mps: float = 0.0,
    leader_mps: float = SPEED_MPS,
    wind_mps: tuple[float, float] = (0.0, 0.0),
    replaced: Replaced = AS_DECIDED,
) -> LawInput:
    """Return a follower with errors forward, right and up, that flies faster and heads further right than its leader.

    The wind that it has besides its leader's is along and across the leader's heading.
    """
    cos, sin = math.cos(HEADING_RAD), math.sin(HEADING_RAD)
    forward_m, right_m = PLACE_M[0] - error_m[0], PLACE_M[1] - error_m[1]
    follower = FlightState(
        cos * forward_m - sin * right_m,
        sin * forward_m + cos * right_m,
        100.0 + PLACE_M[2] - error_m[2],
        climb_mps,
        leader_mps + faster_mps,
        HEADING_RAD + turned_rad,
        cos * wind_mps[0] - sin * wind_mps[1],
        sin * wind_mps[0] + cos * wind_mps[1],
    )
    leader = LeaderMotion(
        FlightState(0.0, 0.0, 100.0, 0.0, leader_mps, HEADING_RAD, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0, DT_S
    )
    flown = follower.airspeed_mps, follower.heading_rad, follower.height_m
    return LawInput(leader, follower, Slot([*PLACE_M], [0.0] * 3, [0.0] * 3), MODEL, flown, 0.0, [1.0] * 3, replaced)


def integrals(of: FollowerController) -> Vector3:
    return of._forward.integral, of._right.integral, of._height.integral


def excess(of: FollowerController, given: LawInput) -> list[float]:
    """Return what is commanded beyond the slot's own speed, heading and height, which last."""
    of.decide(given, DT_S)
    speed_mps, heading_rad, height_m = of.setpoint
    return [speed_mps - given.leader.state.airspeed_mps, heading_rad - HEADING_RAD, height_m - 104.0]


@pytest.mark.parametrize(
    ("replaced", "grows"),
    [
        (AS_DECIDED, (1.0, 1.0, 1.0)),
        ((True, False, False), (0.0, 1.0, 1.0)),
        ((False, True, False), (1.0, 0.0, 1.0)),
        ((False, False, True), (1.0, 1.0, 0.0)),
    ],
)
def test_each_integral_grows_by_gain_error_and_time_unless_its_setpoint_was_replaced(
    replaced: Replaced, grows: Vector3
) -> None:
    of = controller(ki=(0.5, 0.6, 0.7))
    of.decide(pair((0.3, -0.4, 0.2), faster_mps=0.1, turned_rad=0.02, replaced=replaced), DT_S)
    mixed = 0.8 * 0.3 - 0.3 * 0.1, -0.04 * 0.4 - 0.25 * 0.02, 0.7 * 0.2
    assert of.mixed == pytest.approx(mixed)
    expected = [ki * error * DT_S * share for ki, error, share in zip((0.5, 0.6, 0.7), mixed, grows, strict=True)]
    assert integrals(of) == pytest.approx(expected)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    ("channel", "error_m", "gain", "most"),
    [
        (0, 8.0, 1.0, 6.0),
        (1, 9.0, 4.0, math.pi / 3.0),
        (2, 40.0, 1.0, 12.0 - 40.0),
        (0, 1.0, 1.0, 0.8),
        (2, 1.0, 1.0, 0.7),
    ],
)
def test_what_a_limit_takes_from_an_output_leaves_the_integral_within_the_anti_windups_time(
    channel: int, error_m: float, gain: float, most: float, side: float
) -> None:
    """Limits are 28 - 22 = 22 - 16 = 6 m/s, 60 degrees, and 12 m from where it is: 28 m short of a slot 40 m off."""
    errors, kp, ki = [0.0] * 3, [0.0] * 3, [0.0] * 3
    errors[channel], kp[channel], ki[channel] = side * error_m, gain, 30.0
    of = controller((kp[0], kp[1], kp[2]), (ki[0], ki[1], ki[2]))
    found = excess(of, pair((errors[0], errors[1], errors[2])))
    weight = (0.8, 0.04, 0.7)[channel]
    assert side * found[channel] == pytest.approx(most)
    free = most if channel < 2 or error_m < 2.0 else 0.0
    grown = 30.0 * weight * error_m * DT_S - (gain * weight * error_m - free) * DT_S / WINDUP_S
    bound = 12.0 if channel == 0 else math.inf
    taken = (gain * weight * error_m - free) * DT_S / WINDUP_S
    assert side * integrals(of)[channel] == pytest.approx(min(grown + taken, bound) - taken)


def test_what_the_slots_own_motion_asks_beyond_the_envelope_is_nothing_to_unwind() -> None:
    """A leader at 30 m/s, a follower limited to 28: the 2 m/s are no output of the integral's."""
    of = controller(ki=(0.5, 0.0, 0.0))
    of._forward.integral = 0.4
    given = pair((0.5, 0.0, 0.0), leader_mps=30.0)
    of.decide(given, DT_S)
    assert of.setpoint[0] == 28.0
    assert integrals(of)[0] == pytest.approx(0.4 + 0.5 * 0.4 * DT_S - 0.4 * DT_S / WINDUP_S)
    slower = controller(ki=(0.5, 0.0, 0.0))
    slower._forward.integral = -0.4
    slower.decide(pair((-0.5, 0.0, 0.0), leader_mps=15.0), DT_S)
    assert integrals(slower)[0] == pytest.approx(-0.4 - 0.5 * 0.4 * DT_S + 0.4 * DT_S / WINDUP_S)


def test_the_speeds_integral_is_at_most_the_range_of_speeds() -> None:
    """Where it and the derivative cancel, no limit stops it before 28 - 16 = 12 m/s."""
    of = controller(ki=(2.0, 0.0, 0.0), kd=(4.0, 0.0, 0.0))
    for _ in range(200):
        of.decide(pair((9.0, 0.0, 0.0), faster_mps=3.0), DT_S)
    assert 11.0 < integrals(of)[0] <= 12.0


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    ("short_mps", "short_rad", "own_mps2", "own_rps"), [(2.0, 0.07, 2.0 / 3.9, 0.05), (9.0, 1.4, 1.5, 0.25)]
)
def test_a_followers_own_rates_are_those_at_the_end_of_the_tick_before(
    short_mps: float, short_rad: float, own_mps2: float, own_rps: float, side: float
) -> None:
    """By (7) from what is left to its setpoints, with lags of 4 s and 1.5 s less the tick of 0.1 s, and its limits."""
    of, given = controller(), pair()
    given.commanded = given.state.airspeed_mps + side * short_mps, HEADING_RAD + side * short_rad, 104.0
    of.decide(given, DT_S)
    assert (of._forward.rate, of._right.rate) == pytest.approx((-side * 0.3 * own_mps2, -side * 0.25 * own_rps))


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    ("away_m", "closing_mps", "most_mps"),
    [(4.0, 3.0, 2.0 * (1.0 + math.sqrt(6.0)) - 3.0), (4.0, 5.0, 1.0 + math.sqrt(6.0)), (0.54, 0.0, 3.8)],
)
def test_who_closes_faster_than_it_can_brake_from_is_commanded_no_faster_for_that(
    away_m: float, closing_mps: float, most_mps: float, side: float
) -> None:
    """From 4 m away it is 1 m/s + sqrt(2 x 0.75 x 4), from 0.54 m 1.9 m/s; who is slower gets what it lacks besides."""
    of = controller(kp=(99.0, 0.0, 0.0))
    found = excess(of, pair((side * away_m, 0.0, 0.0), faster_mps=side * closing_mps))
    assert side * found[0] == pytest.approx(most_mps)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    ("away_m", "closing_mps", "arrives"),
    [
        (11.0, 0.6, True),
        (11.0, -0.6, True),
        (9.0, 0.6, False),
        (11.0, 0.4, False),
        (19.0, 0.6, True),
        (11.0, 0.9, True),
    ],
)
def test_who_closes_on_a_far_slot_at_speed_is_arriving(
    away_m: float, closing_mps: float, arrives: bool, side: float
) -> None:
    """Further than 10 m, faster than 0.5 m/s, in either direction: its integral doesn't grow."""
    of = controller(ki=(0.5, 0.0, 0.0))
    of.decide(pair((side * away_m, 0.0, 0.0), faster_mps=side * closing_mps), DT_S)
    grown = 0.5 * DT_S * (0.8 * away_m - 0.3 * closing_mps)
    assert side * integrals(of)[0] == pytest.approx(0.0 if arrives else grown)


def test_an_arrival_ends_after_5_s_at_the_slots_speed_and_begins_again_at_once() -> None:
    of, flown = controller(ki=(0.5, 0.0, 0.0)), list[float]()
    of.decide(pair((15.0, 0.0, 0.0), faster_mps=2.0), DT_S)
    for _ in range(30):
        of.decide(pair((1.0, 0.0, 0.0)), DT_S)
    of.decide(pair((1.0, 0.0, 0.0), faster_mps=0.6), DT_S)
    for _ in range(60):
        of.decide(pair((1.0, 0.0, 0.0)), DT_S)
        flown.append(integrals(of)[0])
    still = sum(each == 0.0 for each in flown)
    assert still in (49, 50), "5 s of 0.1 s each, within rounding"
    assert flown[-1] == pytest.approx((60 - still) * 0.5 * 0.8 * DT_S)
    of.decide(pair((15.0, 0.0, 0.0), faster_mps=2.0), DT_S)
    assert integrals(of)[0] == flown[-1]


def test_an_arrival_is_forgotten_with_the_leader() -> None:
    of = controller(ki=(0.5, 0.0, 0.0))
    of.decide(pair((15.0, 0.0, 0.0), faster_mps=2.0), DT_S)
    of.reset()
    of.decide(pair((1.0, 0.0, 0.0)), DT_S)
    assert integrals(of)[0] == pytest.approx(0.5 * 0.8 * DT_S)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("climb_mps", "grows"), [(1.04, True), (1.06, False), (-1.06, True)])
def test_a_height_error_that_shrinks_near_the_climb_limit_is_not_integrated(
    climb_mps: float, grows: bool, side: float
) -> None:
    """At 0.35 times 3 m/s and more towards the slot, but not away from it."""
    of = controller(ki=(0.0, 0.0, 0.5))
    of.decide(pair((0.0, 0.0, side * 0.5), climb_mps=side * climb_mps), DT_S)
    assert side * integrals(of)[2] == pytest.approx(0.5 * 0.7 * 0.5 * DT_S if grows else 0.0)


def test_a_vehicle_that_climbs_through_its_slots_height_has_no_error_to_integrate() -> None:
    of = controller(ki=(0.0, 0.0, 0.5))
    of.decide(pair(climb_mps=2.0), DT_S)
    assert of.mixed[2] == 0.0
    assert integrals(of)[2] == 0.0


class Adding(Feedback):
    """Feedback from outside: as it is stated."""

    def __init__(self, stated: Vector3) -> None:
        self.stated, self.excess, self.resets = stated, NOTHING, 0

    def output(self, mixed: Vector3, slopes: Vector3, replaced: Replaced, dt_s: float) -> Vector3:
        return self.stated

    def limited(self, excess: Vector3) -> None:
        self.excess = excess

    def reset(self) -> None:
        self.resets += 1


def test_a_law_from_outside_is_limited_alike_and_stated_what_the_limits_added() -> None:
    """3 m/s, 2 rad and 30 m are asked, 60 degrees and 12 m are what there is; the height is 1 m below the slot's."""
    of, outside = controller(), Adding((3.0, -2.0, 30.0))
    of.feedback = outside
    found = excess(of, pair((20.0, 0.0, 1.0)))
    assert found == pytest.approx([3.0, -math.pi / 3.0, 11.0])
    assert outside.excess == pytest.approx((0.0, 2.0 - math.pi / 3.0, 11.0 - 30.0))
    assert integrals(of) == NOTHING
    assert all(math.isnan(each) for each in of.gains)
    of.reset()
    assert outside.resets == 1


@pytest.mark.parametrize("place", [0, 1, 2])
def test_an_output_that_is_not_finite_is_not_hidden_by_limits(place: int) -> None:
    of, stated = controller(), [0.0, 0.0, 0.0]
    stated[place] = math.inf
    of.feedback = Adding((stated[0], stated[1], stated[2]))
    of.decide(pair(), DT_S)
    assert math.isinf(of.setpoint[place])


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_heading_correction_grows_by_a_gusts_answer_besides(side: float) -> None:
    """1.04 times the maximum turn rate a tick, plus the setpoint's lead on the change of the drift across.

    From 22 m/s with a lag of 1.5 s it is 1.5 x 2 x 0.5 / 22 rad, against the gust.
    """
    of = FollowerController(replace(parameters(np.array((0.0, 9.0, 0.0)), np.zeros(3), np.zeros(3)), mixer=MIXER))
    of.decide(pair(), DT_S)
    gusty = pair((0.0, side * 10.0, 0.0), wind_mps=(0.0, side * 0.5))
    free = controller()
    free.decide(pair(), DT_S)
    against = excess(free, gusty)[1]
    led = 1.5 * 2.0 * 0.5 / math.hypot(SPEED_MPS, 0.5) * (SPEED_MPS / math.hypot(SPEED_MPS, 0.5))
    assert against == pytest.approx(-side * (math.atan2(0.5, SPEED_MPS) + led))
    assert excess(of, gusty)[1] - against == pytest.approx(side * (1.04 * DT_S * 0.25 + led))


def test_in_the_followers_own_frame_a_gust_across_is_answered_by_the_slow_crab_alone() -> None:
    """Its growth limit is as wide as the answer would be; along, the speed answers at once."""
    of = controller(frame="follower_heading")
    of.decide(pair(), DT_S)
    speed_mps, turned_rad, _ = excess(of, pair(wind_mps=(0.6, 0.0)))
    assert speed_mps == pytest.approx(-0.6 - 4.0 * 2.0 * 0.6)
    assert turned_rad == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("right_m", "share"), [(0.0, 1.0), (13.2, 0.5), (-13.2, 0.5), (29.92, 0.6 / 1.96), (500.0, 0.6 / 1.96)]
)
def test_the_heading_has_half_its_bandwidth_for_a_slot_that_is_0_6_s_sideways(right_m: float, share: float) -> None:
    """And 0.6 / (0.6 + 1.36) of it from 1.36 s sideways on, 29.92 m at 22 m/s."""
    assert swing_share(right_m, SPEED_MPS) == pytest.approx(share)


@pytest.mark.parametrize(
    ("off_deg", "most_deg"), [(0.0, 60.0), (60.0, 60.0), (75.0, 45.0), (90.0, 30.0), (119.0, 1.0), (121.0, 0.0)]
)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_correction_of_a_heading_shrinks_from_60_to_120_degrees_off(
    off_deg: float, most_deg: float, side: float
) -> None:
    state = FlightState(0.0, 0.0, 100.0, 0.0, SPEED_MPS, 3.0 + side * math.radians(off_deg), 0.0, 0.0)
    bounds = Envelope(3.0, state, MODEL)
    for towards in (1.0, -1.0):
        found = bounds.limit(SPEED_MPS, 3.0 + towards * 9.0, 100.0)[1]
        assert found - 3.0 == pytest.approx(towards * math.radians(most_deg))


def test_an_envelope_is_reached_from_both_sides() -> None:
    bounds = Envelope(0.0, FlightState(0.0, 0.0, 100.0, 0.0, SPEED_MPS, 0.0, 0.0, 0.0), MODEL)
    assert bounds.limit(15.9, 0.0, 87.9) == (16.0, 0.0, 88.0)
    assert bounds.limit(28.1, 0.0, 112.1) == (28.0, 0.0, 112.0)
    assert bounds.limit(16.1, 0.1, 88.1) == (16.1, 0.1, 88.1)
    for place in range(3):
        values = [40.0, 9.0, 500.0]
        values[place] = math.nan
        kept = bounds.limit(values[0], values[1], values[2])
        assert [math.isnan(each) for each in kept] == [each == place for each in range(3)]
        assert kept[(place + 1) % 3] == values[(place + 1) % 3], "nothing is limited beside what isn't finite"


def test_a_centroid_has_its_followers_mean_wind_and_flies_level() -> None:
    still = [0.0] * 3
    slots = [Slot([-30.0, 20.0, 4.0], still, still), Slot([-30.0, -20.0, -2.0], still, still)]
    followers = [
        FlightState(70.0, 20.0, 104.0, 0.3, 21.0, 0.0, 2.0, -1.0),
        FlightState(70.0, -20.0, 98.0, -0.1, 23.0, 0.0, 4.0, -3.0),
    ]
    leader = centroid(followers, slots, SPEED_MPS, 0.0, "leader_heading")
    assert leader.values() == pytest.approx((100.0, 0.0, 100.0, 0.0, SPEED_MPS, 0.0, 3.0, -2.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("turn_rps", [0.0, 0.08])
def test_a_centroid_of_slots_that_move_north_and_east_heads_as_they_need(turn_rps: float) -> None:
    """1.2 m/s to the east besides 22 m/s to the north, for one follower; the other's slot stands."""
    still = [0.0] * 3
    slots = [Slot([-30.0, 20.0, 0.0], [0.0, 1.2, 0.0], still), Slot([-30.0, -20.0, 0.0], still, still)]
    headings_rad = math.atan2(1.2, SPEED_MPS), 0.0
    followers = [
        FlightState(70.0, 20.0, 100.0, 0.0, SPEED_MPS, headings_rad[0], 0.0, 0.0),
        FlightState(70.0, -20.0, 100.0, 0.0, SPEED_MPS, headings_rad[1], 0.0, 0.0),
    ]
    leader = centroid(followers, slots, SPEED_MPS, turn_rps, "north")
    assert (leader.north_m, leader.east_m, leader.heading_rad) == pytest.approx((100.0, 0.0, 0.0), abs=1e-9)
