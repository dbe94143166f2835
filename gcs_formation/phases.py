"""The phases of a run: a table of all transitions."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

from airlink.clock import Instant, seconds_between
from formation_scenario.orders import End


class Phase(Enum):
    """Phase of a run."""

    CONNECTING = "connecting"
    ASSEMBLING = "assembling"
    FLYING = "flying"
    ENDING = "ending"
    LOITERING = "loitering"
    DONE = "done"
    FAILED = "failed"


class Cause(Enum):
    """Causes of a transition."""

    REHEARSED = "everything but commands has been done"
    CALLED_OFF = "ended before any vehicle was commanded"
    NOT_BEGUN = "the run can't go on, and no vehicle was commanded"
    LEADER_READY = "the leader follows setpoints"
    PATH_BEGUN = "the leader has passed the start of its path"
    PATH_ENDED = "the path or the time is at its end"
    STOP = "ordered to stop"
    IMMEDIATE_RETURN = "ordered to go home at once"
    ORDERED = "ordered to end"
    OPENED = "every vehicle that receives has a height of its own or hovers, or time is up"
    LOITERED = "every vehicle that is heard loiters"
    HOMEWARD = "every vehicle that is heard flies home or circles there"
    LANDED = "every vehicle that is heard has landed"
    FAILURE = "the run can't go on"
    NOT_ALL_LOITERED = "not every vehicle loiters, or has acknowledged that it does, and the time for that is over"
    NOT_ALL_HOMEWARD = "not every vehicle goes home, or has acknowledged that it does, and the time for that is over"
    NOT_ALL_LANDED = (
        "not every vehicle has landed, or has acknowledged what it was commanded, and the time for that is over"
    )
    GIVEN_UP = "the run can't go on, and vehicles were commanded to loiter"


TRANSITIONS: dict[tuple[Phase, Cause], Phase] = {
    (Phase.CONNECTING, Cause.LEADER_READY): Phase.ASSEMBLING,
    (Phase.CONNECTING, Cause.REHEARSED): Phase.DONE,
    (Phase.CONNECTING, Cause.CALLED_OFF): Phase.DONE,
    (Phase.CONNECTING, Cause.NOT_BEGUN): Phase.FAILED,
    (Phase.CONNECTING, Cause.STOP): Phase.LOITERING,
    (Phase.CONNECTING, Cause.ORDERED): Phase.LOITERING,
    (Phase.CONNECTING, Cause.FAILURE): Phase.LOITERING,
    (Phase.ASSEMBLING, Cause.PATH_BEGUN): Phase.FLYING,
    (Phase.ASSEMBLING, Cause.PATH_ENDED): Phase.ENDING,
    (Phase.ASSEMBLING, Cause.STOP): Phase.ENDING,
    (Phase.ASSEMBLING, Cause.ORDERED): Phase.ENDING,
    (Phase.ASSEMBLING, Cause.FAILURE): Phase.ENDING,
    (Phase.FLYING, Cause.PATH_ENDED): Phase.ENDING,
    (Phase.FLYING, Cause.STOP): Phase.ENDING,
    (Phase.FLYING, Cause.ORDERED): Phase.ENDING,
    (Phase.FLYING, Cause.FAILURE): Phase.ENDING,
    (Phase.ENDING, Cause.ORDERED): Phase.ENDING,
    (Phase.ENDING, Cause.OPENED): Phase.LOITERING,
    (Phase.ENDING, Cause.IMMEDIATE_RETURN): Phase.LOITERING,
    (Phase.LOITERING, Cause.IMMEDIATE_RETURN): Phase.LOITERING,
    (Phase.LOITERING, Cause.ORDERED): Phase.LOITERING,
    (Phase.LOITERING, Cause.LOITERED): Phase.DONE,
    (Phase.LOITERING, Cause.HOMEWARD): Phase.DONE,
    (Phase.LOITERING, Cause.LANDED): Phase.DONE,
    (Phase.LOITERING, Cause.NOT_ALL_LOITERED): Phase.DONE,
    (Phase.LOITERING, Cause.NOT_ALL_HOMEWARD): Phase.DONE,
    (Phase.LOITERING, Cause.NOT_ALL_LANDED): Phase.DONE,
    (Phase.LOITERING, Cause.GIVEN_UP): Phase.FAILED,
}
"""All other combinations change nothing."""

ALL_ENDED: Final[dict[End, Cause]] = {"loiter": Cause.LOITERED, "rtl": Cause.HOMEWARD, "land": Cause.LANDED}
NOT_ALL_ENDED: Final[dict[End, Cause]] = {
    "loiter": Cause.NOT_ALL_LOITERED,
    "rtl": Cause.NOT_ALL_HOMEWARD,
    "land": Cause.NOT_ALL_LANDED,
}
"""Cause of a run's end by the way it was to end: all vehicles do so, or the time for that is over."""
BEFORE_COMMANDS: Final = {Cause.STOP: Cause.CALLED_OFF, Cause.ORDERED: Cause.CALLED_OFF, Cause.FAILURE: Cause.NOT_BEGUN}
"""Replacement of a cause before vehicles may be commanded: they are left as found."""
NONE_COMMANDED: Final = (Cause.REHEARSED, *BEFORE_COMMANDS.values())
"""Causes of an end before any vehicle was commanded."""
COMMANDED: Final = (Phase.ASSEMBLING, Phase.FLYING, Phase.ENDING)
"""Phases in which the law and the separation rule command the formation."""
OVER: Final = (Phase.ENDING, Phase.LOITERING)
"""Phases in which no vehicle is started any more."""


@dataclass
class Flight:
    """The phase of a run, its beginning, the instant of t = 0, and when the flight along the path ended."""

    phase: Phase = Phase.CONNECTING
    since: Instant = Instant(0)
    path_began: Instant | None = None
    path_ended: Instant | None = None

    def move(self, cause: Cause, now: Instant) -> bool:
        """Apply the table; return whether there is such a transition."""
        following = TRANSITIONS.get((self.phase, cause))
        if following is None:
            return False
        if self.phase is Phase.FLYING:
            self.path_ended = now
        self.phase, self.since = following, now
        if cause is Cause.PATH_BEGUN and self.path_began is None:
            self.path_began = now
        return True

    def resume(self, at: Instant, path_began: Instant | None) -> None:
        """Resume an interrupted flight."""
        self.since, self.path_began = at, path_began

    def mission_time_s(self, now: Instant) -> float:
        """Return seconds since the leader started along its path, NaN before."""
        return float("nan") if self.path_began is None else seconds_between(self.path_began, now)

    @property
    def ended(self) -> bool:
        """Whether the run is over."""
        return self.phase in (Phase.DONE, Phase.FAILED)
