"""What a log's reader returns: a vehicle's setpoints from one location in the log, with the responses to them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from flight_model.arrays import Array, Mask
from flight_model.energy import GRAVITY_MPS2

SEEN: Final = ("airspeed", "yaw", "alt", "climb")
"""Names of the quantities that follow the setpoints of speed, heading and height, and of the climb rate."""
OVER_GROUND_SEEN: Final = ("airspeed", "course", "alt", "climb")
"""For a fixed wing that is commanded a course over ground, or positions ahead: it flies courses."""
HOVERING_SEEN: Final = ("speed seen", "course", "alt", "climb")
"""For a vehicle that is commanded velocities over ground."""
ABEAM_RAD: Final = math.radians(60.0)
"""A bearing of L1 guidance this far from the course isn't one to fly: on a circle it is that of the centre."""
NOT_BLANK: Final = 0.5
"""Modes flown for less than this, s, aren't listed."""


class Mode(NamedTuple):
    """A flight mode, from when to when, s of the log's clock."""

    name: str
    begin_s: float
    end_s: float


@dataclass
class Track:
    """One vehicle's setpoints from one location in a log, and its responses."""

    system: int
    setpoints: str = ""
    """Where in the log the setpoints are, in words."""
    identifies: str = ""
    """What leads from these setpoints to these responses, and so what its time constants are of; blank: the whole
    autopilot."""
    aircraft: str | None = None
    """The shipped vehicle file that has the limits of such a vehicle; None: the defaults."""
    seen: tuple[str, str, str, str] = SEEN
    of: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    """Times, s, and values, SI: of the setpoints `speed`, `heading`, `height`, of the responses, and of `lateral`, the
    lateral acceleration of turns."""
    modes: Sequence[Mode] = ()
    follows: frozenset[str] | None = None
    """Modes in which the vehicle follows these setpoints; None: whenever they are there."""
    wait_s: float = 0.0
    """How long a setpoint waits for the vehicle's next cycle after its time in the log."""

    def add(self, at_s: float, values: Mapping[str, float]) -> None:
        """Append the values at one time."""
        for name, value in values.items():
            self.of.setdefault(name, []).append((at_s, value))

    def put(self, name: str, at_s: Array, values: Array) -> None:
        """Set a quantity from its times and values, (N,) each, where both are finite."""
        known = np.isfinite(at_s) & np.isfinite(values)
        order = np.argsort(at_s[known], kind="stable")
        pairs = zip(at_s[known][order].tolist(), values[known][order].tolist(), strict=True)
        self.of[name] = list(pairs)

    def during(self, at_s: Array) -> Mask:
        """Return at which times (K,) the vehicle follows the setpoints, as far as its modes tell."""
        if self.follows is None or not self.modes:
            return np.ones(at_s.shape, dtype=bool)
        kept = np.zeros(at_s.shape, dtype=bool)
        for mode in self.modes:
            if mode.name in self.follows:
                kept |= (at_s >= mode.begin_s) & (at_s < mode.end_s)
        return kept


@dataclass(frozen=True)
class Log:
    """A log's tracks, the best of each vehicle first; what else is in it, and what would be needed, in words."""

    tracks: Sequence[Track]
    found: str
    wanted: str


def modes_of(changes: Iterable[tuple[float, str]]) -> list[Mode]:
    """Return the modes, from the time and name of each change; one that is repeated goes on."""
    found = list[Mode]()
    for at_s, name in changes:
        if found and found[-1].name == name:
            continue
        if found:
            found[-1] = found[-1]._replace(end_s=at_s)
        found.append(Mode(name, at_s, math.inf))
    return found


def spoken(modes: Iterable[Mode], end_s: float) -> str:
    """Return how long each mode was flown, in words."""
    flown = dict[str, float]()
    for mode in modes:
        flown[mode.name] = flown.get(mode.name, 0.0) + min(mode.end_s, end_s) - mode.begin_s
    return ", ".join(f"{name} {duration_s:.0f} s" for name, duration_s in flown.items() if duration_s > NOT_BLANK)


def lateral_mps2(bank_rad: float) -> float:
    """Return the lateral acceleration of a level turn with this bank."""
    return GRAVITY_MPS2 * math.tan(bank_rad)
