"""An expectation is judged over what was flown: a green result means what it says."""

from __future__ import annotations

from formation_scenario import load_scenario
from gcs_formation.record.expectations import Verdict, judge
from tests.gcs_formation.record.test_flight import KEYS, flown

FLOWN_S = 10.0
PARTS = {"duration_s": FLOWN_S, "followers": {str(system): {"settled_at_s": 0.0} for system in (1, 2, 3)}}


def verdict(cut_short: bool = False, **expect) -> Verdict:
    """Return what comes of an expectation of the second vehicle, flown for 10 s without any error."""
    entry = {"metric": "error_x_m.max", "followers": [2], "below": 0.1} | expect
    scenario = load_scenario(KEYS | {"duration_s": 100, "expect": [entry]})
    (found,) = judge(scenario, flown(), PARTS, {}, cut_short)
    return found


def test_a_window_that_was_flown_is_judged_whatever_ended_the_flight_after_it():
    for cut_short in (False, True):
        assert verdict(cut_short, to_s=FLOWN_S).held is True
        assert verdict(cut_short, to_s=FLOWN_S, below=-1).held is False


def test_a_window_that_the_flight_s_own_end_cut_short_is_broken_with_the_time_to_which_it_was_flown():
    found = verdict(from_s=2, to_s=90)
    assert (found.held, found.judged, found.reached) == (False, True, False)
    assert str(found).endswith("expected: below 0.1: broken: flown to 10.0 s of 90 s")
    assert verdict(from_s=50, to_s=90).held is False  # never begun


def test_a_window_that_somebody_cut_short_is_not_judged():
    found = verdict(cut_short=True, from_s=2, to_s=90)
    assert (found.held, found.judged, found.reached) == (None, False, False)
    assert str(found).endswith("not judged: flown to 10.0 s of 90 s")
    assert found.to_dict()["reason"] == "flown to 10.0 s of 90 s"


def test_a_window_may_end_with_the_last_tick_before_it():
    assert verdict(to_s=FLOWN_S + 0.1).held is True
    assert verdict(to_s=FLOWN_S + 0.2).held is False
