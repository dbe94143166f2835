"""What can't be flown in a scenario: where, by how much, and which moves of waypoints would do away with it.

`check` finds all violations of all kinds at once; `formation_scenario.repair` searches changes after which it finds
none. A move is of first order: by so much the nearest waypoints are too low, too high or too far outside.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple, TypeAlias

from formation_scenario.source import Finding, KeyPath

Kind: TypeAlias = Literal[
    "waypoints",
    "path speed",
    "wind",
    "circles",
    "climb",
    "turn",
    "slot turn",
    "slot speed",
    "slot acceleration",
    "slot setpoint",
    "clearance",
    "fence",
    "fence height",
    "ground",
    "separation",
    "frame",
    "start",
    "step",
    "change",
]
"""What limits: the kinds of violations that `check` tells apart."""
MAX_REPORTED = 10
"""Largest number of violations of one kind that are reported individually."""
HEIGHT_TOLERANCE_M = 0.01
"""Tolerance of heights and clearances, m."""
Move: TypeAlias = tuple[float, float, float]
"""Of a waypoint: north, east and up, m."""
NOWHERE: Mapping[int, Move] = MappingProxyType({})


class Violation(NamedTuple):
    """One limit that isn't kept at one position.

    `found` says where and what; `excess` is by which share of the limit, or by which tens of metres, it isn't kept;
    `waypoint` the nearest, if it is a matter of position; `moves` those of waypoints that would do, as far as is known.
    """

    key: KeyPath
    found: str
    allowed: str
    kind: Kind
    excess: float = 1.0
    at_m: float = math.nan
    waypoint: int | None = None
    moves: Mapping[int, Move] = NOWHERE

    @property
    def finding(self) -> Finding:
        """The key, what was found, and what is allowed."""
        return self.key, self.found, self.allowed


def reported(
    violations: Iterable[Violation], would_do: Callable[[Violation], str] = lambda _: ""
) -> Iterator[tuple[KeyPath, str, str, str]]:
    """Yield what is said of violations: of each kind up to `MAX_REPORTED`, and how many more there are.

    The key, what was found, what is allowed, and what would do.
    """
    kinds = dict[Kind, list[Violation]]()
    for violation in violations:
        kinds.setdefault(violation.kind, []).append(violation)
    for kind, each in kinds.items():
        yield from ((*violation.finding, would_do(violation)) for violation in each[:MAX_REPORTED])
        if len(each) > MAX_REPORTED:
            yield each[0].key[:2], f"found {len(each) - MAX_REPORTED} more places like these ({kind})", "", ""
