"""What a vehicle more costs: time, memory and recorded bytes, against the number of vehicles.

Each size flies in a process of its own: emulated vehicles, links and ground station together, law and telemetry at
10 Hz, everything recorded. Under the virtual clock that is all; with `--real`, over UDP, vehicles have a second one.
"""

from __future__ import annotations

import resource
import sys
import time
from typing import Any, NamedTuple

from benchmarks import alone, counts_parser, flown, print_load
from gcs_formation.app.operator import ClockName
from gcs_formation.studies.dataset import markdown

COUNTS = (4, 16, 64, 128, 254, 500)
FULL_NETWORK = 254
DURATION_S = 5.0
RUN_IN_S = 6
REAL_DURATION_S = 30.0
SPEED_MPS = 22.0
MIB = 2**20
RSS_UNIT = 1 if sys.platform == "darwin" else 1024
"""getrusage counts bytes on macOS and KiB on Linux."""


class Cost(NamedTuple):
    """What a flight cost."""

    vehicles: int
    simulated_s: float
    wall_s: float
    processor_s: float
    peak_mib: float
    recorded_mib: float
    worst_m: float
    """Largest formation error of all."""
    control: dict[str, Any]


def scenario(count: int, duration_s: float) -> dict[str, Any]:
    """Return `count` vehicles one behind the other on a straight path, 254 to a network."""
    places = [divmod(index, FULL_NETWORK) for index in range(count)]
    vehicles: list[dict[str, Any]] = [{"id": place + 1, "network": network + 1} for network, place in places]
    vehicles[0]["role"] = "leader"
    return {
        "name": f"scale-{count}",
        "duration_s": duration_s,
        "start": {"in_air": True, "run_in_s": RUN_IN_S, "timeout_s": 60},
        "finish": {"loiter_s": 0},
        "vehicles": vehicles,
        "formation": {"shape": "line", "spacing_m": 30},
        "path": {"speed_mps": SPEED_MPS, "waypoints_m": [[0, 0, 200], [SPEED_MPS * (duration_s + 60), 0, 200]]},
    }


def cost(count: int, clock: ClockName, duration_s: float) -> Cost:
    """Fly one size; meant for a process of its own, whose peak of memory is that flight's."""
    began = time.process_time()
    with flown(scenario(count, duration_s), clock) as summary:
        processor_s, figures = time.process_time() - began, summary.to_dict()
        recorded = sum(file.stat().st_size for file in summary.run_dir.iterdir())
    return Cost(
        vehicles=count,
        simulated_s=figures["real_time_factor"] * figures["wall_s"],
        wall_s=figures["wall_s"],
        processor_s=processor_s,
        peak_mib=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * RSS_UNIT / MIB,
        recorded_mib=recorded / MIB,
        worst_m=max(each[f"error_{axis}_m"]["max"] for each in figures["followers"].values() for axis in "xyz"),
        control=figures["control"],
    )


def growth(costs: list[Cost]) -> str:
    """Return the table of sizes."""
    head = (
        "vehicles", "wall s a simulated s, s", "processor s a simulated s, s", "of it a vehicle, ms",
        "peak memory, MiB", "recorded, KiB a vehicle and s", "largest error, m",
    )  # fmt: skip
    rows = [
        [
            str(each.vehicles),
            f"{each.wall_s / each.simulated_s:.3f}",
            f"{each.processor_s / each.simulated_s:.3f}",
            f"{each.processor_s / each.simulated_s / each.vehicles * 1e3:.1f}",
            f"{each.peak_mib:.0f}",
            f"{each.recorded_mib * 1024 / each.vehicles / each.simulated_s:.1f}",
            f"{each.worst_m:.3f}",
        ]
        for each in costs
    ]
    return markdown(head, rows)


def punctuality(costs: list[Cost]) -> str:
    """Return the table of flights under the real clock."""
    head = ("vehicles", "ticks,", "late,", "compute p50, ms", "compute p99, ms", "period p99, ms", "longest, ms")
    taken = ("compute_ms", "p50"), ("compute_ms", "p99"), ("period_ms", "p99"), ("period_ms", "max")
    rows = [
        [
            *(each.vehicles, each.control["ticks"], each.control["late_ticks"]),
            *(f"{each.control[what][figure]:.1f}" for what, figure in taken),
        ]
        for each in costs
    ]
    return markdown(head, rows)


def main() -> None:
    """Fly every size, one after the other, and print the table."""
    parser = counts_parser(__doc__, COUNTS)
    parser.add_argument("--real", action="store_true", help="under the real clock, over UDP: are ticks in time?")
    given = parser.parse_args()
    clock, duration_s = ("real", REAL_DURATION_S) if given.real else ("virtual", DURATION_S)
    costs = [alone(cost, count, clock, duration_s) for count in given.counts]
    print(punctuality(costs) if given.real else growth(costs))
    print_load()


if __name__ == "__main__":
    main()
