"""Independent streams of random numbers, derived from a run's seed."""

from __future__ import annotations

import numpy as np


def random_stream(seed: int, purpose: str, *key: int) -> np.random.Generator:
    """Return a stream, independent of the streams of every other purpose and key.

    Args:
        seed: the run's seed.
        purpose: what the numbers are for, such as "links".
        *key: distinguishes the streams of one purpose, such as a vehicle's network and system id.
    """
    origin = np.random.SeedSequence(seed, spawn_key=(int.from_bytes(purpose.encode(), "big"), *key))
    return np.random.Generator(np.random.Philox(origin))
