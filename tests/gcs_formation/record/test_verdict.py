"""A bound is kept on one side of it, and judged where enough of its window was."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from airlink.endpoint import VehicleId
from formation_scenario.expectation import JUDGED_SHARE, Expectation
from gcs_formation.record.coverage import coverage, scored_end_s
from gcs_formation.record.verdict import Verdict, weighed

FOLLOWER = VehicleId(1, 2)


def wanted(metric: str = "error_x_m.max", **bounds: Any) -> Expectation:
    return Expectation.model_validate({"metric": metric, "from_s": 2, "to_s": 10} | bounds)


def verdict(value: float | None = 0.1, *, metric: str = "error_x_m.max", below: float = 0.5, **more: Any) -> Verdict:
    return Verdict(wanted(metric, below=below), FOLLOWER, value, **more)


@pytest.mark.parametrize(
    ("bounds", "value", "held"),
    [
        ({"below": 0.5}, math.nextafter(0.5, 0.0), True),
        ({"below": 0.5}, 0.5, False),
        ({"above": 0.5}, math.nextafter(0.5, 1.0), True),
        ({"above": 0.5}, 0.5, False),
        ({"above": 0.2, "below": 0.5}, 0.3, True),
        ({"above": 0.2, "below": 0.5}, 0.2, False),
        ({"above": 0.2, "below": 0.5}, 0.5, False),
        ({"below": 0.5}, None, False),
    ],
)
def test_a_bound_itself_is_not_kept_and_without_a_value_none_is(
    bounds: dict[str, Any], value: float | None, held: bool
) -> None:
    assert Verdict(wanted(**bounds), FOLLOWER, value).held is held
    assert Verdict(wanted(**bounds), FOLLOWER, value, judged=False).held is None
    assert Verdict(wanted(**bounds), FOLLOWER, value, reached=False).held is False


@pytest.mark.parametrize(("share", "judged"), [(1.0, True), (JUDGED_SHARE, True), (JUDGED_SHARE - 1e-5, False)])
def test_a_kept_bound_is_judged_over_at_least_95_percent_of_its_window(share: float, *, judged: bool) -> None:
    """A broken one is over any share; so is one whose window the flight's own end cut short, whatever its value."""
    assert JUDGED_SHARE == 0.95
    assert weighed(verdict(share=share)).judged is judged
    assert weighed(verdict(0.5, share=share)).held is False
    assert weighed(verdict(None, share=share)).held is (False if judged else None)
    assert weighed(verdict(share=share, reached=False)).held is False
    assert weighed(verdict(share=share, reached=False, cut=True)).judged is judged


@pytest.mark.parametrize(
    ("metric", "value", "held"),
    [
        ("error_x_m.max", 0.5, False),
        ("error_x_m.max", 0.4, None),
        ("error_x_m.rms", 0.99, None),
        ("error_x_m.rms", 1.0, False),
        ("error_x_m.p99", 9.0, None),
        ("error_x_m.max", None, None),
    ],
)
def test_over_a_window_that_somebody_cut_a_bound_is_broken_if_no_rest_could_mend_it(
    metric: str, value: float | None, held: bool | None
) -> None:
    """Of a quarter of the window: a mean square of 1 is at best a quarter over the whole, an RMS of 0.5."""
    assert weighed(verdict(value, metric=metric, share=0.25, reached=False, cut=True)).held is held


def test_a_verdict_in_words_and_in_the_summary_has_figure_bound_and_window() -> None:
    found = Verdict(wanted(below=0.5, above=0.25), FOLLOWER, 0.123456, share=0.9, judged=False, reason="no ticks")
    assert str(found) == (
        "vehicle 2: error_x_m.max from 2 s to 10 s: found 0.1235; expected: below 0.5 and above 0.25: "
        "not judged: no ticks"
    )
    assert found.to_dict() == {
        "metric": "error_x_m.max", "follower": 2, "value": 0.123456, "from_s": 2.0, "to_s": 10.0, "below": 0.5,
        "above": 0.25, "held": None, "judged": False, "judged_share": 0.9, "reached": True, "reason": "no ticks",
    }  # fmt: skip
    alone = Verdict(wanted("min_separation_m", above=10.0), None, math.inf)
    assert str(alone) == "min_separation_m from 2 s to 10 s: found inf; expected: above 10: held"
    entry = alone.to_dict()
    assert (entry["value"], entry["held"]) == (None, True)
    assert not {"follower", "below", "reason"} & set(entry)
    assert str(verdict(None)).endswith("found no value; expected: below 0.5: broken")


def test_what_is_not_recorded_is_said_by_its_longest_part_and_counted() -> None:
    times_s = np.concatenate((np.arange(2.0, 3.0, 0.1), np.arange(7.0, 12.55, 0.1), [16.2, 20.0]))
    found = coverage(times_s, 0.0, 20.0, 0.1)
    assert found.gap_s == (pytest.approx(2.9), pytest.approx(7.0))
    assert str(found) == "not recorded from 2.9 s to 7.0 s"
    assert (found.rows, found.expected) == (times_s.size, 200)
    assert found.share == pytest.approx(times_s.size * 0.1 / 20.0), "fewer than half of the rows"
    whole = coverage(np.arange(0.0, 20.01, 0.1), 0.0, 20.0, 0.1)
    assert (whole.share, whole.gap_s, str(whole), whole.enough) == (1.0, None, "", True)


@pytest.mark.parametrize(
    ("gap_s", "share"), [(3.0, 1.0), (3.1, 1.0), (3.1 + 1e-4, (20.0 - 3.1001) / 20.0), (5.0, 0.75)]
)
def test_a_gap_counts_as_judged_up_to_3_s_and_a_period(gap_s: float, share: float) -> None:
    """At either end of the window and within."""
    for begin_s in (0.0, 8.0, 20.0 - gap_s):
        every_s, edges_s = np.arange(0.0, 20.01, 0.1), np.array([begin_s, begin_s + gap_s])
        kept_s = every_s[(every_s < edges_s[0]) | (every_s > edges_s[1])]
        times_s = np.sort(np.concatenate((kept_s, edges_s[(edges_s > 0.0) & (edges_s < 20.0)])))
        found = coverage(times_s, 0.0, 20.0, 0.1)
        assert found.share == pytest.approx(share)
        assert found.enough is (share >= 0.95)
        assert (found.gap_s is None) is (share == 1.0)


def test_half_of_the_rows_are_enough_and_a_longer_gap_may_be_allowed() -> None:
    every_s = np.arange(0.0, 20.0, 0.2)
    assert coverage(every_s, 0.0, 20.0, 0.1).share == 1.0, "100 of 200"
    assert coverage(every_s[1:], 0.0, 20.0, 0.1).share == pytest.approx(9.9 / 20.0)
    assert coverage(np.array([0.0, 10.0]), 0.0, 10.0, 1.0, gap_s=9.0).share == pytest.approx(0.2)
    assert coverage(np.arange(0.0, 30.0, 6.0), 0.0, 30.0, 6.0, gap_s=0.5).share == 1.0
    assert coverage(np.arange(0.0, 30.0, 6.0), 0.0, 30.0, 4.0, gap_s=0.5).share == pytest.approx(0.0)


def test_a_window_without_length_is_judged_by_a_row_in_it() -> None:
    assert coverage(np.array([5.0]), 5.0, 5.0, 0.1).share == 1.0
    assert coverage(np.array([]), 5.0, 5.0, 0.1).share == 0.0
    assert coverage(np.array([5.02]), 5.0, 5.05, 0.1).share == 1.0, "no more than the whole"


@pytest.mark.parametrize(
    ("times_s", "ends_s"),
    [
        ([0.0, 0.1, 9.9, 10.0, 10.1], 10.0),
        ([0.0, 0.1, 9.0], 9.0),
        ([0.0, 9.84, 10.5], 10.0),
        ([0.0, 9.86, 10.5], 9.86),
        ([0.0, 9.0, 10.0 + 1e-10], 10.0 + 1e-10),
        ([10.5], 10.0),
        ([], -math.inf),
    ],
)
def test_a_flight_was_flown_to_its_last_row_unless_a_late_one_hides_its_end(
    times_s: list[float], ends_s: float
) -> None:
    """Late is what comes more than one and a half periods after the row before it."""
    assert scored_end_s(np.array(times_s), 10.0, 0.1) == ends_s
