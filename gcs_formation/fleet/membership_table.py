"""The states of a vehicle's membership in the formation: one table of all transitions, read from top to bottom.

Seven things that are known of a vehicle overlap: its start-up, its mode, its pilot's choice, the age of its telemetry,
whether it is heard, a command on its way to it, and what it did until now. The first row that holds decides. So a
restart comes before everything, a pilot before silence, and silence before a return: what a vehicle that isn't heard
does isn't known. docs/membership.md shows the table and its diagram; both are written from here.
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
    ) -> None:
        """Take it.

        Args:
            started: whether the start-up is finished and the autopilot isn't booting.
            guided: whether it's in the mode in which it follows setpoints, by its pilot's choice, too.
            loiters: whether it's in its loiter mode.
            fresh: whether its telemetry is recent enough for prediction and there is a leader to follow.
            loiter_may_be_commanded: whether it is heard, or has been silent for so long that the others no longer keep
                clear of it.
            order_may_come: whether a recently sent command to loiter may still reach it.
        """
        self.started, self.guided, self.loiters, self.fresh = started, guided, loiters, fresh
        self.loiter_may_be_commanded, self.order_may_come = loiter_may_be_commanded, order_may_come


class Transition:
    """A row of the table."""

    def __init__(self, of: tuple[Member, ...], to: Member, when: str, holds: Callable[[Seen], bool]) -> None:
        """Lead from memberships `of` to one, when `holds`, in words `when`."""
        self.of, self.to, self.when, self.holds = of, to, when, holds


ALL: Final[tuple[Member, ...]] = tuple(Member)
COMMANDABLE: Final = (Member.FLYING, Member.UNHEARD, Member.HOLDING, Member.RETURNING)
"""Memberships of vehicles that neither start nor are left to their pilots."""
UNCOMMANDED: Final = (Member.FLYING, Member.UNHEARD)
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
    # A silent vehicle may not hear a command to loiter, and flies on by its last setpoint; the others keep clear.
    Transition(
        UNCOMMANDED,
        Member.UNHEARD,
        "it can't be flown by what is known of it, and may not hear that it is to loiter",
        lambda seen: not seen.fresh and not seen.loiter_may_be_commanded,
    ),
    Transition(COMMANDABLE, Member.HOLDING, "it can't be flown by what is known of it", lambda seen: not seen.fresh),
    Transition(COMMANDABLE, Member.FLYING, "it is guided and known", lambda seen: seen.guided),
    Transition(
        UNCOMMANDED,
        Member.PARTED,
        "it loiters, and no command of ours to do so is on its way",
        lambda seen: not seen.order_may_come,
    ),
    Transition(COMMANDABLE, Member.RETURNING, "it loiters by our command, and is known", lambda _: True),
)


def next_membership(member: Member, seen: Seen) -> Member:
    """Return the next membership: that of the first row of the table that holds."""
    for row in TRANSITIONS:
        if member in row.of and row.holds(seen):
            return row.to
    raise AssertionError(f"found no row for {member}; the table has one for each")
