"""A link's delay and a vehicle's clock, from requests that the vehicle answers with its time (TIMESYNC)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from airlink.clock import Instant, nanoseconds
from flight_model.arrays import Array
from gcs_formation.link.clock_sync import ClockSync


class Delays(NamedTuple):
    """What was known after each of n answers, (n,) each, s."""

    round_trip_s: Array
    one_way_s: Array
    """Half the mean of the recent round trips, less the wait for the loop that answers."""
    sigma_s: Array
    """Standard deviation of the recent round trips."""
    asymmetry_s: Array
    """How much longer the delay up is than half of the round trip, as far as steps have shown it."""
    offset_s: Array
    """The vehicle's clock minus ours."""
    drift: Array
    """Rate of change of the offset."""


def delays(
    sent_s: npt.ArrayLike, vehicle_s: npt.ArrayLike, received_s: npt.ArrayLike, *, answering_period_s: float = 0.0
) -> Delays:
    """Return the estimates of delay and clock, answer by answer, as the ground station makes them in flight.

    Two Kalman filters of offset and drift, one of which takes the clock for a crystal's; samples weigh by the round
    trips' variance, and where delays have a sharp bound, that counts. Source: Bar-Shalom, Li, Kirubarajan, "Estimation
    with Applications to Tracking and Navigation", 11.6.2.

    Args:
        sent_s: (n,) when each request was sent, on our clock.
        vehicle_s: (n,) the vehicle's time in its answer.
        received_s: (n,) when the answer came, on our clock.
        answering_period_s: period of the vehicle's loop that answers; 0: at once.

    Raises:
        ValueError: other shapes, values that aren't finite, or an answer before its request.
    """
    rows = [np.asarray(each, dtype=np.float64) for each in (sent_s, vehicle_s, received_s)]
    if any(each.ndim != 1 or each.shape != rows[0].shape for each in rows):
        raise ValueError(f"found shapes {', '.join(str(each.shape) for each in rows)}; allowed: one of (n,) for all")
    if not all(np.isfinite(each).all() for each in rows) or (rows[2] < rows[0]).any():
        raise ValueError("found a time that isn't finite, or an answer before its request")
    sync, known = ClockSync(answering_period_s), list[tuple[float, ...]]()
    for sent, shown, received in zip(*(each.tolist() for each in rows), strict=True):
        sync.observe(Instant(nanoseconds(sent)), nanoseconds(shown), Instant(nanoseconds(received)))
        waits = sync.round_trip_s, sync.one_way_s, sync.jitter_s, sync.asymmetry_s
        known.append((*waits, sync.offset_s, sync.drift))
    return Delays(*np.array(known, dtype=np.float64).reshape(-1, len(Delays._fields)).T)
