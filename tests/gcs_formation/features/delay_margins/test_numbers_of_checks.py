"""After how many checks, one a second, and at which shares of a margin gains are changed and holds end, in numbers."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from gcs_formation.features.delay_margins.stages import GainDesign
from gcs_formation.phases import Phase
from tests.gcs_formation.features.delay_margins.test_margin_watch import NOW, Formation, Slow


def test_gains_are_lowered_from_nine_tenths_of_a_margin_on_and_raised_after_ten_checks_below_half() -> None:
    formation = Formation(on_delay="degrade")
    formation.use(0.89)
    assert min(formation.watch.bandwidth[1]) == 1.0
    formation.use(0.91)
    lowered = list(formation.watch.bandwidth[1])
    assert min(lowered) < 1.0
    for _ in range(9):
        formation.use(0.2)
    assert formation.watch.bandwidth[1] == lowered
    formation.use(0.2)
    assert formation.watch.bandwidth[1] == [1.0] * 3


def test_lowered_gains_leave_seven_tenths_of_the_margin_in_use() -> None:
    """Of the axis that uses most; shares of the bandwidth are in steps."""
    formation = Formation(on_delay="degrade")
    assert formation.use(1.5) == pytest.approx(0.7, abs=0.03)


def test_a_vehicle_is_held_for_twenty_checks() -> None:
    formation = Formation(on_delay="hold")
    for _ in range(19):
        formation.use(1.2)
    assert not [text for text in formation.logged.of("delay_margin", 2) if text.startswith("was held for 20 s")]
    formation.use(1.2)
    assert [text for text in formation.logged.of("delay_margin", 2) if text.startswith("was held for 20 s")]


@pytest.mark.parametrize(("share", "said"), [(0.79, 0), (0.81, 1)])
def test_eight_tenths_of_a_margin_are_near_it_and_less_than_seven_are_well_inside(share: float, said: int) -> None:
    formation = Formation()
    formation.use(share)
    assert len(formation.logged) == said
    formation.use(0.71)
    assert len(formation.logged) == said
    for _ in range(3):
        formation.use(0.69)
        assert len(formation.logged) == 2 * said
    formation.use(0.81)
    assert len(formation.logged) == 2 * said + 1, "it is near it again"


@pytest.mark.parametrize(("calm", "held"), [(12, False), (30, True)])
def test_after_a_long_hold_it_is_held_again_once_it_was_well_inside_for_as_long(calm: int, held: bool) -> None:
    """Its gains are the scenario's again after ten checks."""
    formation = Formation(on_delay="hold")
    for share, checks in ((1.3, 21), (0.1, calm)):
        for _ in range(checks):
            formation.use(share)
    assert formation.watch.bandwidth[1] == [1.0] * 3
    assert formation.use(1.3) == (pytest.approx(1.3) if held else pytest.approx(0.7, abs=0.03))
    assert (formation.follower.identity in formation.watch.beyond) == held


def test_while_any_of_its_gains_is_lowered_after_a_long_hold_it_is_not_held_again() -> None:
    """Not all of its axes have lower gains: the link then becomes slower still."""
    formation = Formation(on_delay="hold")
    for _ in range(60):
        formation.use(1.3)
    shares = formation.watch.bandwidth[1]
    assert min(shares) < 1.0 == max(shares)
    assert formation.use(2.0) < 0.75
    assert formation.follower.identity not in formation.watch.beyond


def test_after_a_design_five_checks_of_slower_links_are_needed_again() -> None:
    slow = Slow()
    assert slow.look(0.3, begins=True) is not None
    assert [slow.look(0.6) is not None for _ in range(5)] == [False] * 4 + [True]


def test_in_flight_gains_are_designed_after_five_checks_of_slow_links() -> None:
    slow = Slow()
    assert [slow.look(0.3) is not None for _ in range(5)] == [False] * 4 + [True]
    assert slow.watch.scenario.law.design_delay_ms == pytest.approx(300.0)


def test_the_stage_in_flight_does_not_design_before_its_fifth_run() -> None:
    slow, findings = Slow(), SimpleNamespace(tuned=None)
    slow.clocks[1].one_way_s = 0.3
    cycle: Any = SimpleNamespace(flight=SimpleNamespace(phase=Phase.FLYING), now=NOW, findings=findings)
    for number in range(1, 6):
        GainDesign(slow.watch).run(cycle)
        assert len(slow.logged) == (number == 5)
        assert findings.tuned is slow.watch.scenario


def test_gains_are_not_designed_while_no_delay_is_known() -> None:
    slow = Slow()
    assert [slow.look(math.nan, begins=begins) for begins in (True, False)] == [None, None]
    assert slow.logged == []


def test_a_mutual_laws_gains_are_not_designed_for_slower_links() -> None:
    slow = Slow("law.type=consensus")
    assert [slow.look(0.3, begins=begins) for begins in (True, *[False] * 6)] == [None] * 7
    assert slow.logged == []


def test_a_check_well_inside_makes_up_for_one_of_a_hold() -> None:
    """Nineteen less five are fourteen: six more are twenty."""
    formation, said = Formation(on_delay="hold"), list[bool]()
    for share, checks in ((1.3, 19), (0.3, 5), (1.3, 6)):
        for _ in range(checks):
            formation.use(share)
            texts = formation.logged.of("delay_margin", 2)
            said.append(any(text.startswith("was held for 20 s") for text in texts))
    assert said == [False] * 29 + [True]


@pytest.mark.parametrize("share", [1.05, 1.2, 1.25, 1.6])
def test_one_that_was_held_for_long_follows_with_lower_gains_whatever_share_they_leave(share: float) -> None:
    """At 1.2 an axis of 0.83, which keeps its gains, used to hold the vehicle for good."""
    formation = Formation(on_delay="hold")
    for _ in range(40):
        formation.use(share)
    assert formation.follower.identity not in formation.watch.beyond
    assert min(formation.watch.bandwidth[1]) < 1.0
