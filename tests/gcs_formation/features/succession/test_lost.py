"""When a leader counts as lost."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant, after
from gcs_formation.features.succession.stages import is_lost
from gcs_formation.fleet.membership import SUCCESSION_S
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


@pytest.mark.parametrize(
    ("sinks", "replaceable", "lost"), [(True, True, True), (True, False, False), (False, True, False)]
)
def test_a_leader_that_sinks_is_lost_where_it_can_be_replaced(sinks: bool, replaceable: bool, lost: bool) -> None:
    formation = Formation()
    leader = formation.vehicles[LEADER]
    assert is_lost(leader, cycle(formation, formation.now, sinks=sinks), lambda: replaceable) is lost
    assert leader.member is Member.FLYING
