"""Figures of merit of a recorded flight, as defined for summary.json: settling time, errors, effort."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from airlink.endpoint import VehicleId
from flight_model.arrays import Array, Mask, wrap
from flight_model.slot import CHANNELS
from formation_scenario.expectation import LATE_PERIODS, SETTLED_M, UNJUDGED_GAP_S
from gcs_formation.record.flight import RecordedFlight
from gcs_formation.record.separations import min_separation_m
from gcs_formation.record.timeseries import ERROR, SETPOINT

Effort = dict[str, dict[str, float | None]]
SETTLED_FOR_S = 10.0
STEADY_AFTER_S = 30.0
"""Time from settling to the beginning of steady flight."""


def setpoint_steps(columns: Mapping[str, Array], channel: str) -> Array:
    """Return (T,) absolute changes of the setpoint since the previous tick, m/s, rad or m.

    NaN at the first tick, and where the vehicle wasn't commanded at both ticks.
    """
    values = np.where(columns["active"] > 0, columns[SETPOINT[CHANNELS.index(channel)]], np.nan)
    size = np.full(values.size, np.nan)
    size[1:] = _steps(values, channel)
    return size


def _steps(values: Array, channel: str) -> Array:
    step = values[1:] - values[:-1]
    return np.abs(wrap(step) if channel == "heading" else step)


def effort(columns: Mapping[str, Array], window: Mask) -> Effort:
    """Return each channel's total variation per second and 95th percentile of steps over a (T,) window of ticks."""
    t_s, commanded = columns["t_s"], window & (columns["active"] > 0)
    since_s, within = t_s[1:] - t_s[:-1], commanded[1:] & commanded[:-1]
    found: Effort = {}
    for channel, name in zip(CHANNELS, SETPOINT, strict=True):
        size = _steps(columns[name], channel)
        known = within & np.isfinite(size)
        moved, lasted_s = float(size[known].sum()), float(since_s[known].sum())
        found[channel] = {
            "variation_per_s": moved / lasted_s if known.any() else None,
            "step_p95": percentile(size[known], 95) if known.any() else None,
        }
    return found


def of_follower(flight: RecordedFlight, vehicle: VehicleId, window: Mask, settled_s: float | None) -> dict[str, Any]:
    """Return a follower's figures over a (T,) window of ticks, by their names in summary.json.

    `settled_s` is its settling time in the whole flight, None if it never settled.
    """
    time_s, error_m = flight.scored(vehicle, window)
    axes: dict[str, Any] = {name: axis_figures(time_s, error_m[:, i], settled_s) for i, name in enumerate(ERROR)}
    return axes | {
        "settled_at_s": settled_s,
        "left_at_s": left_at_s(time_s, error_m, settled_s),
        "in_slot_share": in_slot_share(error_m, flight.missed(vehicle, window)),
        "followed_share": float(time_s.size / window.sum()) if window.any() else None,
        "effort": effort(flight.vehicles[vehicle], window),
    }


def settled_at_s(
    time_s: Array, error_m: Array, period_s: float = math.nan, ends_s: tuple[float, float] = (-math.inf, math.inf)
) -> float | None:
    """Return the first time from which every axis stays within `SETTLED_M` for `SETTLED_FOR_S`, None if never.

    Late ticks count as in `coverage`: a vehicle that is in its slot after a gap has been there since the gap began, and
    stays through a gap at the end; after a longer one the 10 s begin again.

    Args:
        time_s: (T,) mission times of the scored ticks.
        error_m: (T, 3) errors at these; an unknown error (NaN) restarts the 10 s.
        period_s: time between ticks if none is late; NaN: none counts as late.
        ends_s: mission times between which ticks are scored.
    """
    inside, indices = _in_slot(error_m), np.arange(time_s.size)
    since_s, until_s, gaps = _through_gaps(time_s, period_s, ends_s)
    # The tick after the last one outside, or after a long gap: since then the vehicle has been in its slot.
    begins = np.maximum.accumulate(np.where(inside, np.where(gaps, indices, 0), indices + 1))
    stayed = inside & (until_s - since_s.take(begins, mode="clip") >= SETTLED_FOR_S - 1e-9)
    return float(since_s[begins[stayed.argmax()]]) if stayed.any() else None


def _through_gaps(time_s: Array, period_s: float, ends_s: tuple[float, float]) -> tuple[Array, Array, Mask]:
    """Return since and until when what a tick (T,) shows counts, s, and whether a gap that is too long ends with it."""
    bounded_s = np.concatenate((ends_s[:1], time_s, ends_s[1:]))
    before_s = np.diff(bounded_s)
    late = (before_s > LATE_PERIODS * period_s) & (before_s <= UNJUDGED_GAP_S + period_s)
    since_s = np.where(late[:-1], bounded_s[:-2] + period_s, time_s)
    until_s = time_s.copy()
    until_s[-1:] = ends_s[1] if late[-1] else time_s[-1:]
    gaps = before_s[:-1] > UNJUDGED_GAP_S + period_s
    return since_s, until_s, gaps


def axis_figures(time_s: Array, error_m: Array, settled_s: float | None) -> dict[str, float | None]:
    """Return rms, max and percentiles of |error| (T,), and the maximum from `STEADY_AFTER_S` after `settled_s`."""
    size = np.abs(error_m)
    shares = percentiles(size, 50, 95, 99)
    if not error_m.size:
        return {"rms": None, "max": None, **shares, "steady_max": None}
    later = size[time_s >= (np.inf if settled_s is None else settled_s + STEADY_AFTER_S - 1e-9)]
    steady = float(later.max()) if later.size else None
    return {"rms": float(np.sqrt(np.mean(size**2))), "max": float(size.max()), **shares, "steady_max": steady}


def in_slot_share(error_m: Array, missed: int = 0) -> float | None:
    """Return the share of (T, 3) errors with every axis within `SETTLED_M`, None if there are no errors.

    `missed` ticks, at which the vehicle was lost, count as out of its slot.
    """
    ticks = len(error_m) + missed
    return float(_in_slot(error_m).sum() / ticks) if ticks else None


def left_at_s(time_s: Array, error_m: Array, settled_s: float | None) -> float | None:
    """Return when a vehicle that settled at `settled_s` first exceeded `SETTLED_M` on any axis, None if never."""
    out = ~_in_slot(error_m) & (time_s >= (np.inf if settled_s is None else settled_s))
    return float(time_s[out.argmax()]) if out.any() else None


def _in_slot(error_m: Array) -> Mask:
    return np.all(np.abs(error_m.T) <= SETTLED_M, axis=0)


def separation_m(flight: RecordedFlight, window: Mask) -> Array:
    """Return the minimum distance of any two airborne vehicles between each tick of the window and the next, (T,) m.

    As `min_separation_m`, at the ticks' positions.
    """
    positions_m = np.stack([flight.position_in_flight(vehicle)[window].T for vehicle in flight.vehicles], axis=1)
    return min_separation_m(flight.common["t_s"][window], positions_m)


def avoidance_s(flight: RecordedFlight, window: Mask, rate_hz: float) -> float:
    """Return how long any vehicle avoided another by the separation rule, s."""
    anybody = np.any([columns["yielding"][window] > 0 for columns in flight.vehicles.values()], axis=0)
    return float(anybody.sum() / rate_hz)


def clearance_m(flight: RecordedFlight, window: Mask) -> Array:
    """Return the minimum height above ground of airborne vehicles at each tick of the window, (T,) m, or NaN."""
    return np.fmin.reduce([flight.clearance(vehicle)[window] for vehicle in flight.vehicles])


def if_finite(value: float) -> float | None:
    """Return a figure for the summary: None if it isn't finite."""
    return float(value) if math.isfinite(value) else None


def minimum(values: Array) -> float | None:
    """Return the smallest of the finite values, None if there are none."""
    known = values[np.isfinite(values)]
    return float(known.min()) if known.size else None


def percentiles(values: Array, *wanted: int) -> dict[str, float | None]:
    """Return percentiles by name, as in {"p50": …}; None where there are no values."""
    ordered = np.sort(values[np.isfinite(values)])
    return {f"p{q}": _percentile(ordered, q) if ordered.size else None for q in wanted}


def percentile(values: Array, q: float) -> float:
    """Return `np.percentile` of finite values, at least one, without its import of numpy.ma."""
    return _percentile(np.sort(values), q)


def _percentile(ordered: Array, q: float) -> float:
    rank = (ordered.size - 1) * (q / 100.0)
    below = int(rank)
    low, high = float(ordered[below]), float(ordered[min(below + 1, ordered.size - 1)])
    share = rank - below
    return high - (high - low) * (1.0 - share) if share >= 0.5 else low + (high - low) * share
