"""Keys of `expect`: bounds that a run must have kept."""

from __future__ import annotations

from typing import Annotated

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from formation_scenario.fields import Allowed, Keys, NonNegative, Number, VehicleSelection

ERROR_METRICS = tuple(f"error_{axis}_m.{figure}" for axis in "xyz" for figure in ("rms", "max", "steady_max"))
FOLLOWER_METRICS = (*ERROR_METRICS, "settled_at_s")
LINK_METRICS = (
    "measured_delay_ms.p50",
    "measured_delay_ms.p99",
    "jitter_ms.p50",
    "jitter_ms.p99",
    "measured_loss",
    "frames_bad",
)
RUN_METRICS = (
    "min_separation_m",
    "min_clearance_m",
    "violations",
    "late_ticks",
    "period_ms.p50",
    "period_ms.p99",
    "period_ms.max",
    "compute_ms.p50",
    "compute_ms.p99",
    "real_time_factor",
    "delay_margin_s",
    "worst_loop_delay_s",
)
METRICS = (*FOLLOWER_METRICS, *LINK_METRICS, *RUN_METRICS)


def _known_metric(value: object) -> object:
    if value not in METRICS:
        raise PydanticCustomError("metric", "unknown metric")
    return value


Metric = Annotated[str, BeforeValidator(_known_metric), Allowed(", ".join(METRICS), METRICS)]


class Expectation(Keys):
    """A bound on one figure of the summary, for some followers and over a window of time."""

    metric: Metric = Field(description="a figure of summary.json")
    followers: VehicleSelection = Field(
        default="all", description="all, or a list of ids; for figures of one follower or one link"
    )
    from_s: NonNegative = Field(default=0.0, description="start of the window, s")
    to_s: NonNegative = Field(description="end of the window, s; default: duration_s")
    below: Number | None = Field(default=None, description="the figure must be smaller")
    above: Number | None = Field(default=None, description="the figure must be larger")
