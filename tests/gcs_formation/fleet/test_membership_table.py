"""Who flies in the formation, by what is seen of each vehicle."""

from itertools import product

import pytest

from gcs_formation.fleet import membership_table
from gcs_formation.fleet.membership_table import TRANSITIONS, Seen
from gcs_formation.vehicle.member import Member
from tests.membership_page import PAGE, page


def next_membership(member: Member, **seen: bool) -> Member:
    return membership_table.next_membership(member, Seen(**seen))


RECEIVED = {"started": True, "fresh": True, "loiter_may_be_commanded": True, "order_may_come": False}
GUIDED = RECEIVED | {"guided": True, "loiters": False}
LOITERS = RECEIVED | {"guided": False, "loiters": True}
ELSEWHERE = RECEIVED | {"guided": False, "loiters": False}
SILENT = GUIDED | {"fresh": False}
STARTS_ANEW = RECEIVED | {"started": False, "guided": True, "loiters": True}


@pytest.mark.parametrize("member", list(Member))
def test_a_restart_leads_to_starting_from_everywhere(member: Member) -> None:
    assert next_membership(member, **STARTS_ANEW) is Member.STARTING


def test_silence_leads_to_loitering_and_back() -> None:
    told = next_membership(Member.FLYING, **SILENT)
    assert told is Member.HOLDING
    assert next_membership(told, **LOITERS) is Member.RETURNING
    assert next_membership(Member.RETURNING, **LOITERS) is Member.RETURNING
    assert next_membership(Member.RETURNING, **GUIDED) is Member.FLYING


def test_one_that_is_not_seen_is_commanded_nothing_until_it_is_commanded_blindly() -> None:
    unseen = SILENT | {"loiter_may_be_commanded": False}
    silent = next_membership(Member.FLYING, **unseen)
    assert silent is next_membership(silent, **unseen) is Member.NO_LINK
    assert next_membership(silent, **SILENT) is Member.HOLDING
    assert next_membership(silent, **GUIDED) is Member.FLYING
    assert next_membership(Member.RETURNING, **unseen) is Member.HOLDING


def test_an_outage_too_short_for_the_order_to_arrive_ends_at_once() -> None:
    assert next_membership(Member.HOLDING, **GUIDED) is Member.FLYING


@pytest.mark.parametrize("member", [Member.FLYING, Member.NO_LINK, Member.HOLDING, Member.RETURNING])
def test_a_pilots_choice_is_respected_until_the_pilot_gives_it_back(member: Member) -> None:
    parted = next_membership(member, **ELSEWHERE)
    assert parted is Member.PARTED
    assert next_membership(parted, **ELSEWHERE) is Member.PARTED
    assert next_membership(parted, **LOITERS) is Member.PARTED
    assert next_membership(parted, **GUIDED) is Member.FLYING


def test_an_order_to_loiter_that_comes_late_is_taken_back_and_isnt_a_pilots_choice() -> None:
    """After an outage the vehicle flies in formation again before the command sent meanwhile reaches it."""
    late = LOITERS | {"order_may_come": True}
    for member in (Member.FLYING, Member.NO_LINK):
        assert next_membership(member, **late) is Member.RETURNING
        assert next_membership(member, **LOITERS) is Member.PARTED
        assert next_membership(member, **ELSEWHERE | {"order_may_come": True}) is Member.PARTED


@pytest.mark.parametrize("member", [Member.FLYING, Member.NO_LINK, Member.HOLDING, Member.RETURNING])
def test_one_that_is_sent_home_flies_there_until_its_pilot_takes_it(member: Member) -> None:
    """A pilot who has it already keeps it; given back, it is sent home."""
    assert next_membership(member, **GUIDED, sent_home=True) is Member.HOMEWARD
    assert next_membership(member, **ELSEWHERE, sent_home=True) is Member.PARTED
    obeyed = ELSEWHERE | {"sent_home": True, "homeward": True}
    for seen in (GUIDED | {"sent_home": True}, LOITERS | {"sent_home": True}, obeyed, obeyed | {"fresh": False}):
        assert next_membership(Member.HOMEWARD, **seen) is Member.HOMEWARD
    assert next_membership(Member.HOMEWARD, **ELSEWHERE, sent_home=True) is Member.PARTED
    assert next_membership(Member.PARTED, **ELSEWHERE, sent_home=True) is Member.PARTED


def test_every_row_of_the_table_decides_somewhere() -> None:
    names = (
        "started",
        "guided",
        "loiters",
        "fresh",
        "loiter_may_be_commanded",
        "order_may_come",
        "sent_home",
        "homeward",
    )
    deciding = set()
    for member, *known in product(Member, *[(False, True)] * len(names)):
        seen = Seen(**{name: bool(each) for name, each in zip(names, known, strict=True)})
        deciding.add(next(i for i, row in enumerate(TRANSITIONS) if member in row.of and row.holds(seen)))
    assert deciding == set(range(len(TRANSITIONS)))


def test_the_page_of_membership_is_that_of_the_table() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "write it again: python -m tests.membership_page"
