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


def following(member: Member, sight: Sight) -> Member:
    """Return the next state. A pilot's change of mode is respected, and ends when the pilot changes it back."""
    if not sight.started:
        return Member.STARTING
    match member:
        case Member.STARTING:
            return Member.FLYING
        case Member.FLYING if not sight.fresh:
            return Member.HOLDING
        case Member.FLYING if not sight.guided:
            return Member.PARTED
        case Member.HOLDING if sight.fresh:
            return Member.FLYING if sight.guided else Member.RETURNING if sight.loiters else Member.PARTED
        case Member.RETURNING if not sight.fresh:
            return Member.HOLDING
        case Member.RETURNING if not sight.loiters and not sight.guided:
            return Member.PARTED
        case Member.PARTED | Member.RETURNING if sight.guided:
            return Member.FLYING
        case _:
            return member
