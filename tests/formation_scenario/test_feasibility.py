import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight_model.spline import SplinePath
from formation_scenario.planned_progress import path_end_s
from formation_scenario.slot_motion import LeaderFlight, SlotMotion, slot_needs


def circle(radius: float, north: float = 0.0) -> list[list[float]]:
    """Return waypoints of a right-hand half circle between two straight kilometres."""
    angles = np.linspace(0.0, np.pi, 25)
    arc = [[north + radius * np.sin(a), radius * (1 - np.cos(a)), 100.0] for a in angles]
    return [[north - 1000.0, 0.0, 100.0], *arc, [north - 1000.0, 2 * radius, 100.0]]


def with_path(waypoints) -> str:
    return f"path.waypoints_m={[[round(float(x), 3) for x in waypoint] for waypoint in waypoints]}"


def test_a_straight_path_is_flown_by_every_shape(load):
    for shape in ("diamond", "circle", "line", "square", "plus"):
        assert load("vehicles={count: 60}", f"formation.shape={shape}").path.begin_mps == 22.0


def test_a_turn_tighter_than_the_leader_can_fly_names_position_figure_and_limit(refusal):
    leader, *slots = refusal(with_path(circle(80.0)))
    assert leader.startswith("path.waypoints_m.2: path at 10")  # the half circle begins at waypoint 1, after 1000 m
    assert "leader 1 would need" in leader
    assert "rad/s of turn; up to 0.25 rad/s" in leader
    assert "height 100" in leader
    limits = (
        "m/s² of acceleration, the worst of 3 slots there; up to 1.5 m/s²",
        "m/s, the worst of 3 slots there; 16 to 28 m/s",
    )
    assert len(slots) == 2
    assert all(limit in slot for limit, slot in zip(limits, slots, strict=True))


def test_the_outer_slot_must_hurry_and_the_inner_one_must_not_stall(refusal, load):
    # 120 m outside a turn of w rad/s asks for 22 + 120 w, 120 m inside for 22 - 120 w.
    path = SplinePath(circle(400.0))
    turn = 22.0 * path.at(np.linspace(0.0, path.length_m, 20_000)).curvature_1pm.max()
    wide = "formation={shape: custom, slots_m: {2: [0, %d, 0], 3: [-60, 0, 0], 4: [-30, 0, 0]}}"
    generous = [f"vehicles.{n}.model.{key}" for n in range(4) for key in ("accel_max_mps2=50", "tau_v_s=0.05")]
    for lateral_m in (-120, 120):  # a right-hand bend
        (line,) = refusal(with_path(circle(400.0)), wide % lateral_m, *generous)
        assert f"vehicle 2's slot in shape custom would need {22.0 - lateral_m * turn:.3g} m/s" in line
        assert line.endswith("m/s; 16 to 28 m/s")
    wide = "formation={shape: custom, slots_m: {2: [0, -120, 0], 3: [0, 120, 0], 4: [-30, 0, 0]}}"
    assert "m/s, the worst of 2 slots there; 16 to 28 m/s" in refusal(with_path(circle(400.0)), wide, *generous)[0]
    faster = [f"vehicles.{n}.model.{key}" for n in (1, 2) for key in ("speed_max_mps=32", "speed_min_mps=12")]
    assert load(with_path(circle(400.0)), wide, *generous, *faster)


def test_a_setpoint_leads_the_speed_by_its_time_constant_and_keeps_to_the_same_limits(refusal, load):
    """120 m inside a bend of 400 m: 16 m/s or so, but on entering it 4 s times the deceleration less."""
    inside = "formation={shape: custom, slots_m: {2: [0, 75, 0], 3: [-60, 0, 0], 4: [-30, 0, 0]}}"
    generous = [f"vehicles.{n}.model.accel_max_mps2=50" for n in range(4)]
    line = refusal(with_path(circle(400.0)), inside, *generous)[0]
    assert "vehicle 2's slot in shape custom would need " in line
    assert line.endswith(" m/s of speed setpoint; 16 to 28 m/s, speed plus tau_v_s (4 s) times acceleration")
    assert load(with_path(circle(400.0)), inside, *generous, *(f"vehicles.{n}.model.tau_v_s=0.05" for n in range(4)))


def test_a_leader_that_is_to_follow_has_a_slot_too(refusal, load):
    column = "formation={shape: custom, slots_m: {2: [-30, 0, 0], 3: [-60, 0, 0], 4: [-90, 0, 0]}, changes: [%s]}"
    assert load(with_path(circle(400.0)), column % "{at_s: 20, leader: 2}")
    lateral = "{at_s: 20, leader: 2, slots_m: {2: [0, -150, 0], 3: [-60, 0, 0], 4: [-90, 0, 0]}}"
    lines = refusal(with_path(circle(400.0)), column % lateral)
    assert any("vehicle 1's slot in shape custom would need" in line for line in lines)


def test_each_position_is_reported_once_with_its_worst_figure(refusal):
    """Two turns are too tight for all four; the second, of 70 m, is the tighter one."""
    twice = [*circle(80.0)[:-1], *([n - 2000.0, e + 4000.0, 100.0] for n, e, _ in circle(70.0))]
    found = [line for line in refusal(with_path(twice)) if "leader 1 would need" in line]
    lines = [line.partition("leader 1 would need ")[2].partition(" ")[0] for line in found]
    assert len(lines) == 2
    assert 22.0 / 80.0 < float(lines[0]) < float(lines[1]) < 1.5 * 22.0 / 70.0


def test_many_positions_are_counted_from_the_eleventh_on(refusal):
    bends = [[500.0 * n, 60.0 * (n % 2) * (-1) ** (n // 2), 100.0] for n in range(60)]
    tight = [f"vehicles.{n}.model.turn_rate_max_rps=0.005" for n in range(4)]
    lines = refusal(with_path(bends), *tight)
    assert len(lines) == 11
    assert lines[-1].startswith("path.waypoints_m: found ")
    assert lines[-1].endswith(" more places like these (turn); ")


def test_a_climb_is_held_against_the_vehicle_that_climbs_least(refusal, load):
    # 150 m over 1000 m at 22 m/s: 3.3 m/s.
    (line,) = refusal("path.waypoints_m=[[0, 0, 100], [1000, 0, 250]]")
    assert line.endswith("climbs 3.3 m/s; up to 3 m/s, vehicle 1's climb_max_mps")
    assert load("path.waypoints_m=[[0, 0, 100], [1000, 0, 236]]")
    (line,) = refusal("path.waypoints_m=[[0, 0, 236], [1000, 0, 100]]", "vehicles.2.model.climb_max_mps=2")
    assert line.endswith("descends 2.99 m/s; up to 2 m/s, vehicle 3's climb_max_mps")


def test_a_climb_takes_more_in_a_tailwind(refusal, load):
    """136 m over 1000 m: 2.99 m/s at 22 m/s, and 3.67 m/s with 5 m/s from behind."""
    climbs, away, back = "path.waypoints_m=[[0, 0, 100], [1000, 0, 236]]", [5.0, 0.0, 0.0], [-5.0, 0.0, 0.0]
    (line,) = refusal(climbs, f"wind.velocity_mps={away}")
    assert line.endswith("climbs 3.67 m/s; up to 3 m/s, vehicle 1's climb_max_mps")
    assert load(climbs, f"wind.velocity_mps={back}")


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        (
            ["path.waypoints_m=[[0, 0, 100], [1000, 0, 236.5]]"],
            "climbs 3.003 m/s; up to 3 m/s, vehicle 1's climb_max_mps",
        ),
        (["path.speed_mps=28.00001"], "found 28.00001 m/s; 16 to 28 m/s, leader 1's limits"),
        (["path.speed_mps=15.99999"], "found 15.99999 m/s; 16 to 28 m/s, leader 1's limits"),
        (["path.waypoints_m=[[0, 0, 100], [1000100, 0, 100]]"], "found a path of 1.0001e+06 m; up to 1e+06 m"),
    ],
)
def test_a_figure_just_beyond_its_limit_is_not_printed_as_the_limit(refusal, keys, line):
    assert refusal(*keys)[0].endswith(line)


@pytest.mark.parametrize(
    ("ground", "limit"), [("terrain=", "safety.clearance_m"), ("terrain={clearance_m: 20}", "terrain.clearance_m")]
)
def test_a_leg_too_steep_is_named_beside_what_dips_below_the_clearance(refusal, ground, limit):
    """The spline swings 450 m below the ground before a leg of 150 m in height over 100 m."""
    lines = refusal("path.waypoints_m=[[0, 0, 100], [2000, 0, 100], [2100, 0, 250], [4000, 0, 100]]", ground)
    assert any(line.startswith("path.waypoints_m.1: ") and "climbs" in line for line in lines)
    assert any(line.endswith("up to 3 m/s, vehicle 1's climb_max_mps") for line in lines)
    assert any(limit in line for line in lines)


@pytest.mark.parametrize("kind", ["spline", "legs"])
def test_a_problem_of_one_kind_hides_none_of_another(refusal, kind):
    """A descent of 8 m/s, then a waypoint 97 m too low and one 400 m outside the fence, 29 m/s, and slots 4 m apart."""
    path = "path.waypoints_m=[[0, 0, 200], [1500, 0, 200], [2000, 0, 20], [4000, 0, 3], [6000, 2400, 200]]"
    fence = "safety={separation_m: 5, clearance_m: 100, fence: {corners_m: %s}}"
    corners = [[-2000, -2000], [7000, -2000], [7000, 2000], [-2000, 2000]]
    lines = refusal(path, f"path.kind={kind}", fence % corners, "path.speed_mps=29", "formation.spacing_m=2")
    for part in ("m/s", "100 m or more (safety.clearance_m)", "outside the fence", "found 29 m/s", "separation_m"):
        assert any(part in line for line in lines), part
    assert any("climb_max_mps" in line for line in lines)


def test_all_waypoints_on_the_one_before_are_named(refusal):
    lines = refusal("path.waypoints_m=[[0, 0, 100], [0, 0.5, 100], [900, 0, 100], [900, 0, 120], [2000, 0, 100]]")
    assert [line.partition(":")[0] for line in lines] == ["path.waypoints_m.1", "path.waypoints_m.3"]


def test_a_path_that_turns_back_is_called_so(refusal):
    """There and back along almost one line: a spline turns there in some metres."""
    lines = refusal("path.waypoints_m=[[0, 0, 100], [2000, 0, 100], [0, 40, 100]]")
    assert any("turns back, or sharply, in a radius of" in line for line in lines)
    assert any("88 m or more, leader 1's turn_rate_max_rps of 0.25 rad/s at 22 m/s" in line for line in lines)
    assert len(lines) == 1


def test_the_speed_of_the_path_must_suit_the_leader(refusal):
    assert refusal("path.speed_mps=30") == ["path.speed_mps: found 30 m/s; 16 to 28 m/s, leader 1's limits"]
    (line,) = refusal("path.speed_mps=27", "vehicles.3.model.speed_max_mps=26")
    assert line == "path.speed_mps: found 27 m/s; 16 to 26 m/s, vehicle 4's limits"


def test_in_thin_air_an_aircraft_that_flies_by_its_sensor_must_fly_faster(refusal, load):
    """At 3000 m air has 0.742 of its density at sea level (ICAO Doc 7488): a reading of 14 m/s is 16.25 m/s true."""
    planes = ["vehicles={count: 2, model: arduplane}", "path.speed_mps=16"]
    assert load(*planes).path.begin_mps == 16.0
    (line,) = refusal(*planes, "origin.alt_m=3000")
    assert line == (
        "path.speed_mps: found 16 m/s; 16.25 to 29 m/s, leader 1's limits, in air of the density at origin.alt_m"
    )


@pytest.mark.parametrize(
    ("wind_mps", "line"),
    [
        ("[-25, 0, 0]", "-3 m/s over the ground is left, at 22 m/s of airspeed in a wind of 25 m/s; 1 m/s or more"),
        ("[-22.5, 0, 0]", "-0.5 m/s over the ground is left, at 22 m/s of airspeed in a wind of 22.5 m/s; 1 m/s or"),
        ("[-21.5, 0, 0]", "0.5 m/s over the ground is left, at 22 m/s of airspeed in a wind of 21.5 m/s; 1 m/s or"),
        ("[0, 23, 0]", "the wind blows 23 m/s across it, at 22 m/s of airspeed in a wind of 23 m/s; less than 22 m/s"),
        ("[-21, 0, 0]", ""),
        ("[0, -21.9, 0]", ""),
        ("[27, 0, 0]", ""),
    ],
)
def test_a_wind_against_which_the_leader_does_not_get_on_is_refused_with_the_speed_that_is_left(
    load, refusal, wind_mps, line
):
    """It flies 22 m/s through the air, northwards: sqrt(22² - 21.9²) = 2.1 m/s are left across a wind of 21.9 m/s."""
    wind = f"wind.velocity_mps={wind_mps}"
    if not line:
        assert load(wind)
        return
    (found,) = refusal(wind)
    assert found.startswith(f"path.waypoints_m.0: path at 0 m (north 0, east 0, height 100): {line}")


def test_the_wind_is_held_against_the_leg_that_leads_into_it(refusal):
    """North with 23 m/s behind it and then west, across it; the leg before the turn is fine."""
    bend = "path.waypoints_m=[[0, 0, 100], [2000, 0, 100], [3000, -1000, 100], [3000, -4000, 100]]"
    (found,) = refusal(bend, "wind.velocity_mps=[23, 0, 0]")
    assert "the wind blows 23 m/s across it" in found
    assert float(found.partition("(north ")[2].partition(",")[0]) > 2000.0


def test_multirotors_fly_their_speed_over_the_ground_against_any_wind_that_they_can_stand(load):
    slow = ["vehicles={count: 2, model: arducopter}", "path.speed_mps=5", "duration_s=900"]
    windy = load(*slow, "wind.velocity_mps=[-8, 0, 0]")
    assert path_end_s(windy) == path_end_s(load(*slow)) == pytest.approx(4000.0 / 5.0)


def test_every_shape_of_the_schedule_is_checked(refusal):
    change = "formation.changes=[{at_s: 30, shape: line, spacing_m: 200}]"
    lines = refusal(with_path(circle(600.0)), change)
    assert lines
    assert all("in shape line" in line for line in lines)


def test_slots_nearer_than_the_safe_separation_are_refused(refusal, load):
    assert refusal("formation={shape: follower, spacing_m: 4}") == [
        "formation.spacing_m: found slots of the leader and vehicle 2 4 m apart in follower; "
        "5 m or more (safety.separation_m)"
    ]
    custom = "formation={shape: custom, slots_m: {2: [-30, 0, 0], 3: [-60, 0, 0], 4: [-60, 3, 0]}}"
    assert "vehicle 3 and vehicle 4 3 m apart" in refusal(custom)[0]
    assert load(custom, "safety.separation_m=3")


@pytest.mark.parametrize("shape", ["circle", "plus"])
def test_slots_ahead_of_the_leader_are_refused_in_the_followers_frame_only(refusal, load, shape):
    fleet = "vehicles={count: 7}"
    (line,) = refusal(fleet, f"formation.shape={shape}", "formation.frame=follower_heading")
    assert line.startswith(f"formation.shape: found shape {shape} with vehicle ")
    assert "ahead of the leader" in line
    assert load(fleet, f"formation.shape={shape}")


@given(st.floats(-200, 200), st.floats(-200, 200), st.floats(0.1, 0.9))
def test_a_slot_moves_as_its_position_on_the_path_does(forward, right, share):
    """The closed form against differences of the slot's position, in the leader's frame."""
    path = SplinePath([[0, 0, 100], [1500, 0, 100], [3000, 900, 100], [3500, 2400, 100]])
    s = float(path.nodes_m[int(share * 192)] + path.nodes_m[int(share * 192) + 1]) / 2
    speed, step = 22.0, 0.01
    points = path.at(s + speed * step * np.arange(-2.0, 3.0))
    heading = np.exp(1j * points.course_rad)
    position = points.north_m + 1j * points.east_m + heading * (forward + 1j * right)
    velocity = np.gradient(position, step)[1:-1]
    slot = SlotMotion.at_rest(np.array([[forward, right, 0.0]]))
    motion = slot_needs(LeaderFlight.along(points, speed), slot, "leader_heading")
    assert abs(velocity[1]) == pytest.approx(motion.speed_mps[2, 0], rel=1e-5)
    turn = np.angle(velocity[2] / velocity[0]) / (2 * step)
    assert turn == pytest.approx(motion.turn_rate_rps[2, 0], abs=1e-5)
    accel = (abs(velocity[2]) - abs(velocity[0])) / (2 * step)
    assert accel == pytest.approx(motion.accel_mps2[2, 0], abs=1e-5)


@given(st.floats(1.0, 200.0), st.floats(-100.0, 100.0), st.floats(-0.05, 0.05))
def test_in_a_steady_turn_both_frames_keep_the_distance_to_the_leader(back, right, turn):
    """All vehicles of a steady turn circle one centre: the slot's speed is its radius times the turn rate."""
    speed = 22.0
    points = SplinePath([[0, 0, 0], [100, 0, 0]]).at(np.zeros(1))._replace(curvature_1pm=np.array([turn / speed]))
    slot = SlotMotion.at_rest(np.array([[-back, right, 0.0]]))
    own = slot_needs(LeaderFlight.along(points, speed), slot, "follower_heading")
    angle = np.arcsin(turn * back / speed)  # leader's heading minus follower's
    along = speed * np.cos(angle) - turn * right
    assert own.speed_mps[0, 0] == pytest.approx(along)
    assert own.turn_rate_rps[0, 0] == pytest.approx(turn)


def test_a_path_or_a_slot_below_the_clearance_over_a_plain_is_refused(load, refusal):
    low = with_path([[0, 0, 30], [2000, 0, 20], [4000, 0, 30]])
    below = "formation.slots_m={2: [-30, 30, 0], 3: [-30, -30, -18], 4: [-60, 0, 5]}"
    assert load(low)
    assert load(low, "formation.shape=custom", below, "safety.clearance_m=1")
    (line,) = refusal(low, "formation.shape=custom", below)
    assert line == (
        "path.waypoints_m.1: path at 2000 m (north 2000, east 0, height 20): the lowest slot of shape custom is 2.0 m "
        "above the ground; "
        "5 m or more (safety.clearance_m)"
    )
    assert "the leader is -50.0 m above the ground" in refusal(with_path([[0, 0, -50], [2000, 0, -50]]))[0]
