"""Faults of telemetry: how soon each is found, and how near vehicles come to one another, by truth.

`python -m benchmarks.features.telemetry_health.faults --seeds 20 --record faults.jsonl` prints the worst of
that many flights for each fault, role, family and link. It may be interrupted: what is in the file isn't flown again,
and `--seeds 0` prints the table of that. `--combined 30` flies two drawn faults at once, or one that comes and goes,
instead. A height that is frozen is flown on a path that climbs: in level flight nothing shows it, and nothing harms.
"""

from __future__ import annotations

import argparse
import itertools
import json
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from benchmarks.in_order import in_order
from gcs_formation import run
from gcs_formation.studies.markdown import markdown
from gcs_formation.studies.random_scenarios import telemetry_fault

CLIMBING: Final = "height frozen, climbing"
FAULTS: Final[Mapping[str, Mapping[str, Any]]] = {
    "position frozen": {"quantity": "position", "effect": "freeze"},
    "position 20 m to the side": {"quantity": "position", "effect": "offset", "amount": [0, 20, 0]},
    "position 100 m ahead": {"quantity": "position", "effect": "offset", "amount": [100, 0, 0]},
    "position drifts 3 m/s": {"quantity": "position", "effect": "drift", "amount": [0, 3, 0]},
    "position noise 10 m": {"quantity": "position", "effect": "noise", "amount": 10},
    "position 2 s late": {"quantity": "position", "effect": "late", "amount": 2},
    "position missing": {"quantity": "position", "effect": "missing"},
    "position 0, 0": {"quantity": "position", "effect": "zero"},
    "velocity 0": {"quantity": "velocity", "effect": "zero"},
    "velocity opposite": {"quantity": "velocity", "effect": "sign"},
    "velocity x 0.5": {"quantity": "velocity", "effect": "scale", "amount": 0.5},
    CLIMBING: {"quantity": "height", "effect": "freeze"},
    "height 20 m lower": {"quantity": "height", "effect": "offset", "amount": -20},
    "height 14 m higher": {"quantity": "height", "effect": "offset", "amount": 14},
    "height drifts 3 m/s": {"quantity": "height", "effect": "drift", "amount": 3},
    "airspeed NaN": {"quantity": "airspeed", "effect": "nan"},
    "airspeed x 0.6": {"quantity": "airspeed", "effect": "scale", "amount": 0.6},
    "attitude NaN": {"quantity": "attitude", "effect": "nan"},
    "attitude 0.5 rad": {"quantity": "attitude", "effect": "offset", "amount": 0.5},
    "attitude missing": {"quantity": "attitude", "effect": "missing"},
    "stamps 0.5 s early": {"quantity": "stamps", "effect": "offset", "amount": 0.5},
    "stamps frozen": {"quantity": "stamps", "effect": "freeze"},
    "heartbeat missing": {"quantity": "heartbeat", "effect": "missing"},
}
ROLES: Final = {"follower": [3], "leader": [1], "all": "all"}
LINKS: Final[Mapping[str, Mapping[str, Any]]] = {
    "0 ms": {"delay_ms": 0},
    "300 ± 20 ms, 5 %": {"delay_ms": 300, "jitter_ms": 20, "loss": 0.05},
}
PLANE: Final[Mapping[str, Any]] = {
    "formation": {"shape": "diamond", "spacing_m": 30},
    "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [400, 0, 100], [1000, 250, 120], [2000, 250, 120]]},
}
COPTER: Final[Mapping[str, Any]] = {
    "formation": {"shape": "diamond", "spacing_m": 20},
    "path": {"speed_mps": 5, "waypoints_m": [[0, 0, 60], [120, 0, 60], [240, 60, 65], [500, 60, 65]]},
}
FAMILIES: Final = {"plane": PLANE, "copter": COPTER}
CLIMBS: Final[Mapping[str, list[list[float]]]] = {
    "plane": [[0, 0, 100], [400, 0, 112], [1000, 250, 131], [2000, 250, 161]],
    "copter": [[0, 0, 60], [120, 0, 66], [240, 60, 73], [500, 60, 86]],
}
BEGINS_S: Final = (5.0, 17.0)
LASTS_S: Final = 25.0
TWO_SHARE: Final = 2.0 / 3.0
EVENTS: Final = ("health", "member", "link", "streams", "airspeed", "sensor")
"""Kinds of events that report a fault."""


class Flown(NamedTuple):
    """One flight."""

    found_s: float
    """How long after the fault it was reported, s; infinite if it never was."""
    separation_m: float
    clearance_m: float


def fly(family: str, role: str, fault: str, link: str, seed: int) -> Flown:
    """Fly one fault, at an instant and on links drawn by the seed."""
    at_s = float(np.random.default_rng(seed).uniform(*BEGINS_S))
    faults = [{"at_s": at_s, "vehicles": ROLES[role], "kind": "telemetry", **FAULTS[fault]}]
    return _flown(family, faults, link, seed, climbs=fault == CLIMBING)


def fly_combined(seed: int) -> list[str]:
    """Fly two faults at once, or one that comes and goes; return a row."""
    rng = np.random.default_rng(1000 + seed)
    family, link, at_s = ("plane", "copter")[seed % 2], list(LINKS)[seed // 2 % 2], float(rng.uniform(*BEGINS_S))
    drawn = [telemetry_fault(rng) | {"vehicles": _whose(rng)} for _ in range(2)]
    if rng.random() < TWO_SHARE:
        faults = [each | {"at_s": at_s + float(rng.uniform(0.0, 4.0))} for each in drawn]
    else:
        on_s, off_s = float(rng.uniform(0.5, 3.0)), float(rng.uniform(0.5, 4.0))
        faults = [drawn[0] | {"at_s": at_s + number * (on_s + off_s), "for_s": on_s} for number in range(5)]
    flown = _flown(family, faults, link, seed)
    names = [f"{each['vehicles']}: {each['quantity']} {each['effect']} {each.get('amount', ''):.3}" for each in faults]
    return [family, link, "; ".join(dict.fromkeys(names)), " / ".join(f"{each:.1f}" for each in flown)]


def _whose(rng: np.random.Generator) -> str | list[int]:
    number = int(rng.integers(5))
    return [number] if number else "all"


def _flown(family: str, faults: list[dict[str, Any]], link: str, seed: int, *, climbs: bool = False) -> Flown:
    vehicles: list[dict[str, Any]] = [{"id": 1, "role": "leader"}, *({"id": i, "role": "follower"} for i in (2, 3, 4))]
    if family == "copter":
        vehicles = [each | {"autopilot": "arducopter", "model": "arducopter"} for each in vehicles]
    scenario: dict[str, Any] = {
        "seed": seed,
        "duration_s": min(each["at_s"] for each in faults) + LASTS_S,
        "start": {"in_air": True},
        "vehicles": vehicles,
        **FAMILIES[family],
        "links": {"default": LINKS[link]},
        "faults": [{"kind": "telemetry", **each} for each in faults],
        "finish": {"loiter_s": 1.0},
    }
    if climbs:
        scenario["path"] = scenario["path"] | {"waypoints_m": CLIMBS[family]}
    with tempfile.TemporaryDirectory() as directory:
        summary = run(scenario, clock="virtual", out=directory, overwrite=True).to_dict()
        events = [json.loads(line) for line in (Path(directory) / "events.jsonl").read_text().splitlines()]
    fault_s = next((each["t_s"] for each in events if each["kind"] == "fault"), 0.0)
    reported_s = [each["t_s"] for each in events if each["kind"] in EVENTS and each["t_s"] >= fault_s]
    safety = summary["safety"]
    return Flown(min(reported_s, default=np.inf) - fault_s, safety["min_separation_m"], safety["min_clearance_m"])


class Cell(NamedTuple):
    """Of which flights the worst is sought."""

    family: str
    fault: str
    role: str
    link: str


Record = dict[tuple[Cell, int], Flown]
"""Flights by cell and seed."""


def recorded(path: Path) -> Record:
    """Return the flights of a file."""
    lines = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    return {(Cell(*each["cell"]), each["seed"]): Flown(*each["flown"]) for each in lines}


def _fly_cell(wanted: tuple[Cell, int]) -> Flown:
    cell, seed = wanted
    return fly(cell.family, cell.role, cell.fault, cell.link, seed)


def record(given: argparse.Namespace, path: Path) -> None:
    """Fly what a file doesn't have, all cells with a seed before those with the next, and add each flight to it."""
    known, faults = recorded(path), [each for each in FAULTS if any(part in each for part in given.fault)]
    cells = [Cell(*each) for each in itertools.product(given.families, faults, given.roles, LINKS)]
    wanted = [(cell, seed) for seed in range(given.seeds) for cell in cells if (cell, seed) not in known]
    with path.open("a") as file:
        for (cell, seed), flown in zip(wanted, in_order(_fly_cell, wanted, given.workers), strict=True):
            file.write(json.dumps({"cell": cell, "seed": seed, "flown": flown}) + "\n")
            file.flush()


def table(known: Record) -> Iterator[list[str]]:
    """Yield rows: for each link and role the latest finding, the least separation, the lowest flight, and of how many.

    A flight without a finding has it at infinity.
    """
    for family, fault, role in itertools.product(FAMILIES, FAULTS, ROLES):
        flown = [_worst([known[each] for each in known if each[0] == (family, fault, role, link)]) for link in LINKS]
        if any(flown):
            yield [family, fault, role, *(each or "–" for each in flown)]


def _worst(flights: list[Flown]) -> str:
    if not flights:
        return ""
    found_s = max(each.found_s for each in flights)
    worst = found_s, min(each.separation_m for each in flights), min(each.clearance_m for each in flights)
    return " / ".join(f"{each:.1f}" for each in worst) + f" ({len(flights)})"


def main() -> None:
    """Fly, and print the table."""
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("--seeds", type=int, default=20)
    options.add_argument("--fault", nargs="+", default=[""], help="only faults whose name contains one of these")
    options.add_argument("--roles", nargs="+", default=list(ROLES), choices=ROLES)
    options.add_argument("--families", nargs="+", default=list(FAMILIES), choices=FAMILIES)
    options.add_argument("--workers", type=int, default=2)
    options.add_argument("--combined", type=int, default=0, metavar="FLIGHTS")
    options.add_argument("--record", type=Path, metavar="FILE", help="where flights are kept, one a line")
    given = options.parse_args()
    if given.combined:
        rows = list(in_order(fly_combined, range(given.combined), given.workers))
        print(markdown(["family", "link", "faults", "found s / separation m / height m"], rows))
        return
    heads = ["family", "fault", "role", *(f"{link}: found s / separation m / height m" for link in LINKS)]
    with tempfile.TemporaryDirectory() as directory:
        path = given.record or Path(directory) / "flights.jsonl"
        record(given, path)
        print(markdown(heads, list(table(recorded(path)))))


if __name__ == "__main__":
    main()
