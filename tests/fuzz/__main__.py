"""Throws any number of datagrams at both ends of flights: `python -m tests.fuzz --datagrams 1000000`."""

from __future__ import annotations

import time
from dataclasses import replace

import click
import numpy as np

from benchmarks.tables import markdown
from gcs_formation.arrays import Array
from tests.fuzz.siege import End, Siege, check, fly, worst_error_m

DURATION_S = 60.0
HEAD = ("thrown at", "what", "datagrams,", "a datagram, µs", "worst error, m", "dropped,", "peak memory, MiB")
ENDS: tuple[End, ...] = ("station", "vehicles")


@click.command()
@click.option("--datagrams", type=click.IntRange(1), default=100_000, help="In all, shared out evenly.")
@click.option("--each-turn", type=click.IntRange(1, 1000), default=200, help="Every 20 ms of flight.")
@click.option("--seed", type=click.IntRange(0), default=1)
def main(datagrams: int, each_turn: int, seed: int) -> None:
    """Throw DATAGRAMS at flights of 60 s under the virtual clock; an exception or a broken limit ends it.

    Thrown at: the ground station, or the vehicles. What: noise, damaged frames and strangers' frames, from thousands of
    addresses ("strangers": the setpoints of the flight are held to those of the same flight in peace, to the bit), from
    its peers' own addresses too ("own"), or with frames forged in its peers' names ("forged").
    """
    peace = np.array(fly(DURATION_S, Siege()).notes.setpoints)
    rows = [
        _besiege(end, what, datagrams // 6, Siege(seed, each_turn), peace)
        for end in ENDS
        for what in ("strangers", "own", "forged")
    ]
    click.echo(markdown(HEAD, rows))


def _besiege(end: End, what: str, wanted: int, siege: Siege, peace: Array) -> list[str]:
    began, thrown, dropped, worst_m, peaks_kib = time.perf_counter(), 0, 0, 0.0, list[int]()
    siege = replace(siege, end=end, forged=what == "forged", own_share=0.0 if what == "strangers" else 0.3)
    while thrown < wanted:
        siege = replace(siege, seed=siege.seed + 1)
        flown = fly(DURATION_S, siege)
        check(flown)
        if what == "strangers":
            assert np.array_equal(np.array(flown.notes.setpoints), peace, equal_nan=True)
        thrown, dropped = thrown + flown.thrown, dropped + flown.dropped
        worst_m = max(worst_m, worst_error_m(flown.notes))
        peaks_kib.extend(flown.peak_kib)
    each_us = (time.perf_counter() - began) / thrown * 1e6
    memory = f"{peaks_kib[0] / 1024:.1f} to {peaks_kib[-1] / 1024:.1f}"
    error = "–" if what == "forged" else f"{worst_m:.3f}"
    return [end, what, f"{thrown}", f"{each_us:.0f}", error, f"{dropped}", memory]


if __name__ == "__main__":
    main()
