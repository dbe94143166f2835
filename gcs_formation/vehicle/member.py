"""Membership in the formation: what removes a vehicle, and what brings it back."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Member(Enum):
    """A vehicle's membership in the formation."""

    STARTING = "starting"
    FLYING = "flying in formation"
    PARTED = "parted by its pilot"
    UNHEARD = "not heard: told nothing until it is"
    HOLDING = "told to loiter"
    RETURNING = "told to come back"


UNTOLD = (Member.FLYING, Member.UNHEARD)
"""Those that haven't been told to loiter."""


@dataclass(frozen=True)
class Sight:
    """What the membership depends on, at one tick."""

    started: bool
    """Whether its start-up is finished."""
    guided: bool
    """Whether it's in the mode in which it follows setpoints."""
    loiters: bool
    """Whether it is in the mode for loitering."""
    fresh: bool
    """Whether its telemetry is recent enough for prediction, and there is a leader to follow."""
    loiter_may_be_told: bool = True
    """Whether it is heard, or has been unheard for so long that the others no longer keep clear of it."""
    order_may_come: bool = False
    """Whether a command to loiter was sent so recently that it may still reach the vehicle."""


def following(member: Member, sight: Sight) -> Member:
    """Return the next membership. A pilot's change of mode is respected until the pilot reverts it.

    A vehicle that is not heard is told nothing at first. Whether it hears or not, it then flies on as it was told last,
    and the others keep clear of that way.
    """
    if not sight.started:
        return Member.STARTING
    back = Member.FLYING if sight.guided else Member.RETURNING if sight.loiters else Member.PARTED
    match member:
        case Member.STARTING:
            return Member.FLYING
        case Member.PARTED:
            return Member.FLYING if sight.guided else Member.PARTED
        case _ if not sight.fresh:
            untold = member in UNTOLD and not sight.loiter_may_be_told
            return Member.UNHEARD if untold else Member.HOLDING
        case Member.FLYING | Member.UNHEARD if not sight.order_may_come:
            return Member.FLYING if sight.guided else Member.PARTED
        case _:
            return back
