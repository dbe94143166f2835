"""Take-offs over links that lose frames: the least separation, and how long until the path begins; the worst of ten.

`python -m benchmarks.features.departure` flies `configs/quickstart.yaml` from the ground, and 5 s of its path, by seeds
to which nothing was tuned. `--first 100` takes others.
"""

from __future__ import annotations

import argparse
import tempfile
from itertools import product
from pathlib import Path
from typing import Any, Final, NamedTuple

from benchmarks.in_order import in_order
from gcs_formation import run
from gcs_formation.studies.markdown import markdown

SCENARIO: Final = Path(__file__).parents[3] / "configs" / "quickstart.yaml"
LINKS: Final[dict[str, dict[str, Any]]] = {
    "ideal": {},
    "300 ± 20 ms, 5 %": {"delay_ms": 300, "jitter_ms": 20, "loss": 0.05},
    "300 ± 20 ms, 10 %": {"delay_ms": 300, "jitter_ms": 20, "loss": 0.1},
    "300 ± 20 ms, 20 % in bursts of 5": {"delay_ms": 300, "jitter_ms": 20, "loss": 0.2, "mean_burst": 5},
    "300 ± 20 ms, 30 %": {"delay_ms": 300, "jitter_ms": 20, "loss": 0.3},
}


class TakenOff(NamedTuple):
    """One take-off and assembly."""

    separation_m: float
    begins_s: float
    """When the path began, s after the start."""


def fly(wanted: tuple[str, int]) -> TakenOff:
    """Fly one over the links of a name, by a seed."""
    link, seed = wanted
    settings = {"seed": seed, "duration_s": 5.0, "expect": [], "finish": {"loiter_s": 1.0}}
    settings |= {"links": {"default": LINKS[link]}}
    with tempfile.TemporaryDirectory() as directory:
        summary = run(SCENARIO, clock="virtual", out=directory, overwrite=True, overrides=settings).to_dict()
    return TakenOff(summary["safety"]["min_separation_m"], summary["begun_s"])


def main() -> None:
    """Fly, and print the table."""
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("--flights", type=int, default=10, help="flights over each kind of link")
    options.add_argument("--first", type=int, default=1, help="the first flight's seed")
    options.add_argument("--workers", type=int, default=2)
    given = options.parse_args()
    if given.flights < 1:
        options.error(f"--flights: found {given.flights}; allowed: 1 or more")
    wanted = list(product(LINKS, range(given.first, given.first + given.flights)))
    flown = dict(zip(wanted, in_order(fly, wanted, given.workers), strict=True))
    rows = list[list[str]]()
    for link in LINKS:
        each = [flown[link, seed] for link_, seed in wanted if link_ == link]
        min_m, latest_s = min(one.separation_m for one in each), max(one.begins_s for one in each)
        rows.append([link, f"{min_m:.1f}", f"{latest_s:.0f}"])
    print(markdown(["links", "least separation, m", "path begins after, s"], rows))


if __name__ == "__main__":
    main()
