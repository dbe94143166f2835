"""Types of values that links and shared radios have in common."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from formation_scenario.fields import NonNegative, Number

MAX_MS: Final = 600_000.0
MIN_KBPS: Final = 1e-3
"""One bit a second, at which the longest UDP datagram takes six days."""
Distribution = Literal["normal", "uniform", "pareto"]
Burst = Annotated[Number, Field(ge=1.0, le=1e6)]
Milliseconds = Annotated[NonNegative, Field(le=MAX_MS)]
