"""How a scenario is to be flown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

ClockName = Literal["real", "virtual"]


@dataclass(frozen=True)
class RunOptions:
    """Options of `run` and `fly`."""

    out: Path
    clock: ClockName = "real"
    speedup: float = 1.0
    until_s: float | None = None
