"""Time, memory and recorded bytes against the number of vehicles.

Each size flies in a process of its own: emulated vehicles, links and ground station together, law and telemetry at 10
Hz, everything recorded. With `--real`, over UDP, vehicles have a second process.
"""

from __future__ import annotations

import resource
import sys
import time
from typing import Any

from benchmarks import alone, flown, parser, print_load
from gcs_formation.app.run_options import ClockName
from gcs_formation.studies.markdown import markdown

COUNTS = (4, 16, 64, 128, 254, 500)
FULL_NETWORK = 254
DURATION_S = 5.0
RUN_IN_S = 6
REAL_DURATION_S = 30.0
SPEED_MPS = 22.0
MIB = 2**20
RSS_UNIT = 1 if sys.platform == "darwin" else 1024
"""getrusage counts bytes on macOS and KiB on Linux."""


HEADS: dict[ClockName, tuple[str, ...]] = {
    "virtual": (
        "vehicles",
        "wall s a simulated s, s",
        "processor s a simulated s, s",
        "of it a vehicle, ms",
        "peak memory, MiB",
        "recorded, KiB a vehicle and s",
        "largest error, m",
    ),
    "real": ("vehicles", "ticks,", "late,", "compute p50, ms", "compute p99, ms", "period p99, ms", "longest, ms"),
}


def scenario(count: int, duration_s: float) -> dict[str, Any]:
    """Return `count` vehicles one behind the other on a straight path, 254 to a network."""
    members = [divmod(index, FULL_NETWORK) for index in range(count)]
    vehicles: list[dict[str, Any]] = [{"id": number + 1, "network": network + 1} for network, number in members]
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


def row(count: int, clock: ClockName, duration_s: float) -> list[str]:
    """Fly one size and return its row; run it in a process of its own, whose peak memory is then the flight's."""
    began = time.process_time()
    with flown(scenario(count, duration_s), clock) as summary:
        processor_s, figures = time.process_time() - began, summary.to_dict()
        recorded = sum(file.stat().st_size for file in summary.run_dir.iterdir())
    if clock == "real":
        control, taken = figures["control"], (("compute_ms", "p50"), ("compute_ms", "p99"), ("period_ms", "p99"))
        times_ms = (control[what][figure] for what, figure in (*taken, ("period_ms", "max")))
        counts = str(count), str(control["ticks"]), str(control["late_ticks"])
        return [*counts, *(f"{time_ms:.1f}" for time_ms in times_ms)]
    simulated_s = figures["real_time_factor"] * figures["wall_s"]
    return [
        str(count),
        f"{figures['wall_s'] / simulated_s:.3f}",
        f"{processor_s / simulated_s:.3f}",
        f"{processor_s / simulated_s / count * 1e3:.1f}",
        f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * RSS_UNIT / MIB:.0f}",
        f"{recorded / 1024 / count / simulated_s:.1f}",
        f"{max(each[f'error_{axis}_m']['max'] for each in figures['followers'].values() for axis in 'xyz'):.3f}",
    ]


def main() -> None:
    """Fly every size, one after the other, and print the table."""
    parsing = parser(__doc__, COUNTS)
    parsing.add_argument("--real", action="store_true", help="under the real clock, over UDP: are ticks in time?")
    given = parsing.parse_args()
    clock: ClockName = "real" if given.real else "virtual"
    duration_s = REAL_DURATION_S if given.real else DURATION_S
    print(markdown(HEADS[clock], [alone(row, count, clock, duration_s) for count in given.counts]))
    print_load()


if __name__ == "__main__":
    main()
