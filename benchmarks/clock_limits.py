"""How well a vehicle's clock is known under jitter, beside what its round trips can tell at all.

Normal jitter: the bound of Cramer and Rao. Uniform and Pareto jitter: what the narrowest corridor of all delays gives
to one who knows the kind of jitter. The clock is a crystal's of unknown rate, the vehicle answers at once.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from airlink.clock import NANOSECONDS, Instant
from airlink.delay_distribution import QUANTILE
from flight_model.arrays import Array
from gcs_formation.link.clock_sync import CRYSTAL_DRIFT, ClockSync
from gcs_formation.link.delay_edges import NEW
from gcs_formation.studies.markdown import markdown

DELAY_S: Final = 0.3
OFFSET_S: Final = 100.0
MAX_DRIFT: Final = 2e-4
SEEDS: Final = 40


def draws(kind: str, jitter_s: float, count: int, seed: int) -> tuple[Array, Array]:
    """Return `count` delays up and down, s."""
    shares = np.random.default_rng(seed).random((2, count)).tolist()
    up_s, down_s = (
        DELAY_S + jitter_s * np.array([QUANTILE[kind](share) for share in direction]) for direction in shares
    )
    return up_s, down_s


def error_s(up_s: Array, down_s: Array, rate_hz: float, drift: float) -> float:
    """Return by how much the estimator maps the newest time since boot wrong, s."""
    sync, sent_s = ClockSync(), 0.0
    for number, (up, down) in enumerate(zip(up_s.tolist(), down_s.tolist(), strict=True)):
        sent_s = number / rate_hz
        shown = round((OFFSET_S + (1 + drift) * (sent_s + up)) * NANOSECONDS)
        sync.observe(Instant(round(sent_s * NANOSECONDS)), shown, Instant(round((sent_s + up + down) * NANOSECONDS)))
    return sync.to_instant(OFFSET_S + (1 + drift) * sent_s) / NANOSECONDS - sent_s


def normal_limit_s(jitter_s: float, count: int, seconds: float) -> float:
    """Return the Cramer-Rao bound of the offset at the end, s: the mean's, and half the time's slope."""
    slope = 1.0 / (count * seconds**2 / (6.0 * jitter_s**2) + CRYSTAL_DRIFT**-2)
    return math.sqrt(jitter_s**2 / (2 * count) + slope * seconds**2 / 4)


def corridor_error_s(up_s: Array, down_s: Array, rate_hz: float, *, both: bool) -> float:
    """Return the error at the end, s, of the narrowest corridor of all delays, of a clock without drift."""
    at_s = (np.arange(len(up_s)) - len(up_s) + 1) / rate_hz

    def edges(drift: float) -> tuple[Array, Array]:
        return up_s - drift * at_s, down_s + drift * at_s

    def width_s(drift: float) -> float:
        directions = edges(drift)
        return float(sum(np.ptp(each) if both else -np.min(each) for each in directions))

    low, high = -MAX_DRIFT, MAX_DRIFT
    for _ in range(60):
        left, right = low + (high - low) / 3, high - (high - low) / 3
        low, high = (low, right) if width_s(left) < width_s(right) else (left, high)
    up, down = edges((low + high) / 2)
    if both:
        return float((np.min(up) + np.max(up) - np.min(down) - np.max(down)) / 4)
    return float((np.min(up) - np.min(down)) / 2)


def found_and_limit_s(kind: str, jitter_s: float, rate_hz: float, seconds: float, seeds: range) -> tuple[float, float]:
    """Return the estimator's error and the limit, rms over seeds, s."""
    count, found, best = round(seconds * rate_hz), list[float](), list[float]()
    for seed in seeds:
        up_s, down_s = draws(kind, jitter_s, count, seed)
        found.append(error_s(up_s, down_s, rate_hz, 20e-6 * (seed % 4 - 1)))
        if kind == "normal":
            best.append(normal_limit_s(jitter_s, count, seconds))
        else:
            seen = count - count // NEW  # before the edges are found next
            best.append(corridor_error_s(up_s[:seen], down_s[:seen], rate_hz, both=kind == "uniform"))
    return float(np.sqrt(np.mean(np.square(found)))), float(np.sqrt(np.mean(np.square(best))))


def main() -> None:
    """Print the table."""
    rows: list[list[str]] = []
    for kind in ("normal", "uniform", "pareto"):
        for jitter_s in (0.005, 0.02):
            for rate_hz in (4.0, 10.0):
                row = [kind, f"{1e3 * jitter_s:g}", f"{rate_hz:g}"]
                for seconds in (30.0, 120.0):
                    found_s, limit_s = found_and_limit_s(kind, jitter_s, rate_hz, seconds, range(SEEDS))
                    row.append(f"{1e3 * limit_s:.3f}, {1e3 * found_s:.3f}")
                rows.append(row)
    head = ("jitter", "deviation, ms", "round trips a second", "after 30 s: limit, found, ms", "after 120 s")
    print(markdown(head, rows))


if __name__ == "__main__":
    main()
