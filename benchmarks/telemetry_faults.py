"""Faults of telemetry: how soon each is found, and how near vehicles come to one another, by truth.

`python -m benchmarks.telemetry_faults --seeds 20` prints the worst of that many flights for each fault, role, family
and link. `--clean 1000` flies random scenarios without faults instead and counts false alarms.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from gcs_formation import run
from gcs_formation.studies.dataset import markdown
from gcs_formation.studies.random_scenarios import HARD, USUAL, draw

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
    "height frozen": {"quantity": "height", "effect": "freeze"},
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
    "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [600, 0, 100], [1200, 250, 120], [2200, 250, 120]]},
}
COPTER: Final[Mapping[str, Any]] = {
    "formation": {"shape": "diamond", "spacing_m": 20},
    "path": {"speed_mps": 5, "waypoints_m": [[0, 0, 60], [120, 0, 60], [240, 60, 65], [500, 60, 65]]},
}
FAMILIES: Final = {"plane": PLANE, "copter": COPTER}
BEGINS_S: Final = (8.0, 25.0)
LASTS_S: Final = 30.0
EVENTS: Final = ("health", "member", "link", "streams", "airspeed", "sensor")
"""Kinds of events by which a fault is said."""


class Flown(NamedTuple):
    """One flight."""

    found_s: float
    """How long after the fault it was said, s; infinite if it never was."""
    separation_m: float
    clearance_m: float


def fly(family: str, role: str, fault: str, link: str, seed: int) -> Flown:
    """Fly one fault, at an instant and on links drawn by the seed."""
    at_s = float(np.random.default_rng(seed).uniform(*BEGINS_S))
    vehicles: list[dict[str, Any]] = [{"id": 1, "role": "leader"}, *({"id": i, "role": "follower"} for i in (2, 3, 4))]
    if family == "copter":
        vehicles = [each | {"autopilot": "arducopter", "model": "arducopter"} for each in vehicles]
    scenario = {
        "seed": seed,
        "duration_s": at_s + LASTS_S,
        "start": {"in_air": True},
        "vehicles": vehicles,
        **FAMILIES[family],
        "links": {"default": LINKS[link]},
        "faults": [{"at_s": at_s, "vehicles": ROLES[role], "kind": "telemetry", **FAULTS[fault]}],
    }
    with tempfile.TemporaryDirectory() as directory:
        summary = run(scenario, clock="virtual", out=directory, overwrite=True).to_dict()
        events = [json.loads(line) for line in (Path(directory) / "events.jsonl").read_text().splitlines()]
    begun_s = next((each["t_s"] for each in events if each["kind"] == "fault"), 0.0)
    said_s = [each["t_s"] for each in events if each["kind"] in EVENTS and each["t_s"] >= begun_s]
    safety = summary["safety"]
    return Flown(min(said_s, default=np.inf) - begun_s, safety["min_separation_m"], safety["min_clearance_m"])


def alarms(seed: int) -> list[str]:
    """Return the events `health` of a random flight without faults."""
    severity = HARD if seed % 2 else USUAL
    scenario = draw(seed, severity).model_copy(update={"faults": ()})
    with tempfile.TemporaryDirectory() as directory:
        run(scenario, clock="virtual", out=directory, overwrite=True)
        events = [json.loads(line) for line in (Path(directory) / "events.jsonl").read_text().splitlines()]
    return [f"seed {seed}: {each['vehicle']}: {each['text']}" for each in events if each["kind"] == "health"]


def table(given: argparse.Namespace) -> Iterator[list[str]]:
    """Yield the rows: for each link and role, the latest finding, the least separation and the lowest flight."""
    with ProcessPoolExecutor(given.workers) as pool:
        for family in given.families:
            for fault in (each for each in FAULTS if given.fault in each):
                for role in given.roles:
                    cells = list[str]()
                    for link in LINKS:
                        flights = list(pool.map(partial(fly, family, role, fault, link), range(given.seeds)))
                        worst = [max(each.found_s for each in flights)]
                        worst += [min(each[place] for each in flights) for place in (1, 2)]
                        cells.append(" / ".join(f"{each:.1f}" for each in worst))
                    yield [family, fault, role, *cells]


def main() -> None:
    """Fly, and print the table or the false alarms."""
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("--seeds", type=int, default=20)
    options.add_argument("--fault", default="", help="only faults whose name contains this")
    options.add_argument("--roles", nargs="+", default=list(ROLES), choices=ROLES)
    options.add_argument("--families", nargs="+", default=list(FAMILIES), choices=FAMILIES)
    options.add_argument("--workers", type=int, default=2)
    options.add_argument("--clean", type=int, default=0, metavar="FLIGHTS")
    options.add_argument("--first", type=int, default=0, help="seed of the first flight without faults")
    given = options.parse_args()
    if given.clean:
        with ProcessPoolExecutor(given.workers) as pool:
            found = list(pool.map(alarms, range(given.first, given.first + given.clean), chunksize=4))
        print(f"{sum(map(bool, found))} of {given.clean} flights without faults had alarms")
        print("\n".join(text for each in found for text in each))
        return
    heads = ["family", "fault", "role", *(f"{link}: found s / separation m / height m" for link in LINKS)]
    print(markdown(heads, list(table(given))))


if __name__ == "__main__":
    main()
