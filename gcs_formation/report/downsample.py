"""Downsampling that keeps what a plot shows."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gcs_formation.arrays import Array

Indices = npt.NDArray[np.int64]


def extremes(values: Array, buckets: int) -> Indices:
    """Return rising indices into (T,) values that keep every extreme a plot could show.

    The series is cut into at most `buckets` pieces; of each the smallest, the largest and, where there is one, an
    unknown (NaN) value are kept, so that a line through them spans the same range and breaks in the same places.
    First and last are kept too. A series of no more than 2 * `buckets` values is kept whole.
    """
    size = values.size
    if size <= 2 * buckets:
        return np.arange(size)
    width = -(-size // buckets)
    padded = np.full(width * -(-size // width), values[-1])
    padded[:size] = values
    pieces = padded.reshape(-1, width)
    unknown = np.isnan(pieces)
    begin = np.arange(pieces.shape[0]) * width
    kept = [
        begin + np.where(unknown, np.inf, pieces).argmin(axis=1),
        begin + np.where(unknown, -np.inf, pieces).argmax(axis=1),
        (begin + unknown.argmax(axis=1))[unknown.any(axis=1)],
        np.array([0, size - 1]),
    ]
    return np.unique(np.minimum(np.concatenate(kept), size - 1))


def evenly(size: int, count: int) -> Indices:
    """Return at most `count` rising indices spread over a series of `size`, first and last included."""
    if size <= count:
        return np.arange(size)
    return np.unique(np.round(np.linspace(0, size - 1, count)).astype(np.int64))
