"""How soon a link that dies is left, and what it costs the formation, over seeds: docs/links.md.

python -m benchmarks.several_links --seeds 5
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gcs_formation
from gcs_formation.studies.markdown import markdown

DIES_S, RETURNS_S = 12.0, 20.0
DIRECTIONS: dict[str, dict[str, Any]] = {"both ways": {}, "up": {"uplink": {}}, "down": {"downlink": {}}}
CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "40 and 400 ms": ({"delay_ms": 40}, {"delay_ms": 400}),
    "both 100 ms": ({"delay_ms": 100}, {"delay_ms": 100}),
    "40 ms and 100 ± 20 ms, 5 % lost": ({"delay_ms": 40}, {"delay_ms": 100, "jitter_ms": 20, "loss": 0.05}),
    "both 60 ± 20 ms, 5 % lost": ({"delay_ms": 60, "jitter_ms": 20, "loss": 0.05},) * 2,
}


def scenario(first: dict[str, Any], second: dict[str, Any] | None, *outages: dict[str, Any]) -> dict[str, Any]:
    """Return a curve flown by three vehicles with one link or two."""
    ends = [f"udpin:127.0.0.1:{port}" for port in (14550, 14551)]
    worse = [] if second is None else [{"at_s": 0, "link": 2, **second}]
    if second is not None:  # it has what the first has, unless it says otherwise
        worse[0] = {**dict.fromkeys(first, 0), **worse[0]}
    return {
        "schema": 1,
        "name": "several links",
        "duration_s": 35,
        "vehicles": {"count": 3, "endpoint": ends[0] if second is None else ends},
        "start": {"in_air": True, "run_in_s": 8},
        "finish": {"loiter_s": 1},
        "formation": {"shape": "arrow", "spacing_m": 30},
        "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [400, 0, 100], [700, 300, 110], [700, 1500, 110]]},
        "links": {"default": first, "changes": [*worse, *outages]},
    }


def flown(planned: dict[str, Any], seed: int) -> tuple[float, float, list[dict[str, Any]]]:
    """Return the RMS of the worst follower, x and y, m, and the events since the path began."""
    with TemporaryDirectory() as out:
        run = Path(out) / "run"
        summary = gcs_formation.run(planned, clock="virtual", seed=seed, out=run).to_dict()
        events = [json.loads(line) for line in (run / "events.jsonl").read_text().splitlines()]
    worst = [max(each[f"error_{axis}_m"]["rms"] for each in summary["followers"].values()) for axis in "xy"]
    for event in events:
        event["t_s"] -= summary["begun_s"]
    return worst[0], worst[1], events


def main() -> None:
    """Fly, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5)
    seeds, rows = range(1, 1 + parser.parse_args().seeds), list[list[str]]()
    for name, (first, second) in CASES.items():
        alone = [flown(scenario(first, None), seed)[:2] for seed in seeds]
        both = [flown(scenario(first, second), seed)[:2] for seed in seeds]
        rms_m = [f"{max(x for x, _ in each):.3f}, {max(y for _, y in each):.3f}" for each in (alone, both)]
        for direction, keys in DIRECTIONS.items():
            left_s, back_s, dead_m, left_formation = list[float](), list[float](), list[float](), 0
            for seed in seeds:
                ends = ((DIES_S, True), (RETURNS_S, False))
                outages = [
                    {"at_s": at_s, "link": 1, **({each: {"outage": on} for each in keys} or {"outage": on})}
                    for at_s, on in ends
                ]
                x_m, y_m, events = flown(scenario(first, second, *outages), seed)
                dead_m.append(max(x_m, y_m))
                chosen = [each for each in events if each["kind"] == "link_choice" and each["t_s"] > DIES_S]
                left_s += [each["t_s"] - DIES_S for each in chosen if each["link"] == 2 and each["t_s"] < RETURNS_S]
                back_s += [each["t_s"] - RETURNS_S for each in chosen if each["link"] == 1]
                left_formation += sum(each["kind"] == "member" and each["t_s"] > 0 for each in events)
            rows.append(
                [
                    name,
                    direction,
                    f"{max(left_s):.1f} ({len(left_s)})" if left_s else "–",
                    f"{max(back_s):.1f}" if back_s else "–",
                    *rms_m,
                    f"{max(dead_m):.3f}",
                    str(left_formation),
                ]
            )
    heads = "links", "the first dies", "left after, s, at most (of vehicles)", "taken again, s"
    print(markdown((*heads, "RMS x, y, m: first alone", "both", "as it dies", "left the formation"), rows))


if __name__ == "__main__":
    main()
