"""Formation errors with noise like a GNSS receiver's in all vehicles' telemetry, by the law's set of gains.

configs/noise.yaml under the virtual clock, with its 0.6 m/s north and east on all, by default at 500 s; the figures are
the rms of the worst follower's true error from then on. With --at 60 --until 160, about 4 s of processor time for each
flight.
"""

from __future__ import annotations

import argparse
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import gcs_formation
from benchmarks.disturbance_grid import DISTURBED_S, both_ways
from benchmarks.tables import markdown

NOISE = Path(__file__).parents[1] / "configs" / "noise.yaml"
DELAYS_MS = (0, 100, 300)
FRAMES = ("leader_heading", "follower_heading")


class Case(NamedTuple):
    """One flight."""

    gains: str
    frame: str
    delay_ms: float


def fly(case: Case, at_s: float, until_s: float) -> list[float]:
    """Fly one case and return the worst follower's rms error along x, y and z in m."""
    expect = [{"metric": f"error_{axis}_m.rms", "from_s": at_s, "above": 0.0} for axis in "xyz"]
    with tempfile.TemporaryDirectory() as out:
        summary = gcs_formation.run(
            NOISE,
            clock="virtual",
            out=out,
            duration_s=until_s,
            links=both_ways(case.delay_ms),
            expect=expect,
            formation__frame=case.frame,
            law__gains=case.gains,
            disturbances__0__at_s=at_s,
        )
    found = [(verdict.expectation.metric[6], verdict.value or 0.0) for verdict in summary.verdicts]
    return [max(value for on, value in found if on == axis) for axis in "xyz"]


def main() -> None:
    """Fly the grid and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--at", type=float, default=DISTURBED_S, metavar="SECONDS", help="when the disturbance begins")
    parser.add_argument("--until", type=float, default=1000.0, metavar="SECONDS", help="end of the flights")
    parser.add_argument("--only", default="", metavar="TEXT", help="sets of gains whose name has TEXT in it")
    given = parser.parse_args()
    chosen = [
        Case(gains, frame, delay_ms)
        for gains in ("noise", "clean")
        if given.only in gains
        for frame in FRAMES
        for delay_ms in DELAYS_MS
    ]
    with ProcessPoolExecutor(given.processes) as pool:
        flown = pool.map(fly, chosen, [given.at] * len(chosen), [given.until] * len(chosen))
        rows = [
            [case.gains, case.frame.split("_")[0], f"{case.delay_ms:g} ms", *(f"{error_m:.3f}" for error_m in errors_m)]
            for case, errors_m in zip(chosen, flown, strict=True)
        ]
    print(markdown(["gains", "slots turn with", "links each way", "rms x, m", "rms y, m", "rms z, m"], rows))


if __name__ == "__main__":
    main()
