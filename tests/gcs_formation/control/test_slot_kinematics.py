"""A slot is a point in axes that turn: its velocity and acceleration, by differences of its positions in time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pytest
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import Instant
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.slot import Slot
from formation_scenario.fields import Frame
from gcs_formation.control.follower import FollowerController
from gcs_formation.control.follower_loops import Controller, LawInput, LawParameters
from gcs_formation.control.law_interface import CycleInput, Lead
from gcs_formation.control.laws import FormationLaw, VelocityController
from gcs_formation.control.setpoint import (
    AS_DECIDED,
    LeaderMotion,
    Target,
    TrailingSlot,
    error_rate,
    feed_forward,
    formation_error,
    slot_target,
)
from gcs_formation.estimation.projection import MeasuredStates
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.guidance.leader_commands import LeaderCommand
from gcs_formation.guidance.tracking import RouteHeading
from tests.gcs_formation.control.law_ticks import AT_ONCE_S, NONE, parameters

Array = npt.NDArray[np.float64]
Along = Callable[[float], Array]

MODEL = AutopilotModel(4.0, 1.5, 1.3, 3.0, 0.0, 99.0, 9.0, 2.0, 30.0)
STEP_S = 0.003


@dataclass(frozen=True)
class Motion:
    """Quantities at 0 s with their first and second derivatives: a leader's and a slot's; and the slot's axes."""

    speed: tuple[float, float]
    heading: tuple[float, float, float]
    height: tuple[float, float, float]
    forward: tuple[float, float, float]
    right: tuple[float, float, float]
    up: tuple[float, float, float]
    axis: tuple[float, float, float]

    def slot(self, at_s: float = 0.0) -> Slot:
        each = self.forward, self.right, self.up
        position, velocity = [taken(values, at_s) for values in each], [b + c * at_s for _, b, c in each]
        return Slot(position, velocity, [values[2] for values in each])

    def leader_at(self, at_s: float) -> FlightState:
        """Return the leader, which began at the origin: its velocity integrated by Simpson's rule."""

        def velocity(time_s: float) -> Array:
            heading = taken(self.heading, time_s)
            return (self.speed[0] + self.speed[1] * time_s) * np.array((math.cos(heading), math.sin(heading)))

        north, east = at_s / 6.0 * (velocity(0.0) + 4.0 * velocity(at_s / 2.0) + velocity(at_s))
        climb_mps = self.height[1] + self.height[2] * at_s
        speed_mps, heading_rad = self.speed[0] + self.speed[1] * at_s, taken(self.heading, at_s)
        return FlightState(north, east, taken(self.height, at_s), climb_mps, speed_mps, heading_rad, 0.0, 0.0)

    def leader(self, turn_rps: float | None = None, dt_s: float = 0.0) -> LeaderMotion:
        turn = self.heading[1] if turn_rps is None else turn_rps
        return LeaderMotion(self.leader_at(0.0), turn, self.heading[2], self.speed[1], self.height[2], dt_s)

    def place(self, at_s: float, axis_rad: float) -> Array:
        """Return where the slot is, north, east and up, if its axes have a heading."""
        leader, slot = self.leader_at(at_s), self.slot(at_s)
        cos, sin = math.cos(axis_rad), math.sin(axis_rad)
        north = leader.north_m + cos * slot.forward_m - sin * slot.right_m
        return np.array((north, leader.east_m + sin * slot.forward_m + cos * slot.right_m, leader.height_m + slot.up_m))


def taken(values: tuple[float, float, float], at_s: float) -> float:
    return values[0] + values[1] * at_s + values[2] * at_s**2 / 2.0


def changes(of: Along) -> tuple[Array, Array]:
    """Return the first and the second derivative at 0 s."""
    before, now, after = of(-STEP_S), of(0.0), of(STEP_S)
    return (after - before) / (2.0 * STEP_S), (after - 2.0 * now + before) / STEP_S**2


def polar(velocity_mps: Array, acceleration_mps2: Array) -> tuple[float, float, float, float]:
    """Return a horizontal velocity's size and direction, and their rates."""
    (north, east), (north2, east2) = velocity_mps[:2], acceleration_mps2[:2]
    size = math.hypot(north, east)
    return (
        size,
        math.atan2(east, north),
        (north * north2 + east * east2) / size,
        (north * east2 - east * north2) / size**2,
    )


MOTIONS = [
    Motion(
        (22.0, 0.8),
        (0.4, 0.06, 0.02),
        (100.0, 0.7, 0.2),
        (-30.0, 0.9, -0.3),
        (20.0, -1.1, 0.25),
        (4.0, 0.6, -0.1),
        (0.9, 0.11, -0.03),
    ),
    Motion(
        (18.0, -0.5),
        (-2.1, -0.09, 0.03),
        (80.0, -0.4, 0.1),
        (15.0, -1.3, 0.2),
        (-35.0, 0.8, 0.4),
        (-6.0, -0.5, 0.3),
        (-2.8, -0.07, 0.05),
    ),
    Motion(
        (25.0, 0.3),
        (3.0, 0.05, -0.04),
        (90.0, 0.9, -0.3),
        (-60.0, -0.7, 0.35),
        (-10.0, 1.2, -0.2),
        (0.0, 0.2, 0.2),
        (2.2, 0.02, 0.06),
    ),
]


@pytest.mark.parametrize("motion", MOTIONS)
def test_what_is_fed_forward_leads_a_slot_in_axes_that_turn_as_they_like(motion: Motion) -> None:
    """A lag of tau is led by tau times the rate of the slot's speed and of its heading."""
    speed, heading, speed_rate, heading_rate = polar(
        *changes(lambda at_s: motion.place(at_s, taken(motion.axis, at_s)))
    )
    found = feed_forward(
        Target(speed, heading), motion.leader(), motion.axis[0], *motion.axis[1:], motion.slot(), MODEL, 0.0
    )
    assert found[0] == pytest.approx(speed + 4.0 * speed_rate, abs=1e-4)
    assert found[1] == pytest.approx(heading + 1.5 * heading_rate, abs=1e-5)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("updraught_mps", [0.0, 0.35])
def test_the_height_that_is_fed_forward_holds_the_slots_height_by_model_7(motion: Motion, updraught_mps: float) -> None:
    """z'' = (z_r - z - (ta + tb) (z' - u)) / (ta tb), solved for z_r, with a slot that rises as the leader climbs."""
    heights_m, rates = motion.place(0.0, 0.0)[2], changes(lambda at_s: motion.place(at_s, 0.0))
    found = feed_forward(Target(22.0, 0.0), motion.leader(), 0.0, 0.0, 0.0, motion.slot(), MODEL, updraught_mps)
    z_mps, z_mps2 = rates[0][2], rates[1][2]
    assert z_mps2 == pytest.approx((found[2] - heights_m - 4.3 * (z_mps - updraught_mps)) / 3.9, abs=1e-5)


@pytest.mark.parametrize("motion", MOTIONS)
def test_the_error_rate_is_that_of_the_error_while_all_turn_drift_and_climb(motion: Motion) -> None:
    """Equation (8) for axes that turn as they like: the error is where the slot is less where the follower is."""
    follower = FlightState(-40.0, 12.0, 95.0, -0.6, 20.0, 0.2, 1.4, -0.8)
    north_mps, east_mps = follower.ground_mps()

    def error(at_s: float) -> Array:
        leader, moved, axis_rad = motion.leader_at(at_s), follower.copy(), taken(motion.axis, at_s)
        leader.north_m += 2.5 * at_s
        leader.east_m -= 1.5 * at_s
        moved.north_m, moved.east_m = moved.north_m + north_mps * at_s, moved.east_m + east_mps * at_s
        moved.height_m += moved.climb_mps * at_s
        return np.array(formation_error(leader, moved, motion.slot(at_s), axis_rad))

    blown = motion.leader_at(0.0)
    blown.wind_north_mps, blown.wind_east_mps = 2.5, -1.5
    x_m, y_m, z_m = error(0.0).tolist()
    found = error_rate(blown, follower, (x_m, y_m, z_m), motion.slot(), motion.axis[0], motion.axis[1])
    assert found == pytest.approx(changes(error)[0], abs=1e-4)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize(("frame", "tau_v_s"), [("leader_heading", 4.0), ("north", 4.0), ("north", 1.5)])
def test_followers_of_either_kind_lead_a_moving_slot_behind_a_turning_leader(
    frame: Frame, tau_v_s: float, motion: Motion
) -> None:
    """Speed and heading are led by their own lags, a velocity over ground along and across the leader's heading."""

    def turned(at_s: float) -> Array:
        return motion.place(at_s, 0.0 if frame == "north" else taken(motion.heading, at_s))

    velocity, acceleration = changes(turned)
    model = AutopilotModel(tau_v_s, *MODEL.values()[1:])
    speed, heading, speed_rate, heading_rate = polar(velocity, acceleration)
    found = commanded(FollowerController, motion, frame, model)
    assert found[0] == pytest.approx(speed + tau_v_s * speed_rate, abs=2e-4)
    assert math.remainder(found[1] - heading - 1.5 * heading_rate, math.tau) == pytest.approx(0.0, abs=2e-5)
    speed_mps, course_rad, height_m = commanded(VelocityController, motion, frame, model)
    axis = motion.heading[0]
    forward, right = np.array((math.cos(axis), math.sin(axis))), np.array((-math.sin(axis), math.cos(axis)))
    wanted = (forward @ (velocity + tau_v_s * acceleration)[:2], right @ (velocity + 1.5 * acceleration)[:2])
    off_rad = course_rad - axis
    assert (speed_mps * math.cos(off_rad), speed_mps * math.sin(off_rad)) == pytest.approx(wanted, abs=2e-4)
    heights = motion.place(0.0, 0.0)[2] + 4.3 * velocity[2] + 3.9 * acceleration[2]
    assert (found[2], height_m) == pytest.approx((heights, heights), abs=2e-4)


def commanded(
    kind: Callable[[LawParameters], Controller], motion: Motion, frame: Frame, model: AutopilotModel
) -> tuple[float, float, float]:
    """Return what a follower without feedback is commanded, 9 m ahead of its slot; its leader's commands by (7)."""
    leader, slot = motion.leader_at(0.0), motion.slot()
    lag = AutopilotModel(5.0, 2.5, *model.values()[2:])
    command = LeaderCommand(
        leader.airspeed_mps + 5.0 * motion.speed[1],
        leader.heading_rad + 2.5 * motion.heading[1],
        leader.height_m + 4.3 * leader.climb_mps + 3.9 * motion.height[2],
        motion.heading[1] + 2.5 * motion.heading[2],
    )
    history = SetpointHistory(10.0)
    history.begin_tick(vec[i64]([-1] * 2))
    history.record([(22.0, 0.0, 100.0)] * 2)
    north, east, up = motion.place(0.0, 0.0)
    follower = FlightState(north + 9.0, east, up, leader.climb_mps + slot.up_mps, 21.0, leader.heading_rad, 0.0, 0.0)
    wide = CycleInput(
        states=MeasuredStates([leader, follower], vec[i64]([0] * 2), [True] * 2, vec[i64]([0] * 2)),
        lead=Lead(0, Instant(0), [command] * 2, RouteHeading(0.0, 0.0, 0.0, 0.0, 22.0)),
        slots=[Slot([0.0] * 3, [0.0] * 3, [0.0] * 3), slot],
        history=history,
        wind_variance=[0.0] * 2,
        active=[True] * 2,
        bandwidth=[[1.0] * 3] * 2,
        replaced=[AS_DECIDED] * 2,
    )
    law = FormationLaw(parameters(NONE, NONE, NONE, frame), [lag, model], kind)
    return law.decide(wide, AT_ONCE_S)[0].setpoint


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("kind", [FollowerController, VelocityController])
def test_over_a_tick_a_slot_moves_by_the_turn_rate_at_its_beginning(
    kind: Callable[[LawParameters], Controller], motion: Motion
) -> None:
    """Given the mean turn rate of a long tick, a slot's velocity is that of the instant at which the tick begins."""
    dt_s = 0.4
    mean_rps = motion.heading[1] + dt_s / 2.0 * motion.heading[2]
    velocity, _ = changes(lambda at_s: motion.place(at_s, taken(motion.heading, at_s)))
    quick = AutopilotModel(1e-9, 1e-9, *MODEL.values()[2:])
    controller, leader = kind(parameters(NONE, NONE, NONE)), motion.leader(mean_rps, dt_s)
    place, up = motion.place(0.0, motion.heading[0]), velocity[2]
    follower = FlightState(place[0], place[1], place[2], up, 21.0, motion.heading[0], 0.0, 0.0)
    controller.decide(
        LawInput(leader, follower, motion.slot(), quick, (22.0, 0.0, 100.0), 0.0, [1.0] * 3, AS_DECIDED), dt_s
    )
    speed_mps, heading_rad, _ = controller.setpoint
    found = speed_mps * math.cos(heading_rad), speed_mps * math.sin(heading_rad)
    assert found == pytest.approx(velocity[:2].tolist(), abs=2e-4)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("drift_mps", [(0.0, 0.0), (1.2, -0.9)])
def test_in_its_own_frame_a_follower_that_heads_as_its_target_keeps_its_slot(
    side: float, drift_mps: tuple[float, float]
) -> None:
    """Flying the target, (8) is 0 along and across its own heading, whatever the slot's motion and a drift."""
    leader = FlightState(0.0, 0.0, 100.0, 0.0, 22.0, 0.5, 0.0, 0.0)
    slot, turn_rps = Slot([-30.0, side * 20.0, 0.0], [0.7, side * 1.3, 0.0], [0.0] * 3), side * 0.08
    along_mps, across_mps = drift_mps[0], side * drift_mps[1]
    target = slot_target(leader, along_mps, across_mps, turn_rps, slot, "follower_heading")
    cos, sin = math.cos(target.heading_rad), math.sin(target.heading_rad)
    follower = FlightState(0.0, 0.0, 100.0, 0.0, target.speed_mps, target.heading_rad, 0.0, 0.0)
    follower.wind_north_mps, follower.wind_east_mps = (
        along_mps * cos - across_mps * sin,
        along_mps * sin + across_mps * cos,
    )
    found = error_rate(leader, follower, (0.0, 0.0, 0.0), slot, target.heading_rad, turn_rps)
    assert found == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert side * (target.heading_rad - 0.5) == pytest.approx(math.asin((1.3 - 30.0 * 0.08 - drift_mps[1]) / 22.0)), (
        "behind a turn to the right a follower heads further left"
    )


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_no_heading_keeps_a_slot_that_swings_faster_than_its_leader_flies(side: float) -> None:
    """The target then is at a right angle to the leader's heading, and its axes turn towards it."""
    leader = FlightState(0.0, 0.0, 100.0, 0.0, 22.0, 0.5, 0.0, 0.0)
    slot = Slot([-200.0, 0.0, 0.0], [0.0] * 3, [0.0] * 3)
    target = slot_target(leader, 0.0, 0.0, side * 0.25, slot, "follower_heading")
    assert (target.heading_rad - 0.5, target.speed_mps) == pytest.approx((-side * math.pi / 2.0, 0.0), abs=1e-12)
    trailing, turning = TrailingSlot(), LeaderMotion(leader, side * 0.25, 0.0, 0.0, 0.0)
    trailing.turning(LeaderMotion(leader, 0.0, 0.0, 0.0, 0.0), slot, 0.1)
    for _ in range(2000):
        rate_rps, _ = trailing.turning(turning, slot, 0.1)
    assert rate_rps == pytest.approx(side * 0.25, abs=1e-3)


@pytest.mark.parametrize(("due", "slope"), [(0.999, 0.05), (0.5, (1.0 - 0.5) / (math.pi / 2.0 - math.pi / 6.0))])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_axes_at_a_right_angle_turn_back_at_a_twentieth_of_the_usual_rate_at_least(
    due: float, slope: float, side: float
) -> None:
    """A sine is flat there; its mean slope on the way back is 0.02 to an angle whose sine is 0.999, by then 0.05.

    In 0.1 s with a lag of 44 m / (22 m/s) = 2 s, axes turn by 1 - exp(-0.1 slope / 2) of the angle.
    """
    leader = FlightState(0.0, 0.0, 100.0, 0.0, 22.0, 0.0, 0.0, 0.0)
    trailing, still = TrailingSlot(), LeaderMotion(leader, 0.0, 0.0, 0.0, 0.0)
    trailing.turning(still, Slot([-44.0, 0.0, 0.0], [0.0, side * 30.0, 0.0], [0.0] * 3), 0.1)
    rate_rps, _ = trailing.turning(still, Slot([-44.0, 0.0, 0.0], [0.0, side * due * 22.0, 0.0], [0.0] * 3), 0.1)
    angle_rad = math.pi / 2.0 - math.asin(due)
    assert rate_rps == pytest.approx(-side * angle_rad * (1.0 - math.exp(-0.1 * slope / 2.0)) / 0.1)


@pytest.mark.parametrize("forward_m", [0.0, 15.0, -1.0])
def test_axes_of_a_slot_that_is_no_tick_behind_take_a_tick_to_turn(forward_m: float) -> None:
    """1 m behind is 1/22 s, less than a tick of 0.1 s; ahead, equation (8) alone would not be stable (item 23)."""
    leader = FlightState(0.0, 0.0, 100.0, 0.0, 22.0, 0.0, 0.0, 0.0)
    trailing, still = TrailingSlot(), LeaderMotion(leader, 0.0, 0.0, 0.0, 0.0)
    trailing.turning(still, Slot([forward_m, 0.0, 0.0], [0.0] * 3, [0.0] * 3), 0.1)
    rate_rps, bend_rps2 = trailing.turning(still, Slot([forward_m, 0.0, 0.0], [0.0, 0.022, 0.0], [0.0] * 3), 0.1)
    assert rate_rps == pytest.approx(0.001 * (1.0 - math.exp(-1.0)) / 0.1, rel=1e-4)
    assert bend_rps2 == pytest.approx(-rate_rps / (0.1 / (1.0 - math.exp(-1.0))), rel=1e-4)


@pytest.mark.parametrize("tick_s", [0.05, 0.01])
def test_the_turn_of_a_trailing_slots_axes_is_the_integral_of_its_bend(tick_s: float) -> None:
    """While slot and leader swing, the rate that is given changes as given, within what a tick's length leaves."""
    trailing, rates, bends = TrailingSlot(), list[float](), list[float]()
    for tick in range(round(3.0 / tick_s)):
        at_s = tick * tick_s
        slot = Slot([-50.0 + 2.0 * at_s, 0.0, 0.0], [2.0, 3.0 * math.sin(at_s), 0.0], [0.0, 3.0 * math.cos(at_s), 0.0])
        state = FlightState(0.0, 0.0, 0.0, 0.0, 22.0, 0.0, 0.0, 0.0)
        leader = LeaderMotion(state, 0.05 * math.sin(0.8 * at_s), 0.04 * math.cos(0.8 * at_s), 0.0, 0.0)
        rate_rps, bend_rps2 = trailing.turning(leader, slot, tick_s)
        rates.append(rate_rps)
        bends.append(bend_rps2)
    np.testing.assert_allclose(np.diff(rates) / tick_s, bends[:-1], atol=0.1 * tick_s)
