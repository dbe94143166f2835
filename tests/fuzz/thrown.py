"""Any number of random datagrams against both ends of flights, and the results."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from flight_model.arrays import Array
from gcs_formation.studies.markdown import markdown
from tests.fuzz.siege import End, Siege, check, fly, worst_error_m

DURATION_S = 60.0
HEAD = ("thrown at", "what", "datagrams,", "a datagram, µs", "worst error, m", "dropped,", "peak memory, MiB")
ENDS: tuple[End, ...] = ("station", "vehicles")


def throw(datagrams: int, each_turn: int, seed: int) -> str:
    """Throw datagrams at flights of 60 s under the virtual clock; return a table. A broken limit raises."""
    peace = np.array(fly(DURATION_S, Siege()).recorder.setpoints)
    rows = [
        _besiege(end, what, datagrams // 6, Siege(seed, each_turn), peace)
        for end in ENDS
        for what in ("strangers", "own", "forged")
    ]
    return markdown(HEAD, rows)


def _besiege(end: End, what: str, wanted: int, siege: Siege, peace: Array) -> list[str]:
    # measured, among other things: the time that a datagram takes
    began, thrown, dropped, worst_m, peaks_kib = time.perf_counter(), 0, 0, 0.0, list[int]()
    siege = replace(siege, end=end, forged=what == "forged", own_share=0.0 if what == "strangers" else 0.3)
    while thrown < wanted:
        siege = replace(siege, seed=siege.seed + 1)
        flown = fly(DURATION_S, siege)
        check(flown)
        if what == "strangers":
            assert np.array_equal(np.array(flown.recorder.setpoints), peace, equal_nan=True)
        thrown, dropped = thrown + flown.thrown, dropped + flown.dropped
        worst_m = max(worst_m, worst_error_m(flown.recorder))
        peaks_kib.extend(flown.peak_kib)
    each_us = (time.perf_counter() - began) / thrown * 1e6
    memory = f"{peaks_kib[0] / 1024:.1f} to {peaks_kib[-1] / 1024:.1f}"
    error = "–" if what == "forged" else f"{worst_m:.3f}"
    return [end, what, f"{thrown}", f"{each_us:.0f}", error, f"{dropped}", memory]
