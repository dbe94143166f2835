"""Figures of merit, computed by hand."""

from __future__ import annotations

from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcs_formation.record.figures_of_merit import (
    axis_figures,
    effort,
    if_finite,
    in_slot_share,
    left_at_s,
    percentile,
    percentiles,
    separation_m,
    settled_at_s,
)

TIME_S = np.arange(0.0, 100.05, 0.1)


def errors(out_from_s: float = np.inf) -> np.ndarray:
    """Return (T, 3) m: beyond 0.5 m in height only before 20 s and for 5 s from `out_from_s` on, 0.3 m to 50 s."""
    out = (TIME_S < 19.95) | ((out_from_s - 0.05 <= TIME_S) & (out_from_s + 4.95 > TIME_S))
    error_m = np.zeros((TIME_S.size, 3))
    error_m[:, 2] = np.where(out, -0.6, np.where(TIME_S < 49.95, 0.3, -0.01))
    return error_m


def test_steady_flight_begins_30_s_after_settling():
    settled_s = settled_at_s(TIME_S, errors())
    assert settled_s == pytest.approx(20.0)
    assert axis_figures(TIME_S, errors()[:, 2], settled_s)["steady_max"] == pytest.approx(0.01)
    early = TIME_S < 49.9
    assert axis_figures(TIME_S[early], errors()[early, 2], settled_s)["steady_max"] is None
    assert axis_figures(TIME_S, errors()[:, 2], None)["steady_max"] is None


def test_percentiles_over_time_are_of_the_error_s_size():
    """0.6 m below for a fifth of the time, 0.3 m for three tenths, 0.01 m for the rest."""
    figures = axis_figures(TIME_S, errors()[:, 2], None)
    assert [figures[name] for name in ("p50", "p95", "p99")] == pytest.approx([0.01, 0.6, 0.6])
    assert axis_figures(TIME_S[:0], TIME_S[:0], None)["p95"] is None


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=40), st.sampled_from([0, 5, 50, 95, 99, 100]))
def test_a_percentile_is_numpys_to_the_last_bit(values, q):
    assert percentile(np.array(values), q) == np.percentile(values, q)


def test_a_vehicle_that_leaves_its_slot_again_is_reported_when_and_its_time_there_counts():
    left = errors(out_from_s=60.0)
    assert left_at_s(TIME_S, left, settled_at_s(TIME_S, left)) == pytest.approx(60.0)
    assert in_slot_share(left) == pytest.approx(751 / 1001)
    assert left_at_s(TIME_S, errors(), 20.0) is None
    assert left_at_s(TIME_S, left, None) is None
    assert in_slot_share(np.empty((0, 3))) is None


def columns(**changes) -> dict[str, np.ndarray]:
    """Return setpoints at 10 Hz: speed up and down by 0.2 m/s, heading turning 0.02 rad per tick through north."""
    ticks = np.arange(101)
    return {
        "t_s": ticks / 10.0,
        "active": np.ones(101),
        "setpoint_speed_mps": 22.0 + 0.2 * (ticks % 2),
        "setpoint_heading_rad": (6.0 + 0.02 * ticks) % (2.0 * np.pi),
        "setpoint_height_m": np.full(101, 100.0),
    } | changes


def test_effort_is_the_setpoints_variation_a_second_and_the_95th_percentile_of_their_steps():
    found = effort(columns(), np.ones(101, dtype=bool))
    assert found["speed"] == {"variation_per_s": pytest.approx(2.0), "step_p95": pytest.approx(0.2)}
    assert found["heading"] == {"variation_per_s": pytest.approx(0.2), "step_p95": pytest.approx(0.02)}
    assert found["height"] == {"variation_per_s": 0.0, "step_p95": 0.0}


def test_effort_has_no_step_into_the_window_nor_where_nothing_is_sent():
    jump = np.where(np.arange(101) < 50, 0.0, 100.0)
    after = effort(columns(setpoint_height_m=jump), np.arange(101) >= 50)
    assert after["height"] == {"variation_per_s": 0.0, "step_p95": 0.0}
    silent = np.where(np.abs(np.arange(101) - 50) < 3, 0.0, 1.0)
    assert effort(columns(setpoint_height_m=jump, active=silent), np.ones(101, dtype=bool))["height"]["step_p95"] == 0.0
    nothing = effort(columns(active=np.zeros(101)), np.ones(101, dtype=bool))
    assert nothing["speed"] == {"variation_per_s": None, "step_p95": None}


@pytest.mark.parametrize("count", [2, 13])
def test_separation_is_in_three_dimensions(count):
    """By 3-4-5: 30 m apart on the ground and 40 m in height, so 50 m."""
    steps = np.array([30.0, 0.0, 40.0])
    places = [np.tile(each * steps, (4, 1)) for each in range(count)]
    flight = with_places(places, 4)
    assert separation_m(flight, np.ones(4, dtype=bool)) == pytest.approx(50.0)


def with_places(places: Any, ticks: int, period_s: float = 0.1) -> Any:
    """Return a flight of vehicles at (V, T, 3) places."""
    vehicles = {each: {"t_s": np.arange(ticks) * period_s} for each in range(len(places))}
    return SimpleNamespace(vehicles=vehicles, common=vehicles[0], position_in_flight=lambda each: places[each])


@given(st.integers(1, 9), st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.3, 1.0]), st.booleans())
def test_separation_is_that_of_the_nearest_two_that_fly_from_tick_to_tick(count, seed, grounded, closely):
    """Compared with every pair at a hundred points between ticks; some fly abreast, and a share is on the ground.

    Over more than a second straight flight isn't assumed.
    """
    draw = np.random.default_rng(seed)
    places = draw.choice([0.0, 1.0, 1.5, 40.0], (count, 6, 3)) * draw.uniform(0.1, 100.0, 3)
    places[draw.random((count, 6)) < grounded] = np.nan
    nearest, resolved_m = np.full(6, np.inf), 0.0
    for one, other in combinations(places, 2):
        difference = one - other
        steps = np.vstack((np.nan_to_num(np.diff(difference, axis=0)), np.zeros(3)))
        resolved_m = max(resolved_m, float(np.linalg.norm(steps, axis=1).max()) / 200.0)
        for share in np.linspace(0.0, 1.0, 101) if closely else (0.0,):
            nearest = np.fmin(nearest, np.linalg.norm(difference + share * steps, axis=1))
    found = separation_m(with_places(places, 6, 0.1 if closely else 1.5), np.ones(6, dtype=bool))
    assert (found <= nearest + 1e-9).all()
    assert found == pytest.approx(nearest, abs=resolved_m + 1e-9)


def test_the_outermost_of_three_in_a_row_may_be_the_nearest():
    """They change places through one another within a tick; the one between is 15 m aside."""
    first = np.array([[0.0, 0.0, 0.0], [20.0, 0.0, 0.0]])
    between = np.array([[10.0, 15.0, 0.0], [10.0, 15.0, 0.0]])
    flight = with_places([first, between, first[::-1]], 2)
    assert separation_m(flight, np.ones(2, dtype=bool))[0] == pytest.approx(0.0, abs=1e-9)


def test_two_that_pass_each_other_between_ticks_were_as_near_as_they_passed():
    """At 2 Hz, 22 m/s each and 0.05 m aside, the ticks alone show 11 m."""
    along = 22.0 * (np.arange(8) * 0.5 - 1.75)
    one = np.stack((along, np.zeros(8), np.zeros(8)), axis=1)
    other = np.stack((-along, np.full(8, 0.05), np.zeros(8)), axis=1)
    assert separation_m(with_places([one, other], 8, 0.5), np.ones(8, dtype=bool)).min() == pytest.approx(0.05)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from([None, 0.0, 12.3, 60.0]))
def test_figures_of_an_axis_are_numpys(seed, settled_s):
    """Steady flight begins 30 s after settling, that instant included."""
    draws = np.random.default_rng(seed)
    time_s = np.sort(draws.uniform(0.0, 100.0, draws.integers(1, 30)))
    error_m = draws.normal(0.0, 1.0, time_s.size)
    if settled_s is not None:
        time_s[-1] = max(settled_s + 30.0, time_s[-1])
    found, size = axis_figures(time_s, error_m, settled_s), np.abs(error_m)
    assert found["rms"] == pytest.approx(np.sqrt(np.mean(error_m**2)))
    assert found["max"] == size.max()
    assert [found[f"p{q}"] for q in (50, 95, 99)] == list(np.percentile(size, [50, 95, 99]))
    steady = size[time_s >= (np.inf if settled_s is None else settled_s + 30.0)]
    assert found["steady_max"] == (steady.max() if steady.size else None)


@pytest.mark.parametrize(("ends_s", "settled_s"), [(9.9, None), (10.0, 0.0), (10.1, 0.0)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_vehicle_has_settled_that_stays_within_half_a_metre_for_10_s(ends_s, settled_s, axis):
    """On every axis; half a metre itself is within, an unknown error is not."""
    time_s = np.arange(0.0, ends_s + 0.05, 0.1)
    error_m = np.full((time_s.size, 3), -0.5)
    assert settled_at_s(time_s, error_m) == settled_s
    for outside in (0.5 + 1e-9, -0.5 - 1e-9, np.nan):
        error_m[0, axis] = outside
        assert settled_at_s(time_s, error_m) == (0.1 if ends_s > 10.05 else None)
    assert settled_at_s(time_s[:0], error_m[:0]) is None


def test_a_share_in_the_slot_counts_the_bound_itself_and_every_axis():
    error_m = np.array([[0.5, -0.5, 0.5], [0.51, 0.0, 0.0], [0.0, -0.51, 0.0], [0.0, 0.0, 0.51]])
    assert in_slot_share(error_m) == 0.25
    assert in_slot_share(error_m, missed=4) == 0.125
    assert in_slot_share(error_m[:0], missed=2) == 0.0
    time_s = np.array([0.0, 1.0, 2.0, 3.0])
    assert [left_at_s(time_s, error_m, at_s) for at_s in (0.0, 1.0, 1.5, 3.5)] == [1.0, 1.0, 2.0, None]


def test_effort_is_by_the_time_that_passed_between_setpoints():
    """At ticks that come late, and over a part of the flight."""
    found = effort(columns(t_s=np.arange(101) / 4.0), np.arange(101) >= 50)
    assert found["speed"]["variation_per_s"] == pytest.approx(0.8)
    unknown = columns(setpoint_speed_mps=np.full(101, np.nan))
    assert effort(unknown, np.ones(101, dtype=bool))["speed"] == {"variation_per_s": None, "step_p95": None}


def test_figures_that_are_not_finite_have_no_place_in_a_summary():
    assert [if_finite(value) for value in (1.5, np.nan, np.inf, -np.inf)] == [1.5, None, None, None]
    assert percentiles(np.array([np.nan, 3.0, 1.0, np.inf]), 50, 99) == {"p50": 2.0, "p99": pytest.approx(2.98)}
    assert percentiles(np.array([np.nan]), 50) == {"p50": None}


def test_a_tick_that_comes_one_and_a_half_periods_after_another_is_not_late():
    """A later one shows what has held since the tick that is missing."""
    error_m = np.zeros((7, 3))
    assert settled_at_s(np.arange(3.0, 16.0, 2.0), error_m, 2.0, (0.0, 15.0)) == 3.0
    assert settled_at_s(np.arange(3.5, 16.0, 2.0), error_m, 2.0, (0.0, 15.5)) == 2.0


@pytest.mark.parametrize(("gap_s", "settled_s"), [(3.125, 0.0), (3.25, None)])
def test_a_gap_of_three_seconds_and_a_period_is_stayed_through(gap_s, settled_s):
    """Ticks of an eighth of a second; after a longer gap the 10 s begin again."""
    time_s = np.arange(0.0, 12.0, 0.125)
    time_s = time_s[(time_s <= 4.0) | (time_s >= 4.0 + gap_s)]
    assert settled_at_s(time_s, np.zeros((time_s.size, 3)), 0.125, (0.0, 12.0)) == settled_s
