"""When checks begin, what excuses a vehicle in them, and what is said; states and setpoints are made up."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import Instant, after
from flight_model.flight_state import FlightState
from formation_scenario import load_scenario
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.conformance import monitor
from gcs_formation.features.conformance.flown_setpoints import CHECKS_STUCK, NonConformance
from gcs_formation.from_scenario import autopilot_models
from gcs_formation.vehicle.reported_motion import ReportedMotion
from tests.flights.conftest import scenario
from tests.gcs_formation.features.conformance.test_flown_setpoints import flier
from tests.gcs_formation.features.conformance.test_monitor import Ground

START = Instant(0)
FIRST = 14
"""Checks until a failure is said: the eleventh, at 4.3 s, is the first of four after 4.2 s."""
FASTER, HIGHER = (27.0, 0.0, 100.0), (22.0, 0.0, 180.0)


class Judged:
    """One that is commanded from the start, every 0.1 s, and checked every 0.4 s."""

    def __init__(self, *, hovers: bool = False) -> None:
        self.flier, self.history, self.tenth = flier(hovers=hovers), SetpointHistory(10.0), 0
        self.flier.since = START

    def fly(
        self,
        checks: int,
        mps: float = 22.0,
        height_m: float = 100.0,
        climb_mps: float = 0.0,
        to: tuple[float, float, float] = (22.0, 0.0, 100.0),
        *,
        saturated: bool = False,
    ) -> list[NonConformance]:
        """Fly on at one airspeed, from a height on; return the failures found."""
        found = list[NonConformance]()
        for number in range(checks):
            for _ in range(4):
                now = after(START, 0.1 * self.tenth)
                self.history.begin_tick(vec[i64]([now]))
                self.history.record([to])
                self.tenth += 1
            seen = FlightState(0.0, 0.0, height_m + climb_mps * 0.4 * number, climb_mps, mps, 0.0, 0.0, 0.0)
            failure = self.flier.check(now, seen, self.history, now, saturated=saturated)
            found += [failure] if failure is not None else []
        return found


def said(found: list[NonConformance]) -> list[str]:
    return [each.channel for each in found]


def test_one_that_does_not_do_as_commanded_is_found_at_the_fourth_check_after_4_2_s() -> None:
    judged = Judged()
    assert judged.fly(FIRST - 1, to=FASTER) == []
    (found,) = judged.fly(9, to=FASTER)
    assert (found.channel, found.flown, found.over_s) == ("airspeed", 0.0, 3.2)
    assert 2.0 < found.expected < 5.0 * (1.0 - math.exp(-2.8 / 4.0)) + 0.2


def test_of_one_that_can_be_no_faster_nothing_is_expected() -> None:
    assert Judged().fly(FIRST + 9, to=FASTER, saturated=True) == []


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("climb_mps", "checks"), [(0.99, FIRST), (1.01, 79)])
def test_one_that_climbed_when_it_was_taken_over_has_thirty_seconds(sign: float, climb_mps: float, checks: int) -> None:
    """The 76th check, at 30.3 s, is then the first of four."""
    judged = Judged()
    judged.fly(1, climb_mps=sign * climb_mps, to=FASTER)
    assert judged.fly(checks - 2, to=FASTER) == []
    assert said(judged.fly(1, to=FASTER)) == ["airspeed"]


@pytest.mark.parametrize(("mps", "channels"), [(25.1, ["height"]), (25.3, [])])
def test_climbs_are_not_judged_of_one_that_flies_nearly_as_fast_as_it_can(mps: float, channels: list[str]) -> None:
    """0.9 of 28 m/s is 25.2 m/s. Descents are."""
    assert said(Judged().fly(FIRST + 20, mps, to=(mps, 0.0, 180.0))) == channels
    assert said(Judged().fly(FIRST + 2, mps, to=(mps, 0.0, 20.0))) == ["height"]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_heights_are_judged_eight_seconds_after_the_airspeed_was_2_mps_off(sign: float) -> None:
    """Twenty checks, and the fourth from then on."""
    near = Judged().fly(FIRST, to=(22.0 + 1.9 * sign, 0.0, 180.0), saturated=True)
    assert said(near) == ["height"]
    far = Judged()
    assert far.fly(FIRST + 2, to=(22.0 + 2.1 * sign, 0.0, 180.0), saturated=True) == []
    assert far.fly(22, to=HIGHER) == []
    assert said(far.fly(1, to=HIGHER)) == ["height"]
    hovers = Judged(hovers=True)
    assert said(hovers.fly(FIRST, to=(22.0 + 2.1 * sign, 0.0, 180.0), saturated=True)) == ["height"]


def test_one_that_is_not_judged_any_more_has_no_misses() -> None:
    judged = Judged()
    judged.fly(FIRST - 1, to=FASTER)
    assert judged.flier.bad == [3, 0, 0]
    judged.flier.since = None
    judged.fly(1, to=FASTER)
    assert (judged.flier.bad, judged.flier.good) == ([0, 0, 0], 0)


def test_failures_are_stated_in_degrees_and_metres() -> None:
    words = "acknowledges setpoints and doesn't follow them: {} expected"
    turn = NonConformance("heading", math.pi / 6.0, math.pi / 180.0)
    assert monitor._words(turn) == words.format("heading changed by 1.0 ° in 3.2 s, 30.0 °")
    assert monitor._words(NonConformance("height", 9.6, -1.0, 8.0)) == words.format(
        "height changed by -1.0 m in 8.0 s, 9.6 m"
    )
    assert monitor._words(NonConformance("airspeed", 3.0, 1.0)) == words.format(
        "airspeed changed by 1.0 m/s in 3.2 s, 3.0 m/s"
    )
    figures = {"order": "setpoints", "channel": "heading", "expected": turn.expected, "flown": turn.flown}
    assert monitor._figures(turn) == figures


@pytest.mark.parametrize("commanded_mps", [14.0, 0.5])
def test_the_heading_by_a_course_is_that_which_has_it_at_the_airspeed_commanded(commanded_mps: float) -> None:
    """In 4 m/s from the west north over ground needs sin w = -4 / v; at 10 m/s flown another course is known.

    A speed below 1 m/s is none.
    """
    mps = commanded_mps if commanded_mps > 1.0 else 10.0
    own = FlightState(0.0, 0.0, 100.0, 0.0, 10.0, -math.asin(4.0 / mps), 0.0, 4.0)
    shown = monitor._by_course(own, ReportedMotion(0.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0), commanded_mps)
    assert shown.heading_rad == pytest.approx(-math.asin(4.0 / mps))
    assert shown.airspeed_mps == 10.0
    east = monitor._by_course(own, ReportedMotion(0.0, 0.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0), commanded_mps)
    assert east.heading_rad == pytest.approx(math.pi / 2.0 - math.asin(4.0 / mps))
    assert monitor._by_course(own, None, commanded_mps).heading_rad == own.heading_rad


def test_noise_that_is_planned_is_allowed_for_in_radians() -> None:
    noisy = {"source": "noisy", "airspeed_sigma_mps": 0.7, "heading_sigma_deg": 3.0, "position_sigma_m": 2.5}
    assert (
        monitor._noise(load_scenario(scenario(vehicles={"count": 2, "navigation": noisy})))
        == [(0.7, pytest.approx(math.pi / 60.0), 2.5)] * 2
    )
    assert monitor._noise(load_scenario(scenario(vehicles={"count": 2}))) == [(0.0, 0.0, 0.0)] * 2


def test_models_are_taken_as_they_are_except_of_airframes_whose_steps_are_slower() -> None:
    """Four seconds at least."""
    planned = load_scenario(scenario(vehicles={"count": 2}))
    plain = [each.tau_v_s for each in autopilot_models(planned)]
    assert [each.tau_v_s for each in monitor._judged_by(planned)] == plain
    airframe = scenario(vehicles={"count": 1, "model": {"airframe": {}, "tau_v_s": 3.0}})
    assert [each.tau_v_s for each in monitor._judged_by(load_scenario(airframe))] == [4.0]


def test_after_standing_down_motion_is_judged_again() -> None:
    ground = Ground()
    tick: Any = SimpleNamespace(active=[True, False, True])
    ground.monitor._next_check = after(START, 1e6)
    ground.monitor.judge_motion(tick, after(START, 1.0))
    ground.monitor.judge_motion(tick, after(START, 2.0))
    assert [each.since for each in ground.monitor._fliers] == [after(START, 1.0), None, after(START, 1.0)]
    ground.monitor.stand_down()
    assert [each.since for each in ground.monitor._fliers] == [None] * 3


def test_motion_is_judged_every_0_4_s() -> None:
    ground = Ground()
    checked = list[float]()
    for flier_of in ground.monitor._fliers:
        own: Any = flier_of
        own.check = lambda _stamp, _seen, _history, now, **_: checked.append(now / 1e9)
    ground.fly(2.0)
    assert sorted(set(checked)) == pytest.approx([0.0, 0.4, 0.8, 1.2, 1.6])
    assert len(checked) == 15


def test_checks_at_which_it_does_not_climb_are_counted_without_a_pause_between_them() -> None:
    """A climb that wasn't commanded for 40 s used to be said to fail at the first check after, by checks before."""
    judged = Judged()
    above = (22.0, 0.0, 180.0)
    judged.fly(10, climb_mps=0.3, to=above)
    judged.flier.air_variance = 100.0  # air so rough that it may explain what is missing
    assert not judged.fly(CHECKS_STUCK - 1, climb_mps=0.3, to=above)
    judged.flier.since = None
    assert not judged.fly(100, to=(22.0, 0.0, 100.0))
    judged.flier.since = after(START, 0.1 * judged.tenth)
    assert not judged.fly(11, to=above)
