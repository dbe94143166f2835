"""The answer to an order."""

from __future__ import annotations

from typing import NamedTuple


class Answer(NamedTuple):
    """Whether an order is accepted, and the answer in words."""

    accepted: bool
    text: str
