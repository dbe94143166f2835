"""When a leader counts as lost."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant, after
from gcs_formation.features.succession.stages import is_lost
from gcs_formation.fleet.membership import SUCCESSION_S
from gcs_formation.link.frame_loss import STALE_AFTER_S
from gcs_formation.link.link_health import LOST_AFTER_S
from gcs_formation.vehicle.member import Member
from tests.gcs_formation.fleet.pair import LEADER, Formation


def cycle(formation: Formation, now: Instant, *, sinks: bool = False) -> Any:
    findings = SimpleNamespace(beyond=set(), sinking={LEADER} if sinks else set())
    controller = SimpleNamespace(estimator=formation.estimator)
    return SimpleNamespace(membership=formation.membership, controller=controller, findings=findings, now=now)


@pytest.mark.parametrize(
    ("late_s", "replaceable", "lost"),
    [(SUCCESSION_S - 0.1, True, False), (SUCCESSION_S + 0.1, True, True), (SUCCESSION_S + 0.1, False, False)],
)
def test_a_leader_that_can_be_replaced_is_given_up_sooner_than_one_that_can_not(
    late_s: float, replaceable: bool, lost: bool
) -> None:
    formation = Formation()
    assert late_s < formation.max_age_s
    formation.ages_s[0], now = late_s, after(Instant(0), late_s)
    assert is_lost(formation.vehicles[LEADER], cycle(formation, now), lambda: replaceable) is lost


@pytest.mark.parametrize(("silent_s", "lost"), [(2.5, False), (4.5, True)])
def test_a_leader_is_replaced_after_more_than_a_burst_of_losses_and_before_its_link_counts_as_lost(
    silent_s: float, lost: bool
) -> None:
    """Each succession moves all slots; and until it followers fly by a guess: 100 m at 22 m/s in 4.5 s."""
    assert STALE_AFTER_S < silent_s < LOST_AFTER_S
    formation = Formation()
    formation.ages_s[0], now = silent_s, after(Instant(0), silent_s)
    assert is_lost(formation.vehicles[LEADER], cycle(formation, now), lambda: True) is lost


@pytest.mark.parametrize(
    ("sinks", "replaceable", "lost"), [(True, True, True), (True, False, False), (False, True, False)]
)
def test_a_leader_that_sinks_is_lost_where_it_can_be_replaced(sinks: bool, replaceable: bool, lost: bool) -> None:
    formation = Formation()
    leader = formation.vehicles[LEADER]
    assert is_lost(leader, cycle(formation, formation.now, sinks=sinks), lambda: replaceable) is lost
    assert leader.member is Member.FLYING
