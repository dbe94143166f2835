"""What `fly --dry-run` prints for a vehicle that is commanded to places."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from formation_scenario import load_scenario
from gcs_formation.app.dry_run import rehearsal_text, rehearsed
from gcs_formation.from_scenario import planned

PX4 = Path(__file__).parents[3] / "configs" / "px4.yaml"


def test_places_keep_all_their_digits_and_what_is_left_to_the_vehicle_is_unset() -> None:
    """The first place is 400 m from the path's start, which is 1400 m north of the origin.

    At a field 10 m above the sea a sensor reads 13.993 at the path's 14 m/s.
    """
    scenario = load_scenario(PX4)
    _, _, vehicles = planned(scenario)
    station: Any = SimpleNamespace(scenario=scenario, vehicles=vehicles, gate=SimpleNamespace(warnings={}))
    report = rehearsed(station)
    assert json.loads(json.dumps(report, allow_nan=False)) == report
    told = next(line for line in rehearsal_text(report).splitlines() if line.startswith("  setpoints"))
    assert told.startswith(
        "  setpoints, 10 a second: COMMAND_INT DO_REPOSITION: param1 13.9933, param2 1, param3 0, param4 unset"
    )
    values = dict(part.split() for part in told.split(": ")[-1].split(", "))
    lat_rad, lon_rad = (math.radians(int(values[name]) / 1e7) for name in ("x", "y"))
    north_m, east_m, _ = scenario.origin.geodetic.to_ned(lat_rad, lon_rad, 0.0)
    assert math.hypot(north_m - 1400.0, east_m) == pytest.approx(400.0, abs=0.05)
