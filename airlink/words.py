"""Numbers in words."""

from __future__ import annotations


def counted(number: int, what: str, plural: str = "s") -> str:
    """Return how many there are of something: `1 flight`, `2 flights`, `2 searches` with `plural` "es"."""
    return f"{number:,} {what}{plural * (number != 1)}"
