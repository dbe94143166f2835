"""Headings of two messages, reports of an estimator and commanded velocities: limits from both of their sides."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from airlink.clock import Instant, after
from airlink.messages import EKF_READY
from airlink.messages.system import Statustext
from airlink.messages.telemetry import Attitude, EkfStatusReport
from flight_model.autopilot_model import AutopilotModel
from flight_model.earth import GeodeticOrigin
from gcs_formation.features.telemetry_health.commanded_velocity import CommandedVelocity
from gcs_formation.features.telemetry_health.estimator_report import EstimatorReport
from gcs_formation.features.telemetry_health.nose import NoseCheck
from gcs_formation.features.telemetry_health.plate import telemetry_health
from gcs_formation.report import load_run
from gcs_formation.vehicle.telemetry import Telemetry
from tests.gcs_formation.report.conftest import make_run

__all__ = ["make_run"]
STEP_S = 0.1


class Pointing:
    """A multirotor whose nose stays north, reported as another heading in its positions."""

    def __init__(self) -> None:
        self.checked, self.at_s = NoseCheck(0.6), 10.0

    def tell(self, samples: int, off_rad: float, *, later_s: float = 0.0, rate_rps: float = 0.0) -> float:
        """Tell some whose positions are off, and later than attitudes; return what is flown."""
        for _ in range(samples):
            self.at_s += STEP_S
            attitude = Attitude(self.at_s, 0.0, 0.0, 0.0, 0.0, 0.0, rate_rps)
            flown = self.checked.take(attitude, off_rad % math.tau, self.at_s + later_s)
        return flown


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_headings_contradict_that_differ_by_a_quarter_radian_three_times(sign: float) -> None:
    pointing = Pointing()
    pointing.tell(30, sign * 0.24)
    assert pointing.checked.finding == ""
    pointing.tell(2, sign * 0.26)
    assert pointing.checked.finding == ""
    assert pointing.tell(1, sign * 0.26) % math.tau == pytest.approx((sign * 0.26) % math.tau)
    assert pointing.checked.finding == "its ATTITUDE's yaw is 15° off its positions' heading: flown by the latter"


@pytest.mark.parametrize(("later_s", "found"), [(0.14, True), (-0.14, True), (0.16, False), (-0.16, False)])
def test_headings_are_compared_whose_times_are_0_15_s_apart(later_s: float, found: bool) -> None:
    pointing = Pointing()
    pointing.tell(5, 0.2, later_s=later_s)
    pointing.tell(5, 0.3, later_s=later_s)
    assert (pointing.checked.finding != "") == found


def test_one_position_that_is_taken_again_contradicts_once() -> None:
    pointing = Pointing()
    for _ in range(9):
        pointing.checked.take(Attitude(10.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 1.0, 10.1)
    assert pointing.checked.finding == ""


def test_headings_that_agree_for_three_seconds_are_believed_again() -> None:
    pointing = Pointing()
    pointing.tell(5, 0.4)
    pointing.tell(29, 0.0)
    assert pointing.checked.finding != ""
    pointing.tell(2, 0.0)
    assert pointing.checked.finding == ""


def test_a_heading_is_carried_to_its_positions_time_by_the_yaw_rate() -> None:
    """0.5 rad/s for 0.1 s."""
    assert NoseCheck(0.6).take(Attitude(10.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.5), math.nan, 10.1) == pytest.approx(1.05)


@pytest.mark.parametrize("turn_rps", [1.2, -1.2])
def test_a_fast_turn_between_an_attitude_and_its_position_is_no_contradiction(turn_rps: float) -> None:
    """0.14 s after each attitude the heading is 0.168 rad further on, in the direction of the yaw rate."""
    checked, flown_rad = NoseCheck(1.5), math.nan
    for tick in range(40):
        at_s = 10.0 + tick * STEP_S
        yaw_rad, heading_rad = (math.remainder(turn_rps * each_s, math.tau) for each_s in (at_s, at_s + 0.14))
        attitude = Attitude(at_s, 0.0, 0.0, yaw_rad, 0.0, 0.0, turn_rps)
        flown_rad = checked.take(attitude, heading_rad % math.tau, at_s + 0.14)
        assert checked.finding == ""
    assert math.remainder(flown_rad - heading_rad, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_yaw_rates_are_integrated_by_their_mean() -> None:
    """From 0 to 0.4 rad/s in 0.1 s: 0.02 rad. An attitude that is taken twice moves nothing."""
    checked = NoseCheck(0.6)
    for at_s, rate_rps in ((10.0, 0.0), (10.1, 0.4), (10.1, 0.4), (10.2, 0.4)):
        checked.take(Attitude(at_s, 0.0, 0.0, 0.0, 0.0, 0.0, rate_rps), math.nan, at_s)
    assert checked._turned_rad == pytest.approx(0.06)


@pytest.mark.parametrize(("ratio", "found"), [(0.99, False), (1.0, True)])
def test_measurements_are_rejected_from_their_gate_on_and_twice_is_no_outlier(ratio: float, found: bool) -> None:
    seen, report = Telemetry(GeodeticOrigin(0.6, 2.1, 0.0)), EstimatorReport()
    for number in range(3):
        seen.store(EkfStatusReport(EKF_READY, ratio, 0.1, ratio, 0.1, 0.0))
        report.take(seen, after(Instant(0), float(number)))
        report.take(seen, after(Instant(0), number + 0.5))
        assert set(report.findings()) == ({"velocity", "height"} if found and number >= 1 else set())


def test_a_switch_of_lanes_is_remembered_for_five_seconds() -> None:
    seen, report = Telemetry(GeodeticOrigin(0.6, 2.1, 0.0)), EstimatorReport()
    seen.store(Statustext(2, "EKF primary changed:1"))
    for at_s, words in ((1.0, "EKF primary changed:1"), (6.0, "EKF primary changed:1"), (6.1, "")):
        report.take(seen, after(Instant(0), at_s))
        assert report.switched == words


@pytest.mark.parametrize(("gap_s", "follows"), [(1.0, True), (1.001, False), (-0.1, False)])
def test_a_commanded_velocity_begins_again_after_a_second_or_backwards_in_time(gap_s: float, follows: bool) -> None:
    witness = CommandedVelocity(AutopilotModel(0.8, 0.6, 0.3, 0.3, 0.0, 15.0, 20.0, 0.5, 1.5))
    witness.take(5_000_000_000, (8.0, 0.0, 30.0), (0.0, 3.0), stops=False)
    velocity = witness.take(5_000_000_000 + round(gap_s * 1e9), (8.0, 0.0, 30.0), (0.0, 3.0), stops=False)
    assert (velocity != pytest.approx([0.0, 3.0])) == follows
    assert witness.take(9_000_000_000, (math.nan, 0.0, 30.0), (0.0, 3.0), stops=False) == pytest.approx(
        [math.nan] * 2, nan_ok=True
    )


def test_a_figure_has_a_row_of_5_5_mm_for_each_quantity_and_thirty_at_most(make_run: Any) -> None:
    """Those that were doubted first; heights in inches of 2.54 cm."""
    run = load_run(make_run())
    reported = {"kind": "health", "vehicle": "2", "healthy": False, "text": ""}
    events = [reported | {"quantity": f"q{number}", "t_s": run.zero_s + 40.0 - number} for number in range(33)]
    figure = telemetry_health(replace(run, events=tuple(events)))
    (axes,) = figure.axes
    assert [each.get_text() for each in axes.get_yticklabels()] == [f"2: q{number}" for number in range(32, 2, -1)]
    assert axes.get_ylim() == (29.5, -0.5)
    assert figure.get_figheight() * 2.54 == pytest.approx(3.5 + 0.55 * 30)
    box = axes.collections[-1].get_paths()[0].get_extents()
    assert (box.y0, box.y1) == pytest.approx((28.65, 29.35))
