"""How long the formation separates, and which heights are left to those that may not do as commanded."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest

from airlink.clock import after
from gcs_formation.core.cycle import Cycle
from gcs_formation.estimation.projection import FORGOTTEN_AFTER_S
from gcs_formation.features.ending.ending import SeparatedEnding
from gcs_formation.features.ending.holding_stack import HoldingStack
from gcs_formation.features.ending.stages import AtEndHeights, EndHeights
from gcs_formation.features.ending.vertical_separation import VerticalSeparation
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.reported_motion import ReportedMotion
from tests.gcs_formation.features.ending.test_vertical_separation import NOW, at, separation_of

LIMIT_S = 60.0
"""Of `separation_of`; vehicles climb at 3 m/s."""


def received(separation: Any, height_m: float) -> list[tuple[int, int]]:
    """Let the history say which height a vehicle received last; return what it is asked."""
    asked = list[tuple[int, int]]()

    def commanded(since: int, index: int) -> tuple[float, float, float]:
        asked.append((since, index))
        return 22.0, 0.0, height_m

    separation._controller.history = SimpleNamespace(commanded=commanded)
    return asked


def heard(each: list[Any], at_s: float) -> None:
    """Let all have been received at a time."""
    for vehicle in each:
        vehicle.connection.last_received = after(NOW, at_s)


@pytest.mark.parametrize(("at_s", "over"), [(LIMIT_S - 0.1, False), (LIMIT_S, True)])
def test_without_progress_it_is_over_at_its_time_limit(at_s: float, over: bool) -> None:
    separation, _, links, _ = separation_of(100.0, 100.0)
    separation.steer(links, NOW)
    assert separation.over(after(NOW, at_s)) is over


def test_it_is_over_as_soon_as_all_are_apart_and_were_stated_so() -> None:
    separation, (_, second), links, tick = separation_of(100.0, 100.0)
    assert separation.steer(links, NOW) == [100.0, 115.0]
    assert not separation.over(NOW)
    tick.setpoints[1][2] = 115.0
    second.telemetry.motion = at(109.9)
    separation.steer(links, NOW)
    assert not separation.over(NOW)
    second.telemetry.motion = at(110.0)
    separation.steer(links, NOW)
    assert separation.over(NOW)


@pytest.mark.parametrize(
    ("north_mps", "east_mps", "over"), [(0.49, 0, True), (0, -0.51, False), (0.3, 0.4, True), (0.3, 0.41, False)]
)
def test_those_that_stop_are_waited_for_until_all_hover(north_mps: float, east_mps: float, over: bool) -> None:
    separation, (vehicle,), links, tick = separation_of(100.0)
    stopping = VerticalSeparation(
        HoldingStack(10.0), separation._controller, {vehicle.identity: vehicle}, NOW, LIMIT_S, 3.0, stops=True
    )
    vehicle.telemetry.motion = ReportedMotion(0.0, 0.0, 0.0, 100.0, north_mps, east_mps, 0.0, 100.0)
    assert stopping.steer(links, NOW) == [tick.setpoints[0][2]]
    assert stopping.over(NOW) is over
    assert stopping.over(after(NOW, LIMIT_S))
    separation.steer(links, NOW)
    assert separation.over(NOW), "it needn't hover"
    links[0].ready = False
    stopping.steer(links, NOW)
    assert stopping.over(NOW), "it isn't steered, so it needn't be waited for"


@pytest.mark.parametrize(
    ("begins_s", "limit_s"), [(0.0, 315.0 / 3.0 + 15.0), (10.0, 130.0), (175.0, 295.0), (190.0, 300.0), (299.0, 300.0)]
)
def test_when_heights_change_there_is_time_for_the_longest_climb_and_15_s_but_300_s_at_most(
    begins_s: float, limit_s: float
) -> None:
    """One circles somewhere from 100 to 400 m; the other climbs by 315 m at 3 m/s."""
    separation, (first, lost), links, _ = separation_of(100.0, 100.0)
    heard([first, lost], begins_s)
    links[1].ready, lost.member, lost.holds_at_m = False, Member.HOLDING, 400.0
    received(separation, math.nan)
    assert separation.steer(links, after(NOW, begins_s)) == [415.0, 400.0]
    assert not separation.over(after(NOW, limit_s - 0.1))
    assert separation.over(after(NOW, limit_s))


def test_a_short_climb_is_given_30_s_and_a_time_limit_is_never_shortened() -> None:
    """Heights change after 50 s: 80 s in all; no change leaves 60 s."""
    separation, each, links, _ = separation_of(100.0, 100.0)
    each[1].telemetry.armed = False
    assert separation.steer(links, NOW)[0] == 100.0
    each[1].telemetry.armed = True
    heard(each, 50.0)
    assert separation.steer(links, after(NOW, 50.0)) == [100.0, 115.0]
    assert not separation.over(after(NOW, 79.9))
    assert separation.over(after(NOW, 80.0))


@pytest.mark.parametrize(("silent_s", "answers"), [(5.0, True), (5.01, False)])
def test_one_that_has_not_answered_for_5_s_may_be_at_any_height_since_it_last_received(
    silent_s: float, answers: bool
) -> None:
    """It is at 100 m, received 107 m last, and was commanded 118 m since: 15 m above that are clear, 115 m aren't."""
    separation, (_, lost), links, tick = separation_of(100.0, 100.0)
    asked = received(separation, 107.0)
    separation.steer(links, NOW)
    tick.setpoints[1][2], links[1].received_at = 118.0, 77
    lost.round_trips = SimpleNamespace(received_at=lambda now: after(now, -silent_s))
    assert separation.steer(links, after(NOW, 20.0)) == ([100.0, 115.0] if answers else [133.0, 118.0])
    assert asked == ([] if answers else [(77, 1)])


@pytest.mark.parametrize("member", [Member.HOLDING, Member.RETURNING])
def test_one_that_was_stated_to_circle_is_between_its_height_the_last_it_received_and_that_of_its_circle(
    member: Member,
) -> None:
    separation, (_, circles), links, _ = separation_of(92.0, 100.0)
    received(separation, 107.0)
    links[1].ready, circles.member, circles.holds_at_m = False, member, 90.0
    assert separation.steer(links, NOW) == [122.0, 90.0]


def test_one_whose_link_is_not_ready_keeps_the_height_that_it_reports() -> None:
    separation, _, links, tick = separation_of(100.0, 104.0)
    links[1].ready, tick.setpoints[1][2] = False, 150.0
    assert separation.steer(links, NOW) == [119.0, 104.0]


def test_without_a_leader_that_is_ready_none_is_steered_and_none_moves() -> None:
    separation, _, links, _ = separation_of(100.0, 104.0)
    links[0].ready = False
    assert separation.steer(links, NOW) == [100.0, 104.0]
    assert separation.over(NOW), "there is none who could be moved"


def test_before_the_first_tick_no_height_has_been_commanded() -> None:
    separation, _, links, _ = separation_of(100.0, 100.0)
    separation._controller.last_tick = None
    assert separation.steer(links, NOW) == [100.0, 115.0]
    links[0].ready = False
    received(separation, math.nan)
    for link in links:
        link.disobeying = True
    assert separation.steer(links, after(NOW, 9.0)) == [100.0, 100.0]


def test_one_that_climbs_out_counts_as_there_where_its_take_off_ends() -> None:
    """It is 12 m above its home at 60 m, and climbs to 45 m above that; the others don't wait for it."""
    separation, (first, climbs), links, _ = separation_of(100.0, 72.0)
    climbs.telemetry.motion = ReportedMotion(0.0, 0.0, 0.0, 72.0, 22.0, 0.0, 3.0, 12.0)
    climbs.autopilot = SimpleNamespace(climbs_out=lambda seen: seen is climbs.telemetry, take_off_m=45.0)
    assert separation.steer(links, NOW) == [100.0, 115.0]
    flier = separation._fliers[climbs.identity]
    assert (flier.motion.height_m, flier.commanded_m, flier.band, flier.steered) == (105.0, 105.0, None, False)
    assert separation._fliers[first.identity].steered


def test_who_lacks_a_height_is_commanded_none_and_each_gets_its_own_by_its_index() -> None:
    separation, (first, second, third), links, _ = separation_of(100.0, 100.0, 100.0)
    first.index, third.index, second.telemetry.motion = 2, 0, None
    heights_m = separation.steer(links, NOW)
    assert math.isnan(heights_m[1])
    assert (heights_m[2], heights_m[0]) == (100.0, 115.0)


def cycle_of(ending: Any) -> Any:
    controller = SimpleNamespace(fly_at=Mock())
    return SimpleNamespace(opening=ending, links=[1, 2], now=NOW, tick=object(), controller=controller)


def test_the_heights_of_an_ending_that_is_under_way_replace_the_laws_and_no_others() -> None:
    ending = SeparatedEnding.__new__(SeparatedEnding)
    ending._separation = Mock()
    ending._separation.steer.return_value = [100.0, math.nan]
    chosen = EndHeights()
    replaces, cycle = AtEndHeights(chosen), cycle_of(ending)
    chosen.run(cycle)
    replaces.run(cycle)
    ending._separation.steer.assert_called_once_with([1, 2], NOW)
    cycle.controller.fly_at.assert_called_once_with(cycle.tick, [100.0, math.nan])
    for other in (None, SimpleNamespace(steer=lambda *_: [1.0])):
        plain: Cycle = cycle_of(other)
        chosen.run(plain)
        replaces.run(plain)
        assert chosen.heights_m is None
        plain.controller.fly_at.assert_not_called()  # type: ignore[attr-defined]


@pytest.mark.parametrize(("silent_s", "counts"), [(FORGOTTEN_AFTER_S, True), (FORGOTTEN_AFTER_S + 0.1, False)])
def test_one_that_is_silent_keeps_its_height_until_it_is_forgotten(silent_s: float, counts: bool) -> None:
    separation, (first, _), links, _ = separation_of(100.0, 100.0)
    heard([first], silent_s)
    _, height_m = separation.steer(links, after(NOW, silent_s))
    assert math.isnan(height_m) is not counts
