"""summary.json: each of its figures against the record that it is taken from."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from airlink.stream_parser import ParserCounts
from formation_scenario import Scenario, load_scenario
from gcs_formation.record.expectations import RunOutcome, judge
from gcs_formation.record.link_verdicts import LinkFigures
from gcs_formation.record.summary import Summary, summarise
from gcs_formation.record.verdict import Verdict
from tests.gcs_formation.record.test_flight import FOLLOWER, KEYS, LEADER, SCENARIO, THIRD, TIME_S, flown

SCHEMA = json.loads((Path(__file__).parents[3] / "docs/summary.schema.json").read_text())
BEGUN_S = 4.0
"""When the path begins on the run's clock."""
TICKS_S = np.stack((0.1 * np.arange(50), 0.1 * np.arange(50), np.linspace(0.001, 0.003, 50)))
"""When ticks were due, began, and how long they took: the first is 15 ms late, the second 9 ms."""
TICKS_S[1, :2] += 0.015, 0.009
UNHEARD = LinkFigures(np.zeros((0, 3)), np.zeros(0), 1.0, 0, 0, 0)
LINK = LinkFigures(
    np.array([[0.1, np.nan, np.nan], [0.3, 0.2, 0.4], [0.2, 0.1, 0.35]]),
    np.arange(3.0),
    0.05,
    *(90, 40, 3),
    frames_implausible=4,
    frames_duplicate=5,
    frames_late=6,
    authenticated=True,
    frames_unverified=7,
    refused={"key": 8, "old": 9},
    injected=(0.1, 0.3, 0.01, 0.02),
)


def flight() -> Any:
    """Return the flight of 10 s with a path that begins at `BEGUN_S`, in which the second vehicle's errors swing."""
    whole = flown()
    for own in whole.vehicles.values():
        own["t_s"] = own["t_s"] + BEGUN_S
        own["jitter_s"] = np.linspace(0.0, 0.01, TIME_S.size)
    for column, name in enumerate(("error_x_m", "error_y_m", "error_z_m")):
        whole.vehicles[FOLLOWER][name] = (0.4 + 0.3 * column) * np.sin(TIME_S + column)
    return whole


def outcome(scenario: Scenario = SCENARIO, **changes: Any) -> RunOutcome:
    made = RunOutcome(
        scenario,
        clock="virtual",
        flight=flight(),
        links={LEADER: UNHEARD, FOLLOWER: LINK, THIRD: UNHEARD},
        ticks_s=TICKS_S,
        delay_margin_s=0.9,
        worst_loop_delay_s=0.7,
        margin_used=0.75,
        received=ParserCounts(frames=11, garbage_bytes=12, bad_checksums=13, unread_bytes=14),
        frames_refused=15,
        simulated_s=20.0,
        wall_s=4.0,
        cut_short=False,
        assembled=True,
        features=("separation",),
    )
    return replace(made, **changes)


def test_a_summary_is_as_its_schema_says_and_what_it_names_is_the_runs() -> None:
    found = summarise(outcome()).to_dict()
    jsonschema.validate(json.loads(json.dumps(found, allow_nan=False)), SCHEMA)
    names = ("schema", "seed", "clock", "duration_s", "begun_s", "wall_s", "real_time_factor", "truth", "assembled")
    assert [found[name] for name in names] == [1, SCENARIO.seed, "virtual", 10.0, BEGUN_S, 4.0, 5.0, True, True]
    assert (found["features"], found["undone"], found["unsafe"], found["failure"]) == (["separation"], [], [], None)
    assert found["stability"] == {"delay_margin_s": 0.9, "worst_loop_delay_s": 0.7, "margin_used": 0.75}
    assert found["received"] == {
        "frames": 11, "frames_refused": 15, "frames_bad": 13, "garbage_bytes": 12, "unread_bytes": 14
    }  # fmt: skip
    assert "finish" not in found
    assert "extensions" not in found
    unknown = summarise(outcome(wall_s=0.0, margin_used=math.nan, features=None, assembled=None)).to_dict()
    assert (unknown["real_time_factor"], unknown["stability"]["margin_used"]) == (None, None)
    assert (unknown["features"], unknown["assembled"]) == (None, None)


def test_figures_of_a_follower_are_numpys_of_its_errors_over_the_scored_time() -> None:
    found = summarise(outcome()).to_dict()["followers"]
    assert list(found) == ["2", "3"]
    error_m = np.stack([flight().vehicles[FOLLOWER][f"error_{axis}_m"] for axis in "xyz"])
    for own_m, axis in zip(np.abs(error_m), "xyz", strict=True):
        figures = found["2"][f"error_{axis}_m"]
        assert figures["rms"] == pytest.approx(np.sqrt(np.mean(own_m**2)))
        assert figures["max"] == own_m.max()
        for q in (50, 95, 99):
            assert figures[f"p{q}"] == np.percentile(own_m, q)
        assert figures["steady_max"] is None
    assert found["2"]["in_slot_share"] == pytest.approx(np.mean((np.abs(error_m) <= 0.5).all(axis=0)))
    assert (found["2"]["settled_at_s"], found["3"]["settled_at_s"]) == (None, 0.0)
    assert (found["3"]["in_slot_share"], found["3"]["followed_share"]) == (1.0, 1.0)


def test_only_the_time_along_the_path_is_scored_and_no_longer_than_was_planned() -> None:
    """Errors after 6 s are larger; the scenario ends then."""
    short, swings = load_scenario(KEYS | {"duration_s": 6}), flight()
    swings.vehicles[FOLLOWER]["error_x_m"] = np.where(TIME_S > 6.05, 9.0, 0.25)
    found = summarise(outcome(short, flight=swings)).to_dict()
    assert found["followers"]["2"]["error_x_m"]["max"] == 0.25
    assert found["duration_s"] == pytest.approx(6.0)


def test_figures_of_a_link_are_in_milliseconds_and_medians_of_what_was_measured() -> None:
    links = summarise(outcome()).to_dict()["links"]
    assert list(links) == ["1", "2", "3"]
    found = links["2"]
    assert [found[f"injected_{name}_ms"] for name in ("delay", "up", "down")] == pytest.approx([200.0, 100.0, 300.0])
    assert found["measured_delay_ms"] == pytest.approx({"p50": 200.0, "p99": np.percentile([100.0, 200.0, 300.0], 99)})
    assert [found["measured_up_ms"], found["measured_down_ms"]] == pytest.approx([150.0, 375.0])
    assert found["jitter_ms"] == pytest.approx({"p50": 5.0, "p99": 9.9})
    assert [found["injected_loss_up"], found["injected_loss"], found["measured_loss"]] == [0.01, 0.02, 0.05]
    names = ("in", "out", "bad", "implausible", "duplicate", "late", "unverified", "refused")
    assert [found[f"frames_{name}"] for name in names] == [90, 40, 3, 4, 5, 6, 7, 17]
    assert (found["authenticated"], found["refused"], found["heard_to_s"]) == (True, {"key": 8, "old": 9}, None)
    assert "radio" not in found
    assert "each" not in found
    assert links["1"]["measured_delay_ms"] == {"p50": None, "p99": None}
    assert [links["1"][f"injected_{name}_ms"] for name in ("delay", "up", "down")] == [None] * 3
    more = replace(LINK, due_to_s=8.0, heard_to_s=7.5, radio={"reports": 3})
    silent = summarise(outcome(links={LEADER: UNHEARD, FOLLOWER: more, THIRD: UNHEARD})).to_dict()["links"]["2"]
    assert (silent["heard_to_s"], silent["radio"]) == (7.5, {"reports": 3})


def test_figures_of_the_loop_are_those_of_its_ticks() -> None:
    found = summarise(outcome()).to_dict()["control"]
    assert (found["rate_hz"], found["ticks"], found["late_ticks"]) == (10.0, 50, 1)
    assert found["lateness"].startswith("late ticks: 1 of 50 began more than 10 ms late")
    period_ms = np.diff(TICKS_S[1]) * 1e3
    p50, p99 = np.percentile(period_ms, [50, 99])
    assert found["period_ms"] == pytest.approx({"p50": p50, "p99": p99, "max": period_ms.max()})
    assert found["compute_ms"] == pytest.approx({"p50": 2.0, "p99": 2.98})
    none = summarise(outcome(ticks_s=np.zeros((3, 0)))).to_dict()["control"]
    assert (none["ticks"], none["lateness"], none["period_ms"]) == (0, None, {"p50": None, "p99": None, "max": None})


def test_the_path_has_the_leaders_distances_and_its_plans_and_the_centres() -> None:
    """The formation flies straight along it; the centre is where the slots say it should be."""
    found = summarise(outcome()).to_dict()["path"]
    assert list(found) == ["leader", "centre"]
    for who in found:
        for name in ("across_m", "along_m", "height_m"):
            assert found[who][name] == {"rms": pytest.approx(0.0, abs=1e-6), "max": pytest.approx(0.0, abs=1e-6)}
    assert found["leader"]["off_legs_m"] == pytest.approx(0.0, abs=1e-6)
    assert "off_legs_m" not in found["centre"]


@pytest.mark.parametrize(
    ("assembled", "errors_m", "said"),
    [
        (True, {FOLLOWER: 1.0}, ""),
        (None, {FOLLOWER: 1.0}, ""),
        (False, {}, ""),
        (False, {FOLLOWER: 1.0}, "follower 2 never settled in its slot"),
        (False, {FOLLOWER: 1.0, THIRD: -1.0}, "followers 2, 3 never settled in their slots"),
    ],
)
def test_a_path_that_began_without_a_formation_that_ever_assembled_is_undone(
    assembled: bool | None, errors_m: dict[Any, float], said: str
) -> None:
    flies = flight()
    for name in ("error_x_m", "error_y_m", "error_z_m"):
        flies.vehicles[FOLLOWER][name] = np.zeros(TIME_S.size)
    for vehicle, error_m in errors_m.items():
        flies.vehicles[vehicle]["error_y_m"] = np.full(TIME_S.size, error_m)
    found = summarise(outcome(flight=flies, assembled=assembled))
    begun = f"never assembled: the path began after start.timeout_s, {SCENARIO.start.timeout_s:g} s, and "
    assert found.figures["undone"] == ([begun + said] if said else [])
    assert found.held is (False if said else None)


def test_what_was_left_undone_and_unsafe_breaks_a_run_in_words() -> None:
    """A vehicle that was to land says why it hasn't."""
    silent = replace(LINK, heard_to_s=3.0)
    made = outcome(
        links={LEADER: UNHEARD, FOLLOWER: silent, THIRD: UNHEARD},
        undone=("the order at 5 s wasn't carried out",),
        unsafe=("a motor still turns",),
        flying_on={THIRD: "vehicle 3 flies on in GUIDED"},
        not_landed={LEADER: None, FOLLOWER: "it circles", THIRD: None},
    )
    found = summarise(made)
    lost = "vehicle 2 was lost in the air: not heard from 3.0 s to the end"
    unsafe = [lost, "vehicle 3 flies on in GUIDED", "a motor still turns"]
    undone = ["the order at 5 s wasn't carried out", "vehicle 2 hasn't landed: it circles"]
    assert (found.figures["unsafe"], found.figures["undone"]) == (unsafe, undone)
    assert found.breaches == (*(f"safety broken: {text}" for text in unsafe), *undone)
    assert found.figures["finish"] == {
        "then": "land",
        "vehicles": {
            "1": {"landed": True, "why": None},
            "2": {"landed": False, "why": "it circles"},
            "3": {"landed": True, "why": None},
        },
    }
    assert found.held is False


def expecting(*expect: dict[str, Any]) -> Scenario:
    return load_scenario(KEYS | {"expect": list(expect)})


BELOW = {"metric": "error_x_m.max", "followers": [2], "from_s": 0, "to_s": 10}


def test_verdicts_are_in_the_summary_in_the_order_of_the_expectations() -> None:
    bounds = (BELOW | {"below": 0.5}, BELOW | {"below": 0.3, "metric": "error_x_m.rms"})
    made = outcome(expecting(*bounds), measure=expecting(BELOW | {"above": 0.0}).expect)
    found = summarise(made)
    expected = judge(made.scenario, made.flight, found.figures, made.links, cut_short=False)
    assert found.figures["expect"] == [each.to_dict() for each in expected]
    assert [each["held"] for each in found.figures["expect"]] == [True, True]
    assert (found.held, len(found.measured)) == (True, 1)
    assert found.measured[0].value == found.verdicts[0].value
    failed = summarise(replace(made, failure="the disk is full"))
    assert failed.figures["failure"] == "the disk is full"


@pytest.mark.parametrize(
    ("held", "breaches", "expected"),
    [
        ((), (), None),
        ((None,), (), None),
        ((True, None), (), True),
        ((None, False, True), (), False),
        ((), ("too near",), False),
        ((True,), ("too near",), False),
    ],
)
def test_a_run_held_what_was_judged_unless_any_of_it_broke(
    held: tuple[bool | None, ...], breaches: tuple[str, ...], expected: bool | None
) -> None:
    (wanted,) = expecting(BELOW | {"below": 1.0}).expect
    each = [Verdict(wanted, FOLLOWER, 2.0 if one is False else 0.5, judged=one is not None) for one in held]
    assert [one.held for one in each] == list(held)
    assert Summary({}, tuple(each), breaches).held is expected


def test_a_path_that_was_not_begun_has_no_beginning_and_no_figure() -> None:
    before = flight()
    for own in before.vehicles.values():
        own["mission_time_s"] = np.full(TIME_S.size, np.nan)
        own["phase"] = np.zeros(TIME_S.size)
    found = summarise(outcome(flight=before)).to_dict()
    assert (found["begun_s"], found["duration_s"]) == (None, 0.0)
    assert found["followers"]["2"]["error_x_m"]["max"] is None
    assert found["followers"]["2"]["followed_share"] is None
    assert found["path"]["leader"]["across_m"] == {"rms": None, "max": None}


METRIC = """
from gcs_formation.extend import Metric, register_metric

@register_metric("own")
class Own(Metric):
    def measure(self, flight):
        {}
"""


@pytest.mark.parametrize(
    ("body", "value", "failed"),
    [
        ("return len(flight.time_s)", 41.0, False),
        ("return flight.time_s[0] + 100.0 * flight.time_s[-1]", 602.0, False),
        ("return flight.dt_s", 0.1, False),
        ("return flight.truth and sum(map(int, flight.vehicles))", 6.0, False),
        ("own = flight.vehicles['2']; return len(own) - len(list(own)) + own['height_m'].sum()", 4100.0, False),
        ("return None", None, False),
        ("return float('inf')", None, False),
        ("return flight.vehicles['4']", None, True),
    ],
)
def test_a_metric_from_outside_sees_the_ticks_of_its_window(
    body: str, value: float | None, failed: bool, tmp_path: Path
) -> None:
    """From 2 s to 6 s; one that raises an error fails the flight, after which its record is there."""
    file = tmp_path / "own.py"
    file.write_text(METRIC.format(body))
    expect = [{"metric": "own", "below": 1e6, "from_s": 2, "to_s": 6}]
    scenario = load_scenario(KEYS | {"expect": expect}, plugins=[file])
    found = summarise(outcome(scenario))
    (verdict,) = found.verdicts
    assert verdict.value == (None if value is None else pytest.approx(value))
    assert verdict.held is (None if failed else value is not None)
    why = found.figures["failure"]
    assert (why is not None and why.startswith("the metric 'own' could not be computed: KeyError")) is failed
    assert verdict.failed is failed
    assert [each["name"] for each in found.figures["extensions"]] == ["own"]
