import re

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from formation_scenario import ScenarioError
from formation_scenario.overrides import apply_overrides
from formation_scenario.source import Dumper, plain_mapping, read_file, read_text, show


def problem_lines(text: str) -> list[str]:
    with pytest.raises(ScenarioError) as refused:
        read_text(text, "a.yaml")
    return str(refused.value).splitlines()


def test_each_key_has_its_line_and_column_from_1():
    source = read_text("name: x\nformation:\n  shape: diamond\nlist:\n  - 3\n  - {a: 4}\n", "a.yaml")
    assert source.position(("formation", "shape")) == ("a.yaml", 3, 3)
    assert source.position(("list", 0)) == ("a.yaml", 5, 5)
    assert source.position(("list", 1, "a")) == ("a.yaml", 6, 6)


def test_a_key_that_is_not_in_the_file_is_placed_at_the_group_around_it():
    source = read_text("formation:\n  shape: diamond\n", "a.yaml")
    assert source.position(("formation", "changes", 0)) == ("a.yaml", 1, 1)
    assert source.position(("law", "type")) == ("a.yaml", None, None)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\nb: 2\na: 3\n", "a.yaml:3:1: a: found a second time, first on line 1; allowed: each key once"),
        (
            "a: {b: 1, b: 2}\n",
            "a.yaml:1:11: a.b: found a second time, first on line 1; allowed: each key once",
        ),
        ("a: [1, 2\nb: 3\n", "a.yaml:2:2: broken YAML: expected ',' or ']', but got ':'"),
        ("- 1\n", "a.yaml:1:1: found a list; allowed: a mapping of scenario keys"),
        ("", "a.yaml:1:1: found nothing; allowed: a mapping of scenario keys"),
        ("a: 1\n---\na: 2\n", "a.yaml:2:1: found another document; allowed: one in a file"),
        ("? [1]\n: 2\n", "a.yaml:1:3: broken YAML: found a list or mapping as a key"),
        ("a: !!python/name:os.system\n", "a.yaml:1:4: broken YAML: could not determine a constructor"),
        ("a:\n\t- 1\n", r"a.yaml:2:1: broken YAML: found character '\t' that cannot start any token; allowed: spaces"),
        ("a: 1\nb: \x00\n", "a.yaml:2: broken YAML: special characters are not allowed"),
        ("a: " + "[" * 5000, "a.yaml: found lists or mappings nested too deeply"),
        ("a: &x [*x]", "a.yaml:1:4: broken YAML: a.0 is an alias of what begins here, which it is part of itself"),
    ],
)
def test_broken_text_names_its_position(text: str, message: str):
    assert problem_lines(text)[0].startswith(message)


@pytest.mark.parametrize("value", ["9" * 101, "0x" + "f" * 5000, "!!int abc", "!!timestamp x", "!!bool maybe"])
def test_a_number_that_python_has_no_words_for_and_a_tag_that_lies_are_refused(value: str):
    assert problem_lines(f"a:\n  b: {value}\n")[0].startswith("a.yaml:2:6: a.b: found '")
    with pytest.raises(ScenarioError, match="--set b="):
        apply_overrides(read_text("a: 1"), [f"b={value}"])


@pytest.mark.parametrize(
    ("override", "said"),
    [
        (
            "links.default={delay_ms: 1, delay_ms: 2}",
            "links.default.delay_ms: found a second time; allowed: each key once",
        ),
        ("start={offset_m: [{a: 1, a: 2}]}", "start.offset_m.0.a: found a second time; allowed: each key once"),
        ("a=[1, 2", "a: broken YAML: expected ',' or ']', but got '<stream end>'"),
        ("a={b: !!int abc}", "a.b: found 'abc'; allowed: text, true"),
    ],
)
def test_what_is_wrong_within_an_override_is_named_by_its_own_key(override: str, said: str):
    with pytest.raises(ScenarioError) as error:
        apply_overrides(read_text("a: 1"), [override])
    assert str(error.value).startswith(f"--set {override}: {said}")


def test_a_mapping_with_a_number_of_thousands_of_digits_is_refused():
    with pytest.raises(ScenarioError, match="seed: found a number of more than 100 digits"):
        plain_mapping({"seed": 10**5000})


def test_aliases_of_aliases_end_before_the_memory_does():
    text = "a: &a [x, x, x, x, x, x, x, x, x]\n"
    text += "".join(f"{chr(98 + i)}: &{chr(98 + i)} [{', '.join(['*' + chr(97 + i)] * 9)}]\n" for i in range(9))
    assert "found more than 500000 values" in problem_lines(text)[0]


@pytest.mark.parametrize(
    "text", ["a: 1\nb: &b\n  c: *b\n", "a: 1\nb: {c: &b [*b]}\n", "a: 1\nb: &b\n  d: 2\n  c: [[*b]]\n"]
)
def test_an_alias_of_what_it_is_in_is_refused_with_its_position(text):
    (line,) = problem_lines(text)
    assert re.fullmatch(r"a\.yaml:[23]:\d+: broken YAML: b\.c[.0]* is an alias of what begins here, .*", line)


def test_an_alias_that_stands_twice_is_no_circle():
    assert read_text("a: &a [1]\nb: [*a, *a]\nc: {d: *a}").data == {"a": [1], "b": [[1], [1]], "c": {"d": [1]}}


def test_every_duplicate_key_is_reported():
    assert len(problem_lines("a: 1\na: 2\nb: {c: 1, c: 2}\n")) == 2


def test_numbers_are_those_of_yaml_1_2():
    data = read_text("{a: 1e3, b: -2.5e-1, c: 1:30, d: 2024-01-01, e: 0x10, f: .5, g: 5., h: +3}").data
    expected = {"a": 1000.0, "b": -0.25, "c": "1:30", "d": "2024-01-01", "e": 16, "f": 0.5, "g": 5.0, "h": 3}
    assert data == expected


def test_merge_keys_give_way_to_the_mapping_that_has_them():
    data = read_text("base: &b {x: 1, y: 2}\nown: {<<: *b, y: 3}\n").data
    assert data["own"] == {"x": 1, "y": 3}


def test_whole_number_keys_stay_numbers_and_other_keys_stay_as_written():
    assert list(read_text("{2: a, on: b, 1.5: c}").data) == [2, "on", "1.5"]


def test_a_file_that_is_not_there_or_not_text_is_refused(tmp_path):
    with pytest.raises(ScenarioError, match="No such file"):
        read_file(tmp_path / "none.yaml")
    (tmp_path / "bytes.yaml").write_bytes(b"name: \xff\n")
    with pytest.raises(ScenarioError, match="found byte 0xff at offset 6; allowed: text in UTF-8"):
        read_file(tmp_path / "bytes.yaml")
    with pytest.raises(ScenarioError, match=r": found a directory; allowed: a scenario file \(\*\.yaml\)$"):
        read_file(tmp_path)
    with pytest.raises(ScenarioError, match="found nothing; allowed: a mapping of study keys"):
        read_text("", of="study")


def test_numpy_values_of_a_mapping_become_plain():
    plain = plain_mapping({"a": np.float64(1.5), "b": np.arange(3), "c": (np.int64(2), {"d": np.True_})})
    assert plain == {"a": 1.5, "b": [0, 1, 2], "c": [2, {"d": True}]}


def test_a_value_that_yaml_has_no_word_for_is_refused():
    with pytest.raises(ScenarioError, match=r"law\.rate_hz: found a complex"):
        plain_mapping({"law": {"rate_hz": 1j}})


plain_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text("abc1e:-. #0x_+'\"\n"),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abc1e", min_size=1), inner, max_size=3),
    max_leaves=10,
)


@given(plain_values)
def test_what_the_dumper_writes_the_loader_reads_back(value):
    text = yaml.dump({"value": value}, Dumper=Dumper)
    assert read_text(text).data["value"] == value


@given(st.text("0123456789eE+-.:xabf_", min_size=1, max_size=6))
def test_text_that_looks_like_a_number_stays_text(text):
    assert read_text(yaml.dump({"name": text}, Dumper=Dumper)).data == {"name": text}


def test_overrides_reach_into_lists_and_make_missing_groups():
    source = read_text("vehicles: [{id: 1}, {id: 2}]\n")
    data = apply_overrides(source, ["vehicles.1.model.tau_v_s=5", "law.type=pid", "formation.slots_m.2=[1,2,3]"]).data
    assert data["vehicles"] == [{"id": 1}, {"id": 2, "model": {"tau_v_s": 5}}]
    assert data["law"] == {"type": "pid"}
    assert data["formation"] == {"slots_m": {2: [1, 2, 3]}}
    assert source.data == {"vehicles": [{"id": 1}, {"id": 2}]}


def test_groups_that_an_override_makes_are_placed_at_it():
    source = apply_overrides(read_text("law: {type: pid}\n", "a.yaml"), ["formation.changes.0.at_s=3", "law.rate_hz=5"])
    assert source.position(("formation", "changes")).file == "--set formation.changes.0.at_s=3"
    assert source.position(("law",)).file == "a.yaml"


def test_a_later_override_wins_and_is_the_position_of_its_value():
    source = apply_overrides(read_text("seed: 1\n", "a.yaml"), ["seed=2", "seed=3"])
    assert source.data["seed"] == 3
    assert source.position(("seed",)).file == "--set seed=3"


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("seed", "--set seed: found 'seed'; allowed: dotted.key=value"),
        ("a..b=1", "--set a..b=1: found 'a..b=1'; allowed: dotted.key=value"),
        ("list.2=1", "--set list.2=1: list: found index '2'; allowed: 0 to 1"),
        ("list.x=1", "--set list.x=1: list: found index 'x'; allowed: 0 to 1"),
        ("name.x=1", "--set name.x=1: name: found 'n', which has no 'x' in it; allowed: a mapping or a list"),
        ("seed=[1", "--set seed=[1: seed: broken YAML"),
    ],
)
def test_an_override_that_fits_nowhere_is_refused(override: str, message: str):
    with pytest.raises(ScenarioError) as refused:
        apply_overrides(read_text("{list: [1, 2], name: n}"), [override])
    assert str(refused.value).startswith(message)


def test_found_values_are_shown_on_one_short_line():
    assert show({"a": [1, 2.5, None, True, "x"]}) == "{a: [1, 2.5, null, true, x]}"
    assert len(show(list(range(1000)))) == 60
