"""Whether a vehicle flies in the formation: what takes it out, and what brings it back."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Member(Enum):
    """A vehicle's place in the formation."""

    STARTING = "starting"
    FLYING = "flying in formation"
    PARTED = "parted by its pilot"
    HOLDING = "told to loiter"
    RETURNING = "told to come back"


@dataclass(frozen=True)
class Sight:
    """What decides on it, at one tick."""

    started: bool
    """Whether its start-up is finished."""
    guided: bool
    """Whether it's in the mode in which it follows setpoints."""
    loiters: bool
    """Whether it's in the mode that it was told to loiter in."""
    fresh: bool
    """Whether its telemetry is young enough to be predicted from, and a leader there to follow."""
    order_may_come: bool = False
    """Whether an order to loiter is so young that it may only now have reached the vehicle."""


def following(member: Member, sight: Sight) -> Member:
    """Return the next state. A pilot's change of mode is respected, and ends when the pilot changes it back."""
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
