"""The report compares errors after a gust on followers only with the least possible under any law."""

import math
import re

import numpy as np
import pytest

from formation_scenario import load_scenario
from gcs_formation.report import load_run
from gcs_formation.report.error_figures import ALLOWED, MINIMUM, errors
from gcs_formation.report.gusts import gusts
from gcs_formation.report.page import embedded
from gcs_formation.report.page_parts import after_gusts

GUST = {"at_s": 30, "vehicles": [2, 3], "velocity_mps": [0.6, -0.6, 0.3]}
UP_S = 0.02
"""Delay of the links in the records."""
ACTS_S = 0.04
"""How late a gust acts: vehicles read the mission time in the pass of their main loop after that."""
BRAKED_M = {"x": 0.36 / (2 * 1.5), "y": 0.36 / (2 * 22 * 0.25)}


def straight_north(disturbances, vehicles=None):
    return straight([4000, 0, 100], disturbances, vehicles)


def straight(end_m, disturbances, vehicles=None):
    path = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], end_m]}
    keys = {"vehicles": vehicles or {"count": 3}, "duration_s": 60, "path": path, "disturbances": disturbances}
    return load_scenario(keys)


@pytest.fixture(scope="module")
def run(make_run):
    return load_run(make_run(straight_north([GUST])))


def test_the_bound_is_of_the_records_round_trip_and_the_models_limits(run):
    found = gusts(run)
    assert [error.axis for error in found] == ["x", "y"]
    assert {(error.at_s, round(error.to_s)) for error in found} == {(30.0, 60)}
    window = run.flown.window(30.0, 60.0)
    for column, error in enumerate(found):
        samples = zip(run.time_s, run.flown.vehicles[error.vehicle]["age_s"], strict=True)
        answered_s = next(tick_s for tick_s, age_s in samples if tick_s - age_s >= 30.0 + ACTS_S - 1e-3)
        assert error.round_trip_s == pytest.approx(answered_s + UP_S - 30.0 - ACTS_S, abs=1e-3)
        assert error.min_m == pytest.approx(0.6 * error.round_trip_s + BRAKED_M[error.axis], abs=1e-3)
        assert error.allowed_m == pytest.approx(1.5 * error.min_m + 0.05)
        worst_m = max(np.abs(run.flown.error(vehicle)[window, column]).max() for vehicle in run.followers)
        assert error.found_m == pytest.approx(worst_m)


def test_a_gust_north_and_east_is_along_and_across_by_the_course_it_is_met_on(make_run):
    """On a course of 30 degrees 0.6 m/s each way are 0.82 m/s along and 0.22 m/s across."""
    each_way = GUST | {"velocity_mps": [0.6, 0.6, 0.0]}
    x, y = gusts(load_run(make_run(straight([2000 * math.sqrt(3), 2000, 100], [each_way]))))
    along_mps, across_mps = 0.3 * (math.sqrt(3) + 1), 0.3 * (math.sqrt(3) - 1)
    assert x.min_m == pytest.approx(along_mps * x.round_trip_s + along_mps**2 / (2 * 1.5), abs=1e-3)
    assert y.min_m == pytest.approx(across_mps * y.round_trip_s + across_mps**2 / (2 * 22 * 0.25), abs=1e-3)


def test_it_is_drawn_from_the_gust_on_and_stands_in_the_table(run):
    figure = errors(run)
    drawn = [line for axes in figure.axes for line in axes.get_lines() if line.get_label() in (ALLOWED, MINIMUM)]
    assert {abs(np.asarray(line.get_ydata()).item(0)) for line in drawn} == {
        size for error in gusts(run) for size in (error.min_m, error.allowed_m)
    }
    assert {np.asarray(line.get_xdata()).item(0) for line in drawn} == {30.0}
    cells = re.findall(r"<td>([0-9.]+)</td>", after_gusts(run))
    assert cells[:3] == [f"{value:.3f}" for value in gusts(run)[0][4:7]]
    assert [bound["axis"] for bound in embedded(run)["meta"]["scene"]["bounds"]] == ["x", "y"]


def test_a_gust_that_ends_is_another_one(make_run):
    along = [
        error for error in gusts(load_run(make_run(straight_north([GUST | {"until_s": 45}])))) if error.axis == "x"
    ]
    assert [(error.at_s, round(error.to_s)) for error in along] == [(30.0, 45), (45.0, 60)]
    carried_m = [error.min_m - 0.6 * error.round_trip_s for error in along]
    assert carried_m == pytest.approx([BRAKED_M["x"]] * 2, abs=1e-3)


@pytest.mark.parametrize(
    ("disturbance", "vehicles"),
    [
        (GUST | {"vehicles": "all"}, None),
        (GUST | {"vehicles": [1]}, None),
        (GUST | {"kind": "ramp", "duration_s": 5}, None),
        (GUST, [{"id": 2}, {"id": 3}]),
    ],
    ids=["on all", "on the leader", "no step", "virtual leader"],
)
def test_there_is_no_bound_without_a_step_between_a_leader_and_its_followers(make_run, disturbance, vehicles):
    run = load_run(make_run(straight_north([disturbance], vehicles)))
    assert gusts(run) == []
    assert after_gusts(run) == ""
