"""Formation errors and measured delays over asymmetric links, with the vehicles' UTC as their common clock.

Three vehicles at 22 m/s along bends under the virtual clock; the followers' clocks drift by 40 and -40 ppm. Errors are
RMS from ground truth over the whole flight.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from typing import Any, NamedTuple

from benchmarks import flown, parser
from gcs_formation.studies.markdown import markdown

Split = tuple[float, float]
EQUAL: dict[int, Split] = {2: (240.0, 240.0), 3: (240.0, 240.0)}
UNEQUAL: dict[int, Split] = {2: (400.0, 80.0), 3: (80.0, 400.0)}
DRIFT_PPM = {1: 0, 2: 40, 3: -40}


class Case(NamedTuple):
    """One flight."""

    name: str
    clock: str
    splits: dict[int, Split]
    third: dict[str, Any]
    """Further keys of follower 3's clock."""
    changes: tuple[dict[str, Any], ...] = ()


def cases() -> Iterator[Case]:
    """Yield every flight."""
    yield Case("240/240 and 240/240", "round_trip", EQUAL, {})
    yield Case("240/240 and 240/240", "gnss", EQUAL, {})
    yield Case("400/80 and 80/400", "round_trip", UNEQUAL, {})
    yield Case("400/80 and 80/400", "gnss", UNEQUAL, {})
    yield Case("240/240, from 60 s on 400/80 on follower 2", "gnss", EQUAL, {}, (link(60.0, 2, (400.0, 80.0)),))
    yield Case("400/80 and 80/400, UTC of 3 absent", "gnss", UNEQUAL, {"utc": False})
    yield Case("… wrong by 1 s", "gnss", UNEQUAL, {"utc_error_s": 1.0})
    yield Case("… wrong by 18 s, as without leap seconds", "gnss", UNEQUAL, {"utc_error_s": 18.0})
    yield Case("… wrong by 50 ms", "gnss", UNEQUAL, {"utc_error_s": 0.05})


def link(at_s: float, vehicle: int, split: Split) -> dict[str, Any]:
    """Return a change of one vehicle's link."""
    up_ms, down_ms = split
    return {"at_s": at_s, "vehicles": [vehicle], "uplink": {"delay_ms": up_ms}, "downlink": {"delay_ms": down_ms}}


def scenario(case: Case, duration_s: float) -> dict[str, Any]:
    """Return the scenario of a flight."""
    bends = [[700 * leg, 150 if leg % 2 else -150, 200] for leg in range(1, int(22 * duration_s / 700) + 3)]
    clocks = {vehicle: {"drift_ppm": ppm} for vehicle, ppm in DRIFT_PPM.items()}
    clocks[3] |= case.third
    roles = {1: "leader", 2: "follower", 3: "follower"}
    return {
        "name": "gnss-grid",
        "duration_s": duration_s,
        "vehicles": [{"id": each, "role": role, "clock": clocks[each]} for each, role in roles.items()],
        "start": {"in_air": True, "run_in_s": 30},
        "finish": {"loiter_s": 0},
        "formation": {"shape": "line", "spacing_m": 30},
        "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 200], *bends]},
        "telemetry": {"clock": case.clock},
        "links": {"changes": [*(link(0, *each) for each in case.splits.items()), *case.changes]},
    }


def row(case: Case, duration_s: float) -> list[str]:
    """Fly a case; return its row of the table."""
    with flown(scenario(case, duration_s)) as summary:
        errors, links = ([summary.to_dict()[part][name] for name in ("2", "3")] for part in ("followers", "links"))
    return [
        case.name,
        case.clock,
        *(", ".join(f"{each[f'error_{axis}_m']['rms']:.3f}" for axis in "xy") for each in errors),
        *(_delays_text(each) for each in links),
    ]


def _delays_text(link: dict[str, Any]) -> str:
    up_ms, down_ms = link["measured_up_ms"], link["measured_down_ms"]
    return "not known" if up_ms is None else f"{up_ms:.0f}/{down_ms:.0f}"


def main() -> None:
    """Fly and print the table."""
    parsing = parser(__doc__, only="links whose name has TEXT in it")
    parsing.add_argument("--until", type=float, default=150.0, metavar="SECONDS", help="length of the flights")
    given = parsing.parse_args()
    chosen = [case for case in cases() if given.only in case.name]
    with ProcessPoolExecutor(given.processes) as pool:
        rows = list(pool.map(row, chosen, [given.until] * len(chosen)))
    head = ("links of followers 2 and 3, up/down, ms", "clock", "2: x, y, m", "3: x, y, m", "measured 2", "measured 3")
    print(markdown(head, rows))


if __name__ == "__main__":
    main()
