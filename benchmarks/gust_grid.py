"""Formation errors after gusts on the followers only, beside the least errors possible under any law.

configs/paper.yaml in its bends, under the virtual clock. From 60 s on, every 10 s (every 25 s if slots turn with the
follower, because these settle more slowly), the air velocity of vehicles 2 to 4 changes by 0.6 m/s along the path and
0.6 m/s across it: forward and to the right, next time backward and to the left. These steps come at ten phases of a
tick of 0.1 s; each is compared with the bound for its own T. The figures are the worst of all steps and followers, by
ground truth. About 10 s of processor time for each flight.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from typing import Any, NamedTuple

from benchmarks import PAPER, both_directions, flown, parser
from formation_scenario import load_scenario
from gcs_formation.report import load_run
from gcs_formation.report.gusts import GustError, gusts
from gcs_formation.studies.markdown import markdown

FRAMES = {"leader_heading": {"kp": 1.2, "ki": 0.5, "kd": 1.8}, "follower_heading": {"kp": 1.0, "ki": 0.6, "kd": 0.1}}
"""For each frame of the slots: gains of the heading channel, as in configs/paper.yaml."""
DELAYS_MS = (20.0, 50.0, 100.0, 300.0)
FOLLOWERS = (2, 3, 4)
GUST_MPS = 0.6
TICK_S, FIRST_S, PHASES = 0.1, 60.0, 10
STEPS = {"leader_heading": (20, 10.0), "follower_heading": (10, 25.0)}
"""For each frame of the slots: the number of steps and the seconds between them."""


class Case(NamedTuple):
    """One flight."""

    frame: str
    delay_ms: float
    telemetry_hz: float
    law_hz: float


def steps(frame: str) -> Iterator[dict[str, Any]]:
    """Yield the steps of the followers' disturbance, each lasting until the next."""
    scenario = load_scenario(PAPER)
    path, speed_mps = scenario.leader_path, scenario.path.begin_mps
    count, interval_s = STEPS[frame]
    for step in range(count):
        at_s = round(FIRST_S + interval_s * step + TICK_S * (step * PHASES // count) / PHASES, 3)
        course_rad, sign = path.at(speed_mps * at_s).course_rad, (-1) ** step
        north, east = (math.sqrt(2.0) * wave(course_rad + math.pi / 4) for wave in (math.cos, math.sin))
        velocity_mps = [sign * GUST_MPS * north, sign * GUST_MPS * east, 0.0]
        yield {"at_s": at_s, "vehicles": list(FOLLOWERS), "velocity_mps": velocity_mps}


def fly(case: Case) -> list[GustError]:
    """Fly one case; return the errors after each step and on each axis, of the follower nearest to its limit."""
    count, interval_s = STEPS[case.frame]
    with flown(
        PAPER,
        duration_s=FIRST_S + interval_s * count,
        links=both_directions(case.delay_ms),
        expect=[],
        formation__frame=case.frame,
        law__heading=FRAMES[case.frame],
        law__rate_hz=case.law_hz,
        telemetry__rate_hz=case.telemetry_hz,
        disturbances=list(steps(case.frame)),
    ) as summary:
        return gusts(load_run(summary.run_dir))


def used(error: GustError) -> float:
    """Return an error's share of the allowed one."""
    return error.found_m / error.allowed_m


def row(case: Case, errors: Sequence[GustError]) -> list[str]:
    """Return a row of the table."""
    cells = [f"{case.delay_ms:g} ms", case.frame.split("_")[0], f"{case.telemetry_hz:g}, {case.law_hz:g}"]
    for axis in "xy":
        mine = [error for error in errors if error.axis == axis]
        largest, nearest = max(mine, key=lambda error: error.found_m), max(mine, key=used)
        cells += [f"{largest.found_m:.3f}", f"{nearest.round_trip_s:.2f}", f"{nearest.found_m:.3f}"]
        cells += [f"{nearest.min_m:.3f}", f"{nearest.allowed_m:.3f}"]
    return [*cells, f"{sum(used(error) <= 1.0 for error in errors)} of {len(errors)}"]


def main() -> None:
    """Fly the grid and print its table."""
    parsing = parser(__doc__, only="frames whose name has TEXT in it")
    for name, usual, unit, what in (
        ("delays", DELAYS_MS, "MS", "of links, each way"),
        ("telemetry", (10.0,), "HZ", "rates of telemetry"),
        ("law", (10.0,), "HZ", "rates of the law"),
    ):
        parsing.add_argument(f"--{name}", type=float, nargs="+", default=usual, metavar=unit, help=what)
    given = parsing.parse_args()
    frames = [frame for frame in FRAMES if given.only in frame]
    rates = list(product(given.delays, given.telemetry, given.law))
    chosen = [Case(frame, *each) for frame in frames for each in rates]
    with ProcessPoolExecutor(given.processes) as pool:
        rows = [row(case, errors) for case, errors in zip(chosen, pool.map(fly, chosen), strict=True)]
    head = ["links each way", "slots turn with", "telemetry, law, Hz"]
    for axis in "xy":
        nearest = ("T, s", f"then {axis}, m", "least possible, m", "held to, m")
        head += [f"max abs error {axis}, m", *nearest]
    print(markdown([*head, "held"], rows))


if __name__ == "__main__":
    main()
