import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from airlink.endpoint import VehicleId
from formation_scenario import load_scenario
from formation_scenario.expectation import Expectation
from gcs_formation.record.parquet import read_parquet, write_parquet
from gcs_formation.record.run_directory import TIMESERIES
from gcs_formation.record.summary import Summary
from gcs_formation.record.verdict import Verdict
from gcs_formation.testing.flown_flight import FlownFlight, in_words

TIME_S = np.arange(-20, 301) / 10.0


def flown(directory: Path, leads_from_10_s: int = 1, /, **errors: np.ndarray) -> FlownFlight:
    """Return a flight of 30 s: 1 leads, errors are 0 except for the given ones; x2 (T,) is vehicle 2's along x."""
    leader = np.where(TIME_S < 10, 1, leads_from_10_s)
    scenario = load_scenario({"vehicles": {"count": 3}, "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}})
    rows, zero = TIME_S.size, np.zeros(TIME_S.size)
    columns: dict[str, Any] = {
        "network": np.ones(3 * rows, dtype=np.int32),
        "vehicle": np.tile(np.array([1, 2, 3], dtype=np.int32), rows),
        "phase": np.ones(3 * rows, dtype=np.int8),
        "active": np.ones(3 * rows),
        "leads": np.equal.outer(leader, [1, 2, 3]).astype(float).ravel(),
        "yielding": np.zeros(3 * rows),
        "airborne": np.ones(3 * rows),
        "t_s": np.repeat(TIME_S, 3),
        "mission_time_s": np.repeat(np.where(TIME_S < 0, np.nan, TIME_S), 3),
    }
    for axis in "xyz":
        parts = [np.where(leader == each, np.nan, errors.get(f"{axis}{each}", zero)) for each in (1, 2, 3)]
        columns[f"error_{axis}_m"] = np.stack(parts, axis=1).ravel()
    write_parquet(directory / TIMESERIES, [columns])
    followers = {"2": {"settled_at_s": 4.0}, "3": {"settled_at_s": None}}
    if leads_from_10_s != 1:
        followers["1"] = {"settled_at_s": 20.0}
    figures = {"duration_s": 30.0, "truth": True, "followers": followers, "safety": {"min_separation_m": 12.5}}
    figures |= {"undone": [], "unsafe": []}
    return FlownFlight(scenario, Summary(figures, (), ("clearance was 1 m",)), directory, "gcs-formation run a.yaml")


@pytest.mark.parametrize("key", ["undone", "unsafe"])
@pytest.mark.parametrize(
    "claim",
    [
        lambda each: each.stays_within(1.0),
        lambda each: each.settles(before_s=9.0, followers=2),
        lambda each: each.keeps_apart(5.0),
    ],
    ids=["stays within", "settles", "keeps apart"],
)
def test_a_flight_that_was_not_flown_as_planned_shows_nothing(tmp_path, key, claim):
    """Followers are in their slots all the time, of another formation than the one that was ordered."""
    flight = flown(tmp_path)
    claim(flight)
    words = "order at 5 s: shape line 900: refused"
    refused = replace(flight, summary=replace(flight.summary, figures={**flight.figures, key: [words]}))
    with pytest.raises(AssertionError, match=f"not flown as planned\n  {words}"):
        claim(refused)


def bump(size_m: float, at_s: float) -> np.ndarray:
    return np.where(np.abs(TIME_S - at_s) < 0.01, size_m, 0.0)


def test_a_flight_within_its_limit_holds_and_goes_on(tmp_path):
    flight = flown(tmp_path, x2=np.full(TIME_S.size, 0.99))
    assert flight.stays_within(0.99) is flight


def test_the_worst_violation_comes_first_with_vehicle_axis_time_and_figure(tmp_path):
    flight = flown(tmp_path, x2=bump(1.2, 12.0), y3=bump(-1.5, 17.5), z3=bump(9.0, 3.0))
    with pytest.raises(AssertionError) as broken:
        flight.stays_within(1.0, axes="xy", from_s=10)
    lines = str(broken.value).splitlines()
    assert lines[0] == "more than 1 m from the slot along x, y from 10 s to 30 s"
    assert lines[1] == "  vehicle 3: |error_y| = 1.500 m at 17.5 s"
    assert lines[2] == "  vehicle 2: |error_x| = 1.200 m at 12.0 s"
    assert lines[3] == f"seed 1, errors by ground truth, recorded in {tmp_path}"
    assert lines[4] == "again: gcs-formation run a.yaml"


def test_what_lies_outside_window_axes_and_followers_does_not_count(tmp_path):
    flight = flown(tmp_path, x2=bump(2.0, 9.9), y2=bump(2.0, 15.0), x3=bump(2.0, 15.0))
    flight.stays_within(1.0, axes="x", followers=2, from_s=10).stays_within(1.0, followers=[2], from_s=20, to_s=25)


def test_an_unknown_error_is_worse_than_any(tmp_path):
    gap = np.where((TIME_S > 14) & (TIME_S < 15), np.nan, 0.0)
    with pytest.raises(AssertionError, match=r"slot.*\n  vehicle 2: error_x unknown at 14.1 s\n  vehicle 3"):
        flown(tmp_path, x2=gap, x3=bump(99.0, 20.0)).stays_within(1.0)


@pytest.mark.parametrize("window", [{"from_s": 31}, {"to_s": 31}, {"from_s": 20, "to_s": 10}])
def test_a_window_that_was_not_flown_is_no_success(tmp_path, window):
    with pytest.raises(AssertionError, match=re.escape("the flight went to 30.0 s, not through from")):
        flown(tmp_path).stays_within(1.0, **window)


def test_a_window_between_two_ticks_is_no_success(tmp_path):
    with pytest.raises(AssertionError, match="unknown"):
        flown(tmp_path).stays_within(1.0, from_s=10.01, to_s=10.09)


@pytest.mark.parametrize("axes", ["", "w", "error_x"])
def test_axes_are_x_y_and_z(tmp_path, axes):
    with pytest.raises(ValueError, match="allowed: one or more of x, y, z"):
        flown(tmp_path).stays_within(1.0, axes=axes)


def test_only_followers_have_a_slot(tmp_path):
    with pytest.raises(ValueError, match="found vehicle 1; allowed: 2, 3"):
        flown(tmp_path).stays_within(1.0, followers=1)


def test_an_empty_list_of_followers_is_refused(tmp_path):
    with pytest.raises(ValueError, match="found no vehicle; allowed: one or more"):
        flown(tmp_path).stays_within(1.0, followers=[])


def test_who_leads_has_no_slot_and_a_leader_that_follows_has_one_from_then_on(tmp_path):
    flight = flown(tmp_path, 2, x1=bump(2.0, 15.0), x2=bump(2.0, 15.0))
    flight.stays_within(1.0, followers=[2, 3]).stays_within(1.0, to_s=14)
    with pytest.raises(AssertionError, match=r"slot.*\n  vehicle 1: \|error_x\| = 2.000 m at 15.0 s\nseed"):
        flight.stays_within(1.0)
    with pytest.raises(AssertionError, match=r"not settled before 5 s\n  vehicle 1: at 20.0 s\n  vehicle 3: never"):
        flight.settles(before_s=5)


def test_settling_is_by_follower(tmp_path):
    flight = flown(tmp_path).settles(before_s=5, followers=2)
    with pytest.raises(AssertionError, match=r"not settled before 4 s\n  vehicle 2: at 4.0 s\n  vehicle 3: never"):
        flight.settles(before_s=4)


def test_separation_and_safety_are_claims_too(tmp_path):
    flight = flown(tmp_path).keeps_apart(12.5)
    with pytest.raises(AssertionError, match=r"vehicles 12.5 m apart; expected: 13 m or more"):
        flight.keeps_apart(13)
    with pytest.raises(AssertionError, match="not as expected\n  clearance was 1 m"):
        flight.meets_its_expectations()


def test_vehicles_that_all_lie_on_the_ground_are_not_kept_apart(tmp_path):
    """Distances before they crashed prove nothing for the rest of the flight; `expect` is broken there, too."""
    flight = flown(tmp_path)
    columns = dict(read_parquet(tmp_path / TIMESERIES))
    columns["airborne"] = np.where(np.repeat(TIME_S, 3) < 20.0, 1.0, 0.0)
    write_parquet(tmp_path / TIMESERIES, [columns])
    with pytest.raises(AssertionError, match=r"not 10 m apart all through the flight: none flew from 20.0 s on"):
        flight.keeps_apart(10)
    columns["airborne"][-3] = 1.0  # one flies at the end
    write_parquet(tmp_path / TIMESERIES, [columns])
    replace(flight).keeps_apart(10)


def test_a_flight_of_which_a_part_is_not_recorded_keeps_none_apart(tmp_path):
    flight = flown(tmp_path)
    columns = {
        name: each[np.abs(np.repeat(TIME_S, 3) - 15.0) > 4.0]
        for name, each in read_parquet(tmp_path / TIMESERIES).items()
    }
    write_parquet(tmp_path / TIMESERIES, [columns])
    with pytest.raises(AssertionError, match=r"not recorded from 10.9 s to 19.1 s"):
        flight.keeps_apart(10)


def test_many_violations_are_counted(tmp_path):
    everywhere = np.full(TIME_S.size, 5.0)
    flight = flown(tmp_path, **{f"{axis}{vehicle}": everywhere for axis in "xyz" for vehicle in (2, 3)})
    with pytest.raises(AssertionError) as broken:
        flight.stays_within(1.0)
    assert str(broken.value).count("|error_") == 6
    assert in_words(VehicleId(2, 9), "x", 1.0, 2.0).startswith("vehicle 2:9:")


def test_a_bound_that_is_no_number_settles_none(tmp_path):
    with pytest.raises(AssertionError, match="vehicle 2: at 4"):
        flown(tmp_path).settles(before_s=math.nan, followers=2)


def test_a_window_in_which_those_named_only_led_is_no_success(tmp_path):
    flight = flown(tmp_path, 3)
    with pytest.raises(AssertionError, match="none of these followed from 15 s to 30 s\n  3"):
        flight.stays_within(1.0, followers=3, from_s=15)


def test_a_window_in_which_those_named_hardly_followed_is_no_success(tmp_path):
    """It leads from 10 s on; of the other, that follows to the end, enough is judged."""
    flight = flown(tmp_path, 3)
    flight.stays_within(1.0, followers=[2, 3])
    with pytest.raises(AssertionError, match=r"not judged from 0 s to 30 s\n  vehicle 3: 33% of it judged"):
        flight.stays_within(1.0, followers=3)


def test_a_window_of_which_a_part_is_not_recorded_is_no_success(tmp_path):
    flight = flown(tmp_path)
    columns = read_parquet(tmp_path / TIMESERIES)
    write_parquet(tmp_path / TIMESERIES, [{n: each[np.repeat(~missing(15.0, 4.0), 3)] for n, each in columns.items()}])
    with pytest.raises(AssertionError, match="not judged from 0 s to 30 s"):
        flight.stays_within(1.0)
    write_parquet(tmp_path / TIMESERIES, [{n: each[np.repeat(~missing(15.0, 2.8), 3)] for n, each in columns.items()}])
    replace(flight).stays_within(1.0).keeps_apart(10)


def missing(from_s: float, for_s: float) -> np.ndarray:
    return (from_s - 0.01 < TIME_S) & (from_s + for_s - 0.01 > TIME_S)


def test_expectations_none_of_which_was_judged_arent_met(tmp_path):
    flight = flown(tmp_path)
    expectation = Expectation(metric="error_x_m.max", to_s=20.0, below=1.0)
    unjudged = Verdict(expectation, VehicleId(1, 2), None, reached=False, judged=False, reason="cut by --until")
    with pytest.raises(AssertionError, match="no expectation was judged"):
        replace(flight, summary=Summary(flight.figures, (unjudged,), ())).meets_its_expectations()


def test_none_settles_where_none_follows(tmp_path):
    flight = flown(tmp_path)
    alone = replace(flight, summary=Summary({**flight.figures, "followers": {}}, (), ()))
    with pytest.raises(AssertionError, match="none followed that could settle before 5 s"):
        alone.settles(before_s=5)


def test_expectations_that_a_scenario_doesnt_have_arent_met(tmp_path):
    flight = flown(tmp_path)
    with pytest.raises(AssertionError, match="no expectation was judged: the scenario has no expect\nseed 1"):
        replace(flight, summary=Summary(flight.figures, (), ())).meets_its_expectations()
