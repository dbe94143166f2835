import pytest

from formation_scenario import dump_scenario, load_scenario
from formation_scenario.expectation import METRICS, WINDOWED
from formation_scenario.source import read_text


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["vehicles.3.id=2"], "vehicles.3.id: found 2 again on network 1, first at vehicles.1; each id once"),
        (["vehicles.2.role=leader"], "vehicles.2.role: found a second leader, first at vehicles.0"),
        (
            ["vehicles.1.endpoint=ble:127.0.0.1:1"],
            "vehicles.1.endpoint: connection string 'ble:127.0.0.1:1': found 'ble'; udpin:HOST:PORT, udpout:HOST:PORT",
        ),
        (
            ["vehicles.1.endpoint=udpout:127.0.0.1:9", "vehicles.2.endpoint=udpout:127.0.0.1:9"],
            "vehicles.2.endpoint: found udpout:127.0.0.1:9 for vehicles 2 and 3: both emulators listen there; udpout:",
        ),
        (
            ["vehicles.1.endpoint=[udpin:127.0.0.1:14560, udpin:127.0.0.1:14560]"],
            "vehicles.1.endpoint.1: found udpin:127.0.0.1:14560 twice; another endpoint for each link of a vehicle",
        ),
        (
            ["vehicles.1.endpoint=[udpin:127.0.0.1:14560, ble:1]"],
            "vehicles.1.endpoint.1: connection string 'ble:1': found 'ble'; udpin:HOST:PORT, udpout:HOST:PORT",
        ),
        (["vehicles.1.endpoint=[]"], "vehicles.1.endpoint: found []"),
        (
            ["links.changes=[{at_s: 1, link: 2, loss: 1}]"],
            "links.changes.0.link: found 2, where its vehicles have 1 link at most; 1 to 1, the place in the",
        ),
        (["vehicles.1.network=2", "vehicles.1.endpoint=udp:127.0.0.1:14550"], "for networks 1 and 2"),
        (
            ["vehicles.1.model.speed_min_mps=30"],
            "vehicles.1.model.speed_min_mps: found 30; at most speed_max_mps",
        ),
        (
            ["vehicles.1.true_model={speed_min_mps: 30}"],
            "vehicles.1.true_model.speed_min_mps: found 30; at most speed_max_mps",
        ),
        (["faults=[{at_s: 1, until_s: 2, kind: crash}]"], "faults.0.until_s: found an end of a crash; only for freeze"),
        (["faults=[{at_s: 3, until_s: 2, kind: freeze}]"], "faults.0.until_s: found 2; after at_s, 3"),
        (["faults=[{at_s: 1, mode: RTL, kind: freeze}]"], "faults.0.mode: found a mode for a freeze; only for pilot"),
        (["faults=[{at_s: 1, vehicles: [2, 9], kind: crash}]"], "faults.0.vehicles.1: found 9; 1, 2, 3, 4"),
        (["disturbances=[{at_s: 1, vehicles: [9], velocity_mps: [0, 0, 0]}]"], "disturbances.0.vehicles.0"),
        (["links.changes=[{at_s: 1, vehicles: ['2:1'], loss: 1}]"], "links.changes.0.vehicles.0: found 2:1"),
        (
            ["expect=[{metric: settled_at_s, followers: [1], below: 9}]"],
            "expect.0.followers.0: found 1; 2, 3, 4",
        ),
        (["expect=[{metric: settled_at_s}]"], "expect.0: found no bound; below, above or both"),
        (
            ["duration_s=120", "expect=[{metric: in_slot_share, above: 0.5, from_s: 120}]"],
            "found a window from 120 to 120 s",
        ),
        (
            ["expect=[{metric: settled_at_s, below: 99, from_s: 30, to_s: 35}]"],
            "expect.0.from_s: found 30 for settled_at_s, a figure of the whole flight; 0, or nothing",
        ),
        (
            ["duration_s=120", "expect=[{metric: frames_bad, followers: [2], below: 1, to_s: 35}]"],
            "expect.0.to_s: found 35 for frames_bad, a figure of the whole flight; duration_s, 120, or nothing",
        ),
        (["expect=[{metric: violations, followers: [2], below: 1}]"], "a figure of the whole run; all"),
        (["expect=[{metric: violations, above: 2, below: 1}]"], "found above 2 and below 1; more than above"),
        (["start.row_m=4"], "start.row_m: found 4 m; safety.separation_m, 5 m, or more"),
        (["start={in_air: true, row_m: 9}"], "start.row_m: found a row of vehicles that begin in the air"),
        (["formation.shape=custom"], "formation.slots_m: found no slot for follower 2, 3, 4"),
        (
            ["formation.changes=[{at_s: 1, shape: custom, slots_m: {2: [-9, 0, 0]}}]"],
            "no slot for follower 3, 4",
        ),
        (["formation.slots_m={1: [0, 0, 0]}"], "formation.slots_m.1: found 1; 2, 3, 4"),
        (
            ["vehicles.1.model={airframe: {}, climb_max_mps: 30}"],
            "vehicles.1.model.climb_max_mps: found 30; up to 16.2 m/s, what the airframe's thrust leaves at its cruis",
        ),
        (
            ["vehicles.1.model={airframe: {climb_max_mps: 30}}"],
            "vehicles.1.model.airframe.climb_max_mps: found 30; up to 16.2 m/s, ",
        ),
        (
            ["vehicles.1.model={airframe: {thrust_mps2: 6}}"],
            "vehicles.1.model.climb_max_mps: found 3; up to 0 m/s, what the airframe's thrust leaves",
        ),
        (["law.consensus.graph=[[0, 1], [1, 0]]"], "found 2 rows of 2, 2; 4 rows of 4 weights"),
        (
            ["path.waypoints_m=[[0, 0, 90], [0, 0.5, 99]]"],
            "path.waypoints_m.1: found a waypoint 0.5 m from the one",
        ),
        (
            ["path.waypoints_m=[[0, 0, 90], [900, 0, 90], [0, 0, 90]]"],
            "path.waypoints_m.1: found a path that turns",
        ),
        (["path.waypoints_m=[[0, 0, 90], [2e6, 0, 90]]"], "path.waypoints_m: found a path of 2e+06 m; up to 1e+06 m"),
        (
            ["path.waypoints_m=[[1e8, 0, 90], [100002000, 0, 90]]"],
            "path.waypoints_m.0: found a waypoint 1e+08 m from the origin; up to 1e+06 m",
        ),
        (
            ["origin.lat_deg=-85", "path.waypoints_m=[[0, 0, 90], [-5e5, 0, 90]]"],
            "path.waypoints_m.1: found a waypoint at latitude -89.5°; up to 89°",
        ),
        (
            ["path.waypoints_m=[[0, 0, 1e8], [2000, 0, 1e8]]"],
            "path.waypoints_m.0: found a waypoint 1e+08 m high; up to 30000 m above sea level",
        ),
        (
            ["wind.velocity_mps=[20, 20, 0]", "vehicles.2.model.speed_max_mps=25"],
            "wind.velocity_mps: found a wind of 28.3 m/s; less than 25 m/s, vehicle 3's speed_max_mps",
        ),
    ],
)
def test_keys_that_contradict_each_other_are_refused(refusal, overrides, expected):
    lines = refusal(*overrides)
    assert any(expected in line for line in lines), lines


def test_a_figure_is_of_the_whole_flight_or_over_a_window_as_its_description_says():
    for metric, text in METRICS.items():
        assert metric not in WINDOWED or "the whole flight" not in text, metric
        assert metric in WINDOWED or "window" not in text, metric
    assert "measured_delay_ms.p99" in WINDOWED


def test_the_whole_flight_may_be_said_and_stays_whole_where_a_written_scenario_is_flown_longer(load):
    wanted = load("duration_s=120", "expect=[{metric: margin_used, from_s: 0, to_s: 120, below: 1}]")
    assert load_scenario(read_text(dump_scenario(wanted)).data, ["duration_s=150"]).expect[0].to_s == 150.0


def test_what_is_expected_of_a_flight_hides_nothing_that_keeps_it_from_being_flown(refusal):
    steep, late = (
        "path.waypoints_m=[[0, 0, 100], [500, 0, 400]]",
        "expect=[{metric: error_x_m.max, below: 1, from_s: 60}]",
    )
    (alone,) = refusal("path.waypoints_m=[[0, 0, 100], [500, 0, 100]]", "duration_s=120", late)
    assert alone == "expect.0.from_s: found 60; less than 23.7 s, when the flight is over at the latest"
    *path, expected = refusal(steep, "duration_s=120", late)
    assert path == refusal(steep)
    assert "climb" in path[0]
    assert expected.startswith("expect.0.from_s: found 60; ")


@pytest.mark.parametrize("metric", ["settled_at_s", "error_x_m.max", "margin_used", "delay_margin_s"])
def test_an_expectation_of_followers_needs_one(load, refusal, metric):
    wanted = f"expect=[{{metric: {metric}, below: 5}}]"
    assert refusal("vehicles={count: 1}", wanted) == [
        f"expect.0.metric: found {metric} of a formation without followers; one or more followers, or a figure that "
        "needs none"
    ]
    assert load("vehicles=[{id: 7}]", wanted).leader is None


def test_the_leaders_link_can_be_named_and_its_errors_cannot(load, refusal):
    assert load("expect=[{metric: measured_loss, followers: [1], below: 0.1}]").expect[0].followers == (1,)
    assert refusal("expect=[{metric: error_x_m.max, followers: [1], below: 1}]") == [
        "expect.0.followers.0: found 1; 2, 3, 4"
    ]
    assert refusal("expect=[{metric: measured_loss, followers: [5], below: 0.1}]") == [
        "expect.0.followers.0: found 5; 1, 2, 3, 4"
    ]


def test_an_expectation_of_distance_needs_two(load, refusal):
    wanted = "expect=[{metric: violations, below: 1}, {metric: min_separation_m, above: 5}]"
    assert refusal("vehicles={count: 1}", wanted) == [
        "expect.1.metric: found min_separation_m of one vehicle; two or more vehicles, or a figure that needs one alone"
    ]
    assert load("vehicles={count: 2}", wanted)


@pytest.mark.parametrize(
    ("bound", "line"),
    [
        ("metric: measured_loss, below: 5", "below: found 5 for measured_loss; from 0 to 1"),
        ("metric: in_slot_share, below: 1.5", "below: found 1.5 for in_slot_share; from 0 to 1"),
        ("metric: error_x_m.max, above: -1", "above: found -1 for error_x_m.max; 0 or more"),
        (
            "metric: measured_loss, above: 1",
            "above: found 1 for measured_loss, above which it never is; from 0 to 1, 1 itself excluded",
        ),
    ],
)
def test_bounds_that_cannot_be_broken_or_kept_are_refused(refusal, bound, line):
    assert refusal(f"expect=[{{{bound}}}]") == [f"expect.0.{line}"]


@pytest.mark.parametrize(
    "bound",
    [
        "metric: measured_loss, below: 1",
        "metric: in_slot_share, above: 0",
        "metric: min_clearance_m, above: -5",
        "metric: delay_margin_s, below: -1",
        "metric: violations, below: 1e6",
    ],
)
def test_bounds_within_what_a_figure_can_be_are_taken(load, bound):
    assert load(f"expect=[{{{bound}}}]").expect


def test_an_id_on_two_networks_is_named_with_its_network(load, refusal):
    fleet = "vehicles=[{id: 1, role: leader}, {id: 2}, {id: 2, network: 2}]"
    assert refusal(fleet, "faults=[{at_s: 1, vehicles: [2], kind: crash}]") == [
        "faults.0.vehicles.0: found 2, the id of 2 vehicles; '1:2', '2:2'"
    ]
    assert load(fleet, "faults=[{at_s: 1, vehicles: ['2:2'], kind: crash}]").faults[0].vehicles == ("2:2",)


def test_a_weight_of_a_vehicle_on_itself_is_refused(refusal):
    rows = [[1 if p == q else 0 for q in range(4)] for p in range(4)]
    assert "diagonal" in refusal(f"law.consensus.graph={rows}")[0]


def test_a_graph_in_which_none_is_heard_by_all_is_refused(load, refusal):
    disconnected = [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1], [0, 0, 1, 0]]
    assert refusal(f"law.consensus.graph={disconnected}") == [
        "law.consensus.graph: found none from which all receive; a vehicle from which all receive, directly or through "
        "others (a spanning tree)"
    ]
    two_heard = [[0, 0, 0, 0], [0, 0, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0]]
    assert refusal(f"law.consensus.graph={two_heard}")
    joined: list[list[float]] = [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0.1, 0, 1], [0, 0, 1, 0]]
    assert load(f"law.consensus.graph={joined}").law.consensus.graph == tuple(tuple(row) for row in joined)
    chain = [[0, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]
    assert load(f"law.consensus.graph={chain}").law.consensus.graph == tuple(map(tuple, chain))


@pytest.mark.parametrize(
    ("entry", "line"),
    [
        ("velocity_mps: [1, 0, 0], until_s: 5", "disturbances.0.until_s: found 5; more than at_s, 5"),
        ("kind: dryden", "disturbances.0: found neither; wind_6m_mps, or sigma_mps and length_m"),
        (
            "kind: dryden, wind_6m_mps: 7, length_m: [9, 9, 9]",
            "disturbances.0: found length_m, wind_6m_mps; wind_6m_mps, or sigma_mps and length_m",
        ),
    ],
)
def test_a_disturbance_ends_after_it_begins_and_turbulence_has_one_intensity(refusal, entry, line):
    assert refusal(f"disturbances=[{{at_s: 5, {entry}}}]") == [line]
