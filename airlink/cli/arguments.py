"""Types of arguments on the command lines."""

from __future__ import annotations

import math
import os
from pathlib import Path

import click


class WholeNumber(click.IntRange):
    """A whole number in a range."""

    name = "integer"


class Number(click.FloatRange):
    """A finite number in a range."""

    name = "number"

    def convert(self, value: float, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number


class Directory(click.Path):
    """A directory to write into; "" isn't one."""

    def __init__(self) -> None:
        """Give commands a Path."""
        super().__init__(path_type=Path)

    def convert(
        self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> str | bytes | os.PathLike[str]:
        """Return the path."""
        if not os.fspath(value):
            self.fail("found ''; allowed: a directory", param, ctx)
        return super().convert(value, param, ctx)


SECONDS = Number(0)
"""A duration or a mission time, s."""
OUT = Directory()
"""Where a command writes to."""
SEED = WholeNumber(0, 2**63 - 1)
"""A seed of the random streams: the same range as the scenario's key `seed`."""
