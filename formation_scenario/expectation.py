"""Keys of `expect`: bounds that a run must have kept."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated

from formation_scenario.fields import Keys, NonNegative, Number, Open, VehicleSelection, key

SETTLED_M = 0.5
"""A vehicle is in its slot if its error is at most this on every axis."""
UNJUDGED_GAP_S = 3.0
"""Longest time without a row of the time series that counts as judged, anywhere in a window, its ends included."""
LATE_PERIODS = 1.5
"""Rows that are further apart, in periods of the loop, are ones between which a tick is missing."""
JUDGED_SHARE = 0.95
"""Least part of a window that must have been judged, so that a bound counts as held."""
_AXES = {"x": "forward error, m", "y": "lateral error, m", "z": "height error, m"}
_FIGURES = {
    "rms": "root mean square over the window",
    "max": "largest over the window",
    "p50": "median of |error| over the window",
    "p95": "the same, 95th percentile",
    "p99": "the same, 99th percentile",
    "steady_max": "largest over the window from 30 s after settled_at_s on; no value if that is never flown",
}
ERROR_METRICS = {
    f"error_{axis}_m.{figure}": f"{error}: {meaning}"
    for axis, error in _AXES.items()
    for figure, meaning in _FIGURES.items()
}
CHANNEL_UNITS = {"speed": "m/s", "heading": "rad", "height": "m"}
_EFFORT = {
    "variation_per_s": "setpoint's total variation a second over the window, {}/s",
    "step_p95": "setpoint's step from tick to tick: 95th percentile over the window, {}",
}
EFFORT_METRICS = {
    f"effort.{channel}.{figure}": f"{channel} {meaning.format(unit)}"
    for channel, unit in CHANNEL_UNITS.items()
    for figure, meaning in _EFFORT.items()
}
FOLLOWER_METRICS = {
    **ERROR_METRICS,
    **EFFORT_METRICS,
    "in_slot_share": "share of the window with every error within 0.5 m, without the time in which it leads",
    "settled_at_s": "from when on every error stays within 0.5 m for 10 s, s; of the whole flight",
}
LINK_METRICS = {
    "measured_delay_ms.p50": "one-way delay, half the round trip: median over the window, ms",
    "measured_delay_ms.p99": "the same, 99th percentile",
    "jitter_ms.p50": "estimated jitter: median over the window, ms",
    "jitter_ms.p99": "the same, 99th percentile",
    "injected_loss": "share of the datagrams to the ground that the scenario's links lost; of the whole flight",
    "injected_loss_up": "the same of those to the vehicle; of the whole flight",
    "measured_loss": "share of the vehicle's frames that never came, 0 to 1; of the whole flight",
    "frames_bad": "frames that came damaged; of the whole flight",
}
SEPARATION, FENCE = "min_separation_m", "fence_m"
LIMIT_METRICS = {
    SEPARATION: "least distance of any two vehicles over the window, m",
    "min_clearance_m": "least height of any vehicle above the ground over the window, m",
    FENCE: "how far outside `safety.fence` any vehicle was that its pilot didn't fly, over the window, m",
}
"""Limits of `safety`, judged at every instant at which positions are known."""
_FROM_PATH = {
    "across_m": "horizontal distance from the path, m",
    "along_m": "distance along the path from where it was planned to be at the time, m",
    "height_m": "difference in height from the path, m",
}
PATH_METRICS = {
    f"{prefix}_{name}.{figure}": (who, f"{name}.{figure}")
    for prefix, who in (("path", "leader"), ("centre", "centre"))
    for name in _FROM_PATH
    for figure in ("rms", "max")
}
"""Metrics of the distance from the path: whose, and which of its figures."""
_WHOSE = {"leader": "the leader's", "centre": "the formation centre's"}
RUN_METRICS = {
    **LIMIT_METRICS,
    **{
        metric: f"{_WHOSE[who]} {_FROM_PATH[name.partition('.')[0]]}: {_FIGURES[name.partition('.')[2]]}"
        for metric, (who, name) in PATH_METRICS.items()
    },
    "violations": "how often the limits of `safety` were broken; of the whole flight",
    "late_ticks": "control ticks that began more than 10 ms late; of the whole flight",
    "period_ms.p50": "time between control ticks: median, ms; of the whole flight",
    "period_ms.p99": "the same, 99th percentile",
    "period_ms.max": "the same, the longest",
    "compute_ms.p50": "computing time of a control tick: median, ms; of the whole flight",
    "compute_ms.p99": "the same, 99th percentile",
    "real_time_factor": "simulated seconds by seconds that passed; of the whole flight",
    "delay_margin_s": "least delay margin of any loop, s; of the whole flight",
    "worst_loop_delay_s": "longest delay of any loop, s; of the whole flight",
    "margin_used": "largest share of a delay margin in use, 1 at the margin; of the whole flight",
}
LOOP_METRICS = ("delay_margin_s", "worst_loop_delay_s", "margin_used")
OF_FOLLOWERS = (*FOLLOWER_METRICS, *LOOP_METRICS)
"""Metrics that exist only with followers, including those of the loops that control them."""
METRICS = {**FOLLOWER_METRICS, **LINK_METRICS, **RUN_METRICS}
"""Metrics and their meanings."""
WINDOWED = (
    *ERROR_METRICS,
    *EFFORT_METRICS,
    "in_slot_share",
    "measured_delay_ms.p50",
    "measured_delay_ms.p99",
    "jitter_ms.p50",
    "jitter_ms.p99",
    *LIMIT_METRICS,
    *PATH_METRICS,
)
"""Metrics over the window from `from_s` to `to_s`; the others are of the whole flight."""
SHARE, ANY = (0.0, 1.0), (-math.inf, math.inf)
RANGES = {
    "in_slot_share": SHARE,
    "injected_loss": SHARE,
    "injected_loss_up": SHARE,
    "measured_loss": SHARE,
    "min_clearance_m": ANY,
    "delay_margin_s": ANY,
    "broken_invariants": (0.0, math.inf),
}
"""Possible values of figures; all others of `METRICS` are 0 or more, those of extensions any number."""


Metric = Annotated[str, Open(", ".join(METRICS), tuple(METRICS))]


def keeps(value: float, below: float | None, above: float | None) -> bool:
    """Return whether a figure keeps its bounds; None means no bound."""
    return (below is None or value < below) and (above is None or value > above)


_GROWING = ("violations", "late_ticks", "period_ms.max", "frames_bad", "settled_at_s", "margin_used", "fence_m")


def stays_broken(metric: str, value: float | None, below: float | None, above: float | None, share: float) -> bool:
    """Return whether a figure over a `share` of its window breaks a bound, whatever the rest of the window brings.

    A maximum, a count and a time can only grow, a minimum only fall; a mean is at best that with a rest without errors.
    """
    if value is None:
        return False
    minimum, maximum = -math.inf, math.inf
    if metric in _GROWING or metric.endswith(("_m.max", "_m.steady_max")):
        minimum = value
    elif metric.endswith("_m.rms"):
        minimum = value * math.sqrt(share)
    elif metric == "in_slot_share":
        minimum, maximum = value * share, value * share + 1.0 - share
    elif metric.startswith("min_"):
        maximum = value
    return (below is not None and minimum >= below) or (above is not None and maximum <= above)


def bounds_text(below: float | None, above: float | None) -> str:
    """Return bounds in words: "below 3 and above 2"."""
    bounds = {"below": below, "above": above}
    return " and ".join(f"{name} {bound:g}" for name, bound in bounds.items() if bound is not None)


def range_text(metric: str) -> str:
    """Return the possible values of a figure in words."""
    minimum, maximum = RANGES.get(metric, (0.0, math.inf) if metric in METRICS else ANY)
    if math.isinf(maximum):
        return "any number" if math.isinf(minimum) else f"{minimum:g} or more"
    return f"from {minimum:g} to {maximum:g}"


def pointless(metric: str, below: float | None, above: float | None) -> Iterator[tuple[str, str, str]]:
    """Yield bounds that a figure can't break, or can't keep: which, what was found and what is allowed.

    Exempt is `below` at a figure's least value: it is always broken, and the verdict shows that.
    """
    minimum, maximum = RANGES.get(metric, (0.0, math.inf) if metric in METRICS else ANY)
    for name, bound in (("below", below), ("above", above)):
        if bound is not None and not minimum <= bound <= maximum:
            yield name, f"found {bound:g} for {metric}", range_text(metric)
        elif name == "above" and bound == maximum:
            found = f"found {bound:g} for {metric}, above which it never is"
            yield name, found, f"{range_text(metric)}, {bound:g} itself excluded"


class Expectation(Keys):
    """A bound on one figure of the summary, for some followers and over a window of time."""

    metric: Metric = key(..., "a figure of summary.json: see Metrics", "error_x_m.max")
    followers: VehicleSelection = key(
        "all", "all, or a list of ids; for figures of one follower, or of one link, which the leader has too", [2, 3]
    )
    from_s: NonNegative = key(0.0, "start of the window, s; 0 for figures of the whole flight", 70)
    to_s: NonNegative = key(
        ..., "end of the window, s; not before duration_s for figures of the whole flight", 120, derived="duration_s"
    )
    below: Number | None = key(None, "the figure must be smaller, in its own unit", 0.22)
    above: Number | None = key(None, "the figure must be larger, in its own unit", 20)
