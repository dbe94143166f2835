"""Formation errors after a gust on the followers only, held against the least that any law could have.

configs/paper.yaml with its 0.6 m/s north and east at 500 s on vehicles 2 to 4, under the virtual clock; the figures are
the largest |error| along each slot axis from 500 s on. About 30 s of processor time for each flight.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

import gcs_formation
from benchmarks.disturbance_grid import DISTURBED_S, FRAMES, PAPER, both_ways
from benchmarks.tables import markdown
from formation_scenario import load_scenario
from gcs_formation.record.run_directory import TIMESERIES
from gcs_formation.record.timeseries import flying, read_parquet
from gcs_formation.stability.gust import accel_limits_mps2, allowed_gust_error_m, least_gust_error_m
from gcs_formation.stability.loops import loop_delay_s

DELAYS_MS = (0, 20, 30, 50, 100, 200, 300)
FOLLOWERS = (2, 3, 4)
RATES_HZ = (10.0, 10.0)
GUST_MPS = np.array((0.6, 0.6))


class Case(NamedTuple):
    """One flight."""

    frame: str
    delay_ms: float


class Axis(NamedTuple):
    """The worst follower's error along one axis, the least possible one, and what the law is held to, m."""

    error_m: float
    least_m: float
    allowed_m: float


class Errors(NamedTuple):
    """What came of a flight."""

    round_trip_s: float
    x: Axis
    y: Axis


def fly(case: Case, until_s: float) -> Errors:
    """Fly one case and return its errors."""
    with tempfile.TemporaryDirectory() as out:
        summary = gcs_formation.run(
            PAPER,
            clock="virtual",
            out=out,
            duration_s=until_s,
            links=both_ways(case.delay_ms),
            expect=[],
            formation__frame=case.frame,
            law__heading=FRAMES[case.frame],
            disturbances__0__vehicles=list(FOLLOWERS),
        ).to_dict()
        columns = read_parquet(Path(out) / TIMESERIES)
        series = {name: values[flying(columns)] for name, values in columns.items()}
    delays = [summary["links"][str(follower)]["measured_delay_ms"]["p50"] / 1e3 for follower in FOLLOWERS]
    round_trip_s = max(loop_delay_s(delay, delay, 0.0, *RATES_HZ) for delay in delays)
    axes = [axis_of(series, case.frame, follower, round_trip_s) for follower in FOLLOWERS]
    x, y = (max(each, key=lambda axis: axis.error_m / axis.allowed_m) for each in zip(*axes, strict=True))
    return Errors(round_trip_s, x, y)


def axis_of(series: dict[str, np.ndarray], frame: str, follower: int, round_trip_s: float) -> tuple[Axis, Axis]:
    """Return a follower's errors along x and y."""
    own = {name: column[series["vehicle"] == follower] for name, column in series.items()}
    lead = {name: column[series["vehicle"] == 1] for name, column in series.items()}
    after = own["mission_time_s"] >= DISTURBED_S
    heading = float((lead if frame == "leader_heading" else own)["true_heading_rad"][after][0])
    cos, sin = math.cos(heading), math.sin(heading)
    model, speed_mps = load_scenario(PAPER).vehicles[1].model, load_scenario(PAPER).path.speed_mps
    gust = GUST_MPS @ np.array(((cos, -sin), (sin, cos)))
    limits = zip(gust, accel_limits_mps2(model, speed_mps), ("error_x_m", "error_y_m"), strict=True)
    x, y = (
        Axis(
            float(np.abs(own[name][after]).max()),
            float(least_gust_error_m(along, round_trip_s, most)),
            float(allowed_gust_error_m(along, round_trip_s, most)),
        )
        for along, most, name in limits
    )
    return x, y


def row(case: Case, errors: Errors) -> list[str]:
    """Return a row of the table."""
    cells = [f"{case.delay_ms:g} ms", case.frame.split("_")[0], f"{errors.round_trip_s:.3f}"]
    for axis in (errors.x, errors.y):
        cells += [f"{axis.error_m:.3f}", f"{axis.least_m:.3f}", f"{axis.allowed_m:.3f}"]
    held = all(axis.error_m <= axis.allowed_m for axis in (errors.x, errors.y))
    return [*cells, "yes" if held else "no"]


def main() -> None:
    """Fly the grid and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--until", type=float, default=1000.0, metavar="SECONDS", help="end of the flights")
    parser.add_argument("--only", default="", metavar="TEXT", help="frames whose name has TEXT in it")
    given = parser.parse_args()
    chosen = [Case(frame, delay_ms) for frame in FRAMES if given.only in frame for delay_ms in DELAYS_MS]
    with ProcessPoolExecutor(given.processes) as pool:
        flown = pool.map(fly, chosen, [given.until] * len(chosen))
        rows = [row(case, errors) for case, errors in zip(chosen, flown, strict=True)]
    head = ["links each way", "slots turn with", "round trip, s"]
    head += [f"{what} {axis}, m" for axis in "xy" for what in ("max abs error", "least possible", "held to")]
    print(markdown([*head, "held"], rows))


if __name__ == "__main__":
    main()
