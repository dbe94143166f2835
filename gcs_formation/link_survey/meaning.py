"""What a survey's links mean for a formation: a rehearsal with their delays and losses under the virtual clock.

Aeroplanes of the default model fly bends at 22 m/s over links as they were measured: as many as were received, each
over its own, or four over the only one.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from statistics import fmean
from typing import Any, Final

import yaml

from formation_scenario import Scenario, load_scenario
from gcs_formation.app.check_links import traffic_kbps
from gcs_formation.errors import StationError
from gcs_formation.link_survey.report import write
from gcs_formation.python_api import run

ALONE: Final = 4
"""Vehicles of the rehearsal where one was received."""
MAXIMUM: Final = 12
"""Vehicles of a rehearsal at most: those with the longest delays."""
RATES_HZ: Final = (10.0, 5.0, 2.0)
"""Rates of setpoints and telemetry that are tried, the highest that the link carries first."""
FLIGHTS: Final = 6
"""Flights of a rehearsal, each over another part of what was measured: with 15 to 30 ms of jitter the error of one was
0.04 to 0.15 m rms."""
JITTER: Final = 0.5
"""Correlation of successive delays below which they vary by jitter rather than by a queue: then each varies more from
the next one than delays do altogether."""
AXES: Final = ("x", "y")
"""Of the errors that bring two vehicles of one height near each other."""
REHEARSED_S: Final = 90.0
SPEED_MPS: Final = 22.0
WAYPOINTS_M: Final = [[0, 0, 100], [800, 0, 100], [1550, 250, 110], [2150, 750, 125], [2750, 1250, 130]]
NAME: Final = "rehearsal"


def rehearsal(vehicles: Mapping[str, Any], rate_hz: float) -> dict[str, Any]:
    """Return the scenario of a rehearsal as a mapping; traces are files beside it."""
    links = [each for each in vehicles.values() if each["delay_ms"]["round_trip"]["mean"] is not None]
    links.sort(key=lambda each: -each["delay_ms"]["round_trip"]["mean"])
    links = links[:MAXIMUM] if len(links) > 1 else links * ALONE
    changes = [{"at_s": 0, "vehicles": [number], **_impaired(each)} for number, each in enumerate(links, 1)]
    return {
        "schema": 1,
        "name": NAME,
        "seed": 1,
        "duration_s": REHEARSED_S,
        "vehicles": {"count": len(links)},
        "start": {"in_air": True},
        "formation": {"shape": "arrow", "spacing_m": 30},
        "telemetry": {"rate_hz": rate_hz},
        "law": {"type": "fuzzy_pid", "rate_hz": rate_hz},
        "path": {"speed_mps": SPEED_MPS, "kind": "legs", "waypoints_m": WAYPOINTS_M},
        "links": {"changes": changes},
    }


def _impaired(link: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of a link as it was measured."""
    return {f"{direction}link": {"trace": _trace(link, direction)} for direction in ("up", "down")}


def _trace(link: Mapping[str, Any], direction: str) -> dict[str, str]:
    """Return the keys of one direction's trace: of jitter, delays between samples vary as much as these."""
    correlation = link["delay_ms"][direction].get("correlation")
    jitters = correlation is not None and correlation < JITTER
    between = "drawn" if jitters else "interpolated"
    return {"file": link["trace"], "column": f"{direction}_ms", "kind": "one_way", "time": "t_s", "between": between}


def meaning(found: Mapping[str, Any], directory: Path) -> dict[str, Any] | None:
    """Return what the links found carry, and the errors and margins that a rehearsal foretells; None: too little known.

    The rehearsal's scenario is written beside the traces in `directory`, as NAME.yaml.

    Raises:
        RecordError: it can't be written.
    """
    vehicles = found["vehicles"]
    if all(each["delay_ms"]["round_trip"]["mean"] is None for each in vehicles.values()):
        return None
    capacity_kbps, file = _capacity_kbps(vehicles), directory / f"{NAME}.yaml"
    for rate_hz in RATES_HZ:
        write(yaml.safe_dump(rehearsal(vehicles, rate_hz), sort_keys=False), file)
        scenario = load_scenario(file)
        up_kbps, down_kbps = _needs_kbps(scenario)
        fits = None if capacity_kbps is None else up_kbps + down_kbps <= capacity_kbps
        if fits is not False:
            break
    carried = {"capacity_kbps": capacity_kbps, "needs_up_kbps": up_kbps, "needs_down_kbps": down_kbps}
    flown = foretold(parts(scenario, found["duration_s"]))
    return {"vehicles": len(scenario.vehicles), "rate_hz": rate_hz, "carries": fits, **carried, **flown}


def _capacity_kbps(vehicles: Mapping[str, Any]) -> float | None:
    """Return what the links carry together, both ways, as far as that was probed at every endpoint."""
    probed = {each["endpoint"]: each["capacity_kbps"] for each in vehicles.values() if each["capacity_kbps"]}
    if {each["endpoint"] for each in vehicles.values()} - set(probed):
        return None
    return 2.0 * sum(each["each_way"] for each in probed.values())


def _needs_kbps(scenario: Scenario) -> tuple[float, float]:
    """Return what all vehicles' setpoints, requests and telemetry need, up and down, kbit/s."""
    each = [traffic_kbps(scenario, vehicle) for vehicle in scenario.vehicles]
    return round(sum(up for up, _ in each), 1), round(sum(down for _, down in each), 1)


def parts(scenario: Scenario, length_s: float) -> Iterator[Scenario]:
    """Yield a rehearsal for each flight: seeds differ, and so do the parts of the record of `length_s` that come first.

    A record that is replayed from its beginning is the same link each time, whatever the seed.
    """
    traced = [
        f"links.changes.{number}.{direction}.trace.begin_s"
        for number, change in enumerate(scenario.links.changes)
        for direction in ("uplink", "downlink")
        if (patch := getattr(change, direction)) is not None and patch.trace is not None
    ]
    for flight in range(FLIGHTS):
        begin_s = length_s * flight / FLIGHTS
        yield load_scenario(scenario, [f"seed={flight + 1}", *(f"{each}={begin_s}" for each in traced)], option="")


def foretold(flights: Iterable[Scenario]) -> dict[str, Any]:
    """Fly rehearsals; return the worst follower's errors, the share of the delay margin, and the spacing.

    One flight's error along the path is what its clocks are off by, which is chance: of several the rms is foretold.
    """
    worst, largest_m, used = list[float](), 0.0, list[float]()
    with tempfile.TemporaryDirectory() as directory:
        for number, scenario in enumerate(flights):
            out = Path(directory) / f"{NAME}-{number}"
            try:
                flown = run(scenario, clock="virtual", out=out).to_dict()
            except StationError as error:
                return {"flies": False, "reason": str(error)}
            errors = [each[f"error_{axis}_m"] for each in flown["followers"].values() for axis in AXES]
            if any(each["rms"] is None for each in errors):
                return {"flies": False, "reason": "a follower didn't come to its slot"}
            worst.append(max(each["rms"] for each in errors))
            largest_m = max(largest_m, *(each["max"] for each in errors))
            used.append(flown["stability"]["margin_used"] or 0.0)
    return {
        "flies": True,
        "rms_m": round(math.sqrt(fmean(each**2 for each in worst)), 4),
        "max_m": round(largest_m, 4),
        "margin_used": max(used),
        "spacing_from_m": round(scenario.safety.separation_m + 2.0 * largest_m, 1),
    }
