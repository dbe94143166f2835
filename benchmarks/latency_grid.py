"""One-way delay as measured by the ground station beside the injected one: delays, jitter, clock drift, asymmetry.

One flight of 300 s under the virtual clock with a follower for each cell. Cells share only the time: every link has its
own random numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from benchmarks import flown
from gcs_formation.studies.markdown import markdown

DURATION_S = 300.0
SPEED_MPS = 22.0
DELAYS_MS = (0, 50, 150, 300, 600)
SPLITS_MS = ((50, 250), (250, 50))
JITTERS_MS = (0, 20)
DRIFTS_PPM = (0, 50, 15000)
TOLERANCE_MS, TOLERANCE_SHARE = 2.0, 0.02


class Cell(NamedTuple):
    """One follower's link and clock."""

    up_ms: float
    down_ms: float
    jitter_ms: float
    drift_ppm: float


def cells() -> Iterator[Cell]:
    """Yield the grid, symmetric links first."""
    for up_ms, down_ms in (*((delay, delay) for delay in DELAYS_MS), *SPLITS_MS):
        for jitter_ms in JITTERS_MS:
            yield from (Cell(up_ms, down_ms, jitter_ms, drift) for drift in DRIFTS_PPM)


def scenario(grid: list[Cell]) -> dict[str, Any]:
    """Return a leader on a straight path and a follower for each cell, ids from 2."""
    followers = [{"id": 2 + i, "clock": {"drift_ppm": cell.drift_ppm}} for i, cell in enumerate(grid)]
    links = [
        {"at_s": 0, "vehicles": [2 + i], "jitter_ms": cell.jitter_ms, "reorder": True}
        | {"uplink": {"delay_ms": cell.up_ms}, "downlink": {"delay_ms": cell.down_ms}}
        for i, cell in enumerate(grid)
    ]
    return {
        "name": "latency-grid",
        "duration_s": DURATION_S,
        "start": {"in_air": True, "run_in_s": 6},
        "finish": {"loiter_s": 0},
        "vehicles": [{"id": 1, "role": "leader"}, *followers],
        "telemetry": {"rate_hz": 5},
        "law": {"rate_hz": 5},
        "formation": {"shape": "line", "spacing_m": 30},
        "path": {"speed_mps": SPEED_MPS, "waypoints_m": [[0, 0, 200], [SPEED_MPS * (DURATION_S + 30), 0, 200]]},
        "links": {"changes": links},
    }


def row(cell: Cell, link: dict[str, Any]) -> list[str]:
    """Return a row of the table."""
    injected_ms, measured_ms = link["injected_delay_ms"], link["measured_delay_ms"]["p50"]
    error_ms = measured_ms - injected_ms
    allowed_ms = max(TOLERANCE_MS, TOLERANCE_SHARE * injected_ms)
    held = "yes" if abs(error_ms) <= allowed_ms else f"no ({allowed_ms:.1f} allowed)"
    split = f"{cell.up_ms:g}" if cell.up_ms == cell.down_ms else f"{cell.up_ms:g} up, {cell.down_ms:g} down"
    delays = f"{injected_ms:.2f}", f"{measured_ms:.2f}", f"{error_ms:+.2f}"
    return [split, f"{cell.jitter_ms:g}", f"{cell.drift_ppm:g}", *delays, held]


def main() -> None:
    """Fly and print the table."""
    grid = list(cells())
    with flown(scenario(grid)) as summary:
        links = summary.to_dict()["links"]
    head = ("delay, ms", "jitter, ms", "drift, ppm", "realised mean, ms", "measured median, ms", "error, ms")
    print(markdown((*head, "within max(2 ms; 2 %)"), (row(cell, links[str(2 + i)]) for i, cell in enumerate(grid))))


if __name__ == "__main__":
    main()
