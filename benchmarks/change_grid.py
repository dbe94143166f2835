"""Changes of shape in flight: how long they take, the least separation and the largest errors on the way.

configs/paper.yaml on a straight path, without its disturbance, everyone in its slot at first; a diamond of 30 m, then
three changes 70 s apart, under the virtual clock. Each row is of the 70 s from one change to the next. About 10 s of
processor time for each flight, a minute for that with 20 followers.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import gcs_formation
from benchmarks.gust_grid import FRAMES, PAPER, both_ways
from gcs_formation.record.run_directory import EVENTS
from gcs_formation.studies.dataset import markdown

FIRST_S, APART_S = 10.0, 70.0
ANYWHERE = ("line", "circle", "square")
BEHIND = ("line", "arrow", "square")
"""Shapes of which no slot is ahead of the leader: those that the follower's own frame has."""


class Case(NamedTuple):
    """One flight."""

    frame: str
    delay_ms: float
    followers: int
    shapes: tuple[str, ...]


class Change(NamedTuple):
    """What came of one change: how long the way is, s; the least separation and the largest |errors|, m."""

    shape: str
    way_s: float
    separation_m: float
    errors_m: tuple[float, float, float]


CASES = (
    *(Case("leader_heading", 0, followers, ANYWHERE) for followers in (3, 8, 20)),
    Case("leader_heading", 300, 3, ANYWHERE),
    Case("follower_heading", 0, 3, BEHIND),
    Case("follower_heading", 300, 3, BEHIND),
)


def fly(case: Case) -> list[Change]:
    """Fly one case and return its changes."""
    begins_s = [FIRST_S + APART_S * i for i in range(len(case.shapes))]
    with tempfile.TemporaryDirectory() as out:
        summary = gcs_formation.run(
            PAPER,
            clock="virtual",
            out=out,
            duration_s=begins_s[-1] + APART_S,
            start__offset_m=[0, 0, 0],
            vehicles__count=1 + case.followers,
            formation__frame=case.frame,
            formation__changes=[{"at_s": at_s, "shape": s} for at_s, s in zip(begins_s, case.shapes, strict=True)],
            law__heading=FRAMES[case.frame],
            path__waypoints_m=[[0, 0, 200], [9000, 0, 200]],
            links=both_ways(case.delay_ms),
            disturbances=[],
            expect=[each for at_s in begins_s for each in expectations(at_s)],
        )
        ways_s = list(ways(Path(out) / EVENTS))
    found: dict[tuple[float, str], float] = {}
    for verdict in summary.verdicts:
        key = verdict.expectation.from_s, verdict.expectation.metric
        least = min if verdict.expectation.metric == "min_separation_m" else max
        found[key] = least(found.get(key, verdict.value or 0.0), verdict.value or 0.0)
    return [
        Change(
            shape,
            way_s,
            found[at_s, "min_separation_m"],
            (found[at_s, "error_x_m.max"], found[at_s, "error_y_m.max"], found[at_s, "error_z_m.max"]),
        )
        for shape, way_s, at_s in zip(case.shapes, ways_s, begins_s, strict=True)
    ]


def expectations(from_s: float) -> list[dict[str, Any]]:
    """Return what makes the summary look at the time from one change to the next."""
    window = {"from_s": from_s, "to_s": from_s + APART_S - 0.1, "above": 0.0}
    return [{"metric": metric, **window} for metric in ("min_separation_m", *(f"error_{a}_m.max" for a in "xyz"))]


def ways(events: Path) -> Iterator[float]:
    """Yield how long each planned way is, s."""
    for line in events.read_text().splitlines():
        event = json.loads(line)
        if event["kind"] == "formation":
            yield float(event["duration_s"])


def rows(case: Case, changes: list[Change]) -> Iterator[list[str]]:
    """Yield the rows of a case."""
    for shape, way_s, separation_m, errors_m in changes:
        errors = " / ".join(f"{error_m:.2f}" for error_m in errors_m)
        flown = [case.frame.split("_")[0], f"{case.delay_ms:g} ms", str(case.followers)]
        yield [f"→ {shape}", *flown, f"{way_s:.1f}", f"{separation_m:.1f}", errors]


def main() -> None:
    """Fly the grid and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    with ProcessPoolExecutor(given.processes) as pool:
        flown = list(pool.map(fly, CASES))
    head = ("change", "slots turn with", "links each way", "followers", "way, s", "least separation, m")
    found = [row for case, changes in zip(CASES, flown, strict=True) for row in rows(case, changes)]
    print(markdown((*head, "max abs error x / y / z, m"), found))


if __name__ == "__main__":
    main()
