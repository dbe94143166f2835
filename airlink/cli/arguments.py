"""Types of numbers on the command lines."""

from __future__ import annotations

import math

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


SECONDS = Number(0)
"""A duration or a mission time, s."""
SEED = WholeNumber(0, 2**63 - 1)
"""A seed of the random streams: the same range as the scenario's key `seed`."""
