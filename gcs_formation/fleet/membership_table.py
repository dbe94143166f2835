"""Membership in the formation: who is commanded setpoints, who is left to a pilot, who waits.

**Problem.** At every tick each vehicle is commanded setpoints, commanded to loiter or to come back, or left alone.
Seven things that are known of it overlap: its start-up, its mode, its pilot's choice, the age of its telemetry, whether
frames of it are received, a command on its way to it, and what it did until now. A wrong answer is dangerous in both
directions: setpoints to a vehicle that a pilot flies by hand, or silence to one that flies on by its last setpoint.

**Method.** One table of transitions, read from top to bottom at every tick; the first row that holds decides
(`TRANSITIONS`, a decision table with priorities). So a restart comes before everything, a pilot before silence, and
silence before a return, as what a silent vehicle does isn't known. A mode to which none of our commands leads is a
pilot's choice, or a failsafe's if the vehicle says so in time. Silence can't be told from a slow link (T. D. Chandra,
S. Toueg, "Unreliable failure detectors for reliable distributed systems", Journal of the ACM 43(2), 1996): a vehicle
that is suspected keeps its place in the others' plans. Others keep clear of it for `FORGOTTEN_AFTER_S`, and only then
is it commanded to loiter, blindly, for until then the command would make it turn off where none expects that. To return
takes fresher telemetry than to stay (`BACK_S`), so that membership doesn't alternate.

**Why this.** Flags that are set and cleared where something happens had seven owners, and their combinations no test. A
chart of states with events as arrows needs an arrow for each order in which two events may come; a table of conditions
doesn't depend on the order, and a lost event can't leave it in a wrong state, for what is known is read again at each
tick.

**Costs and limits.** At most ten comparisons for each vehicle and tick. A pilot who chooses GUIDED, or LOITER while a
command of ours to loiter may still be on its way, can't be told from our own command: the first is commanded on, the
second counts as ours until the next change. No memory of why a vehicle left, but the event.

**Shown by** `tests/gcs_formation/fleet/test_membership_table.py` (every row decides somewhere) and
`test_membership.py`. docs/membership.md has the table and its diagram, written from here by `python -m
tests.membership_page`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from gcs_formation.vehicle.member import Member


class Seen:
    """What is known of a vehicle."""

    def __init__(
        self,
        *,
        started: bool,
        guided: bool,
        loiters: bool,
        fresh: bool,
        loiter_may_be_commanded: bool,
        order_may_come: bool,
        sent_home: bool = False,
        homeward: bool = False,
    ) -> None:
        """Take it.

        Args:
            started: whether the start-up is finished and the autopilot isn't booting.
            guided: whether it's in the mode in which it follows setpoints, by its pilot's choice, too.
            loiters: whether it's in its loiter mode.
            fresh: whether its telemetry is recent enough for prediction and there is a leader to follow.
            loiter_may_be_commanded: whether it is received, or has been silent for so long that the others no longer
                keep clear of it.
            order_may_come: whether a recently sent command to loiter may still reach it.
            sent_home: whether it is to fly home while the others fly on.
            homeward: whether it's in the mode in which it flies home.
        """
        self.started, self.guided, self.loiters, self.fresh = started, guided, loiters, fresh
        self.loiter_may_be_commanded, self.order_may_come = loiter_may_be_commanded, order_may_come
        self.sent_home, self.homeward = sent_home, homeward


class Transition:
    """A row of the table."""

    def __init__(self, of: tuple[Member, ...], to: Member, when: str, holds: Callable[[Seen], bool]) -> None:
        """Lead from memberships `of` to one, when `holds`, in words `when`."""
        self.of, self.to, self.when, self.holds = of, to, when, holds


ALL: Final[tuple[Member, ...]] = tuple(Member)
COMMANDABLE: Final = (Member.FLYING, Member.NO_LINK, Member.HOLDING, Member.RETURNING)
"""Memberships of vehicles that neither start nor are left to their pilots."""
UNCOMMANDED: Final = (Member.FLYING, Member.NO_LINK)
"""Memberships of vehicles that haven't been commanded to loiter."""

TRANSITIONS: Final[tuple[Transition, ...]] = (
    Transition(ALL, Member.STARTING, "its start-up isn't finished, or it boots", lambda seen: not seen.started),
    Transition((Member.STARTING,), Member.FLYING, "it has started", lambda _: True),
    # A pilot's change of mode is respected until the pilot reverts it.
    Transition((Member.PARTED,), Member.FLYING, "its pilot has given it back: it is guided", lambda seen: seen.guided),
    Transition((Member.PARTED,), Member.PARTED, "its pilot has it still", lambda _: True),
    Transition(
        COMMANDABLE,
        Member.PARTED,
        "it is in a mode to which none of our commands leads",
        lambda seen: not (seen.guided or seen.loiters),
    ),
    Transition(
        UNCOMMANDED,
        Member.PARTED,
        "it loiters, and no command of ours to do so is on its way",
        lambda seen: seen.loiters and not (seen.guided or seen.order_may_come),
    ),
    Transition(COMMANDABLE, Member.HOMEWARD, "it is to fly home", lambda seen: seen.sent_home),
    Transition(
        (Member.HOMEWARD,),
        Member.HOMEWARD,
        "it flies home, or hasn't obeyed yet",
        lambda seen: seen.homeward or seen.guided or seen.loiters,
    ),
    Transition((Member.HOMEWARD,), Member.PARTED, "its pilot has chosen another mode", lambda _: True),
    # A silent vehicle may not receive a command to loiter, and flies on by its last setpoint; the others keep clear.
    Transition(
        UNCOMMANDED,
        Member.NO_LINK,
        "it can't be flown by what is known of it, and may not receive the command to loiter",
        lambda seen: not seen.fresh and not seen.loiter_may_be_commanded,
    ),
    Transition(COMMANDABLE, Member.HOLDING, "it can't be flown by what is known of it", lambda seen: not seen.fresh),
    Transition(COMMANDABLE, Member.FLYING, "it is guided and known", lambda seen: seen.guided),
    Transition(COMMANDABLE, Member.RETURNING, "it loiters by our command, and is known", lambda _: True),
)


def next_membership(member: Member, seen: Seen) -> Member:
    """Return the next membership: that of the first row of the table that holds."""
    for row in TRANSITIONS:
        if member in row.of and row.holds(seen):
            return row.to
    raise AssertionError(f"found no row for {member}; the table has one for each")
