"""A flight is the same in every direction, although headings and courses wrap at half a turn or a whole one."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.flights.conftest import Fly

BEND = ((0.0, 0.0), (250.0, 0.0), (480.0, 120.0), (600.0, 350.0), (610.0, 900.0))
"""North and east, m: a right turn by 90 degrees."""
THROUGH = {"south": math.radians(135.0), "north": math.radians(315.0)}
AT_FIRST_PASS = {"in_air": True, "run_in_s": 12}
"""Long enough for the path to begin without another lap, also over links with delay."""
ROUNDED_M = 0.05
"""Positions are sent in 1e-7 degrees, 11 mm north and 9 mm east, so lags are estimated slightly differently."""
SEEDS = {"arduplane": 36, "px4": 12}
"""Flights of an aircraft's own loops in each direction, whose mean is compared. The largest height error depends on
when the bend ends between two setpoints: of an ArduPlane it is 0.5 to 0.6 m or 0.75 to 0.85 m in every direction, about
as often, so that the mean of 12 has a standard deviation of 0.04 m. Over 36 it is 0.65 to 0.67 m in each.
"""


def turned(by_rad: float) -> list[list[float]]:
    """Return the bend's waypoints, turned clockwise."""
    cosine, sine = math.cos(by_rad), math.sin(by_rad)
    return [[north * cosine - east * sine, north * sine + east * cosine, 100.0] for north, east in BEND]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("autopilot", "delay_ms", "speed_mps", "seeds"),
    [
        ("emulator", 150, 22.0, 1),
        *(
            pytest.param(*each, marks=pytest.mark.slow)
            for each in (("arduplane", 0, 22.0, SEEDS["arduplane"]), ("px4", 0, 15.0, SEEDS["px4"]))
        ),
    ],
)
def test_a_flight_that_turns_through_south_or_north_is_the_one_that_turns_from_north_to_east(
    fly: Fly, tmp_path: Path, autopilot: str, delay_ms: float, speed_mps: float, seeds: int
) -> None:
    vehicles = [
        {"id": number, "role": role, "autopilot": autopilot} for number, role in ((1, "leader"), (2, "follower"))
    ]
    keys: dict[str, Any] = {"vehicles": vehicles, "links": {"default": {"delay_ms": delay_ms}}}
    path: dict[str, Any] = {"speed_mps": speed_mps}
    found = dict[str, tuple[set[tuple[str, ...]], list[float]]]()
    for way, by_rad in {"north to east": 0.0, **THROUGH}.items():
        kinds, errors = set[tuple[str, ...]](), []
        for seed in range(1, seeds + 1):
            path["waypoints_m"] = turned(by_rad)
            summary = fly(seed=seed, path=path, duration_s=740.0 / speed_mps, start=AT_FIRST_PASS, **keys)
            lines = (tmp_path / "run" / "events.jsonl").read_text(encoding="utf-8").splitlines()
            kinds.add(tuple(json.loads(line)["kind"] for line in lines))
            (follower,) = summary.figures["followers"].values()
            errors.append([follower[axis]["max"] for axis in ("error_x_m", "error_y_m", "error_z_m")])
        found[way] = kinds, np.mean(errors, axis=0).tolist()
    kinds, mean_m = found["north to east"]
    assert not [each for each in kinds if "disobeys" in each]
    for way in THROUGH:
        assert found[way][0] == kinds
        assert found[way][1] == pytest.approx(mean_m, abs=ROUNDED_M)
