"""What the fence's keys mean: which shape and limits they give, what is refused, and what a file's fence becomes."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from pydantic import ValidationError

from airlink.clock import Instant
from flight_model.earth import GeodeticOrigin
from flight_model.fence_geometry import Circle, Polygon
from flight_model.flight_state import FlightState
from formation_scenario import load_scenario
from formation_scenario.mission_files.mission import FenceCircle, FencePolygon, FileFence
from gcs_formation.core.cycle import Cycle
from gcs_formation.features.airspace.check_warnings import WARNINGS
from gcs_formation.features.airspace.feature import FEATURE
from gcs_formation.features.airspace.keys import KEYS, AirspaceKeys, Area, Fence
from gcs_formation.features.airspace.mission_keys import fence_keys
from gcs_formation.features.airspace.rules import RULES
from gcs_formation.recorder import Tick, VehicleLink
from tests.flights.conftest import scenario

PLANNED = load_scenario(scenario())
ORIGIN = GeodeticOrigin(math.radians(47.4), math.radians(8.54), 488.0)
SQUARE = ((0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0))
WIDE = {"corners_m": [[-900, -700], [5000, -700], [5000, 700], [-900, 700]]}
REFERENCE = Path(__file__).parents[4] / "docs" / "scenario.md"
WHERE = np.array([[50.0, 50.0], [-10.0, 50.0], [150.0, 50.0]])


def place(north_m: float, east_m: float) -> tuple[float, float]:
    lat_rad, lon_rad, _ = ORIGIN.from_ned(north_m, east_m, 0.0)
    return math.degrees(lat_rad), math.degrees(lon_rad)


def test_an_area_is_the_polygon_of_its_corners_or_else_a_circle() -> None:
    polygon = Area(kind="exclusion", corners_m=SQUARE, centre_m=(5.0, 6.0), radius_m=7.0).shape
    assert isinstance(polygon, Polygon)
    assert polygon.inside_m(WHERE) == pytest.approx([50.0, -10.0, -50.0])
    circle = Area(kind="exclusion", centre_m=(30.0, 50.0), radius_m=40.0).shape
    assert isinstance(circle, Circle)
    assert circle.inside_m(WHERE) == pytest.approx([20.0, 0.0, -80.0])
    nothing = Area(kind="exclusion").shape
    assert nothing.inside_m(np.array([[0.0, 0.0], [3.0, 4.0]])) == pytest.approx([0.0, -5.0])


@pytest.mark.parametrize(("inclusions", "inside_m"), [("all", [40.0, -10.0, -60.0]), ("any", [50.0, 80.0, -50.0])])
def test_inclusions_bind_all_or_one_is_enough_and_exclusions_always_bind(
    inclusions: Any, inside_m: list[float]
) -> None:
    """A square, a circle around its southern side, and one to stay out of that begins 40 m north of it."""
    around = Area(kind="inclusion", centre_m=(0.0, 50.0), radius_m=90.0)
    out = Area(kind="exclusion", centre_m=(250.0, 50.0), radius_m=110.0)
    sides = Fence(corners_m=SQUARE, areas=(around, out), inclusions=inclusions).sides
    assert sides is not None
    assert [each.key for each in sides.areas] == [
        "safety.fence.corners_m",
        "safety.fence.areas.0",
        "safety.fence.areas.1",
    ]
    assert [each.inclusion for each in sides.areas] == [True, True, False]
    assert sides.inside_m(WHERE) == pytest.approx(inside_m)


def test_without_areas_there_are_no_sides_and_heights_without_limits_are_infinite() -> None:
    assert Fence().sides is None
    assert Fence().heights_m == (-math.inf, math.inf)
    assert Fence(height_min_m=0.0).heights_m == (0.0, math.inf)
    assert Fence(height_max_m=0.0).heights_m == (-math.inf, 0.0)
    only = Fence(areas=(Area(kind="exclusion", centre_m=(0.0, 0.0), radius_m=5.0),)).sides
    assert only is not None
    assert only.inside_m(np.array([[0.0, 0.0], [20.0, 0.0]])) == pytest.approx([-5.0, 15.0])
    assert Fence(rally_m=((1.0, 2.0, 3.0),)).rally_positions_m == ((1.0, 2.0, 3.0),)


def ring(count: int) -> list[tuple[float, float]]:
    return [(math.cos(2.0 * math.pi * each / count), math.sin(2.0 * math.pi * each / count)) for each in range(count)]


@pytest.mark.parametrize(
    ("made", "least", "most"),
    [
        (lambda count: Fence(corners_m=tuple(ring(count))), 3, 200),
        (lambda count: Fence(areas=(Area(kind="exclusion"),) * count), 0, 100),
        (lambda count: Fence(rally_m=((0.0, 0.0, 0.0),) * count), 0, 100),
    ],
    ids=["corners", "areas", "rally points"],
)
def test_of_corners_areas_and_rally_points_there_may_be_as_many_as_the_reference_says(
    made: Any, least: int, most: int
) -> None:
    for count in (least, most):
        assert made(count)
    for count in (least - 1, most + 1):
        if count >= 0:
            with pytest.raises(ValidationError):
                made(count)


def test_the_examples_of_the_reference_are_those_of_the_keys() -> None:
    text = REFERENCE.read_text()
    shown = dict[str, Any]()
    for kind in (Area, Fence):
        for name, field in kind.model_fields.items():
            for example in field.examples or ():
                shown[name] = example
                wanted = yaml.safe_dump({name: example}, default_flow_style=True, width=1000).strip()[1:-1]
                assert f"`{wanted}`" in text, name
    assert {"corners_m", "centre_m", "radius_m", "rally_m", "height_min_m", "height_max_m"} <= shown.keys()


@pytest.mark.parametrize(("lowest_m", "found"), [(120.0, False), (120.1, True)])
def test_a_lowest_height_up_to_the_highest_is_allowed(lowest_m: float, found: bool) -> None:
    (rule,) = RULES
    assert bool(list(rule(fenced(height_min_m=lowest_m, height_max_m=120.0)))) is found


def fenced(**keys: Any) -> Any:
    safety = PLANNED.safety.model_copy(update={"fence": Fence(**keys) if keys else None})
    return PLANNED.model_copy(update={"safety": safety})


def test_areas_that_are_neither_or_both_are_found_by_their_numbers() -> None:
    circle = Area(kind="exclusion", centre_m=(0.0, 0.0), radius_m=5.0)
    areas = (
        circle,
        Area(kind="inclusion"),
        Area(kind="inclusion", corners_m=SQUARE),
        Area(kind="exclusion", radius_m=1.0),
    )
    (rule,) = RULES
    found = list(rule(fenced(areas=areas)))
    assert [each[0] for each in found] == [("safety", "fence", "areas", 1), ("safety", "fence", "areas", 3)]
    assert [each[1] for each in found] == ["found neither corners nor centre", "found radius_m"]
    assert list(rule(fenced())) == []


@pytest.mark.parametrize(
    ("east_m", "height_m", "reported"),
    [(700.0, 50.0, ""), (700.6, 50.0, "1"), (703.0, 50.0, "3"), (703.0, 104.0, "5")],
)
def test_a_rally_point_is_reported_with_how_far_outside_the_fence_it_is(
    east_m: float, height_m: float, reported: str
) -> None:
    """3 m beside it and 4 m above its highest height are 5 m."""
    (warn,) = WARNINGS
    said = list(warn(fenced(**WIDE, height_max_m=100.0, rally_m=[[0, 0, 60], [0, east_m, height_m]])))
    assert said == [f"safety.fence.rally_m.1: rally point {reported} m outside the fence"] * bool(reported)
    assert list(warn(fenced())) == []


def test_the_first_polygon_to_stay_in_is_the_fence_and_everything_else_an_area_with_north_before_east() -> None:
    """In the file they are latitudes and longitudes; a degree of longitude is shorter here by cos 47.4°."""
    corners, inner, lake = ((0.0, 0.0), (900.0, 0.0), (0.0, 500.0)), SQUARE, ((5.0, 6.0), (7.0, 8.0), (9.0, 6.0))
    file = FileFence(
        (
            FencePolygon(tuple(place(*each) for each in lake), inclusion=False),
            FencePolygon(tuple(place(*each) for each in corners), inclusion=True),
            FenceCircle(place(300.0, -40.0), 25.0, inclusion=True),
            FencePolygon(tuple(place(*each) for each in inner), inclusion=True),
        ),
        ((*place(-70.0, 20.0), 40.0),),
        any_inclusion=True,
    )
    keys: Any = fence_keys(file, ORIGIN, 7.5)
    assert np.array(keys["corners_m"]) == pytest.approx(np.array(corners), abs=1e-3)
    first, second, third = keys["areas"]
    assert [each["kind"] for each in keys["areas"]] == ["exclusion", "inclusion", "inclusion"]
    assert np.array(first["corners_m"]) == pytest.approx(np.array(lake), abs=1e-3)
    assert (second["centre_m"], second["radius_m"]) == (pytest.approx((300.0, -40.0), abs=1e-3), 25.0)
    assert np.array(third["corners_m"]) == pytest.approx(np.array(inner), abs=1e-3)
    assert keys["inclusions"] == "any"
    assert keys["rally_m"] == [pytest.approx((-70.0, 20.0, 47.5), abs=1e-3)]


@pytest.mark.parametrize(("count", "is_any", "said"), [(1, True, False), (2, True, True), (2, False, False)])
def test_that_one_inclusion_is_enough_is_said_only_of_several(count: int, is_any: bool, said: bool) -> None:
    areas = [FenceCircle(place(10.0 * each, 0.0), 500.0, inclusion=True) for each in range(count)]
    lake = FenceCircle(place(0.0, 90.0), 5.0, inclusion=False)
    keys = fence_keys(FileFence((*areas, lake), any_inclusion=is_any), ORIGIN, 0.0)
    assert ("inclusions" in keys) is said
    assert keys.keys() - {"inclusions"} == {"areas"}


def test_a_file_without_a_fence_or_with_one_polygon_has_no_more_keys_than_that() -> None:
    assert fence_keys(FileFence(), ORIGIN, 0.0) == {}
    polygon = FencePolygon(tuple(place(*each) for each in SQUARE), inclusion=True)
    assert fence_keys(FileFence((polygon,)), ORIGIN, 0.0).keys() == {"corners_m"}


def test_its_stages_hold_what_leads_out_and_then_what_leads_into_the_ground() -> None:
    """Of a fence from 30 to 120 m and a clearance of 50 m the ground has the last word."""
    planned = load_scenario(scenario(safety={"fence": {"height_min_m": 30, "height_max_m": 120}, "clearance_m": 50}))
    models = [each.model.autopilot() for each in planned.vehicles]
    now = Instant(1)
    tick = Tick(now, 0.0, "flying", 0, [VehicleLink(now)] * 3, [0.0] * 3, [0.0] * 3, [True] * 3)
    for index, height_m in enumerate((10.0, 100.0, 300.0)):
        tick.state[index] = FlightState(0.0, 0.0, 100.0, 0.0, 22.0, 0.0, 0.0, 0.0)
        tick.setpoints[index] = 22.0, 0.0, height_m
    stub: Any = SimpleNamespace(scenario=planned, controller=SimpleNamespace(models=models), tick=tick)
    cycle: Cycle = stub
    for stage, heights_m in zip(FEATURE.stages(cycle), ([30.0, 100.0, 120.0], [50.0, 100.0, 120.0]), strict=True):
        stage.run(cycle)
        assert [each[2] for each in tick.setpoints] == heights_m
    assert (AirspaceKeys,) == KEYS
