"""Wall time for a simulated second and peak memory, against the number of vehicles.

Each size flies in a process of its own under the virtual clock: emulated vehicles, links and ground station together,
10 Hz, everything recorded. Ratios to the smallest size are what can be compared between machines.
"""

from __future__ import annotations

import resource
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, NamedTuple

import gcs_formation
from benchmarks.tables import markdown

COUNTS = (4, 20, 100, 254)
DURATION_S = 20.0
SPEED_MPS = 22.0
KIB_OF_A_MIB = 1024
UNITS_OF_A_KIB = 1024 if sys.platform == "darwin" else 1
"""getrusage counts KiB on Linux and bytes on macOS."""


class Cost(NamedTuple):
    """What a size costs."""

    wall_per_s: float
    peak_mib: float


def scenario(count: int) -> dict[str, Any]:
    """Return `count` vehicles one behind the other on a straight path."""
    return {
        "name": f"scale-{count}",
        "duration_s": DURATION_S,
        "start": {"in_air": True, "run_in_s": 6},
        "finish": {"loiter_s": 0},
        "vehicles": {"count": count},
        "formation": {"shape": "line", "spacing_m": 30},
        "path": {"speed_mps": SPEED_MPS, "waypoints_m": [[0, 0, 200], [SPEED_MPS * (DURATION_S + 60), 0, 200]]},
    }


def cost(count: int) -> Cost:
    """Fly one size; meant for a process of its own."""
    with tempfile.TemporaryDirectory() as out:
        figures = gcs_formation.run(scenario(count), clock="virtual", out=out).to_dict()
    peak_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / UNITS_OF_A_KIB
    return Cost(1.0 / figures["real_time_factor"], peak_kib / KIB_OF_A_MIB)


def main() -> None:
    """Fly every size, one after the other, and print the table."""
    costs: dict[int, Cost] = {}
    for count in COUNTS:
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            costs[count] = pool.submit(cost, count).result()
    least = costs[COUNTS[0]]
    rows = [
        [
            str(count),
            f"{each.wall_per_s:.4f}",
            f"{each.wall_per_s / least.wall_per_s:.1f}",
            f"{each.peak_mib:.0f}",
            f"{each.peak_mib / least.peak_mib:.2f}",
        ]
        for count, each in costs.items()
    ]
    head = ("vehicles", "wall s a simulated s, s", "ratio to 4, times", "peak memory, MiB", "ratio to 4, times")
    print(markdown(head, rows))


if __name__ == "__main__":
    main()
