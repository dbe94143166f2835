import json
import pickle

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airlink.endpoint import VehicleId
from formation_scenario import Scenario, ScenarioError, dump_scenario, load_scenario
from formation_scenario.source import read_text

EVERY_KEY = """
schema: 1
name: three-followers
seed: 1
duration_s: 120
origin: {lat_deg: 35.0, lon_deg: 125.0, alt_m: 0.0}
start: {in_air: false, offset_m: [8, 6, 4]}
vehicles:
  - {id: 1, role: leader}
  - id: 2
    role: follower
    endpoint: "udpin:127.0.0.1:14552"
    autopilot: emulator
    model: {tau_v_s: 4.0, tau_psi_s: 1.5, tau_ha_s: 1.0, tau_hb_s: 3.0, speed_min_mps: 16, speed_max_mps: 28,
            accel_max_mps2: 1.5, turn_rate_max_rps: 0.25, climb_max_mps: 3.0}
    navigation: {source: truth}
    clock: {offset_s: 0.25, drift_ppm: 20}
  - {id: 3}
telemetry: {rate_hz: 10}
formation:
  shape: diamond
  spacing_m: 30
  frame: leader_heading
  slots_m: {2: [-30, 30, 0], 3: [-30, -30, 0]}
  changes: [{at_s: 60, shape: square}, {at_s: 90, shape: custom}]
law:
  type: fuzzy_pid
  rate_hz: 10
  delay_compensation: true
  mixer: {k_v: 0.1, k_x: 1.0, k_psi: 0.1, k_y: 0.05, k_z: 1.0}
  speed:   {kp: 3.0, ki: 0.8, kd: 6.5, error_scale: 1.0, rate_scale: 1.0}
  fuzzy: {base: 0.7, span: 0.6, tables: printed}
  consensus: {k1: 0.1, k2: 0.6, k3: 0.25, graph: [[0, 0, 0], [1, 0, 0], [1, 0, 0]]}
path: {speed_mps: 22, waypoints_m: [[0, 0, 100], [1500, 0, 100], [3000, 700, 120]]}
links:
  default: {delay_ms: 0, jitter_ms: 0, loss: 0.0, uplink: {loss: 0.1}}
  downlink: {delay_ms: 20}
  changes: [{at_s: 40, vehicles: [2], delay_ms: 300}]
disturbances: [{at_s: 60, vehicles: all, velocity_mps: [0.6, 0.6, 0.0]}]
faults: [{at_s: 90, vehicles: [3], kind: crash}]
expect:
  - {metric: error_x_m.max, followers: all, from_s: 70, to_s: 120, below: 0.22}
"""


def test_two_required_keys_make_a_scenario(load):
    scenario = load()
    assert (scenario.schema_, scenario.seed, scenario.duration_s) == (1, 1, 181.818)  # 4000 m at 22 m/s
    assert scenario.leader is scenario.vehicles[0]
    assert [vehicle.vehicle_id for vehicle in scenario.followers] == [VehicleId(1, n) for n in (2, 3, 4)]
    assert {vehicle.endpoint for vehicle in scenario.vehicles} == {"udpin:127.0.0.1:14550"}
    assert scenario.law.type == "fuzzy_pid"
    assert scenario.expect == ()


def test_without_a_duration_a_flight_ends_with_its_path_and_with_one_when_that_says(load):
    long = "path.waypoints_m=[[0, 0, 100], [22000, 0, 100]]"
    assert load(long).duration_s == 1000.0
    assert load(long, "duration_s=120").duration_s == 120.0
    assert load(long, "wind.velocity_mps=[-2, 0, 0]").duration_s == 1100.0  # 20 m/s over ground
    expected = load(long, "expect=[{metric: error_x_m.max, below: 1}]")
    assert expected.expect[0].to_s == 1000.0
    assert load_scenario(read_text(dump_scenario(expected)).data) == expected


def test_count_is_written_out_as_a_list_led_by_vehicle_1(load):
    scenario = load("vehicles={count: 20, network: 2, model: {tau_v_s: 5}}")
    assert [vehicle.vehicle_id for vehicle in scenario.vehicles] == [VehicleId(2, n) for n in range(1, 21)]
    assert scenario.leader is scenario.vehicles[0]
    assert len(scenario.followers) == 19
    assert {vehicle.endpoint for vehicle in scenario.vehicles} == {"udpin:127.0.0.1:14551"}
    assert {vehicle.model.tau_v_s for vehicle in scenario.vehicles} == {5.0}


def test_a_list_without_a_leader_follows_a_virtual_one(load):
    scenario = load("vehicles=[{id: 7}, {id: 8}]")
    assert scenario.leader is None
    assert len(scenario.followers) == 2


@pytest.mark.parametrize(
    ("frame", "gains"), [("follower_heading", (1.0, 0.6, 0.1)), ("leader_heading", (1.2, 0.5, 1.8))]
)
def test_heading_gains_default_by_the_frame_of_the_slots(load, frame, gains):
    heading = load(f"formation.frame={frame}").law.heading
    assert (heading.kp, heading.ki, heading.kd) == gains
    assert (heading.error_scale, heading.rate_scale) == (0.1, 0.1)


def test_a_given_gain_leaves_the_other_defaults_of_its_channel(load):
    law = load("law.heading={kp: 0.5}", "law.height={kd: 1}").law
    assert (law.heading.kp, law.heading.ki, law.heading.kd) == (0.5, 0.5, 1.8)
    assert (law.height.kp, law.height.ki, law.height.kd, law.height.error_scale) == (2.0, 0.4, 1.0, 2.0)
    assert (law.speed.kp, law.speed.ki, law.speed.kd, law.speed.rate_scale) == (3.0, 0.8, 6.5, 1.0)


def test_the_run_in_is_longer_from_the_ground(load):
    assert load().start.run_in_s == 60.0
    assert load("start={in_air: true}").start.run_in_s == 10.0
    assert load("start={in_air: true, run_in_s: 3}").start.run_in_s == 3.0


def test_an_expectation_ends_with_the_run_and_a_change_keeps_the_spacing(load):
    scenario = load(
        "duration_s=90",
        "expect=[{metric: settled_at_s, below: 20}]",
        "formation={spacing_m: 40, changes: [{at_s: 5, shape: arrow}]}",
    )
    assert scenario.expect[0].to_s == 90.0
    assert scenario.formation.changes[0].spacing_m == 40.0


def test_the_name_defaults_to_the_file(tmp_path):
    path = tmp_path / "hill-run.yaml"
    path.write_text("vehicles: {count: 2}\npath: {waypoints_m: [[0, 0, 50], [900, 0, 50]]}\n")
    assert load_scenario(path).name == "hill-run"


def test_whole_numbers_stand_for_numbers(load):
    assert load("law.rate_hz=50", "start.offset_m=[8, 6, 4]").start.offset_m == (8.0, 6.0, 4.0)


def every_key() -> Scenario:
    mapping = read_text(EVERY_KEY).data
    return load_scenario(mapping, ["vehicles.1.model.climb_max_mps=9", "path.waypoints_m.2.2=100"])


def test_numbers_without_a_fraction_are_whole(load, refusal):
    written = (
        "seed=1e3",
        "vehicles={count: 3.0, network: 2.0}",
        "expect=[{metric: measured_loss, followers: [2.0], below: 1}]",
    )
    scenario = load(*written)
    assert (scenario.seed, len(scenario.vehicles), scenario.expect[0].followers) == (1000, 3, (2,))
    assert {(vehicle.network, vehicle.endpoint) for vehicle in scenario.vehicles} == {(2, "udpin:127.0.0.1:14551")}
    assert all(type(number) is int for number in (scenario.seed, scenario.vehicles[0].network))
    for key, value in (("seed", "1.5"), ("seed", "true"), ("seed", ".inf"), ("vehicles.0.id", "1.5")):
        assert refusal(f"{key}={value}")[0].startswith(f"{key}: found {value}; a whole number from ")
    assert refusal("vehicles={count: 2.5}")[0].startswith("vehicles.count: found 2.5; 1 to 254")


def test_in_json_where_keys_are_text_a_vehicle_is_named_by_its_digits(tmp_path):
    path = tmp_path / "custom.json"
    slots = {"2": [-30, 30, 0], "1:3": [-30, -30, 0]}
    keys = {"vehicles": {"count": 3}, "formation": {"shape": "custom", "slots_m": slots}}
    path.write_text(json.dumps(keys | {"path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}}))
    assert load_scenario(path).formation.slots_m == {2: (-30.0, 30.0, 0.0), "1:3": (-30.0, -30.0, 0.0)}


def test_every_key_is_read():
    scenario = every_key()
    assert scenario.vehicles[1].clock.offset_s == 0.25
    assert scenario.formation.slots_m == {2: (-30.0, 30.0, 0.0), 3: (-30.0, -30.0, 0.0)}
    assert scenario.law.consensus.graph == ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert scenario.faults[0].kind == "crash"
    assert scenario.disturbances[0].model_dump()["velocity_mps"] == (0.6, 0.6, 0.0)


def test_a_dumped_scenario_loads_back_equal(tmp_path):
    scenario = every_key()
    path = tmp_path / "run.yaml"
    path.write_text(dump_scenario(scenario), encoding="utf-8")
    assert load_scenario(path) == scenario
    assert load_scenario(scenario) == scenario


names = st.text(min_size=1, max_size=80).filter(str.isprintable)
seconds = st.floats(1e-3, 1e6, allow_nan=False)


@settings(max_examples=20)
@given(
    names,
    st.integers(0, 2**63 - 1),
    seconds,
    st.floats(0, 1),
    st.integers(1, 12),
    st.sampled_from(["all", [1]]),
    st.floats(0, 1e3),
)
def test_dump_and_load_is_the_identity(name, seed, duration, loss, count, vehicles, offset):
    scenario = load_scenario(
        {
            "name": name,
            "seed": seed,
            "duration_s": duration,
            "vehicles": {"count": count, "clock": {"offset_s": offset}},
            "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]},
            "links": {"changes": [{"at_s": duration, "vehicles": vehicles, "loss": loss}]},
        }
    )
    assert load_scenario(read_text(dump_scenario(scenario)).data) == scenario


@pytest.mark.parametrize("key", ["links", "wind", "telemetry", "origin", "finish", "expect", "faults", "orders"])
def test_a_group_whose_every_line_is_commented_out_is_its_default(load, key):
    assert load(f"{key}=") == load()


def test_an_empty_key_that_none_knows_is_still_unknown(refusal):
    assert "link: found an unknown key 'link'" in refusal("link=")[0]


def test_a_scenario_cannot_be_changed(load):
    with pytest.raises(ValueError, match="frozen"):
        load().path.begin_mps = 3.0


def test_overrides_apply_to_a_scenario_too(load):
    assert load_scenario(load(), ["seed=9"]).seed == 9


def test_selected_vehicles_are_named_by_id_or_network_and_id(load):
    scenario = load("vehicles=[{id: 1, role: leader}, {id: 2}, {id: 2, network: 2}]")
    assert scenario.selected("all") == scenario.vehicles
    assert scenario.selected((1, "2:2")) == (scenario.vehicles[0], scenario.vehicles[2])


HOVERING = "vehicles={count: 3, autopilot: arducopter}", "path.speed_mps=5"


def test_vehicles_that_hover_fly_by_the_shipped_file(load):
    scenario = load(*HOVERING)
    assert scenario.hovers
    assert {vehicle.model.speed_min_mps for vehicle in scenario.vehicles} == {0.0}
    assert scenario.law.gains == "auto"


def test_those_that_hover_and_those_that_dont_make_no_formation(refusal):
    mixed = "vehicles=[{id: 1, role: leader, autopilot: arducopter}, {id: 2}]"
    assert refusal(mixed, "path.speed_mps=8", "vehicles.1.model.speed_min_mps=5")[0] == (
        "vehicles: found vehicles that hover and others that don't; one kind in a formation"
    )


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ("vehicles.0.model={}", "vehicles.0.model.hovers: found false of arducopter; true"),
        (
            "vehicles.1.autopilot=arduplane",
            "vehicles.1.model.hovers: found true of arduplane; false",
        ),
        (
            "formation.frame=follower_heading",
            "formation.frame: found follower_heading of vehicles that hover; leader_heading, or north",
        ),
        ("law.type=consensus", "law.type: found consensus of vehicles that hover; fuzzy_pid, pid"),
    ],
)
def test_keys_that_do_not_suit_vehicles_that_hover_are_refused(refusal, change, expected):
    group = "vehicles=[{id: 1, role: leader, autopilot: arducopter}, {id: 2, model: arducopter}]"
    assert expected in refusal(group, "path.speed_mps=5", change)


@pytest.mark.parametrize(
    ("true_model", "expected"),
    [
        ("{hovers: true}", "hovers: found true beside a model with false; false"),
        ("{speed_min_mps: 0}", "speed_min_mps: found 0 of a vehicle that doesn't hover; 0.001 m/s or more"),
        (
            "{airframe: {airspeed_scale: 0.8}}",
            "airframe.airspeed_scale: found 0.8 of a vehicle whose model has no airframe: no sensor is read; "
            "1, or an airframe in its model too",
        ),
    ],
)
def test_impossible_true_models_are_refused(refusal, true_model, expected):
    assert f"vehicles.1.true_model.{expected}" in refusal(
        f"vehicles=[{{id: 1, role: leader}}, {{id: 2, true_model: {true_model}}}]"
    )


def test_a_least_speed_of_0_is_refused_of_vehicles_that_do_not_hover(refusal):
    expected = "vehicles.0.model.speed_min_mps: found 0 of a vehicle that doesn't hover"
    assert refusal("vehicles={count: 2, model: {speed_min_mps: 0}}")[0].startswith(expected)


@pytest.mark.parametrize(("model", "speed"), [("{hovers: true}", "16"), ("{hovers: true, speed_min_mps: 3}", "3")])
def test_a_least_speed_above_0_is_refused_of_vehicles_that_hover(refusal, model, speed):
    expected = f"vehicles.0.model.speed_min_mps: found {speed} of a vehicle that hovers; 0: it can hover"
    assert expected in refusal(f"vehicles={{count: 2, model: {model}}}", "path.speed_mps=20")


@pytest.mark.parametrize(
    ("model", "expected"),
    [
        ("{prompt_share: 0.5}", "prompt_share: found 0.5 of an ArduPlane; 1; less of what hovers, and of a PX4"),
        (
            "{firmware: px4, prompt_share: 0.5, airframe: {}}",
            "prompt_share: found 0.5 beside an airframe, which has time constants of its own; 1",
        ),
    ],
)
def test_a_prompt_share_below_1_is_refused_of_vehicles_without_an_integrator(refusal, load, model, expected):
    assert f"vehicles.0.model.{expected}" in refusal(f"vehicles={{count: 2, model: {model}}}")
    assert load("vehicles={count: 2, model: {firmware: px4, prompt_share: 0.5}}").vehicles[1].model.prompt_share == 0.5


def test_the_grade_of_inertial_sensors_fills_in_what_is_not_given(load):
    keys = "{source: ins, grade: tactical, sensors: {gyro_bias_deg_per_h: [1, 2, 3]}}"
    sensors = load(f"vehicles.1.navigation={keys}").vehicles[1].navigation.sensors
    assert (sensors.accel_bias_ug, sensors.gyro_bias_deg_per_h) == (2000.0, (1.0, 2.0, 3.0))
    assert load("vehicles.1.navigation={source: ins}").vehicles[1].navigation.sensors.accel_bias_ug == 100.0


def test_a_scenario_goes_to_another_process_by_its_keys_alone(load):
    """Values derived from the keys may be compiled objects, which can't be pickled."""
    scenario = load()
    end_m = scenario.leader_path.length_m
    there = pickle.loads(pickle.dumps(scenario))
    assert "leader_path" not in vars(there)
    assert "written" not in vars(there.path)
    assert there == scenario
    assert there.leader_path.length_m == end_m


def test_one_error_carries_every_problem():
    with pytest.raises(ScenarioError) as refused:
        load_scenario({"vehicles": {"count": 0}, "path": {"speed": 3}, "seed": -1})
    assert {problem.key for problem in refused.value.problems} == {
        "seed",
        "vehicles.count",
        "path.speed",
        "path.waypoints_m",
    }


def test_noisy_navigation_chooses_the_gains_for_noise_unless_set_otherwise(load):
    noisy = "vehicles.2.navigation={source: noisy}"
    clean, chosen = load().law, load(noisy).law
    assert (clean.gains, clean.speed.kp, clean.derivative_filter_s) == ("clean", 3.0, 0.1)
    assert (chosen.gains, chosen.speed.kp, chosen.derivative_filter_s) == ("noise", 1.0, 1.0)
    assert load(noisy, "law.gains=clean").law == clean
    mixed = load("law.gains=noise", "law.speed.kp=2.5", "law.mixer={k_x: 0.7}").law
    assert (mixed.speed.kp, mixed.speed.ki) == (2.5, chosen.speed.ki)
    assert (mixed.mixer.k_x, mixed.mixer.k_v) == (0.7, chosen.mixer.k_v)


def test_a_set_of_gains_that_does_not_exist_is_refused(refusal):
    assert refusal("law.gains=noisy") == ["law.gains: found 'noisy'; auto, clean, noise (did you mean 'noise'?)"]


CONSENSUS = {"schema": 1, "path": {"waypoints_m": [[0, 0, 100], [3000, 0, 100]]}, "law": {"type": "consensus"}}
AIRCRAFT = {"count": 4, "autopilot": "arduplane"}


def protocol(**keys):
    found = load_scenario(CONSENSUS | keys).law.consensus
    return found.k1, found.k2, found.k3


def test_the_protocols_gains_are_by_design_where_a_vehicle_has_an_airframe():
    assert protocol(vehicles={"count": 4}) == (0.1, 0.6, 0.25)
    assert protocol(vehicles=AIRCRAFT, law={"type": "consensus", "gains": "clean"}) == (0.1, 0.6, 0.25)
    k1, k2, k3 = protocol(vehicles=AIRCRAFT)
    assert (k2, k3) == (0.0, 1.0)  # 1/tau_v of the shipped ArduPlane
    assert protocol(vehicles=AIRCRAFT, law={"type": "consensus", "consensus": {"k2": 0.1}}) == (k1, 0.1, k3)
    flown = load_scenario(CONSENSUS | {"vehicles": AIRCRAFT})
    assert load_scenario(read_text(dump_scenario(flown)).data) == flown


def test_a_graph_that_is_none_is_refused_before_gains_are_designed_on_it():
    law = {"type": "consensus", "consensus": {"graph": [[0, 1], [1, 0]]}}
    with pytest.raises(ScenarioError, match="2 rows"):
        load_scenario(CONSENSUS | {"vehicles": AIRCRAFT, "law": law})
