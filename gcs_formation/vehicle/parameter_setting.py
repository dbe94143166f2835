"""Sets parameters of a vehicle, and reads each back.

Source: MAVLink guide, "Parameter Protocol": PARAM_SET is answered by PARAM_VALUE with the value that is stored then.
Parameters of failsafes, fences and arming checks are never set, whatever asks for it: they are their owner's.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from airlink.clock import Instant, after
from airlink.messages.command import ParamSet, ParamValue

UNTOUCHED: Final = (
    "AFS_",
    "ARMING_",
    "AVD_",
    "BATT",
    "BAT",
    "BRD_SAFETY",
    "CBRK_",
    "COM_",
    "CHUTE_",
    "DISARM_",
    "FENCE_",
    "FLTMODE",
    "FS_",
    "GF_",
    "LAND_",
    "NAV_DLL_ACT",
    "NAV_RCL_ACT",
    "RALLY_",
    "RTL_",
    "TERRAIN_",
    "THR_FAILSAFE",
    "THR_FS_VALUE",
)
"""Beginnings of names that are never set: failsafes, fences, batteries, arming, the way home."""
RETRY_S: Final = 0.7
TRIES: Final = 12
"""Attempts for each parameter: with half of all datagrams lost each way, three in a hundred aren't set."""
AT_ONCE: Final = 4
"""Number of parameters under way at once: autopilots have a short queue for them."""
REFUSED: Final = 3
"""Answers with another value after which a parameter counts as refused."""
Encode = Callable[[str, float, int], ParamSet]
"""Returns the message that sets a parameter, by its name, value and MAV_PARAM_TYPE."""


class Change(NamedTuple):
    """A parameter's value before and after it is set."""

    name: str
    kind: int
    """Its MAV_PARAM_TYPE."""
    before: float
    after: float

    @property
    def words(self) -> str:
        """The change in words."""
        return f"{self.name}: from {self.before:g} to {self.after:g}"

    def back(self) -> Change:
        """Return the change that undoes it."""
        return Change(self.name, self.kind, self.after, self.before)


def is_untouched(name: str) -> bool:
    """Return whether a parameter is never set."""
    return name.startswith(UNTOUCHED)


class ParameterWriter:
    """Sets some parameters of one vehicle."""

    def __init__(self, changes: Sequence[Change], encode: Encode, value_of: Callable[[ParamValue], float]) -> None:
        """Prepare; `value_of` decodes an answer."""
        self._changes = {each.name: each for each in changes if not is_untouched(each.name)}
        self._encode, self._value_of = encode, value_of
        self._tries, self._others = dict.fromkeys(self._changes, 0), dict.fromkeys(self._changes, 0)
        self._next = Instant(0)
        self.done = dict[str, Change]()
        """Those that have been set, as they were read back."""

    @property
    def pending(self) -> list[Change]:
        """Those that are under way."""
        return [each for name, each in self._changes.items() if name not in self.done and self._goes_on(name)]

    @property
    def failed(self) -> list[Change]:
        """Those that couldn't be set."""
        return [each for name, each in self._changes.items() if name not in self.done and not self._goes_on(name)]

    def _goes_on(self, name: str) -> bool:
        return self._tries[name] < TRIES and self._others[name] < REFUSED

    def requests(self, now: Instant) -> list[ParamSet]:
        """Return the messages to send now: those with the fewest attempts first."""
        waiting = sorted(self.pending, key=lambda each: self._tries[each.name])[:AT_ONCE]
        if not waiting or now < self._next:
            return []
        self._next = after(now, RETRY_S)
        for each in waiting:
            self._tries[each.name] += 1
        return [self._encode(each.name, each.after, each.kind) for each in waiting]

    def take(self, message: ParamValue, now: Instant) -> Change | None:
        """Take a parameter that the vehicle reports; return the change that it confirms for the first time."""
        change = self._changes.get(message.param_id)
        if change is None or not self._tries[change.name] or change.name in self.done:
            return None
        if _rounded(self._value_of(message)) != _rounded(change.after):
            self._others[change.name] += 1
            return None
        self.done[change.name] = change
        if not any(self._tries[each.name] for each in self.pending):
            self._next = now
        return change


def _rounded(value: float) -> float:
    """Return a value as a 32-bit float, which is what is sent."""
    return float(struct.unpack("<f", struct.pack("<f", value))[0])
