"""Options of `run` and `fly`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Literal, get_args

from airlink.forwarding import Forward
from formation_scenario.expectation import Expectation

ClockName = Literal["real", "virtual"]
Record = Literal["full", "series", "summary", "none"]
"""What is kept of a flight: everything, all but the frames, only the summary, nothing."""


@dataclass(frozen=True)
class RunOptions:
    """Options of `run` and `fly`.

    Raises:
        ValueError: a value that isn't allowed.
    """

    out: Path
    clock: ClockName = "real"
    speedup: float = 1.0
    until_s: float | None = None
    overwrite: bool = False
    """Whether an earlier run in `out` may be replaced."""
    record: Record = "full"
    """What is written to `out`; the summary is returned in any case."""
    measure: tuple[Expectation, ...] = ()
    """Further figures over windows of time for the summary; their bounds aren't judged."""
    confirm: bool = False
    """`fly` only: whether the operator must confirm before any vehicle is commanded."""
    dry_run: bool = False
    """`fly` only: whether the run ends before the first command."""
    resume: bool = False
    """`fly` only: whether the unfinished run in `out` is continued."""
    set_parameters: bool = False
    """`fly` only: whether parameters are set that aren't as the check asks for, and restored after the flight."""
    take: bool = False
    """`fly` only: whether vehicles are taken over too that fly under somebody else's command."""
    forward: tuple[Forward, ...] = ()
    """Second ground stations that see the vehicles, and may command them; under the real clock alone."""
    recording: Callable[[], None] | None = None
    """Called when the record is open; with it, the record is written at every tick, since somebody may look on."""

    def __post_init__(self) -> None:
        """Refuse values that the command line refuses as well."""
        if self.clock not in get_args(ClockName):
            raise ValueError(f"clock: found {self.clock!r}; allowed: {', '.join(get_args(ClockName))}")
        if not _is_number(self.speedup, 0.01, 1000.0):
            raise ValueError(f"speedup: found {self.speedup!r}; allowed: a number from 0.01 to 1000")
        if self.clock == "virtual" and self.speedup != 1.0:
            found = f"found {self.speedup:g} under the virtual clock, which is as fast as the processor allows"
            raise ValueError(f"speedup: {found}; allowed: none, or the real clock")
        if self.clock == "virtual" and self.forward:
            found = f"found {self.forward[0].endpoint} under the virtual clock, which has no other programs"
            raise ValueError(f"forward: {found}; allowed: none, or the real clock")
        if self.until_s is not None and not _is_number(self.until_s, 0.0, sys.float_info.max):
            raise ValueError(f"until: found {self.until_s!r}; allowed: a number >= 0")


def _is_number(found: object, minimum: float, maximum: float) -> bool:
    """Return whether what a script gave is a number within bounds."""
    return isinstance(found, Real) and minimum <= float(found) <= maximum
