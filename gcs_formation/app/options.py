"""Options of a flight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from formation_scenario.expectation import Expectation

ClockName = Literal["real", "virtual"]
Record = Literal["full", "series", "summary", "none"]
"""What is kept of a flight: everything, all but the frames, the summary alone, nothing."""


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
    """Figures over windows of time that the summary is to have besides; their bounds don't count."""
    confirm: bool = False
    """`fly` alone: whether somebody's word is awaited before anybody is commanded."""
    dry_run: bool = False
    """`fly` alone: whether the run ends there."""
    resume: bool = False
    """`fly` alone: whether the unfinished run in `out` goes on."""
    retake: bool = False
    """With `resume`: whether vehicles on their way home are taken too."""

    def __post_init__(self) -> None:
        """Refuse values that the command line refuses as well."""
        if self.clock not in get_args(ClockName):
            raise ValueError(f"clock: found {self.clock!r}; allowed: {', '.join(get_args(ClockName))}")
        if not 0.01 <= self.speedup <= 1000.0:
            raise ValueError(f"speedup: found {self.speedup!r}; allowed: a number from 0.01 to 1000")
        if self.clock == "virtual" and self.speedup != 1.0:
            found = f"found {self.speedup:g} under the virtual clock, which is as fast as the processor allows"
            raise ValueError(f"speedup: {found}; allowed: none, or the real clock")
        if self.until_s is not None and not 0.0 <= self.until_s < math.inf:
            raise ValueError(f"until: found {self.until_s!r}; allowed: a number >= 0")
