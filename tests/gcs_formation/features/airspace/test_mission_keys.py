"""A mission file's geofence and rally points are the fence's keys."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from formation_scenario import mission_path
from gcs_formation.features.airspace.keys import AirspaceKeys
from tests.formation_scenario.test_mission_path import HOME, lat_lon, load, plan


def test_without_a_feature_that_keeps_it_a_files_fence_is_not_flown_and_that_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    around = [lat_lon(*place) for place in ((-4000, -4000), (6000, -4000), (6000, 6000), (-4000, 6000))]
    areas = [{"polygon": around, "inclusion": True}]

    def nothing(_: str) -> tuple[object, ...]:
        return ()

    monkeypatch.setattr(mission_path, "brought", nothing)
    scenario = load(plan(tmp_path, geoFence={"polygons": areas}))
    assert scenario.fence is None
    said = "1 areas of a fence aren't used: no feature that keeps vehicles inside is there"
    assert any(said in each for each in scenario.path.not_flown)


def test_a_fence_to_stay_in_is_the_scenarios_unless_it_has_one(tmp_path: Path) -> None:
    around = [lat_lon(*place) for place in ((-4000, -4000), (6000, -4000), (6000, 6000), (-4000, 6000))]
    away = [lat_lon(*place) for place in ((7000, 0), (7100, 0), (7100, 100))]
    areas = [{"polygon": around, "inclusion": True}, {"polygon": away, "inclusion": False}]
    scenario = load(plan(tmp_path, geoFence={"polygons": areas}))
    fence = AirspaceKeys.of(scenario).fence
    assert fence is not None
    assert fence.corners_m is not None
    assert fence.corners_m[0] == pytest.approx((-4000.0, -4000.0), abs=1e-3)
    (kept_out,) = fence.areas
    assert kept_out.kind == "exclusion"
    assert kept_out.corners_m == pytest.approx(np.array([(7000.0, 0.0), (7100.0, 0.0), (7100.0, 100.0)]), abs=1e-3)
    rally = {"points": [[*lat_lon(-100.0, 50.0), 40]]}
    own = load(plan(tmp_path, geoFence={"polygons": areas}, rallyPoints=rally), safety={"fence": {"height_max_m": 200}})
    assert own.fence is not None
    assert (own.fence.sides, own.fence.rally_positions_m) == (None, ())
    said = "2 areas of a fence and 1 rally points aren't used: the scenario has its safety.fence"
    assert any(said in each for each in own.path.not_flown)


def test_circles_of_a_files_fence_stay_circles_and_rally_points_are_above_home(tmp_path: Path) -> None:
    circle = {"circle": {"center": lat_lon(1000.0, 500.0), "radius": 6000.0}, "inclusion": True}
    rally = {"points": [[*lat_lon(-100.0, 50.0), 40]]}
    origin = {"lat_deg": HOME[0], "lon_deg": HOME[1], "alt_m": 470.0}
    fence = AirspaceKeys.of(
        load(plan(tmp_path, geoFence={"circles": [circle]}, rallyPoints=rally), origin=origin)
    ).fence
    assert fence is not None
    (area,) = fence.areas
    assert (area.kind, area.radius_m, area.centre_m) == ("inclusion", 6000.0, pytest.approx((1000.0, 500.0), abs=1e-3))
    assert fence.rally_m == (pytest.approx((-100.0, 50.0, 58.0), abs=1e-3),)


@pytest.mark.parametrize(("firmware", "inclusions"), [(3, "all"), (12, "any"), (None, "all")])
def test_of_several_inclusions_those_bind_that_the_plans_autopilot_asks_for(
    tmp_path: Path, firmware: int | None, inclusions: str
) -> None:
    circles = [
        {"circle": {"center": lat_lon(1000.0, east_m), "radius": 6000.0}, "inclusion": True} for east_m in (0.0, 900.0)
    ]
    directory = plan(tmp_path, geoFence={"circles": circles})
    written = json.loads((directory / "tour.plan").read_text())
    written["mission"]["firmwareType"] = firmware
    (directory / "tour.plan").write_text(json.dumps(written))
    fence = AirspaceKeys.of(load(directory)).fence
    assert fence is not None
    assert fence.inclusions == inclusions
