"""The law of followers that hover: velocities in place of speed and heading, limited so that they can brake."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.slot import Slot, Vector3
from gcs_formation.control.follower_loops import LawInput
from gcs_formation.control.laws import VelocityController
from gcs_formation.control.outside import Feedback
from gcs_formation.control.setpoint import AS_DECIDED, LeaderMotion, Mixer, Replaced
from tests.gcs_formation.control.law_ticks import parameters

DT_S = 0.1
WINDUP_S = 2.0
MODEL = AutopilotModel(0.8, 0.8, 1.0, 3.0, 0.0, 12.0, 1.5, 2.0, 3.0)
MIXER = Mixer(k_v=0.3, k_x=0.8, k_psi=0.2, k_y=0.05, k_z=0.7)
SLOT = Slot([-6.0, 8.0, 2.0], [0.0] * 3, [0.0] * 3)
AXIS_RAD = 0.6


def controller(
    kp: Vector3 = (0.0, 0.0, 0.0), ki: Vector3 = (0.0, 0.0, 0.0), kd: Vector3 = (0.0, 0.0, 0.0)
) -> VelocityController:
    return VelocityController(replace(parameters(np.array(kp), np.array(ki), np.array(kd)), mixer=MIXER))


def pair(
    error_m: Vector3 = (0.0, 0.0, 0.0),
    leader_mps: float = 0.0,
    climbs_mps: float = 0.0,
    slot: Slot = SLOT,
    model: AutopilotModel = MODEL,
    replaced: Replaced = AS_DECIDED,
    follower_mps: Vector3 = (0.0, 0.0, 0.0),
) -> LawInput:
    """Return a follower with errors forward, right and up of a leader that heads by `AXIS_RAD`, and its velocity."""
    leader = FlightState(50.0, -20.0, 100.0, climbs_mps, leader_mps, AXIS_RAD, 0.0, 0.0)
    cos, sin = math.cos(AXIS_RAD), math.sin(AXIS_RAD)
    forward_m, right_m = slot.forward_m - error_m[0], slot.right_m - error_m[1]
    along_mps, across_mps, climb_mps = follower_mps
    follower = FlightState(
        50.0 + cos * forward_m - sin * right_m,
        -20.0 + sin * forward_m + cos * right_m,
        100.0 + slot.up_m - error_m[2],
        climb_mps,
        math.hypot(along_mps, across_mps),
        AXIS_RAD + math.atan2(across_mps, along_mps),
        0.0,
        0.0,
    )
    motion = LeaderMotion(leader, 0.0, 0.0, 0.0, 0.0)
    return LawInput(motion, follower, slot, model, (0.0, 0.0, 100.0), 0.0, [1.0] * 3, replaced)


def asked(of: VelocityController, given: LawInput) -> list[float]:
    """Return the velocity that is commanded forward and right of the leader, and the height."""
    of.decide(given, DT_S)
    speed_mps, course_rad, height_m = of.setpoint
    return [speed_mps * math.cos(course_rad - AXIS_RAD), speed_mps * math.sin(course_rad - AXIS_RAD), height_m]


def test_forward_and_right_are_equal_channels_and_neither_speed_nor_heading_is_mixed_in() -> None:
    of = controller(kp=(0.5, 0.5, 2.0))
    found = asked(of, pair((1.0, -0.5, 0.25), leader_mps=5.0, follower_mps=(3.0, -2.0, 0.0)))
    assert of.error_m == pytest.approx((1.0, -0.5, 0.25))
    assert of.mixed == pytest.approx((0.8, -0.4, 0.175))
    assert found == pytest.approx([5.0 + 0.4, -0.2, 102.0 + 0.35])


def test_the_derivative_is_that_of_the_errors_by_velocities_over_ground() -> None:
    """The leader is 2 m/s faster forward and 1 m/s faster to the right, it climbs 0.5 m/s faster; times kd and k_x."""
    slot = Slot([-6.0, 8.0, 2.0], [0.0, 0.4, 0.0], [0.0] * 3)
    given = pair(leader_mps=5.0, follower_mps=(3.0, -0.6, -0.2), climbs_mps=0.3, slot=slot)
    found, plain = asked(controller(kd=(0.2, 0.1, 2.0)), given), asked(controller(), given)
    assert np.subtract(found, plain) == pytest.approx([0.2 * 0.8 * 2.0, 0.1 * 0.8 * 1.0, 2.0 * 0.7 * 0.5], abs=1e-6)


def test_the_derivative_knows_that_the_axes_turn() -> None:
    """An offset of 8 m to the right and 6 m behind moves back and left at 0.2 rad/s, as a follower at rest sees it."""
    given = pair(leader_mps=0.0)
    given.leader = LeaderMotion(given.leader.state, 0.2, 0.0, 0.0, 0.0)
    found, plain = asked(controller(kd=(0.1, 0.1, 0.0)), given), asked(controller(), given)
    moved = 0.08 * 0.2 * -8.0, 0.08 * 0.2 * -6.0
    assert np.subtract(found, plain)[:2] == pytest.approx(moved, abs=1e-6)


@pytest.mark.parametrize("bandwidth", [1.0, 0.5])
def test_a_share_of_the_bandwidth_is_that_of_each_gain(bandwidth: float) -> None:
    of, given = controller(kp=(0.5, 0.5, 2.0)), pair((1.0, 0.5, 0.25))
    given.bandwidth = [bandwidth] * 3
    found = asked(of, given)
    assert found == pytest.approx([0.4 * bandwidth, 0.2 * bandwidth, 102.0 + 0.35 * bandwidth])
    assert of.gains[:3] == pytest.approx((0.5 * bandwidth, 0.5 * bandwidth, 2.0 * bandwidth))


@pytest.mark.parametrize("towards_rad", [0.0, 1.0, 2.5, -2.0, math.pi])
@pytest.mark.parametrize("away_m", [0.0, 1e-3, 5.0, 60.0])
def test_a_correction_is_no_faster_than_can_be_braked_from_whatever_its_direction(
    towards_rad: float, away_m: float
) -> None:
    """v² = 2 a d with half of 1.5 m/s², plus 0.5 m/s; straight to the slot, and in all at most 12 m/s."""
    error_m = away_m * math.cos(towards_rad), away_m * math.sin(towards_rad), 0.0
    found = asked(controller(kp=(1e3, 1e3, 0.0)), pair(error_m, leader_mps=2.0))
    most_mps = min(0.5 + math.sqrt(1.5 * away_m), 800.0 * away_m)
    expected = np.array((2.0 + most_mps * math.cos(towards_rad), most_mps * math.sin(towards_rad)))
    expected *= min(12.0 / np.hypot(*expected), 1.0)
    assert found[:2] == pytest.approx(expected.tolist(), abs=1e-9)


@pytest.mark.parametrize(("slot_mps", "course_rad"), [(0.015, 0.0), (0.03, math.pi / 2.0), (-0.03, -math.pi / 2.0)])
def test_without_a_velocity_its_course_is_the_leaders_heading(slot_mps: float, course_rad: float) -> None:
    """Below 0.02 m/s the course of a velocity would be that of noise."""
    of = controller()
    of.decide(pair(slot=Slot([-6.0, 8.0, 2.0], [0.0, slot_mps, 0.0], [0.0] * 3)), DT_S)
    assert of.setpoint[:2] == pytest.approx((abs(slot_mps), AXIS_RAD + course_rad))


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("up_m", "closing_mps"), [(4.0, 2.5), (0.25, 1.0)])
def test_a_height_is_approached_no_faster_than_can_be_braked_from(side: float, up_m: float, closing_mps: float) -> None:
    """With half of 1 m/s²: 0.5 m/s plus the root of the distance. By (7) 1 m/s is a setpoint 1 s + 3 s ahead.

    That is besides the slot's own climb through the air: its leader's 0.3 m/s and its own 0.2 m/s in 0.1 m/s of lift.
    """
    slot = Slot([-6.0, 8.0, 2.0], [0.0, 0.0, 0.2], [0.0] * 3)
    quick = AutopilotModel(*MODEL.values()[:8], 20.0)
    given = pair((0.0, 0.0, side * up_m), climbs_mps=0.3, slot=slot, model=quick)
    given.state.updraught_mps = 0.1
    found = asked(controller(kp=(0.0, 0.0, 1e3)), given)
    assert found[2] == pytest.approx(given.state.height_m + 4.0 * (0.3 + 0.2 - 0.1) + side * 4.0 * closing_mps)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_far_height_is_approached_at_the_climb_limit(side: float) -> None:
    """3 m/s: a setpoint 12 m above or below the vehicle."""
    given = pair((0.0, 0.0, side * 80.0))
    assert asked(controller(kp=(0.0, 0.0, 1e3)), given)[2] == pytest.approx(given.state.height_m + side * 12.0)


MOVING = Slot([-6.0, 8.0, 2.0], [0.3, -0.4, 0.1], [0.0] * 3)


@pytest.mark.parametrize(
    ("channel", "error_m", "most"),
    [
        (0, 5.0, 0.5 + math.sqrt(7.5)),
        (0, -5.0, 0.5 + math.sqrt(7.5)),
        (1, 5.0, 0.5 + math.sqrt(7.5)),
        (1, -5.0, 0.5 + math.sqrt(7.5)),
        (2, 20.0, 12.0 - 20.0),
        (2, -20.0, 12.0 - 20.0),
        (0, 0.25, math.inf),
        (1, 0.25, math.inf),
        (2, 0.25, math.inf),
    ],
)
def test_an_integral_grows_by_gain_error_and_time_less_what_limits_took(
    channel: int, error_m: float, most: float
) -> None:
    """Of the limited share it loses dt over 2 s a tick, and of the feed-forward nothing: the slot moves, all climb.

    A vertical error of 20 m is answered by 12 m above the vehicle, 8 m below the slot's height.
    """
    side, gain, ki = math.copysign(1.0, error_m), (1.0, 1.0, 0.1)[channel], 0.4
    errors, kp, kis = [0.0] * 3, [0.0] * 3, [0.0] * 3
    errors[channel], kp[channel], kis[channel] = error_m, gain, ki
    of = controller(kp=(kp[0], kp[1], kp[2]), ki=(kis[0], kis[1], kis[2]))
    given = pair((errors[0], errors[1], errors[2]), leader_mps=3.0, climbs_mps=-0.1, slot=MOVING)
    steady_input = pair(leader_mps=3.0, climbs_mps=-0.1, slot=MOVING)
    steady, first = asked(controller(), steady_input), asked(of, given)
    weight = (0.8, 0.8, 0.7)[channel]
    output = gain * weight * abs(error_m)
    limited = min(output, most)
    assert side * (first[channel] - steady[channel]) == pytest.approx(limited)
    grown = ki * weight * abs(error_m) * DT_S
    kept = max(grown - (output - limited) * DT_S / WINDUP_S, 0.0)
    then = asked(of, steady_input)
    assert side * (then[channel] - steady[channel]) == pytest.approx(kept)
    for other in {0, 1, 2} - {channel}:
        assert then[other] == pytest.approx(steady[other])


@pytest.mark.parametrize(
    ("replaced", "grows"),
    [
        (AS_DECIDED, (True, True, True)),
        ((True, False, False), (False, False, True)),
        ((False, True, False), (False, False, True)),
        ((False, False, True), (True, True, False)),
    ],
)
def test_nothing_is_integrated_of_a_velocity_or_a_height_that_was_replaced(
    replaced: Replaced, grows: tuple[bool, bool, bool]
) -> None:
    """Speed and heading are one velocity: neither of its components is known if either was another's."""
    of = controller(ki=(0.4, 0.4, 0.4))
    asked(of, pair((0.25, 0.25, 0.25), leader_mps=3.0, replaced=replaced))
    found, steady = asked(of, pair(leader_mps=3.0)), asked(controller(), pair(leader_mps=3.0))
    for each in range(3):
        expected = 0.4 * (0.8, 0.8, 0.7)[each] * 0.25 * DT_S if grows[each] else 0.0
        assert found[each] - steady[each] == pytest.approx(expected)


@pytest.mark.parametrize(("climb_mps", "grows"), [(1.04, True), (1.06, False), (-1.06, True)])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_height_error_that_shrinks_near_the_climb_limit_is_not_integrated(
    side: float, climb_mps: float, grows: bool
) -> None:
    """A climb of 0.35 times 3 m/s = 1.05 m/s on its way up to the slot, but not away from it."""
    of = controller(ki=(0.0, 0.0, 0.4))
    asked(of, pair((0.0, 0.0, side * 2.0), follower_mps=(0.0, 0.0, side * climb_mps)))
    assert side * (asked(of, pair())[2] - 102.0) == pytest.approx(0.4 * 0.7 * 2.0 * DT_S if grows else 0.0)


class Adding(Feedback):
    """Feedback from outside: as it is stated."""

    def __init__(self, stated: Vector3) -> None:
        self.stated, self.excess = stated, (0.0, 0.0, 0.0)

    def output(self, mixed: Vector3, slopes: Vector3, replaced: Replaced, dt_s: float) -> Vector3:
        return self.stated

    def limited(self, excess: Vector3) -> None:
        self.excess = excess


def test_a_law_from_outside_is_limited_alike_and_stated_what_the_limits_added() -> None:
    """From 20 m away it is 0.5 + sqrt(1.5 x 20) m/s; the height stays within 12 m of the vehicle."""
    of, outside = controller(kp=(9.0, 9.0, 9.0)), Adding((30.0, -40.0, 50.0))
    of.feedback = outside
    found = asked(of, pair((12.0, -16.0, 0.0), leader_mps=3.0, slot=MOVING))
    most = 0.5 + math.sqrt(30.0)
    free = asked(controller(), pair((12.0, -16.0, 0.0), leader_mps=3.0, slot=MOVING))
    added = 0.6 * most, -0.8 * most
    assert found[:2] == pytest.approx([free[0] + added[0], free[1] + added[1]])
    height_m = found[2] - free[2]
    assert outside.excess == pytest.approx((added[0] - 30.0, added[1] + 40.0, height_m - 50.0))
    assert 0.0 < height_m < 12.0
    assert all(math.isnan(each) for each in of.gains)


@pytest.mark.parametrize("place", [0, 1, 2])
def test_an_output_that_is_not_finite_is_not_hidden_by_limits(place: int) -> None:
    of, stated = controller(), [0.0, 0.0, 0.0]
    stated[place] = math.nan
    of.feedback = Adding((stated[0], stated[1], stated[2]))
    of.decide(pair(), DT_S)
    assert any(math.isnan(each) for each in of.setpoint)


@pytest.mark.parametrize("turned_rad", [1.0, -2.2])
def test_around_a_hovering_leader_no_direction_is_another(turned_rad: float) -> None:
    """With all velocities and errors turned, so are the commands, through limits and integrals."""
    plain, turned = (controller((2.0, 2.0, 1.0), (0.5, 0.5, 0.2), (0.3, 0.3, 0.3)) for _ in range(2))
    cos, sin = math.cos(turned_rad), math.sin(turned_rad)

    def about(forward: float, right: float) -> tuple[float, float]:
        return cos * forward - sin * right, sin * forward + cos * right

    still = Slot([0.0] * 3, [0.0] * 3, [0.0] * 3)
    for forward_m, right_m in ((9.0, -3.0), (4.0, -2.5), (0.4, 0.1), (-0.1, 0.2)):
        one = asked(plain, pair((forward_m, right_m, 1.0), slot=still, follower_mps=(0.6, -0.2, 0.1)))
        other = asked(
            turned, pair((*about(forward_m, right_m), 1.0), slot=still, follower_mps=(*about(0.6, -0.2), 0.1))
        )
        assert other == pytest.approx([*about(one[0], one[1]), one[2]])
