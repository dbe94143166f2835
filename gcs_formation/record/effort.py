"""Control effort: how much the setpoints that a vehicle was sent move from tick to tick."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gcs_formation.arrays import Array, Mask
from gcs_formation.record.timeseries import CHANNELS, SETPOINT

Effort = dict[str, dict[str, float | None]]


def setpoint_steps(columns: Mapping[str, Array], channel: str) -> Array:
    """Return (T,) sizes of the steps to each tick's setpoint from the one before, m/s, rad or m.

    NaN at the first tick, and where the vehicle wasn't commanded at either.
    """
    values = np.where(columns["active"] > 0, columns[SETPOINT[CHANNELS.index(channel)]], np.nan)
    step = np.diff(values, prepend=np.nan)
    if channel == "heading":
        step = (step + np.pi) % (2.0 * np.pi) - np.pi
    return np.abs(step)


def effort(columns: Mapping[str, Array], window: Mask) -> Effort:
    """Return each channel's total variation a second and 95th percentile of its steps over a (T,) window of ticks."""
    since_s = np.diff(columns["t_s"], prepend=np.nan)
    within = window & np.concatenate(([False], window[:-1]))
    found: Effort = {}
    for channel in CHANNELS:
        size = setpoint_steps(columns, channel)
        known = within & np.isfinite(size)
        moved, lasted_s = float(size[known].sum()), float(since_s[known].sum())
        found[channel] = {
            "variation_per_s": moved / lasted_s if known.any() else None,
            "step_p95": float(np.percentile(size[known], 95)) if known.any() else None,
        }
    return found
