"""Studies: designs, searches, resuming, verdicts; a few real flights."""

import json
import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections import Counter, deque
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from jsonschema import Draft202012Validator

from formation_scenario import ScenarioError, load_scenario
from gcs_formation.cli import main
from gcs_formation.errors import RecordError, RecordingError, RunAbortedError
from gcs_formation.studies import Study, study_schema
from gcs_formation.studies.campaign import judge
from gcs_formation.studies.cluster import Cluster
from gcs_formation.studies.dataset import Dataset, read_journal
from gcs_formation.studies.flight import Task, alike, figure, fly
from gcs_formation.studies.plan import (
    Plan,
    Planned,
    count_flights,
    count_samples,
    drawn,
    replayed,
    samples,
)
from gcs_formation.studies.preparation import load_study, prepare, refly_task
from gcs_formation.studies.sample_table import sample_table
from gcs_formation.studies.workers import Processes
from tests.flights.conftest import scenario
from tests.processes import wait_for

SCENARIO: Any = {
    "vehicles": {"count": 2},
    "start": {"in_air": True},
    "duration_s": 3,
    "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]},
}
DELAY, LOSS = "links.default.delay_ms", "links.default.loss"
DONE: Any = {"flight": 1, "seed": 1, DELAY: 0, "error_x_m.max": 0.1, "exit": 0, "wall_s": 1.0, "cpu_s": 1.0,
             "version": "x", "words": ""}  # fmt: skip
MAXIMUM = ("error_x_m.max",)
SEARCH = {"parameter": DELAY, "low": 0, "high": 1000, "tolerance": 10, "metric": "error_x_m.max", "below": 1.0}


def study(**keys):
    return load_study({"base": SCENARIO, **keys})[0]


def row(planned, **values):
    return {"flight": planned.flight, "seed": planned.seed, **planned.parameters, "exit": 0, **values}


def test_a_grid_is_every_combination_with_every_seed():
    grid = study(parameters={DELAY: [0, 100], LOSS: {"range": [0.0, 0.1, 3]}}, seeds={"first": 5, "count": 2})
    flights = list(Plan(grid).first_flights())
    assert [each.flight for each in flights] == list(range(12))
    assert Counter(each.seed for each in flights) == {5: 6, 6: 6}
    assert len({(*each.parameters.values(), each.seed) for each in flights}) == 12
    assert {each.parameters[LOSS] for each in flights} == {0.0, 0.05, 0.1}


def test_a_grid_goes_without_samples():
    assert count_samples(study(parameters={DELAY: [0, 100]}, design="grid", samples=50)) == 2


def test_a_base_brings_along_what_its_file_reads_from_others_beside_it(tmp_path, monkeypatch):
    (tmp_path / "files").mkdir()
    (tmp_path / "files" / "mine.yaml").write_text("model: {tau_v_s: 2.5}")
    (tmp_path / "files" / "late.txt").write_text("40\n60\n")
    base = SCENARIO | {"vehicles": {"count": 2, "model": "mine.yaml"}, "links": {"default": {"trace_file": "late.txt"}}}
    (tmp_path / "files" / "base.yaml").write_text(json.dumps(base))
    (tmp_path / "study.yaml").write_text(json.dumps({"base": "files/base.yaml", "parameters": {LOSS: [0.0, 0.1]}}))
    monkeypatch.chdir("/")
    planned, keys = prepare(tmp_path / "study.yaml")
    first = next(iter(Plan(planned).first_flights()))
    found = Task(first, planned, keys).scenario()
    assert [each.model.tau_v_s for each in found.vehicles] == [2.5, 2.5]
    assert found.links.default.trace_file == str(tmp_path / "files" / "late.txt")


def test_files_that_a_study_names_itself_are_beside_it(tmp_path, monkeypatch):
    """In keys that all flights have, in a parameter's values and in cases; the base is elsewhere."""
    (tmp_path / "base").mkdir()
    (tmp_path / "mine.yaml").write_text("model: {tau_v_s: 2.5}")
    (tmp_path / "late.txt").write_text("40\n60\n")
    (tmp_path / "base" / "base.yaml").write_text(json.dumps(SCENARIO))
    models = {"cases": {"shipped": {"vehicles.model": "arduplane"}, "mine": {"vehicles.model": "mine.yaml"}}}
    parameters = {"model": models, "links.default.trace_file": ["late.txt"]}
    keys = {"base": "base/base.yaml", "set": {"links.uplink": {"trace_file": "late.txt"}}, "parameters": parameters}
    (tmp_path / "study.yaml").write_text(json.dumps(keys))
    monkeypatch.chdir("/")
    planned, base = prepare(tmp_path / "study.yaml")
    flown = [refly_task(each, planned, base, tmp_path).scenario() for each in Plan(planned).first_flights()]
    assert flown[1].vehicles[0].model.tau_v_s == 2.5 != flown[0].vehicles[0].model.tau_v_s
    late, (default, uplink) = str(tmp_path / "late.txt"), (flown[0].links.default, flown[0].links.uplink)
    assert uplink is not None
    assert (default.trace_file, uplink.trace_file) == (late, late)


def test_cases_set_several_keys_by_a_name():
    frames = {"cases": {"own": {"formation.frame": "follower_heading", "law.speed.kp": 2.0}, "as it is": {}}}
    planned = study(parameters={"slots turn with": frames, DELAY: [0, 100]})
    flights = list(Plan(planned).first_flights())
    assert [tuple(each.parameters.values()) for each in flights] == list(product(["own", "as it is"], [0, 100]))
    flown = refly_task(flights[1], planned, SCENARIO, Path("x")).scenario()
    assert (flown.formation.frame, flown.law.speed.kp, flown.links.default.delay_ms) == ("follower_heading", 2.0, 100)
    assert refly_task(flights[2], planned, SCENARIO, Path("x")).scenario().formation.frame == "leader_heading"


def test_metrics_count_in_their_window_of_time(tmp_path):
    keys = Study(metrics=("error_x_m.max", "settled_at_s"), record="series", from_s=1.0, to_s=2.0)
    base = SCENARIO | {"start": {"in_air": True, "offset_m": [8, 0, 0]}}
    task = Task(Planned(0, 1, {}), keys, base, str(tmp_path))
    found = fly(task)
    rows = pq.read_table(tmp_path / "timeseries.parquet").to_pydict()
    within = [abs(error) for error, at_s, vehicle in zip(rows["error_x_m"], rows["mission_time_s"], rows["vehicle"],
              strict=True) if vehicle == 2 and 1.0 - 1e-9 <= at_s <= 2.0 + 1e-9]  # fmt: skip
    assert found["exit"] == 0
    assert found["error_x_m.max"] == pytest.approx(max(within))
    assert max(within) < max(map(abs, filter(np.isfinite, rows["error_x_m"])))


@pytest.mark.parametrize("window", [{}, pytest.param({"from_s": 0.0}, marks=pytest.mark.slow)])
def test_a_flight_that_lost_its_formation_has_no_figure_of_its_errors(window):
    """The leader crashes at 2 s of 12 s, and nobody takes over: errors were 0 while there were any."""
    base = SCENARIO | {"duration_s": 12, "faults": [{"at_s": 2, "vehicles": [1], "kind": "crash"}]}
    metrics = ("error_x_m.max", "in_slot_share", "min_separation_m")
    for succession, known in (("none", False), ("nearest", True)):
        keys = base | {"vehicles": {"count": 3}, "formation": {"succession": succession}}
        found = fly(Task(Planned(0, 1, {}), Study(metrics=metrics, record="none", **window), keys))
        assert (found["error_x_m.max"] is not None) is known
        assert (found["in_slot_share"] > 0.5) is known
        assert found["min_separation_m"] > 10.0


def test_a_flight_s_row_says_what_of_its_own_expectations_was_not_judged() -> None:
    """It isn't broken by that. A figure over a time that was hardly flown is none."""
    expect = [{"metric": "error_x_m.max", "below": 1}]
    keys = scenario(duration_s=30, vehicles={"count": 2}, expect=expect)
    study = Study(metrics=("error_x_m.rms",), record="none", until_s=2, from_s=0, to_s=30)
    found = fly(Task(Planned(0, 1, {}), study, keys))
    words = "nothing was judged: 1 of 1 expectation not judged (flown to 2.0 s of 30 s)"
    assert (found["exit"], found["words"], found["error_x_m.rms"]) == (0, words, None)


def test_a_table_has_a_row_for_each_sample_and_of_several_seeds_median_and_worst():
    planned = study(parameters={DELAY: [0, 100]}, seeds={"count": 3}, metrics=["error_x_m.max", "min_separation_m"])
    rows = [
        row(each, **{"error_x_m.max": 0.1 * each.flight, "min_separation_m": 20.0 - each.flight})
        for each in Plan(planned).first_flights()
    ]
    rows[5]["min_separation_m"] = None
    assert sample_table(planned, rows, []).splitlines() == [
        "| links.default.delay_ms | error_x_m.max | min_separation_m |",
        "| --- | ---: | ---: |",
        "| 0 | 0.1 (0.2) | 19 (18) |",
        "| 100 | 0.4 (0.5) | 16.5 (–) |",
    ]


def test_a_table_has_the_least_and_the_most_of_what_each_flight_of_a_sample_draws():
    planned = study(parameters={DELAY: [0, 100], LOSS: {"uniform": [0.0, 0.1]}}, seeds={"count": 3}, metrics=MAXIMUM)
    rows = [row(each, **{"error_x_m.max": 0.1}) for each in Plan(planned).first_flights()]
    losses = [each[LOSS] for each in rows[:3]]
    shown = f"| 0 | {min(losses):.3g} to {max(losses):.3g} | 0.1 (0.1) |"
    assert sample_table(planned, rows, []).splitlines()[2] == shown


def test_a_search_s_row_has_both_flights_between_which_the_bound_is_crossed():
    plan = Plan(study(bisect=SEARCH, metrics=["margin_used"]))
    flown = [{**each, "margin_used": each[DELAY] / 500} for each in searched(plan, breaks_at={1: 437.0})]
    assert sample_table(plan.study, flown, plan.crossings()).splitlines()[2] == "| 1 | 430 | 438 | 0.859 to 0.875 |"


def test_a_search_that_breaks_at_once_has_the_figures_of_its_one_flight():
    plan = Plan(study(bisect=SEARCH, metrics=["margin_used"]))
    flown = [{**each, "margin_used": 0.4} for each in searched(plan, breaks_at={1: -1.0})]
    assert sample_table(plan.study, flown, plan.crossings()).splitlines()[2] == "| 1 | – | 0 | 0.4 |"


def test_one_at_a_time_varies_each_parameter_around_the_first_values():
    each = samples(study(parameters={DELAY: [0, 100, 300], LOSS: [0.0, 0.1]}, design="one_at_a_time"))
    assert [tuple(sample.values()) for sample in each] == [(0, 0.0), (100, 0.0), (300, 0.0), (0, 0.1)]


@pytest.mark.parametrize("design", ["random", "latin_hypercube", "sobol"])
def test_points_follow_the_distributions(design):
    """Means and quantiles of 512 points; a Latin hypercube has one in each of 512 slices."""
    wide = {"uniform": [0.0, 0.2]}, {"normal": [100.0, 10.0]}, {"log_uniform": [1.0, 100.0]}, ["a", "b"]
    planned = study(parameters=dict(zip("uvwx", wide, strict=True)), design=design, samples=512)
    u, v, w = (np.array([sample[name] for sample in samples(planned)]) for name in "uvw")
    assert [u.mean(), v.mean(), v.std(), np.median(w)] == pytest.approx([0.1, 100.0, 10.0, 10.0], rel=0.15)
    assert 150 < [sample["x"] for sample in samples(planned)].count("a") < 362
    if design == "latin_hypercube":
        assert sorted((u / 0.2 * 512).astype(int)) == list(range(512))
    assert samples(planned) == samples(planned)


def test_a_distribution_in_a_grid_is_drawn_for_each_flight_and_the_same_again():
    mixed = study(parameters={DELAY: [0, 100], LOSS: {"uniform": [0.0, 0.1]}}, seeds={"count": 3})
    losses = [each.parameters[LOSS] for each in Plan(mixed).first_flights()]
    assert len(set(losses)) == 6
    assert all(0.0 <= loss <= 0.1 for loss in losses)
    assert drawn(mixed, 4)[LOSS] == losses[4]


def test_counts_are_known_without_planning():
    huge = study(parameters={DELAY: {"range": [0, 1, 10_000]}, LOSS: {"range": [0, 1, 1000]}}, seeds={"count": 10})
    assert (count_samples(huge), count_flights(huge)) == (10**7, 10**8)


def searched(plan, breaks_at):
    """Fly a search whose error is below 1 m up to a delay."""
    flown, waiting = [], deque(plan.first_flights())
    while waiting:
        planned = waiting.popleft()
        delay = planned.parameters[DELAY]
        flown.append(row(planned, **{"error_x_m.max": 0.5 if delay < breaks_at[planned.seed] else 2.0}))
        following = plan.after(flown[-1])
        if following is not None:
            waiting.append(following)
    return flown


def test_a_search_finds_where_the_bound_breaks_in_as_few_flights_as_halving_takes():
    plan = Plan(study(bisect=SEARCH, seeds={"count": 2}))
    flown = searched(plan, breaks_at={1: 437.0, 2: 12.0})
    assert len(flown) <= count_flights(plan.study) == 2 * 9
    assert len({each["flight"] for each in flown}) == len(flown)
    for first, crossing in plan.crossings():
        assert crossing.kept is not None
        assert crossing.broken is not None
        assert crossing.kept < {1: 437.0, 2: 12.0}[first.seed] <= crossing.broken
        assert crossing.broken - crossing.kept <= 10


@pytest.mark.parametrize(("breaks_at", "expected"), [(-1.0, (None, 0.0)), (2000.0, (1000.0, None))])
def test_a_search_says_when_the_bound_breaks_at_once_or_never(breaks_at, expected):
    plan = Plan(study(bisect=SEARCH))
    flown = searched(plan, breaks_at={1: breaks_at})
    assert len(flown) == (1 if breaks_at < 0 else 2)
    assert [tuple(crossing) for _, crossing in plan.crossings()] == [expected]


def test_a_search_goes_on_from_any_part_of_its_rows():
    planned = study(bisect=SEARCH, seeds={"count": 2})
    whole = searched(Plan(planned), breaks_at={1: 437.0, 2: 700.0})
    for kept in range(len(whole)):
        plan = Plan(planned)
        left = replayed(plan, whole[:kept])
        again = {each["flight"]: each for each in whole}
        assert all(each.parameters == {DELAY: again[each.flight][DELAY]} for each in left)


def test_a_share_is_of_the_flights_that_an_expectation_applies_to():
    far_enough = {"metric": "min_separation_m", "above": 10, "share": 0.75, "where": {DELAY: 300}}
    planned = study(parameters={DELAY: {"range": [0, 300, 2]}}, expect=[far_enough])
    wanted = planned.expect[0]
    rows = [{"flight": i, DELAY: delay, "min_separation_m": s, "exit": e} for i, (delay, s, e) in enumerate(
            [(300, 11, 0), (300, 12, 1), (300, 13, 0), (300, 14, 3), (0, 1, 0)])]  # fmt: skip
    verdict = judge(planned, wanted, rows)
    assert (verdict.flights, verdict.kept, verdict.held) == (4, 3, True)
    assert not judge(planned, wanted, rows[:1] + rows[3:4]).held
    assert not judge(planned, wanted, []).held, "an expectation that concerns no flight isn't kept"


def test_flights_in_which_the_seed_changes_nothing_have_no_interval():
    """Equal counts of a limit that no flight broke don't show it: other figures may differ."""
    keys: Any = {"parameters": {DELAY: [0, 300]}, "seeds": {"count": 3}, "metrics": ["violations"]}
    planned = study(**keys, expect=[{"metric": "violations", "below": 1}])
    flown = [
        {**row(each, violations=0), "digest": str(each.parameters[DELAY])} for each in Plan(planned).first_flights()
    ]
    verdict = judge(planned, planned.expect[0], flown)
    assert "6 of 6 flights (no interval: the seed changes nothing in these flights); " in str(verdict)
    assert (verdict.to_dict()["interval"], verdict.held) == (None, True)
    for other in ({"digest": "different"}, {"digest": None}):
        verdict = judge(planned, planned.expect[0], [*flown[:-1], {**flown[-1], **other}])
        assert "6 of 6 flights (95% confidence, by 3 seeds: " in str(verdict)


@pytest.mark.parametrize(
    ("keys", "chance"),
    [
        ({}, False),
        ({"seeds": {"count": 2}}, True),
        ({"design": "random", "samples": 2}, True),
        ({"parameters": {DELAY: {"uniform": [0, 300]}}, "design": "random", "samples": 2}, True),
    ],
)
def test_one_seed_without_draws_has_no_interval(keys: dict[str, Any], chance: bool):
    far = {"metric": "min_separation_m", "above": 10, "share": 0.5}
    planned = study(**{"parameters": {DELAY: [0, 300]}, "seeds": {"count": 1}, "expect": [far], **keys})
    rows = [{"flight": s, "seed": s, DELAY: s, "min_separation_m": s, "exit": 0} for s in (0, 300)]
    verdict = judge(planned, planned.expect[0], rows)
    assert (verdict.kept, verdict.held, verdict.interval is not None) == (1, True, chance)
    assert ("1 of 2 flights (no interval: one seed, and nothing is drawn); " in str(verdict)) is not chance


def test_a_seed_changes_a_flight_through_losses_alone():
    def flown(seed, loss):
        planned = study(parameters={LOSS: [loss]}, metrics=["violations"], record="none")
        short = SCENARIO | {"duration_s": 1, "start": {"in_air": True, "run_in_s": 20}}
        return fly(Task(Planned(0, seed, {LOSS: loss}), planned, short))["digest"]

    assert flown(1, 0.0) == flown(2, 0.0)
    assert flown(1, 0.1) != flown(2, 0.1)


def test_flights_that_differ_in_their_seed_alone_share_what_follows_from_the_rest():
    planned = study(parameters={LOSS: [0.1, 0.2]}, metrics=["violations"], record="none")
    one, other = (alike(Task(Planned(0, seed, {LOSS: 0.1}), planned, SCENARIO)) for seed in (1, 2))
    assert (one.seed, other.seed) == (1, 2)
    assert other.written_path is one.written_path
    assert other == load_scenario(SCENARIO, ["seed=2", f"{LOSS}=0.1"])
    third = alike(Task(Planned(0, 2, {LOSS: 0.2}), planned, SCENARIO))
    assert third == load_scenario(SCENARIO, ["seed=2", f"{LOSS}=0.2"])


def test_of_several_vehicles_the_worst_counts_and_one_that_never_settles_has_no_time():
    def summary(*followers):
        each = {str(i): {"error_x_m": {"max": x}, "settled_at_s": t} for i, (x, t) in enumerate(followers, 2)}
        return {"followers": each, "links": {}, "safety": {"min_separation_m": 9.0}, "control": {}, "stability": {}}

    assert figure(summary((0.1, 5.0), (0.3, 2.0)), "error_x_m.max") == 0.3
    assert figure(summary((0.1, 5.0), (0.3, 2.0)), "settled_at_s") == 5.0
    assert figure(summary((0.1, 5.0), (0.3, None)), "settled_at_s") is None
    assert figure(summary((0.1, 5.0)), "min_separation_m") == 9.0


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"parameters": {"links.default.dely_ms": [1]}}, "did you mean 'delay_ms'?"),
        ({"parameters": {DELAY: []}}, "found []; allowed: a list of 1 to"),
        ({"parameters": {LOSS: [2.0, 3.0]}}, "a number from 0 to 1"),
        ({"metrics": ["error_q_m.max"]}, "error_x_m.max"),
        ({"design": "grd"}, "grid, one_at_a_time"),
        ({"parameters": {"seed": [1, 2]}}, "parameters.seed: found 'seed'; allowed: seeds"),
        ({"parameters": {"flight": {"cases": {"a": {}}}}}, "parameters.flight: found 'flight'; allowed: another name"),
        (
            {"parameters": {"violations": {"cases": {"a": {}}}}, "metrics": ["violations"]},
            "found 'violations'; allowed: another name",
        ),
        ({"set": {"seed": 5}}, "set.seed: found 'seed'; allowed: seeds: {first"),
        (
            {"parameters": {DELAY: [0]}, "bisect": SEARCH},
            f"bisect.parameter: found '{DELAY}'; allowed: a parameter that",
        ),
        (
            {"parameters": {DELAY: [0, 100], "links.default": [{"loss": 0.1}]}},
            f"parameters.links.default: found 'links.default', which replaces {DELAY} of '{DELAY}'; allowed: keys that",
        ),
        (
            {"set": {DELAY: 100}, "parameters": {"links.default": [{"loss": 0.1}, {"loss": 0.0}]}},
            f"parameters.links.default: found 'links.default', which replaces {DELAY} of 'set'",
        ),
        (
            {"set": {DELAY: 50}, "parameters": {DELAY: [0, 100]}},
            f"parameters.{DELAY}: found '{DELAY}', which replaces {DELAY} of 'set'; allowed: keys that none before it",
        ),
        ({"set": {DELAY: 50}, "bisect": SEARCH}, f"bisect.parameter: found '{DELAY}', which replaces {DELAY} of 'set'"),
        (
            {"set": {DELAY: 50}, "parameters": {"link": {"cases": {"late": {DELAY: 100}, "later": {DELAY: 200}}}}},
            f"parameters.link: found 'link', which replaces {DELAY} of 'set'",
        ),
        (
            {"parameters": {"link": {"cases": {"late": {DELAY: 100}}}, "other": {"cases": {"late": {DELAY: 50}}}}},
            f"parameters.other: found 'other', which replaces {DELAY} of 'link'",
        ),
        (
            {"parameters": {"link": {"cases": {"late": {DELAY: 100}}}}, "bisect": SEARCH},
            f"bisect.parameter: found '{DELAY}', which replaces {DELAY} of 'link'",
        ),
        ({"from_s": 2, "to_s": 1}, "to_s: found 2 to 1 s; allowed: a time after from_s"),
        ({"from_s": 3}, "from_s: found 3 s; allowed: less than 3 s, where flights end"),
        ({"to_s": 2.5, "until_s": 2}, "to_s: found 2.5 s; allowed: up to 2 s, where flights end"),
        ({"bases": "x"}, "unknown key"),
        ({"base": "nowhere.yaml"}, "No such file"),
        (
            {"parameters": {DELAY: [0]}, "expect": [{"metric": "violations", "below": 1, "where": {"delay": 0}}]},
            "found 'delay'; allowed: a parameter of the study",
        ),
        (
            {"parameters": {DELAY: [0]}, "expect": [{"metric": "violations", "below": 1, "where": {DELAY: 5}}]},
            "found links.default.delay_ms = 5; allowed: one that is flown: 0",
        ),
    ],
)
def test_a_wrong_study_is_refused_in_words(keys, words):
    with pytest.raises(ScenarioError, match="(?s)" + re.escape(words)):
        prepare({"base": SCENARIO, **keys})


def test_some_cases_may_replace_what_the_others_have_from_set():
    cases: Any = {"cases": {"as set": {}, "late": {DELAY: 100}}}
    planned, base = prepare({"base": SCENARIO, "set": {DELAY: 50}, "parameters": {"link": cases}})
    scenarios = [Task(flight, planned, base).scenario() for flight in Plan(planned).first_flights()]
    assert [each.links.default.delay_ms for each in scenarios] == [50, 100]


def test_a_parameter_may_set_a_part_of_what_one_before_it_sets():
    parameters = {"links.default": [{"loss": 0.1}], DELAY: [50], "links.default.jitter_ms": [0]}
    planned, base = prepare({"base": SCENARIO, "parameters": parameters})
    (flight,) = Plan(planned).first_flights()
    default = Task(flight, planned, base).scenario().links.default
    assert (default.loss, default.delay_ms) == (0.1, 50)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"parameters": {"law.type": ["fuzzy_pid", "nonsense"]}}, ["law.type: found 'nonsense'; allowed: fuzzy_pid"]),
        ({"parameters": {DELAY: [0, -5], LOSS: [0.1, 2]}}, [f"{DELAY}: found -5;", f"{LOSS}: found 2;"]),
        ({"parameters": {DELAY: {"range": [100, -50, 4]}}}, [f"{DELAY}: found -50; allowed: a number from 0"]),
        ({"parameters": {DELAY: [0, -5], LOSS: {"uniform": [0, 0.1]}}, "design": "sobol"}, [f"{DELAY}: found -5;"]),
        ({"parameters": {LOSS: {"uniform": [1.5, 2.0]}}}, [f"{LOSS}: found 1.75;"]),
        ({"bisect": {**SEARCH, "low": -5}}, [f"{DELAY}: found -5.0; allowed: a number from 0"]),
        ({"bisect": {**SEARCH, "high": 1e6}}, [f"{DELAY}: found 1000000.0; allowed: a number from 0 to 600000"]),
        (
            {"parameters": {"law": {"cases": {"a": {"law.rate_hz": 5}, "b": {"law.rate_hz": -5}}}}},
            ["law.rate_hz: found -5;"],
        ),
        (
            {"parameters": {"vehicles.model.speed_max_mps": [28, 18]}},
            ["path.speed_mps: found 22 m/s (with vehicles.model.speed_max_mps = 18); allowed: 16 to 18 m/s"],
        ),
    ],
)
def test_a_value_that_cannot_be_is_found_before_the_first_flight(keys, words):
    """The first one of each parameter, anywhere in a list, a range, cases or a search."""
    with pytest.raises(ScenarioError) as refused:
        prepare({"base": SCENARIO, **keys})
    lines = str(refused.value).splitlines()
    assert len(lines) == len(words)
    assert all(word in line for line, word in zip(lines, words, strict=True))


def test_a_value_that_is_drawn_with_others_only_with_which_it_can_be_is_flown():
    """40 m/s contradict the first value of the vehicles' limits, but not those in some samples."""
    limits = {"cases": {"slow": {}, "fast": {"vehicles.model.speed_max_mps": 60}}}
    either = {"parameters": {"path.speed_mps": [22, 40], "limits": limits}}
    planned, _ = prepare({"base": SCENARIO, **either, "design": "latin_hypercube", "samples": 4})
    assert {40, 22} == {sample["path.speed_mps"] for sample in samples(planned)}
    with pytest.raises(ScenarioError, match=r"path\.speed_mps"):
        prepare({"base": SCENARIO, **either, "design": "one_at_a_time"})


def test_a_distribution_may_have_draws_that_cannot_be():
    prepare({"base": SCENARIO, "parameters": {LOSS: {"uniform": [0.5, 1.5]}, DELAY: {"normal": [-1, 10]}}})


def test_a_range_of_whole_numbers_may_count_something():
    prepare({"base": SCENARIO, "parameters": {"vehicles.count": {"range": [2, 4, 3]}}})


@pytest.mark.parametrize(
    ("lines", "at"),
    [
        ("parameters:\n  law:\n    cases:\n      a: {law.rate_hz: -1}\n      b: {law.rate_hz: 5}", "5:7"),
        ("parameters:\n  links.default.dely_ms: [1]", "3:3"),
        ("set:\n  law.tipe: pid", "3:3"),
        ("parameters:\n  links:\n    cases:\n      a: {links.default.dely_ms: 1}", "5:7"),
        ("bisect:\n  {parameter: law.x, low: 0, high: 1, tolerance: 0.5, metric: violations, below: 1}", "3:4"),
    ],
)
def test_a_wrong_key_is_named_with_its_place_in_the_study(tmp_path, lines, at):
    path = tmp_path / "study.yaml"
    path.write_text(f"base: {json.dumps(SCENARIO)}\n{lines}\n")
    with pytest.raises(ScenarioError) as refused:
        prepare(path)
    assert str(refused.value).startswith(f"{path}:{at}: ")


def test_a_scenario_that_is_given_for_a_study_is_said_once_to_be_one_with_what_flies_it(tmp_path):
    path = tmp_path / "a flight.yaml"
    path.write_text(json.dumps(SCENARIO), encoding="utf-8")
    with pytest.raises(ScenarioError) as refused:
        prepare(path)
    assert str(refused.value) == (
        f"{path}: found a scenario; allowed: a study of it (`base`); gcs-formation run '{path}' flies it"
    )


def test_a_base_that_is_missing_is_named_with_its_place_in_the_study(tmp_path):
    path = tmp_path / "study.yaml"
    path.write_text("name: nothing\nbase: nope.yaml\n", encoding="utf-8")
    with pytest.raises(ScenarioError) as refused:
        prepare(path)
    missing = f"{tmp_path / 'nope.yaml'}: No such file or directory"
    assert str(refused.value) == f"{path}:2:1: base: {missing}; allowed: a scenario's file"
    path.write_text("base: nope.yaml\npath: {}\n", encoding="utf-8")
    with pytest.raises(ScenarioError, match="unknown key 'path'"):
        prepare(path)
    path.write_text("base: nope.yaml\n", encoding="utf-8")
    (tmp_path / "nope.yaml").write_text("a: [", encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"nope\.yaml:1:5: broken YAML"):
        prepare(path)


def test_the_schema_allows_what_the_loader_allows():
    validator = Draft202012Validator(study_schema())
    Draft202012Validator.check_schema(study_schema())
    good = {"base": SCENARIO, "parameters": {DELAY: [0], LOSS: {"uniform": [0, 0.1]}}, "bisect": SEARCH}
    assert validator.is_valid(good)
    assert not validator.is_valid({**good, "design": "grd"})


@pytest.fixture
def two(tmp_path):
    """Return a study of four flights of 3 s on disk."""
    path = tmp_path / "two.yaml"
    keys = {"base": SCENARIO, "parameters": {DELAY: [0, 50]}, "seeds": {"count": 2}, "metrics": ["error_x_m.max"]}
    path.write_text(json.dumps(keys), encoding="utf-8")
    return path


def command(*words):
    return CliRunner().invoke(main, [*map(str, words)])


def values_of(directory):
    kept = pq.read_table(directory / "flights.parquet").to_pylist()
    return [{name: each[name] for name in each if name not in {"wall_s", "cpu_s"}} for each in kept]


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"expect": [{"metric": "error_x_m.max"}]}, "expect.0: found no bound; allowed: below, above or both"),
        (
            {"expect": [{"metric": "error_x_m.max", "below": 1, "share": 0}]},
            "expect.0.share: found 0; allowed: a number > 0 and <= 1",
        ),
        (
            {"bisect": {**SEARCH, "low": 9, "high": 9}},
            "bisect: found a low that isn't below high; allowed: a high that",
        ),
        (
            {"expect": [{"metric": "measured_loss", "below": 5}]},
            "expect.0.below: found 5 for measured_loss; allowed: from 0 to 1",
        ),
        (
            {"expect": [{"metric": "broken_invariants", "above": -1}]},
            "expect.0.above: found -1 for broken_invariants; allowed: 0 or more",
        ),
        (
            {"bisect": {**SEARCH, "metric": "jitter_ms.p50", "above": -1}},
            "bisect.above: found -1 for jitter_ms.p50; allowed: 0 or more",
        ),
        ({"metrics": []}, "metrics: found []; allowed: a list of 1 or more figures"),
        ({"seeds": {"first": 2**63}}, f"seeds.first: found {2**63}; allowed: a whole number from 0 to 2^62"),
        (
            {"parameters": {DELAY: {"uniform": [5, 5]}}},
            f"parameters.{DELAY}: found {{uniform: [5, 5]}}; allowed: a list",
        ),
    ],
)
def test_what_is_wrong_in_a_study_is_said_once(keys, said):
    with pytest.raises(ScenarioError) as refused:
        study(**keys)
    (line,) = str(refused.value).splitlines()
    assert line.startswith(said)


def test_options_may_come_before_the_study_s_file(tmp_path):
    missing, out = tmp_path / "missing.yaml", tmp_path / "out"
    said = [command("study", *each) for each in ((missing, "--out", out), ("--out", out, missing))]
    assert [each.exit_code for each in said] == [2, 2]
    assert said[0].output == said[1].output == f"{missing}: No such file or directory\n"


@pytest.mark.slow
def test_a_study_flies_resumes_and_flies_one_again_to_the_same_figures(two, tmp_path):
    out = tmp_path / "out"
    assert command("study", two, "--out", out, "--workers", 1, "--quiet").exit_code == 0
    whole = values_of(out)
    assert [each["flight"] for each in whole] == [0, 1, 2, 3]
    journal = (out / "flights.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    (out / "flights.jsonl").write_text("".join(journal[:2]) + journal[2][:20], encoding="utf-8")
    assert "earlier" in command("study", two, "--out", out, "--workers", 1).output
    assert command("study", two, "--out", out, "--workers", 1, "--quiet", "--resume").exit_code == 0
    assert values_of(out) == whole
    again = command("study", "fly", out, 2)
    assert again.exit_code == 0
    assert f"error_x_m.max: {whole[2]['error_x_m.max']}" in again.output
    assert (out / "again" / "000002" / "flight.tlog").stat().st_size > 1000
    refused = command("study", "fly", out, 2, "--out", out / "again" / "000002")
    assert refused.exit_code == 2
    assert "earlier run" in refused.output
    two.write_text(two.read_text(encoding="utf-8").replace("50", "60"), encoding="utf-8")
    changed = command("study", two, "--out", out, "--resume")
    assert changed.exit_code == 2
    assert "the study file changed" in changed.output
    assert command("report", out).exit_code == 0
    assert "gcs-formation study fly" in (out / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(("record", "kept"), [("none", set()), ("summary", {"summary.json"}),
    ("series", {"summary.json", "run.yaml", "timeseries.parquet", "events.jsonl"})])  # fmt: skip
def test_records_hold_what_their_level_says(tmp_path, record, kept):
    base = SCENARIO | {"start": {"in_air": True, "run_in_s": 6}, "duration_s": 1}
    task = Task(Planned(0, 1, {}), Study(metrics=MAXIMUM, record=record), base, str(tmp_path / "flight"))
    assert fly(task)["exit"] == 0
    assert {path.name for path in tmp_path.glob("flight/*")} == kept


def test_a_flight_that_cannot_be_flown_is_a_row_with_its_words(tmp_path):
    task = Task(Planned(7, 1, {"path.speed_mps": 90}), Study(metrics=MAXIMUM, record="none"), SCENARIO)
    found = fly(task)
    assert (found["flight"], found["exit"], found["error_x_m.max"]) == (7, 2, None)
    assert "path.speed_mps" in found["words"]


@pytest.mark.slow
def test_a_killed_worker_loses_nothing_and_counts_nothing_twice(two, tmp_path):
    planned, base = prepare(two)
    tasks = deque(Task(each, Study(metrics=MAXIMUM, record="none"), base) for each in Plan(planned).first_flights())
    with Processes(2) as workers:
        rows = workers.rows(tasks)
        first = next(rows)
        os.kill(next(iter(workers._pool._processes)), signal.SIGKILL)
        flown = [first, *rows]
    assert sorted(each["flight"] for each in flown) == [0, 1, 2, 3]
    assert all(each["exit"] == 0 for each in flown)


def kill_or_fly(task):
    """Flight 0 kills its process before any flight beside it has ended."""
    if task.planned.flight == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.5)
    return row(task.planned)


@pytest.mark.slow
def test_a_flight_that_kills_its_worker_is_the_only_one_that_is_lost(two, monkeypatch):
    monkeypatch.setattr("gcs_formation.studies.workers.fly", kill_or_fly)
    planned, base = prepare(two)
    tasks = deque(Task(each, planned, base) for each in Plan(planned).first_flights())
    with Processes(2) as workers:
        flown = list(workers.rows(tasks))
    assert sorted((each["flight"], each["exit"]) for each in flown) == [(0, 3), (1, 0), (2, 0), (3, 0)]


@pytest.mark.slow
def test_a_cluster_flies_the_same_as_processes_do_and_survives_a_killed_worker(two, tmp_path):
    distributed = pytest.importorskip("distributed")
    here, there = tmp_path / "here", tmp_path / "there"
    assert command("study", two, "--out", here, "--workers", 1, "--quiet").exit_code == 0
    planned, base = prepare(two)
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        assert command("study", two, "--out", there, "--scheduler", address, "--quiet").exit_code == 0
        tasks = deque(Task(each, Study(metrics=MAXIMUM, record="none"), base) for each in Plan(planned).first_flights())
        with Cluster(address) as workers:
            rows = workers.rows(tasks)
            first = next(rows)
            os.kill(cluster.workers[0].pid, signal.SIGKILL)
            flown = [first, *rows]
    assert values_of(there) == values_of(here)
    assert sorted(each["flight"] for each in flown) == [0, 1, 2, 3]
    found = {each["flight"]: each["error_x_m.max"] for each in flown}
    assert found == {each["flight"]: each["error_x_m.max"] for each in values_of(here)}


@pytest.mark.slow
def test_a_restarted_scheduler_costs_no_flight_and_one_that_is_gone_ends_the_study(two, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr("gcs_formation.studies.cluster.GONE_S", 10.0)
    planned, base = prepare(two)
    tasks = deque(Task(each, Study(metrics=MAXIMUM, record="none"), base) for each in Plan(planned).first_flights())
    small = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None}
    before = distributed.LocalCluster(**small)
    port = int(before.scheduler_address.rpartition(":")[2])
    with Cluster(before.scheduler_address) as workers:
        rows = workers.rows(tasks)
        flown = [next(rows)]
        before.close()
        with distributed.LocalCluster(**small, scheduler_port=port):
            flown += [next(rows), next(rows)]
        with pytest.raises(RunAbortedError, match="is gone"):
            flown += rows
    assert len({each["flight"] for each in flown}) == len(flown) >= 3
    assert all(each["exit"] == 0 for each in flown)


@pytest.mark.slow
@pytest.mark.usefixtures("foreground")
def test_an_interrupted_study_says_so_keeps_its_rows_and_leaves_no_process(two, tmp_path):
    """Ctrl-C reaches the whole process group."""
    study_command = [sys.executable, "-m", "gcs_formation", "study", two, "--out", tmp_path / "out", "--workers", "1"]
    flying = subprocess.Popen(study_command, stderr=subprocess.PIPE, text=True, start_new_session=True)
    wait_for(lambda: flying.poll() is not None or list(read_journal(tmp_path / "out")))
    os.killpg(flying.pid, signal.SIGINT)
    _, said = flying.communicate()  # returns when the last process that holds the pipe has ended
    assert flying.returncode == 130
    assert "interrupted; what was flown is in" in said
    assert "Traceback" not in said
    assert values_of(tmp_path / "out")


def test_a_row_counts_once(two, tmp_path):
    planned, base = prepare(two)
    with Dataset(tmp_path / "out", planned, base, resume=False, overwrite=False) as data:
        data.add(DONE)
        data.add({**DONE, "error_x_m.max": 0.2})
        assert data.write_table().num_rows == 1
    assert list(read_journal(tmp_path / "out")) == [DONE]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"seed": "x"}, 'found "x" for seed in {journal}, flight 1; expected: an integer'),
        ({"error_x_m.max": "big"}, 'found "big" for error_x_m.max in {journal}, flight 1; expected: a number or null'),
        ({"exit": True}, "found true for exit in {journal}, flight 1; expected: an integer"),
        ({"flight": "one"}, 'found "one" for flight in {journal}, flight one; expected: an integer'),
        (None, "found no seed in {journal}, flight 1; expected: an integer"),
    ],
)
def test_a_row_that_is_none_of_the_study_is_named(two, tmp_path, wrong, said):
    """When a study is resumed, reported, or one of its flights is repeated."""
    out = tmp_path / "out"
    planned, base = prepare(two)
    Dataset(out, planned, base, resume=False, overwrite=False).__exit__()
    row = {"flight": 1} if wrong is None else DONE | wrong
    (out / "flights.jsonl").write_text(json.dumps(row) + "\n")
    expected = said.format(journal=out / "flights.jsonl")
    with pytest.raises(RecordError) as resumed:
        Dataset(out, planned, base, resume=True, overwrite=False)
    assert str(resumed.value) == expected
    for command in (["report", str(out)], ["study", "fly", str(out), "1"]):
        refused = CliRunner().invoke(main, command)
        assert (refused.exit_code, refused.output.strip().removeprefix("Error: ")) == (2, expected)


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("- 1", "found [1] in {plan}; expected: an object"),
        ("study: {}", "found no base in {plan}; expected: an object"),
        ("{study: {nme: x}, base: {}, version: x}", "found a study with wrong keys ("),
    ],
)
def test_a_study_file_that_no_study_wrote_is_named(tmp_path, written, said):
    (tmp_path / "study.yaml").write_text(written)
    (tmp_path / "flights.jsonl").write_text(json.dumps(DONE) + "\n")
    refused = CliRunner().invoke(main, ["report", str(tmp_path)])
    assert refused.exit_code == 2
    assert said.format(plan=tmp_path / "study.yaml") in refused.output


@pytest.mark.parametrize("resume", [False, True])
def test_a_directory_takes_one_study_at_a_time(two, tmp_path, resume):
    planned, base = prepare(two)
    out = tmp_path / "out"
    with Dataset(out, planned, base, resume=False, overwrite=False) as data:
        with pytest.raises(RecordError, match="another study that is being flown into"):
            Dataset(out, planned, base, resume=resume, overwrite=True)
        data.add(DONE)
    assert [each["flight"] for each in read_journal(out)] == [1]
    with Dataset(out, planned, base, resume=True, overwrite=False) as data:
        assert set(data.rows) == {1}


def test_of_an_earlier_study_nothing_is_left_where_it_is_replaced(two, tmp_path):
    planned, base = prepare(two)
    out = tmp_path / "out"
    with Dataset(out, planned, base, resume=False, overwrite=False) as data:
        data.add(DONE)
    earlier = ("flights/000017/summary.json", "again/000017/run.yaml", "figures/maps.png", "report.html", "study.json")
    for name in earlier:
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).touch()
    with Dataset(out, planned, base, resume=True, overwrite=False):
        assert all((out / name).exists() for name in earlier)
    with Dataset(out, planned, base, resume=False, overwrite=True):
        assert {str(path.relative_to(out)) for path in out.rglob("*")} == {"study.yaml", "flights.jsonl", "figures"}


class Instant:
    """Workers whose flights take no time; those in `unflown` can't be flown, those in `broken` break their bounds."""

    where = ""

    def __init__(self, unflown=(), broken=()):
        self.unflown, self.broken = unflown, broken

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def rows(self, tasks):
        while tasks:
            task = tasks.popleft()
            head = {"flight": task.planned.flight, "seed": task.planned.seed, **task.planned.parameters}
            lost = task.planned.flight in self.unflown
            status = int(task.planned.flight in self.broken)
            ended = {"exit": status, "words": "error_x_m.max broken" * status}
            ended = {"error_x_m.max": None, "exit": 3, "words": "bad air"} if lost else ended
            yield {**head, "error_x_m.max": 0.1, "wall_s": 1.0, "cpu_s": 1.0, "version": "x", **ended}


@contextmanager
def files_up_to(size):
    """Let no file grow beyond `size` bytes, like a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_costs_no_flight_that_was_flown(tmp_path, monkeypatch):
    """The disk is full in the middle of the journal's line; the study continues when there is room again."""
    monkeypatch.setattr("gcs_formation.cli.study.Processes", lambda _count: Instant())
    path, out = tmp_path / "many.yaml", tmp_path / "out"
    path.write_text(json.dumps({"base": SCENARIO, "seeds": {"count": 50}, "metrics": ["error_x_m.max"]}))
    with files_up_to(3000):
        full = command("study", path, "--out", out)
    assert full.exit_code == 3
    assert f"cannot go on writing to {out}: File too large; what was flown is in {out}; --resume goes on" in full.output
    kept = [each["flight"] for each in read_journal(out)]
    assert kept == list(range(len(kept)))
    assert (out / "flights.jsonl").stat().st_size == 3000
    assert command("study", path, "--out", out, "--resume").exit_code == 0
    assert [each["flight"] for each in values_of(out)] == list(range(50))
    assert Counter(each["flight"] for each in read_journal(out)) == Counter(range(50))


def test_a_flight_whose_record_cannot_be_written_ends_the_study_and_is_no_row(tmp_path):
    task = Task(Planned(0, 1, {}), Study(metrics=MAXIMUM, record="full"), SCENARIO, str(tmp_path / "flight"))
    with files_up_to(10_000), pytest.raises(RecordingError, match="File too large"):
        fly(task)


def test_a_study_of_which_nothing_was_flown_makes_room_for_the_next(two, tmp_path, monkeypatch):
    monkeypatch.setattr("gcs_formation.cli.study.Processes", lambda _count: Instant())
    planned, base = prepare(two)
    with Dataset(tmp_path / "out", planned, base, resume=False, overwrite=False):
        pass
    assert command("study", two, "--out", tmp_path / "out").exit_code == 0
    assert command("study", two, "--out", tmp_path / "out").exit_code == 2


def test_ten_million_flights_are_asked_about(two, tmp_path):
    two.write_text(json.dumps({"base": SCENARIO, "parameters": {DELAY: [0]}, "seeds": {"count": 10**6}}))
    refused = command("study", two, "--out", tmp_path / "out")
    assert refused.exit_code == 2
    assert "1,000,000 flights" in refused.output


@pytest.mark.parametrize(("unflown", "status"), [((), 0), ((1, 3), 1), (range(4), 3)])
def test_a_study_with_flights_that_could_not_be_flown_says_so_and_is_no_success(
    two, tmp_path, monkeypatch, unflown, status
):
    monkeypatch.setattr("gcs_formation.cli.study.Processes", lambda _count: Instant(unflown))
    done = command("study", two, "--out", tmp_path / "out", "--quiet")
    assert done.exit_code == status
    first = f"the first, flight {min(unflown, default=0)}: bad air"
    said = f"{len(unflown)} of 4 flights couldn't be flown to their end; {first}\n"
    assert done.output == (said if unflown else "")


@pytest.mark.parametrize(
    ("own", "broken", "status"),
    [
        ({}, (), 0),
        ({}, (2,), 1),
        ({}, range(4), 1),
        ({"expect": [{"metric": "error_x_m.max", "below": 0.2}]}, range(4), 0),
        ({"bisect": SEARCH, "parameters": {}}, range(4), 0),
    ],
    ids=["kept", "one broken", "all broken", "the study's own rules", "a search goes beyond"],
)
def test_without_an_expectation_of_the_study_those_of_its_flights_count(
    two, tmp_path, monkeypatch, own, broken, status
):
    monkeypatch.setattr("gcs_formation.cli.study.Processes", lambda _count: Instant(broken=broken))
    two.write_text(json.dumps(json.loads(two.read_text()) | own))
    done = command("study", two, "--out", tmp_path / "out", "--quiet")
    assert done.exit_code == status
    said = f"{len(broken)} of 4 flights broke an expectation or a safety limit of their own"
    assert (said in done.output) == bool(status)


def test_a_search_that_finds_no_crossing_says_so(two, tmp_path, monkeypatch):
    monkeypatch.setattr("gcs_formation.cli.study.Processes", lambda _count: Instant())
    two.write_text(
        json.dumps({"base": SCENARIO, "bisect": SEARCH, "seeds": {"count": 2}, "metrics": ["error_x_m.max"]})
    )
    done = command("study", two, "--out", tmp_path / "out")
    assert "2 of 2 searches found no crossing" in done.output
    found = json.loads((tmp_path / "out" / "study.json").read_text(encoding="utf-8"))["bisect"]
    assert found == [{"seed": seed, "kept": 1000.0, "broken": None} for seed in (1, 2)]


def test_ten_million_samples_are_counted_and_not_made(two, tmp_path, monkeypatch):
    monkeypatch.setattr("gcs_formation.studies.plan.samples", None)
    keys = {"base": SCENARIO, "parameters": {LOSS: {"uniform": [0, 0.1]}}, "design": "sobol", "samples": 10**7}
    two.write_text(json.dumps(keys))
    refused = command("study", two, "--out", tmp_path / "out")
    assert refused.exit_code == 2
    assert "found 10,000,000 flights; allowed: up to 100,000, or --yes" in refused.output


def test_a_scheduler_s_address_is_looked_at_before_anything(two, tmp_path):
    refused = command("study", two, "--out", tmp_path / "out", "--scheduler", "here")
    assert refused.exit_code == 2
    assert "found 'here'; allowed: tcp://HOST:PORT" in refused.output


def test_a_scheduler_that_does_not_answer_is_said_so(two, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("gcs_formation.studies.cluster.ANSWER_S", 0.3)
    done = command("study", two, "--out", tmp_path / "out", "--scheduler", "tcp://127.0.0.1:9")
    assert done.exit_code == 3
    assert "no Dask scheduler answers at tcp://127.0.0.1:9" in done.output
    assert "; nothing was flown" in done.output


def test_study_models_and_keys_agree():
    assert Study.model_validate(study().model_dump(by_alias=True)) == study()


def test_a_file_that_holds_no_keys_is_said_to_hold_no_study(tmp_path):
    (tmp_path / "study.yaml").write_text("- 1\n")
    with pytest.raises(ScenarioError, match=r"study\.yaml:1:1: found a list; allowed: a mapping of study keys$"):
        load_study(tmp_path / "study.yaml")
