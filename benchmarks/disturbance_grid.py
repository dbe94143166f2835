"""Formation errors after a disturbance on every vehicle, over delays, their split, losses and the slots' frame.

configs/paper.yaml under the virtual clock, with its 0.6 m/s north and east on all, by default at 500 s; the figures are
the largest |error| of the worst follower from then on. With --at 60 --until 90, about 4 s of processor time for each
of the 34 flights.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import gcs_formation
from benchmarks.tables import markdown

PAPER = Path(__file__).parents[1] / "configs" / "paper.yaml"
DISTURBED_S = 500.0
FRAMES = {
    "leader_heading": {"kp": 1.2, "ki": 0.5, "kd": 1.8},
    "follower_heading": {"kp": 1.0, "ki": 0.6, "kd": 0.1},
}
"""Frame of the slots -> gains of the heading channel, as configs/paper.yaml says."""


class Case(NamedTuple):
    """One flight."""

    links: str
    keys: dict[str, Any]
    frame: str
    compensated: bool


class Errors(NamedTuple):
    """Largest |error| in m and the follower that had it, along x and y."""

    x: tuple[float, str]
    y: tuple[float, str]


def both_ways(delay_ms: float) -> dict[str, Any]:
    """Return links with one delay in each direction."""
    return {"default": {"delay_ms": delay_ms}}


def split(up_ms: float, down_ms: float) -> dict[str, Any]:
    """Return links with different delays to and from the vehicles."""
    return {"uplink": {"delay_ms": up_ms}, "downlink": {"delay_ms": down_ms}}


SAME = {f"{delay} ms": both_ways(delay) for delay in (0, 100, 200, 300, 500)}
UNEQUAL = {
    "leader 50 ms, followers 350 ms": both_ways(350) | {"changes": [{"at_s": 0, "vehicles": [1], "delay_ms": 50}]}
}
COMPENSATED_ONLY = {
    "150 ms up, 150 ms down": split(150, 150),
    "50 ms up, 250 ms down": split(50, 250),
    "250 ms up, 50 ms down": split(250, 50),
    "5 % loss": {"default": {"loss": 0.05}},
    "20 % loss, 5 in a row": {"default": {"loss": 0.2, "mean_burst": 5.0}},
}


def cases() -> Iterator[Case]:
    """Yield every flight of the grid."""
    for frame in FRAMES:
        for links, keys in (SAME | UNEQUAL).items():
            yield from (Case(links, keys, frame, compensated) for compensated in (True, False))
        yield from (Case(links, keys, frame, True) for links, keys in COMPENSATED_ONLY.items())


def fly(case: Case, at_s: float, until_s: float) -> Errors:
    """Fly one case and return its errors."""
    expect = [{"metric": f"error_{axis}_m.max", "from_s": at_s, "above": 0.0} for axis in "xy"]
    with tempfile.TemporaryDirectory() as out:
        summary = gcs_formation.run(
            PAPER,
            clock="virtual",
            out=out,
            duration_s=until_s,
            links=case.keys,
            expect=expect,
            formation__frame=case.frame,
            law__heading=FRAMES[case.frame],
            law__delay_compensation=case.compensated,
            disturbances__0__at_s=at_s,
        )
    found = [(v.expectation.metric[6], v.value, str(v.vehicle)) for v in summary.verdicts]
    worst = {axis: max((value, who) for on, value, who in found if on == axis and value is not None) for axis in "xy"}
    return Errors(worst["x"], worst["y"])


def row(case: Case, errors: Errors) -> list[str]:
    """Return a row of the table."""
    cells = [case.links, case.frame.split("_")[0], "yes" if case.compensated else "no"]
    return [*cells, *(f"{error_m:.3f} ({who})" for error_m, who in errors)]


def main() -> None:
    """Fly the grid and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--at", type=float, default=DISTURBED_S, metavar="SECONDS", help="when the disturbance begins")
    parser.add_argument("--until", type=float, default=1000.0, metavar="SECONDS", help="end of the flights")
    parser.add_argument("--only", default="", metavar="TEXT", help="links whose name has TEXT in it")
    given = parser.parse_args()
    chosen = [case for case in cases() if given.only in case.links]
    with ProcessPoolExecutor(given.processes) as pool:
        flown = pool.map(fly, chosen, [given.at] * len(chosen), [given.until] * len(chosen))
        rows = [row(case, errors) for case, errors in zip(chosen, flown, strict=True)]
    head = (
        "links each way",
        "slots turn with",
        "compensated",
        "max abs error x, m (follower)",
        "max abs error y, m (follower)",
    )
    print(markdown(head, rows))


if __name__ == "__main__":
    main()
