"""A fence of several areas: what is refused, and what `check` says of each slot."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from flight_model.arrays import offset_points
from flight_model.earth import GeodeticOrigin
from formation_scenario import Scenario, ScenarioError, dump_scenario, load_scenario
from formation_scenario.mission_files import read_mission
from formation_scenario.mission_files.mission import FenceCircle, FencePolygon
from formation_scenario.planned_progress import planned_end_s, planned_m
from formation_scenario.repair import repair
from formation_scenario.slot_assignment import names_by_index, slot_schedule
from gcs_formation.app.check_path import path_figures, path_text
from gcs_formation.app.export_path import export_path
from gcs_formation.features.airspace.check_warnings import rally_outside
from gcs_formation.features.airspace.keys import AirspaceKeys
from tests.flights.conftest import scenario

WIDE = [[-900, -700], [5000, -700], [5000, 700], [-900, 700]]
HOME = (47.4, 8.54, 488.0)
ORIGIN = GeodeticOrigin(math.radians(HOME[0]), math.radians(HOME[1]), HOME[2])


def keys(*areas: dict[str, Any], **fence: Any) -> dict[str, Any]:
    """Return a formation of three on a straight path north, with a fence."""
    return scenario(safety={"fence": {"corners_m": WIDE, "areas": list(areas)} | fence})


def circle(kind: str, north_m: float, east_m: float, radius_m: float) -> dict[str, Any]:
    return {"kind": kind, "centre_m": [north_m, east_m], "radius_m": radius_m}


def problems(plain: dict[str, Any]) -> str:
    with pytest.raises(ScenarioError) as refused:
        load_scenario(plain)
    return "\n".join(str(problem) for problem in refused.value.problems)


@pytest.mark.parametrize(
    ("area", "found", "allowed"),
    [
        (
            circle("exclusion", 1500, 90, 100),
            "path at 1531 m (north 1531, east 0, height 100): vehicle 3's slot in shape arrow is 40 m inside the "
            "exclusion circle",
            "outside it (safety.fence.areas.0)",
        ),
        (
            {"kind": "exclusion", "corners_m": [[2000, -60], [2000, 60], [2400, 0]]},
            "inside the exclusion polygon",
            "outside it (safety.fence.areas.0)",
        ),
        (
            circle("inclusion", 1000, 0, 2500),
            "path at 4000 m (north 4000, east 0, height 100): the leader is 500 m outside the inclusion circle",
            "inside it (safety.fence.areas.0)",
        ),
        (circle("exclusion", 4120, 0, 40), "m from the exclusion circle and heads for it", "(safety.fence.areas.0)"),
        ({"kind": "exclusion"}, "found neither corners nor centre", "corners_m of a polygon, or centre_m and radius_m"),
        ({"kind": "exclusion", "centre_m": [0, 900]}, "found centre_m", "corners_m of a polygon, or centre_m and"),
        (
            circle("exclusion", 0, 900, 9) | {"corners_m": [[0, 900], [9, 900], [9, 909]]},
            "found corners_m and centre_m and radius_m",
            "corners_m of a polygon, or centre_m and radius_m of a circle",
        ),
    ],
)
def test_what_an_area_refuses_is_said_with_which_it_is_and_where(
    area: dict[str, Any], found: str, allowed: str
) -> None:
    said = problems(keys(area))
    assert found in said
    assert allowed in said


def test_a_small_exclusion_between_two_samples_of_the_path_is_found() -> None:
    assert "exclusion circle" in problems(keys(circle("exclusion", 1502.5, 0, 0.5)))


def test_beside_the_slots_and_with_one_of_two_inclusions_enough_there_is_nothing_to_say() -> None:
    clear, near = circle("exclusion", 1500, 400, 100), circle("inclusion", 0, 0, 1500)
    assert load_scenario(keys(clear)).fence
    assert "outside the inclusion circle" in problems(keys(near))
    assert load_scenario(keys(near, inclusions="any")).fence


def test_a_start_in_an_exclusion_is_refused() -> None:
    start = {"in_air": True, "run_in_s": 6, "offset_m": [0, 200, 0]}
    said = problems(keys(circle("exclusion", -160, 215, 80)) | {"start": start})
    assert said.startswith("start.offset_m: vehicle 3 begins ")
    assert said.endswith("m inside the exclusion circle; allowed: outside it (safety.fence.areas.0)")


def test_check_says_for_every_slot_how_near_to_which_area_it_comes_and_where() -> None:
    planned = load_scenario(keys(circle("exclusion", 1500, 330, 150), rally_m=[[0, 800, 50], [0, 0, 50]]))
    slots = {each["who"]: each for each in path_figures(planned)["fence"]}
    places = dict(zip(names_by_index(planned), slot_schedule(planned)[0].positions_m.tolist(), strict=True))
    assert len(slots) == len(places) == 3
    for who, place in places.items():
        (told,) = [each for name, each in slots.items() if name.startswith(who) or who == "vehicle 1"][:1]
        assert told["area"] == "safety.fence.areas.0"
        assert told["least_m"] == pytest.approx(330.0 - 150.0 - told["east_m"], abs=0.1)
        assert told["north_m"] == pytest.approx(1500.0, abs=3.0), place
    text = "\n".join(path_text(planned))
    assert "m from safety.fence.areas.0 at " in text
    assert list(rally_outside(planned)) == ["safety.fence.rally_m.0: rally point 100 m outside the fence"]


def plan(tmp_path: Path) -> dict[str, Any]:
    """Write a mission around a lake, with a polygon to stay in, a circle to stay out of, and two rally points."""

    def lat_lon(north_m: float, east_m: float) -> list[float]:
        lat_rad, lon_rad, _ = ORIGIN.from_ned(north_m, east_m, 0.0)
        return [math.degrees(lat_rad), math.degrees(lon_rad)]

    turns = [(600, 0), (2600, 0), (2600, 1800), (600, 1800), (600, 400)]
    items = [
        {
            "type": "SimpleItem",
            "command": 16,
            "frame": 3,
            "doJumpId": number,
            "params": [0, 0, 0, None, *lat_lon(*at), 90],
        }
        for number, at in enumerate(turns, 1)
    ]
    around = [lat_lon(*at) for at in ((-900, -500), (3300, -500), (3300, 2500), (-900, 2500))]
    lake = {"circle": {"center": lat_lon(1600, 900), "radius": 350}, "inclusion": False, "version": 1}
    (tmp_path / "lake.plan").write_text(
        json.dumps(
            {
                "fileType": "Plan",
                "geoFence": {"circles": [lake], "polygons": [{"polygon": around, "inclusion": True}], "version": 2},
                "mission": {"items": items, "plannedHomePosition": list(HOME), "firmwareType": 3},
                "rallyPoints": {"points": [[*lat_lon(-300, 0), 50], [*lat_lon(3000, 2000), 60]], "version": 2},
            }
        )
    )
    return {"vehicles": {"count": 4}, "path": {"file": "lake.plan"}, "start": {"in_air": True}}


def load(tmp_path: Path, plain: dict[str, Any]) -> Scenario:
    (tmp_path / "lake.yaml").write_text(json.dumps(plain))
    return load_scenario(tmp_path / "lake.yaml")


def test_every_slot_of_a_plan_stays_inside_its_polygon_and_outside_its_circle_at_25_hz(tmp_path: Path) -> None:
    planned = load(tmp_path, plan(tmp_path))
    fence = AirspaceKeys.of(planned).fence
    assert fence is not None
    corners, (lake,) = np.array(fence.corners_m), fence.areas
    at_m = planned_m(planned, np.arange(0.0, planned_end_s(planned), 0.04))
    points = planned.leader_path.at(np.concatenate((np.arange(-planned.run_in_m, 0.0, 0.9), at_m)))
    for forward_m, right_m, _ in slot_schedule(planned)[0].positions_m.tolist():
        north_m, east_m = offset_points(points.north_m, points.east_m, points.course_rad, forward_m, right_m)
        assert (north_m > corners[:, 0].min()).all()
        assert (north_m < corners[:, 0].max()).all()
        assert (east_m > corners[:, 1].min()).all()
        assert (east_m < corners[:, 1].max()).all()
        assert lake.centre_m is not None
        assert (np.hypot(north_m - lake.centre_m[0], east_m - lake.centre_m[1]) > lake.radius_m).all()


def test_a_plans_leg_across_its_exclusion_is_refused_with_the_place(tmp_path: Path) -> None:
    plain = plan(tmp_path)
    text = (tmp_path / "lake.plan").read_text().replace('"radius": 350', '"radius": 950')
    (tmp_path / "lake.plan").write_text(text)
    with pytest.raises(ScenarioError) as refused:
        load(tmp_path, plain)
    assert "inside the exclusion circle" in str(refused.value)
    assert "path at" in str(refused.value)


def test_a_plan_comes_back_from_the_scenario_with_its_fence_and_rally_points(tmp_path: Path) -> None:
    planned = load(tmp_path, plan(tmp_path))
    (tmp_path / "run.yaml").write_text(dump_scenario(planned))
    assert load_scenario(tmp_path / "run.yaml").safety == planned.safety
    export_path(planned, tmp_path / "back.plan")
    given, back = (read_mission(tmp_path / name).fence for name in ("lake.plan", "back.plan"))
    assert back.any_inclusion is given.any_inclusion is False
    (lake, around), (lake_given, around_given) = back.areas, given.areas
    assert isinstance(lake, FenceCircle)
    assert isinstance(lake_given, FenceCircle)
    assert (lake.radius_m, lake.inclusion) == (350.0, False)
    assert lake.centre == pytest.approx(lake_given.centre, abs=2e-8)
    assert isinstance(around, FencePolygon)
    assert isinstance(around_given, FencePolygon)
    assert np.array(around.corners) == pytest.approx(np.array(around_given.corners), abs=2e-8)
    assert np.array(back.rally) == pytest.approx(np.array(given.rally), abs=1e-3)


def test_a_leg_across_an_exclusion_is_repaired_to_one_beside_it() -> None:
    path = {"kind": "legs", "waypoints_m": [[0, 0, 100], [3000, 0, 100], [3000, 2000, 100]]}
    plain = keys(circle("exclusion", 1500, 130, 150), corners_m=None) | {"path": path}
    assert "inside the exclusion circle" in problems(plain)
    found = repair(plain)
    assert [change.key for change in found.changes] == ["path.waypoints_m.0", "path.waypoints_m.1"]
    assert min(each["least_m"] for each in path_figures(load_scenario(yaml.safe_load(found.text())))["fence"]) > 0.0
