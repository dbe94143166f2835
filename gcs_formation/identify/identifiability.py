"""Which of the model's channels recordings identify, and in words why others can't be: speed, heading, height.

Its setpoints must move a channel, the search (`fitting`) must know its time constants well enough, and for heights its
predictions must explain most of what was flown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array
from flight_model.slot import CHANNELS
from gcs_formation.errors import RecordError
from gcs_formation.identify.recording import MIN_MOVED, Recording

QUANTITIES = ("airspeed_mps", "heading_rad", "height_m")
"""Quantities in which recordings and models are compared."""
TAUS = ("tau_v_s", "tau_psi_s", "tau_ha_s", "tau_hb_s")
TAUS_OF = {"speed": TAUS[:1], "heading": TAUS[1:2], "height": TAUS[2:]}
"""The time constants of each channel."""
KNOWN = 0.25
"""A channel whose time constants' sum has a larger standard deviation, relative to it, isn't identified: the search
holds it with one of 0.35 to 0.5 if nothing is estimated."""
EXPLAINED = 0.8
"""A height whose predictions explain a smaller share of its change isn't identified: vertical gusts moved the vehicle,
and its setpoints answered them. Flights without gusts explain 0.94 and more, with white noise of 0.6 m 0.86 and more.
In gusts the sum of the time constants, truly 4.0 s, was found as 4.4 to 7.2 s where 0.80 to 0.96 were explained, and as
5.5 to 24 s, mostly with deviations that don't cover that, where 0.24 to 0.70 were. Tuned: a share; 0.7 to 0.9; by
judgement."""


class Estimate(NamedTuple):
    """A parameter and its standard deviation: by the spread of the errors, and by when setpoints acted."""

    value: float
    sigma: float


def hardly_moved(recordings: Sequence[Recording]) -> dict[str, str]:
    """Return why channels can't be identified, by name: no setpoints, or hardly moved, in all recordings.

    Raises:
        RecordError: none can.
    """
    found, moved = dict[str, str](), [each.moved() for each in recordings]
    for channel, (minimum, unit) in MIN_MOVED.items():
        spans = [each[channel] for each in moved if channel in each]
        if not spans:
            found[channel] = f"no {channel} setpoints with responses to them"
        elif (largest := max(spans)) < minimum:
            text = (
                f"the {channel} setpoint changed by no more than {largest:.2g} {unit}: found too little to learn from"
            )
            found[channel] = f"{text}; {minimum:g} {unit} or more would do"
    if len(found) == len(CHANNELS):
        raise too_little(found)
    return found


def too_little(unidentified: Mapping[str, str]) -> RecordError:
    """Return the error of recordings that identify nothing; `unidentified`: why, by channel."""
    allowed = ", ".join(f"{minimum:g} {unit} of {channel}" for channel, (minimum, unit) in MIN_MOVED.items())
    text = "; ".join(unidentified.values())
    return RecordError(
        f"{text}; allowed: steps or ramps of at least one of {allowed}, as `identify SCENARIO` flies them"
    )


def unknown(estimates: Mapping[str, Estimate], covariance: Array) -> dict[str, str]:
    """Return of which channels too little is known, and why: by the sum of its time constants."""
    names, found = list(estimates), dict[str, str]()
    for channel, time_constants in TAUS_OF.items():
        if time_constants[0] in estimates:
            rows = [names.index(name) for name in time_constants]
            values = np.array([estimates[name].value for name in time_constants])
            sigma = math.sqrt(values @ covariance[np.ix_(rows, rows)] @ values) / float(values.sum())
            if sigma > KNOWN:
                found[channel] = f"{channel}: {sigma:.0%} would be the standard deviation of its time constant"
    return found


def unexplained(explained: Mapping[str, float]) -> dict[str, str]:
    """Return why the height isn't identified, by its name, if its predictions explain too little."""
    share = explained.get(QUANTITIES[-1], 1.0)
    text = f"height: its predictions explain {share:.0%} of its change, as in gusts; {EXPLAINED:.0%} or more would do"
    return {} if share >= EXPLAINED else {CHANNELS[-1]: text}
