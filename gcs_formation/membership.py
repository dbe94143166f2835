"""Membership in the formation: what removes a vehicle, and what brings it back."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Member(Enum):
    """A vehicle's membership in the formation."""

    STARTING = "starting"
    FLYING = "flying in formation"
    PARTED = "parted by its pilot"
    HOLDING = "told to loiter"
    RETURNING = "told to come back"


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
    order_may_come: bool = False
    """Whether a command to loiter was sent so recently that it may still reach the vehicle."""


def following(member: Member, sight: Sight) -> Member:
    """Return the next membership. A pilot's change of mode is respected until the pilot reverts it."""
    if not sight.started:
        return Member.STARTING
    back = Member.FLYING if sight.guided else Member.RETURNING if sight.loiters else Member.PARTED
    match member:
        case Member.STARTING:
            return Member.FLYING
        case Member.FLYING if sight.fresh and not sight.order_may_come:
            return Member.FLYING if sight.guided else Member.PARTED
        case Member.FLYING | Member.HOLDING | Member.RETURNING if sight.fresh:
            return back
        case Member.PARTED:
            return Member.FLYING if sight.guided else Member.PARTED
        case _:
            return Member.HOLDING
