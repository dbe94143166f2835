"""Who flies in the formation, by what is seen of each vehicle."""

import pytest

from gcs_formation.fleet.membership_and_succession import MembershipInputs, following
from gcs_formation.vehicle.vehicle import Member

GUIDED = MembershipInputs(started=True, guided=True, loiters=False, fresh=True)
LOITERS = MembershipInputs(started=True, guided=False, loiters=True, fresh=True)
ELSEWHERE = MembershipInputs(started=True, guided=False, loiters=False, fresh=True)
SILENT = MembershipInputs(started=True, guided=True, loiters=False, fresh=False)
STARTS_ANEW = MembershipInputs(started=False, guided=True, loiters=True, fresh=True)


@pytest.mark.parametrize("member", list(Member))
def test_a_restart_leads_to_starting_from_everywhere(member: Member) -> None:
    assert following(member, STARTS_ANEW) is Member.STARTING


def test_silence_leads_to_loitering_and_back() -> None:
    told = following(Member.FLYING, SILENT)
    assert told is Member.HOLDING
    assert following(told, LOITERS) is Member.RETURNING
    assert following(Member.RETURNING, LOITERS) is Member.RETURNING
    assert following(Member.RETURNING, GUIDED) is Member.FLYING


def test_one_that_is_not_seen_is_told_nothing_until_it_is_told_blindly() -> None:
    unseen = SILENT._replace(loiter_may_be_commanded=False)
    unheard = following(Member.FLYING, unseen)
    assert unheard is following(unheard, unseen) is Member.UNHEARD
    assert following(unheard, SILENT) is Member.HOLDING
    assert following(unheard, GUIDED) is Member.FLYING
    assert following(Member.RETURNING, unseen) is Member.HOLDING


def test_an_outage_too_short_for_the_order_to_arrive_ends_at_once() -> None:
    assert following(Member.HOLDING, GUIDED) is Member.FLYING


@pytest.mark.parametrize("member", [Member.FLYING, Member.UNHEARD, Member.HOLDING, Member.RETURNING])
def test_a_pilots_choice_is_respected_until_the_pilot_gives_it_back(member: Member) -> None:
    parted = following(member, ELSEWHERE)
    assert parted is Member.PARTED
    assert following(parted, ELSEWHERE) is Member.PARTED
    assert following(parted, LOITERS) is Member.PARTED
    assert following(parted, GUIDED) is Member.FLYING


def test_an_order_to_loiter_that_comes_late_is_taken_back_and_isnt_a_pilots_choice() -> None:
    """After an outage the vehicle flies in formation again before the command sent meanwhile reaches it."""
    late = LOITERS._replace(order_may_come=True)
    for member in (Member.FLYING, Member.UNHEARD):
        assert following(member, late) is Member.RETURNING
        assert following(member, LOITERS) is Member.PARTED
        assert following(member, ELSEWHERE._replace(order_may_come=True)) is Member.PARTED
