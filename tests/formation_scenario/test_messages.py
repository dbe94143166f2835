import pickle

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from formation_scenario import ScenarioError, load_scenario
from formation_scenario.fields import did_you_mean

BASE = "vehicles: {count: 4}\npath: {waypoints_m: [[0, 0, 100], [4000, 0, 100]]}\n"
JARGON = (
    "Input should",
    "valid integer",
    "valid dictionary",
    "type=",
    "pydantic",
    "Extra inputs",
    "_parsing",
)


def message(tmp_path, text: str) -> str:
    path = tmp_path / "a.yaml"
    path.write_text(BASE + text)
    with pytest.raises(ScenarioError) as refused:
        load_scenario(path)
    return str(refused.value).replace(str(path), "a.yaml")


@pytest.mark.parametrize("keys", ["nonsense: 1\n", "formation: {spacing_m: 3}\nwind: {velocity_mps: [60, 0, 0]}\n"])
def test_a_refusal_comes_out_of_another_process_as_it_is(keys):
    with pytest.raises(ScenarioError) as refused:
        load_scenario(yaml.safe_load(BASE + keys))
    again = pickle.loads(pickle.dumps(refused.value))
    assert isinstance(again, ScenarioError)
    assert (str(again), again.problems) == (str(refused.value), refused.value.problems)


def test_a_wrong_word_names_file_line_column_key_choices_and_the_nearest(tmp_path):
    assert message(tmp_path, "formation:\n  shape: diamnd\n") == (
        "a.yaml:4:3: formation.shape: found 'diamnd'; allowed: follower, diamond, triangle, square, plus, "
        "arrow, line, echelon, circle, custom (did you mean 'diamond'?)"
    )


def test_a_text_of_a_number_s_digits_is_not_asked_whether_it_meant_itself(tmp_path):
    assert message(tmp_path, "schema: '1'\n") == "a.yaml:3:1: schema: found '1'; allowed: 1"


WRONG = [
    (
        "sede: 3\n",
        "a.yaml:3:1: sede: found an unknown key 'sede'; allowed: schema, name, seed, duration_s,",
    ),
    ("finish: {loiter: 3}\n", "allowed: loiter_s, then (did you mean 'loiter_s'?)"),
    ("law: {fuzzy: {table_p: [[0, 1]]}}\n", "law.fuzzy.table_p.0: found [0, 1]; allowed: 5 numbers from 0 to 1"),
    ("seed: true\n", "a.yaml:3:1: seed: found true; allowed: a whole number from 0 to 2^63 - 1"),
    ("seed: 1.5\n", "seed: found 1.5; allowed: a whole number from 0"),
    ("duration_s: .inf\n", "duration_s: found .inf; allowed: a number > 0 and <= 1e+06"),
    ("duration_s: 'long'\n", "duration_s: found 'long'; allowed: a number > 0"),
    ("start: {in_air: 1}\n", "start.in_air: found 1; allowed: true or false"),
    ("start: {offset_m: [1, 2]}\n", "start.offset_m: found [1, 2]; allowed: a list of 3 numbers"),
    ("law: 3\n", "law: found 3; allowed: a mapping with type, rate_hz"),
    ("law: {consensus: {graph: sta}}\n", "or a square list of weights >= 0 (did you mean 'star'?)"),
    ("faults: [{at_s: 1, kind: crash, vehicles: [1.5]}]\n", "allowed: all, or a list of vehicle ids"),
    ("faults: [{at_s: 1}]\n", "faults.0.kind: not found; allowed: crash, freeze, restart, ignore, pilot"),
    ("disturbances: {at_s: 1}\n", "disturbances: found {at_s: 1}; allowed: a list"),
    (
        "disturbances: [{at_s: 1, kind: rmp}]\n",
        "a.yaml:3:26: disturbances.0.kind: found 'rmp'; allowed: step, ramp, sine, dryden (did you mean 'ramp'?)",
    ),
    (
        "disturbances: [{at_s: 1, kind: sine, perod_s: 3, velocity_mps: [1, 0, 0]}]\n",
        "a.yaml:3:38: disturbances.0.perod_s: found an unknown key 'perod_s'; allowed: at_s, vehicles,",
    ),
    (
        "disturbances: [{at_s: 1, kind: ramp, velocity_mps: [1, 0, 0]}]\n",
        "a.yaml:3:16: disturbances.0.duration_s: not found; allowed: a number > 0",
    ),
    (
        "formation: {slots_m: {x: [1, 2, 3]}}\n",
        "formation.slots_m.x: found key 'x'; allowed: a vehicle's id",
    ),
    ("formation: {slots_m: {2: 1}}\n", "formation.slots_m.2: found 1; allowed: a list of 3 numbers"),
    (
        "links: {uplink: {rate_kbps: 0.0009}}\n",
        "links.uplink.rate_kbps: found 0.0009; allowed: 0, or a number >= 0.001",
    ),
    ("links: {default: {loss: 1.01}}\n", "links.default.loss: found 1.01; allowed: a number from 0 to 1"),
    ("name: ''\n", "name: found ''; allowed: text of 1 to 80 printable characters"),
    ("schema: 2\n", "schema: found 2; allowed: 1"),
    ("expect: [{metric: error_x.max, below: 1}]\n", "(did you mean 'error_x_m.max'?)"),
    (
        "expect: [{metric: [error_x_m.max], below: 1}]\n",
        "expect.0.metric: found [error_x_m.max]; allowed: error_x_m.rms",
    ),
    (
        "expect: [{metric: settled_at_s, followers: [], below: 1}]\n",
        "expect.0.followers: found []; allowed: all, or",
    ),
    ("5: 5\n", "a.yaml:3:1: 5: found an unknown key '5'; allowed: schema, name,"),
    ("law: {mixer: {7: 1}}\n", "a.yaml:3:15: law.mixer.7: found an unknown key '7'; allowed: k_v, k_x,"),
    ("orders: [{at_s: 1, order: sped 20}]\n", "loiter, rtl, land (did you mean 'speed 24'?)"),
    ("law: {rate_hz: 0.01}\n", "law.rate_hz: found 0.01; allowed: a number from 0.5 to 1000"),
    ("telemetry: {rate_hz: 100}\n", "telemetry.rate_hz: found 100; allowed: a number from 0.5 to 50"),
    ("safety: {separation_m: 1e9}\n", "safety.separation_m: found 1000000000.0; allowed: a number from 0 to 10000"),
    ("start: {offset_m: [1e6, 0, 0]}\n", "allowed: a list of 3 numbers, up to ±10000"),
]
WRONG_VALUES = [text for text, _ in WRONG]


@pytest.mark.parametrize(("text", "expected"), WRONG)
def test_what_was_found_and_what_is_allowed(tmp_path, text: str, expected: str):
    assert expected in message(tmp_path, text)


def test_what_other_defaults_are_made_of_is_refused_once(tmp_path):
    expected = "expect: [{metric: settled_at_s, below: 1}]\n"
    assert len(message(tmp_path, f"duration_s: .inf\n{expected}").splitlines()) == 1
    assert len(message(tmp_path, "safety: {separation_m: .nan}\n").splitlines()) == 1


@pytest.mark.parametrize("key", ["tau_v_s", "tau_psi_s", "tau_ha_s", "tau_hb_s", "speed_min_mps", "climb_max_mps"])
@pytest.mark.parametrize("number", [1e-300, 1e9])
def test_a_model_that_no_aircraft_has_is_refused(refusal, key: str, number: float):
    assert f"vehicles.1.model.{key}: found" in refusal(f"vehicles.1.model.{key}={number!r}")[0]


def test_more_vehicles_than_system_ids_are_sent_to_another_network(refusal):
    assert "another `network`" in refusal("vehicles={count: 255}")[0]
    assert "another `network`" in refusal("vehicles=[{id: 255}]")[0]


@pytest.mark.parametrize("number", [0, 255])
def test_the_ids_of_everyone_and_of_the_ground_station_are_no_vehicles(refusal, number: int):
    assert f"vehicles.0.id: found {number}; a whole number from 1 to 254" in refusal(f"vehicles=[{{id: {number}}}]")[0]


def test_a_key_without_its_unit_is_offered_the_key_with_it():
    assert did_you_mean("speed", ["seed", "spaced", "speed_mps"]) == " (did you mean 'speed_mps'?)"
    assert did_you_mean("max_height_m", ["height_min_m", "height_max_m"]) == " (did you mean 'height_max_m'?)"
    assert did_you_mean("zzz", ["speed_mps"]) == ""


junk = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=2),
    max_leaves=5,
)
KEYS = (
    "vehicles",
    "path",
    "law",
    "links",
    "formation",
    "start",
    "expect",
    "faults",
    "origin",
    "name",
    "safety",
)


@given(st.sampled_from(KEYS), junk, st.sampled_from([(), ("default",), ("changes",), ("speed",), ("model",)]))
def test_junk_is_refused_in_the_users_words_or_taken_as_a_default(key, value, inner):
    for name in reversed(inner):
        value = {name: value}
    scenario = {"vehicles": {"count": 2}, "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}} | {key: value}
    try:
        load_scenario(scenario)
    except ScenarioError as error:
        for problem in error.problems:
            assert problem.key
            assert not any(jargon in problem.allowed for jargon in JARGON)


def test_a_list_whose_only_item_is_wrong_is_not_called_empty():
    with pytest.raises(ScenarioError) as refused:
        load_scenario({"vehicles": [{"id": 0}], "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}})
    assert [problem.key for problem in refused.value.problems] == ["vehicles.0.id"]


def test_a_key_of_a_group_within_is_named_where_it_is():
    with pytest.raises(ScenarioError, match=r"unknown key 'delay_ms'.*did you mean 'links\.default\.delay_ms'\?"):
        load_scenario(yaml.safe_load(BASE), ["links.delay_ms=300"])
    with pytest.raises(ScenarioError, match=r"did you mean 'law\.fuzzy\.tables'\?"):
        load_scenario(yaml.safe_load(BASE), ["law.tables=printed"])
