"""Changes of shape in flight: how long they take, the least separation and the largest errors meanwhile.

configs/paper.yaml on a straight path, without its disturbance, all vehicles in their slots at first; a diamond of 30 m,
then three changes 70 s apart, under the virtual clock. Each row covers the 70 s from one change to the next. About 10 s
of processor time for each flight, a minute for the one with 20 followers.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from typing import Any, NamedTuple

from benchmarks import PAPER, both_directions, events_of, flown, parser
from benchmarks.gust_grid import FRAMES
from gcs_formation.studies.markdown import markdown

FIRST_S, INTERVAL_S = 10.0, 70.0
ANYWHERE = ("line", "circle", "square")
BEHIND = ("line", "arrow", "square")
"""Shapes without slots ahead of the leader: those possible in the follower's own frame."""


class Case(NamedTuple):
    """One flight."""

    frame: str
    delay_ms: float
    followers: int
    shapes: tuple[str, ...]


CASES = (
    *(Case("leader_heading", 0, followers, ANYWHERE) for followers in (3, 8, 20)),
    Case("leader_heading", 300, 3, ANYWHERE),
    Case("follower_heading", 0, 3, BEHIND),
    Case("follower_heading", 300, 3, BEHIND),
)


def fly(case: Case) -> list[list[str]]:
    """Fly one case and return a row for each of its changes."""
    begins_s = [FIRST_S + INTERVAL_S * i for i in range(len(case.shapes))]
    with flown(
        PAPER,
        duration_s=begins_s[-1] + INTERVAL_S,
        start__offset_m=[0, 0, 0],
        vehicles__count=1 + case.followers,
        formation__frame=case.frame,
        formation__changes=[{"at_s": at_s, "shape": s} for at_s, s in zip(begins_s, case.shapes, strict=True)],
        law__heading=FRAMES[case.frame],
        path__waypoints_m=[[0, 0, 200], [9000, 0, 200]],
        links=both_directions(case.delay_ms),
        disturbances=[],
        expect=[each for at_s in begins_s for each in expectations(at_s)],
    ) as summary:
        durations_s = [float(event["duration_s"]) for event in events_of(summary, "formation")]
    found: dict[tuple[float, str], float] = {}
    for verdict in summary.verdicts:
        key = verdict.expectation.from_s, verdict.expectation.metric
        worst = min if verdict.expectation.metric == "min_separation_m" else max
        found[key] = worst(found.get(key, verdict.value or 0.0), verdict.value or 0.0)
    case_cells = [case.frame.split("_")[0], f"{case.delay_ms:g} ms", str(case.followers)]
    rows: list[list[str]] = []
    for shape, duration_s, at_s in zip(case.shapes, durations_s, begins_s, strict=True):
        errors = " / ".join(f"{found[at_s, f'error_{axis}_m.max']:.2f}" for axis in "xyz")
        rows.append([f"→ {shape}", *case_cells, f"{duration_s:.1f}", f"{found[at_s, 'min_separation_m']:.1f}", errors])
    return rows


def expectations(from_s: float) -> list[dict[str, Any]]:
    """Return expectations that make the summary cover the time from one change to the next."""
    window = {"from_s": from_s, "to_s": from_s + INTERVAL_S - 0.1, "above": 0.0}
    return [{"metric": metric, **window} for metric in ("min_separation_m", *(f"error_{a}_m.max" for a in "xyz"))]


def main() -> None:
    """Fly the grid and print its table."""
    with ProcessPoolExecutor(parser(__doc__).parse_args().processes) as pool:
        rows = [row for each in pool.map(fly, CASES) for row in each]
    head = ("change", "slots turn with", "links each way", "followers", "way, s", "least separation, m")
    print(markdown((*head, "max abs error x / y / z, m"), rows))


if __name__ == "__main__":
    main()
