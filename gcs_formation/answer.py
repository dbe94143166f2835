"""What came of an order."""

from __future__ import annotations

from typing import NamedTuple


class Answer(NamedTuple):
    """Whether an order is followed, and what is said to it."""

    accepted: bool
    text: str
