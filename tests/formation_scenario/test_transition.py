"""Transitions: smooth, within all vehicles' limits, and separated as Turpin, Michael and Kumar prove."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist, squareform

from flight_model.path_offsets import DisplacedPath, Rise
from flight_model.spline import SplinePath
from formation_scenario import load_scenario
from formation_scenario.fields import distinct_texts
from formation_scenario.formation_changes import (
    ACCELERATION_SHARE,
    TURN_SHARE,
    ahead,
    keepable_turn_rps,
    plan_change,
    plan_joining_up,
    take_over,
)
from formation_scenario.slot_assignment import assigned, slot_schedule
from formation_scenario.slot_motion import LeaderFlight, SlotMotion, Transition, slot_needs
from formation_scenario.transition_plan import NotFlyableError, segment_distances_m

CONFIGS = Path(__file__).parents[2] / "configs"
SPEED = 22.0
STRAIGHT = [[0, 0, 100], [6000, 0, 100]]
CHANGES = "formation.changes=[{at_s: 10, shape: line}, {at_s: 80, shape: circle}, {at_s: 150, shape: square}]"
vectors = st.lists(st.floats(-60, 60), min_size=12, max_size=12).map(lambda values: np.array(values).reshape(4, 3))


def flown(scenario):
    """Plan every change of a scenario, each from where the previous one ends."""
    path = SplinePath(scenario.path.waypoints_m)
    steps = slot_schedule(scenario)
    transition = Transition.standing(steps[0].positions_m)
    for step in steps[1:]:
        flight = ahead(path, SPEED, SPEED * step.at_s)
        transition = plan_change(scenario, transition.at(step.at_s), step.arrangement, step.at_s, flight)
        yield transition


@pytest.mark.parametrize("followers", [3, 8, 20])
def test_diamond_line_circle_square_keeps_15_m_at_30_m_spacing_and_takes_less_than_a_minute(load, followers):
    scenario = load(f"vehicles={{count: {followers + 1}}}", CHANGES)
    for transition in flown(scenario):
        sampled = transition.sample(np.linspace(0.0, transition.duration_s, 600))
        assert min(pdist(positions).min() for positions in sampled.position_m) > 17.9
        assert transition.duration_s < 55.0


@given(vectors, vectors, vectors, st.floats(8, 60), st.floats(0, 20))
def test_a_transition_begins_as_the_slots_move_ends_at_rest_and_is_smooth(begin, goal, velocity, duration, up_m):
    start = SlotMotion(begin, velocity / 20, velocity / 200)
    transition = Transition(5.0, duration, start, goal, np.array([0.0, up_m, 0.0, 0.0]), duration / 3)
    first, last = transition.at(5.0), transition.at(5.0 + duration)
    np.testing.assert_allclose(first.position_m, begin, atol=1e-9)
    np.testing.assert_allclose(first.velocity_mps, start.velocity_mps, atol=1e-9)
    np.testing.assert_allclose(first.acceleration_mps2, start.acceleration_mps2, atol=1e-9)
    np.testing.assert_allclose(last.position_m, goal, atol=1e-9)
    step = duration * 1e-4
    moments = 5.0 + duration * np.linspace(0.05, 0.95, 7)
    for moment in moments:
        before, now, after = (transition.at(moment + k * step) for k in (-1, 0, 1))
        np.testing.assert_allclose((after.position_m - before.position_m) / (2 * step), now.velocity_mps, atol=1e-3)
        np.testing.assert_allclose(
            (after.velocity_mps - before.velocity_mps) / (2 * step), now.acceleration_mps2, atol=1e-2
        )


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_assigned_at_the_least_sum_of_squares_straight_paths_stay_separated(seed):
    """CAPT, theorem 4.3: from positions with a separation of 2 sqrt(2) R, no two come within 2 R of each other."""
    random = np.random.default_rng(seed)
    lattice = 30.0 * np.array([(i, j, 0.0) for i in range(6) for j in range(6)])
    begin, goal = (lattice[random.permutation(36)[:12]] for _ in range(2))
    cost = np.square(begin[:, None] - goal[None]).sum(axis=2)
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - the peer to hold the package's own against

    ends = goal[linear_sum_assignment(cost)[1]]
    transition = Transition(0.0, 20.0, SlotMotion.at_rest(begin), ends, np.zeros(12), 0.0)
    assert (
        min(pdist(positions).min() for positions in transition.sample(np.linspace(0, 20, 200)).position_m)
        > 30 / np.sqrt(2) - 0.01
    )


def test_who_is_away_is_kept_the_last_slots(load):
    scenario = load("vehicles={count: 5}")
    step = slot_schedule(scenario)[0]
    arrangement = step.arrangement._replace(shape="line", leader=2)
    present = np.array([False, True, True, True, True])
    given_out = assigned(scenario, arrangement, step.positions_m, present)
    np.testing.assert_array_equal(given_out[2], 0.0)
    np.testing.assert_array_equal(given_out[0], [0, 60, 0])
    assert {tuple(position) for position in given_out} == {(0, -60, 0), (0, -30, 0), (0, 0, 0), (0, 30, 0), (0, 60, 0)}


def test_a_slot_whose_vehicle_is_away_has_no_path_and_none_makes_room_for_it(load):
    scenario = load("vehicles={count: 5}")
    step = slot_schedule(scenario)[0]
    start = SlotMotion(step.positions_m - step.positions_m[2], np.ones((5, 3)), np.zeros((5, 3)))
    present = np.array([False, True, True, True, True])
    flight = ahead(SplinePath(scenario.path.waypoints_m), SPEED, 0.0)
    transition = plan_change(scenario, start, step.arrangement._replace(shape="line", leader=2), 0.0, flight, present)
    positions_m = transition.sample(np.linspace(0.0, transition.duration_s, 1001)).position_m[:, 1:]
    assert transition.separation_m is not None
    nearest_m = squareform(np.min([pdist(each) for each in positions_m], axis=0))
    assert np.isinf(transition.separation_m[0]).all()
    assert np.allclose(np.nan_to_num(transition.separation_m[1:, 1:], posinf=0.0), nearest_m, atol=0.01)
    for moment in (0.0, transition.duration_s / 2):
        np.testing.assert_array_equal(transition.at(moment).position_m[0], [0, 60, 0])
        np.testing.assert_array_equal(transition.at(moment).velocity_mps[0], 0.0)


@pytest.mark.parametrize("below_m", [0.0, 5.0])
def test_who_begins_lower_is_raised_as_far_over_the_leader(load, below_m):
    scenario = load("vehicles={count: 2}")
    arrangement = slot_schedule(scenario)[0].arrangement._replace(shape="follower")
    start = SlotMotion.at_rest(np.array([[0.0, 0.0, 0.0], [30.0, 0.0, -below_m]]))
    transition = plan_change(
        scenario, start, arrangement, 0.0, ahead(SplinePath(scenario.path.waypoints_m), SPEED, 0.0)
    )
    sampled = transition.sample(np.linspace(0.0, transition.duration_s, 600)).position_m
    assert np.linalg.norm(sampled[:, 1], axis=1).min() > 17.9


def test_who_is_up_already_is_raised_over_the_others_not_over_itself(load):
    """A follower passes 18 m over the leader: one that begins 12 m up needs no more than one that doesn't."""
    scenario = load("vehicles={count: 2}")
    arrangement = slot_schedule(scenario)[0].arrangement._replace(shape="follower")
    flight = ahead(SplinePath(scenario.path.waypoints_m), SPEED, 0.0)
    raised = [
        plan_change(
            scenario, SlotMotion.at_rest(np.array([[0.0, 0.0, 0.0], [30.0, 0.0, up_m]])), arrangement, 0.0, flight
        )
        for up_m in (0.0, 12.0)
    ]
    assert [transition.height_offset_m[1] for transition in raised] == pytest.approx([18.0, 18.0])


EVERYONE = np.ones(4, dtype=np.bool_)
ROW = np.array([[0.0, 0.0, 0.0], [0.0, 12.0, 0.0], [0.0, 24.0, 0.0], [0.0, 36.0, 0.0]])


def gathered(scenario, start_m, flight=None):
    """Plan the transition of vehicles from where they are to the slots of a diamond."""
    goal_m = slot_schedule(scenario)[0].positions_m
    flight = flight or ahead(SplinePath(scenario.path.waypoints_m), SPEED, 0.0)
    return plan_joining_up(scenario, SlotMotion.at_rest(start_m), goal_m, 0, 0.0, flight, EVERYONE)


def test_who_stood_in_a_row_joins_up_farther_apart_than_the_separation_rule_keeps(load):
    transition = gathered(load("safety.separation_m=3"), ROW)
    assert transition is not None
    positions = transition.sample(np.linspace(0.0, transition.duration_s, 600)).position_m
    assert transition.height_offset_m.max() >= 10.0
    assert min(pdist(each).min() for each in positions) > 8.0 + 1.99
    np.testing.assert_allclose(positions[-1], slot_schedule(load())[0].positions_m)


def test_who_is_near_its_slot_and_in_nobodys_way_needs_none_planned(load):
    slots = slot_schedule(load())[0].positions_m
    assert gathered(load(), slots + np.array([[0, 0, 0], [8, 6, 4], [8, 6, 4], [8, 6, 4]])) is None
    assert gathered(load(), slots + np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0], [-21, 0, 0]])) is not None


def test_two_within_metres_of_their_slots_whose_paths_cross_have_them_planned(load):
    """In either order they conflict: 4 leaves the crossing as 3 starts, and would block it if it came later."""
    slots = "formation={shape: custom, slots_m: {2: [-60, 0, 0], 3: [8, 40, 0], 4: [7, 23, 0]}}"
    scenario = load(slots, "safety.separation_m=3")
    goal_m = slot_schedule(scenario)[0].positions_m
    start_m = goal_m + np.array([[0, 0, 0], [0, 0, 0], [-18, 0, 0], [0, 18, 0]])
    level = Transition(0.0, 20.0, SlotMotion.at_rest(start_m), goal_m, np.zeros(4), 0.0)
    assert min(pdist(each).min() for each in level.sample(np.linspace(0, 20, 200)).position_m) > 11.0
    assert gathered(scenario, start_m) is not None


def test_gathering_waits_for_a_leader_that_climbs(load):
    """A climb leaves little climb rate to pass over others; after it they take a third of the time."""

    def climbing(elapsed_s):
        still = np.zeros_like(elapsed_s)
        return LeaderFlight(SPEED, still, still, np.where(elapsed_s < 30.0, 2.0, 0.0), still)

    scenario = load("safety.separation_m=3")
    with pytest.raises(NotFlyableError, match="to gather; allowed: up to"):
        gathered(scenario, ROW, climbing)
    transition = gathered(scenario, ROW, lambda elapsed_s: climbing(elapsed_s + 30.0))
    assert transition is not None
    assert transition.duration_s < 60.0


@given(st.integers(0, 10_000))
def test_the_least_distance_of_two_straight_paths_is_that_of_their_nearest_points(seed):
    random = np.random.default_rng(seed)
    begin, displacement = random.uniform(-30, 30, (2, 3, 3)).round()
    shares = np.linspace(0.0, 1.0, 201)
    points = begin[:, None] + shares[:, None] * displacement[:, None]
    pairs = ((0, 1), (0, 2), (1, 2))
    sampled = [np.linalg.norm(points[a][:, None] - points[b], axis=-1).min() for a, b in pairs]
    step_m = np.linalg.norm(displacement, axis=1).max() / 200.0
    found = segment_distances_m(begin, displacement)
    assert (found <= np.array(sampled) + 1e-9).all()
    assert (found >= np.array(sampled) - step_m).all()


def test_a_change_is_planned_within_another_leaders_path_over_hills():
    """The first leader is still 17 m up, on its way into its slot, when the next change begins."""
    changes = "{at_s: 190, leader: 2}, {at_s: 250, shape: square}"
    assert load_scenario(CONFIGS / "hills.yaml", [f"formation.changes=[{{at_s: 130, shape: circle}}, {changes}]"])


def test_a_custom_shape_under_another_leader_gives_its_slot_to_the_scenarios_leader(load):
    own = "{2: [-10, 0, 0], 3: [-20, 0, 0], 4: [-30, 0, 0]}"
    steps = slot_schedule(load(f"formation.changes=[{{at_s: 20, shape: custom, slots_m: {own}, leader: 3}}]"))
    np.testing.assert_array_equal(steps[1].positions_m, [[-20, 0, 0], [-10, 0, 0], [0, 0, 0], [-30, 0, 0]])


def test_another_leader_sees_the_same_positions():
    transition = Transition(
        0.0, 20.0, SlotMotion.at_rest(np.diag([0.0, -30.0, 30.0])), np.diag([0.0, -60.0, 9.0]), np.zeros(3), 0.0
    )
    swing = 0.3
    for moment in (0.0, 7.0, 30.0):
        before, after = transition.at(moment).position_m, transition.seen_from(1, swing).at(moment).position_m
        turned = np.exp(-1j * swing) * ((before[:, 0] - before[1, 0]) + 1j * (before[:, 1] - before[1, 1]))
        np.testing.assert_allclose(after[:, 0] + 1j * after[:, 1], turned, atol=1e-9)


def test_a_moving_slot_needs_what_its_position_over_ground_does():
    """The velocity and acceleration of a point that moves in a turning frame, against differences of its positions."""
    step, t = 0.01, 0.01 * np.arange(-3.0, 4.0)
    turn, bend = 0.04, 0.002
    heading = turn * t + bend * t**2 / 2
    leader = np.cumsum(SPEED * np.exp(1j * heading)) * step
    leader = leader - SPEED * np.exp(1j * heading) * step / 2  # the trapezium rule
    slot, velocity, acceleration = -30 + 20j, 1.5 - 2j, 0.2 + 0.3j
    positions = leader + np.exp(1j * heading) * (slot + velocity * t + acceleration * t**2 / 2)
    ground = np.gradient(positions, step)
    flight = LeaderFlight(SPEED, np.array([turn]), np.array([bend]), np.zeros(1), np.zeros(1))
    motion = SlotMotion(*(np.array([[[v.real, v.imag, 0.0]]]) for v in (slot, velocity, acceleration)))
    needs = slot_needs(flight, motion, "leader_heading")
    assert abs(ground[3]) == pytest.approx(needs.speed_mps[0, 0], abs=1e-4)
    assert np.angle(ground[3]) == pytest.approx(needs.relative_heading_rad[0, 0], abs=1e-5)
    assert (abs(ground[4]) - abs(ground[2])) / (2 * step) == pytest.approx(needs.accel_mps2[0, 0], abs=1e-3)
    assert np.angle(ground[4] / ground[2]) / (2 * step) == pytest.approx(needs.turn_rate_rps[0, 0], abs=1e-4)


@pytest.mark.parametrize("right_slope", [0.0, 0.2])
def test_a_displaced_path_is_a_curve_whose_course_and_curvature_are_its_own(right_slope):
    path = SplinePath([[0, 0, 100], [1500, 0, 100], [3000, 700, 120]])
    displaced = DisplacedPath(path, 400.0, 600.0, 40.0, Rise(15.0), right_slope=right_slope)
    for distance in np.linspace(410.0, 990.0, 9):
        before, point, after = (displaced.at(distance + d) for d in (-0.5, 0.0, 0.5))
        north, east = after.north_m - before.north_m, after.east_m - before.east_m
        assert np.arctan2(east, north) == pytest.approx(point.course_rad, abs=1e-5)
        made = np.hypot(north, east)
        assert (after.course_rad - before.course_rad) / made == pytest.approx(point.curvature_1pm, abs=1e-5)
        assert (after.height_m - before.height_m) / made == pytest.approx(point.slope, abs=1e-5)
    assert displaced.at(1000.0).values() == path.at(1000.0).values()
    begun, abreast = displaced.at(400.0), path.at(400.0)
    assert abreast.lateral_and_up_m(begun.north_m, begun.east_m, begun.height_m) == pytest.approx((40.0, 15.0))
    along = 1.0 - 40.0 * abreast.curvature_1pm
    assert begun.course_rad - abreast.course_rad == pytest.approx(np.arctan2(right_slope, along), abs=1e-9)


def test_a_displaced_path_goes_on_with_the_climb_that_it_begins_with():
    path = SplinePath([[0, 0, 100], [1500, 0, 100], [3000, 700, 100]])
    displaced = DisplacedPath(path, 400.0, 600.0, 0.0, Rise(8.0, 0.06, -2e-4))
    begun, ended = displaced.at(400.0), displaced.at(1000.0 - 1e-6)
    assert (begun.height_m, begun.slope, begun.slope_rate_1pm) == pytest.approx((108.0, 0.06, -2e-4), abs=1e-3)
    assert ended.values() == pytest.approx(path.at(1000.0 - 1e-6).values(), abs=1e-6)
    for distance in np.linspace(401.0, 999.0, 9):
        before, point, after = (displaced.at(distance + d) for d in (-0.5, 0.0, 0.5))
        assert after.height_m - before.height_m == pytest.approx(point.slope, abs=1e-6)
        assert after.slope - before.slope == pytest.approx(point.slope_rate_1pm, abs=1e-7)


@pytest.mark.parametrize("right_slope", [0.0, 0.1, -0.3])
@pytest.mark.parametrize(("right_m", "reach_m"), [(30.0, 60.0), (-80.0, 20.0), (15.0, 200.0)])
def test_a_new_leader_turns_onto_the_path_as_gently_as_the_farthest_slot_can_follow(
    load, right_m, reach_m, right_slope
):
    """On the inside of a turn a slot slows down with the turn rate, and decelerates with the rate of that."""
    scenario, path = load(), SplinePath([[0, 0, 100], [3000, 0, 100], [6000, 0, 100]])
    speed, max_mps2 = scenario.path.begin_mps, scenario.vehicles[0].model.accel_max_mps2
    displaced = take_over(scenario, path, 1000.0, right_m, Rise(), reach_m, right_slope=right_slope)
    at_m = 1000.0 + np.arange(1.0, 3000.0, 2.0)
    rates = speed * np.array([displaced.at(distance).curvature_1pm for distance in at_m.tolist()])
    assert np.abs(rates).max() <= 1.02 * TURN_SHARE * keepable_turn_rps(scenario, reach_m)
    assert reach_m * np.abs(np.diff(rates)).max() * speed / 2.0 <= 1.02 * ACCELERATION_SHARE * max_mps2


def test_a_change_that_cannot_be_flown_where_it_falls_is_refused_with_position_and_figure(refusal):
    climb = "path.waypoints_m=[[0, 0, 100], [4000, 0, 620]]"  # 2.86 m/s of 3: too little is left to pass the leader
    swap = "formation={shape: custom, slots_m: {2: [-30, 0, 0], 3: [30, 0, 0], 4: [-60, 0, 0]}, changes: [%s]}"
    other = "{at_s: 20, slots_m: {2: [30, 0, 0], 3: [-30, 0, 0], 4: [-60, 0, 0]}}"
    (line,) = refusal(climb, swap % other)
    assert line.startswith("formation.changes.0: path at 440 m (north 4")
    assert "no climb is left" in line


@pytest.mark.parametrize(
    ("change", "found"),
    [
        ("{at_s: 20}", "formation.changes.0: found no change; shape, spacing_m, slots_m or leader"),
        ("{at_s: 20, leader: 9}", "formation.changes.0.leader: found 9; 1, 2, 3, 4"),
    ],
)
def test_a_change_of_nothing_or_to_none_is_refused(refusal, change, found):
    assert found in refusal(f"formation.changes=[{change}]")


def test_under_a_virtual_leader_none_takes_over(refusal):
    (line,) = refusal("vehicles=[{id: 2}, {id: 3}]", "formation.changes=[{at_s: 20, leader: 3}]")
    assert line.startswith("formation.changes.0.leader: found 3, but a virtual leader flies the path")


def test_of_a_speed_that_comes_with_an_integrator_a_transition_counts_on_the_prompt_share_alone():
    """A PX4 at 18 m/s of 20 soon flies 55 % of the rest, 19.1; a multirotor reaches all of it within seconds."""
    keys = {"vehicles": {"count": 4, "autopilot": "px4"}, "path": {"speed_mps": 18, "waypoints_m": STRAIGHT}}
    scenario = load_scenario(keys | {"formation": {"changes": [{"at_s": 10, "shape": "line"}]}})
    model = scenario.vehicles[0].model
    assert model.soon_mps(18.0) == pytest.approx((14.15, 19.1))
    assert model.model_copy(update={"hovers": True}).soon_mps(18.0) == (11.0, 20.0)
    flight, (first, last) = ahead(SplinePath(scenario.path.waypoints_m), 18.0, 180.0), slot_schedule(scenario)
    transition = plan_change(scenario, SlotMotion.at_rest(first.positions_m), last.arrangement, 10.0, flight)
    moments_s = np.linspace(0.0, transition.duration_s, 101)
    needs = slot_needs(flight(moments_s), transition.sample(moments_s), "leader_heading")
    assert needs.speed_mps.max() < 19.1
    assert needs.speed_mps.min() > 14.15


@pytest.mark.parametrize(
    ("found", "allowed", "texts"),
    [(31.24, 28.0, ("31.2", "28")), (15.98, 16.0, ("15.98", "16")), (28.000004, 28.0, ("28.000004", "28"))],
)
def test_a_demand_and_its_limit_are_printed_with_digits_that_tell_them_apart(found, allowed, texts):
    assert distinct_texts(found, allowed) == texts
