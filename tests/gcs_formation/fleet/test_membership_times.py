"""For how long what is known of a vehicle counts where its membership is decided."""

from __future__ import annotations

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from gcs_formation.vehicle.member import Member
from tests.gcs_formation.fleet.pair import GUIDED, LEADER, LOITER, Formation

FAILSAFE = "Failsafe. Long event on: type=3/reason=5"


@pytest.mark.parametrize(("age_s", "member"), [(2.0, Member.RETURNING), (4.0, Member.HOLDING)])
def test_one_that_loiters_comes_back_by_telemetry_of_two_seconds_ago_and_not_of_four(
    age_s: float, member: Member
) -> None:
    """Telemetry comes as late over a slow link as it may; one that flies on stays with what is older than 4 s."""
    formation = Formation()
    formation.silent(40.0)
    formation.reports(LOITER)
    formation.ages_s[1] = age_s
    assert formation.judge(41.0) is member
    staying = Formation()
    staying.ages_s[1] = 4.0
    assert staying.judge(1.0) is Member.FLYING


@pytest.mark.parametrize(("later_s", "member"), [(3.0, Member.RETURNING), (8.0, Member.PARTED)])
def test_one_that_loiters_three_seconds_after_the_last_command_obeys_it_and_eight_after_it_its_pilot(
    later_s: float, member: Member
) -> None:
    """A queue and a heartbeat may take 3 s: the vehicle wouldn't come back for a command that was ours.

    Later its pilot's choice would be undone.
    """
    formation = Formation()
    formation.beyond.add(formation.follower.identity)
    assert formation.judge(1.0) is Member.HOLDING
    formation.beyond.clear()
    assert formation.judge(2.0) is Member.FLYING
    formation.reports(LOITER)
    assert formation.judge(2.0 + later_s) is member


def test_all_leave_together_whose_last_heartbeats_came_in_one_second_and_before_a_silent_link_would_be_lost() -> None:
    """Each sends one a second, at a time of its own. Their modes are unknown since the heartbeat that is missing."""
    formation, left_s = Formation(), dict[int | None, float]()
    for tick in range(1, 90):
        now = after(Instant(0), 0.1 * tick)
        for each in formation.vehicles.values():
            leads = each is formation.vehicles[LEADER]
            each.connection.record_frame(now, heartbeat=leads and tick <= 9)
            each.round_trips._answered = now
            each.connection.check(now)
        formation.judge(0.1 * tick, received=False)
    for said in formation.logged:
        if said.text == Member.HOLDING.value:
            left_s[said.vehicle] = said.at_s
    assert left_s[1] == left_s[2]
    assert 4.5 < left_s[2] < 5.5


@pytest.mark.parametrize(("later_s", "failsafes"), [(-4.5, False), (-2.0, True), (2.0, True), (4.5, False)])
def test_a_failsafes_text_is_of_the_mode_that_changes_within_two_seconds_and_not_in_four(
    later_s: float, failsafes: bool
) -> None:
    """A heartbeat shows the mode a second late, or two if one is lost; after four a pilot may have chosen another."""
    formation, changes_s = Formation(), 10.0
    said_at = after(Instant(0), changes_s + later_s)
    if later_s < 0.0:
        formation.membership.receive(formation.follower, FAILSAFE, said_at)
    formation.reports(m.PLANE_MODE_RTL)
    assert formation.judge(changes_s) is Member.PARTED
    if later_s > 0.0:
        formation.membership.receive(formation.follower, FAILSAFE, said_at)
    said = formation.logged.of("member", 2)[-1]
    assert said == (f"parted by its failsafe: '{FAILSAFE}'" if failsafes else "parted by its pilot")


@pytest.mark.parametrize(("alone_s", "may_be"), [(2.0, True), (4.5, False)])
def test_one_that_nothing_has_reached_for_a_moment_may_be_flown_by_its_failsafe_two_seconds_later(
    alone_s: float, may_be: bool
) -> None:
    formation = Formation()
    formation.reports(GUIDED)
    formation.follower.left_alone(after(Instant(0), 10.0 - alone_s))
    formation.reports(m.PLANE_MODE_RTL)
    formation.judge(10.0)
    assert ("failsafe" in formation.logged.of("member", 2)[-1]) == may_be
