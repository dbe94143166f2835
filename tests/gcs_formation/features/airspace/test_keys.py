"""The fence: its geometry, and which paths and slots it refuses, with place and figure."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flight_model.fence_geometry import (
    REACT_S,
    TURN_SHARE,
    Drift,
    FenceArea,
    FenceAreas,
    Flyers,
    Polygon,
    inside_m,
    room_along_m,
    room_m,
)
from formation_scenario import ScenarioError, load_scenario
from tests.flights.conftest import scenario

SQUARE = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]])
L_SHAPED = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 50.0], [50.0, 50.0], [50.0, 100.0], [0.0, 100.0]])


def only(corners: np.ndarray) -> FenceAreas:
    """Return the fence of one polygon to stay in."""
    return FenceAreas((FenceArea(Polygon(corners), inclusion=True, key="safety.fence.corners_m"),))


@pytest.mark.parametrize(
    ("corners", "place", "within_m"),
    [
        (SQUARE, (50.0, 50.0), 50.0),
        (SQUARE, (90.0, 50.0), 10.0),
        (SQUARE, (130.0, 50.0), -30.0),
        (SQUARE, (130.0, 140.0), -50.0),  # from a corner: 30 and 40 m
        (L_SHAPED, (25.0, 75.0), 25.0),
        (L_SHAPED, (75.0, 75.0), -25.0),  # in the L's bay
        (L_SHAPED, (45.0, 45.0), np.hypot(5.0, 5.0)),  # from the corner that points inwards
    ],
)
def test_the_distance_to_the_edge_is_positive_inside(
    corners: np.ndarray, place: tuple[float, float], within_m: float
) -> None:
    assert inside_m(corners, np.array(place)) == pytest.approx(within_m)
    assert inside_m(corners[::-1], np.array([place, place])) == pytest.approx([within_m] * 2)


def test_room_is_what_a_circle_to_either_side_leaves() -> None:
    """Northbound at 10 m/s and 0.5 rad/s, 30 m from the eastern side of a square of 400 m."""
    fence, speed, turn = only(4.0 * SQUARE), 10.0, 0.5
    room = room_m(fence, np.array([200.0, 370.0]), np.array([speed, 0.0]), np.array(speed), np.array(turn))
    radius = speed / (TURN_SHARE * turn)
    ahead = 200.0 + REACT_S * speed
    left, right = min(400 - ahead, 30.0 + radius) - radius, (30.0 - radius) - radius
    assert room == pytest.approx([left, right])


def test_in_a_wind_slots_are_behind_the_nose_and_the_wind_carries_everybody() -> None:
    """Course north at 20 m/s through air, 12 m/s from the west: a 3-4-5 triangle, 16 m/s over ground."""
    fence, turn = only(100.0 * SQUARE), np.array([0.2, 0.2])
    way, flyers = (
        (np.array([5000.0]), np.array([9900.0]), np.zeros(1)),
        Flyers(np.array([0.0, -50.0]), np.zeros(2), turn),
    )
    places, room = room_along_m(fence, way, flyers, Drift(20.0, 0.0, 12.0, 32.0))
    assert places[:, 0] == pytest.approx(np.array([[5000.0, 9900.0], [4960.0, 9930.0]]))
    reached, radius = 5000.0 + REACT_S * 16.0, 32.0 / (TURN_SHARE * 0.2)
    assert reached < 10000.0 - radius
    assert room[:, 0] == pytest.approx([100.0, 70.0])


def keys(**fence: Any) -> dict[str, Any]:
    """A leader and two followers at 22 m/s northwards, 100 m high, from -132 to 4000 m; both slots are 42 m aside."""
    return scenario(safety={"fence": fence})


WIDE = [[-400, -300], [4200, -300], [4200, 300], [-400, 300]]


def test_inside_the_fence_there_is_nothing_to_say() -> None:
    assert load_scenario(keys(corners_m=WIDE, height_min_m=100, height_max_m=100)).fence


@pytest.mark.parametrize(
    ("fence", "found", "allowed"),
    [
        ({"height_max_m": 90}, "the leader is at 100.0 m", "90 m or less (safety.fence.height_max_m)"),
        ({"height_min_m": 110}, "the leader is at 100.0 m", "110 m or more (safety.fence.height_min_m)"),
        (
            {"corners_m": [[-400, -300], [3900, -300], [3900, 300], [-400, 300]]},
            "path at 4000 m (north 4000, east 0, height 100): the leader is 100 m outside the fence",
            "inside it (safety.fence.corners_m)",
        ),
        (
            {"corners_m": [[-400, -20], [4300, -20], [4300, 300], [-400, 300]]},
            "slot in shape arrow is 10 m outside the fence",
            "inside it (safety.fence.corners_m)",
        ),
        (
            {"corners_m": [[-400, -300], [4050, -300], [4050, 300], [-400, 300]]},
            "the leader is 50 m from the fence and heads for it",
            "more room to turn away (safety.fence.corners_m)",
        ),
        ({"corners_m": [[0, 0], [1, 1]]}, "found [[0, 0], [1, 1]]", "a list of 3 to 200 corners [north, east]"),
        ({"height_min_m": 120, "height_max_m": 80}, "found 120 m", "up to height_max_m, 80 m"),
    ],
)
def test_what_leaves_the_fence_is_refused_with_place_and_figure(
    fence: dict[str, Any], found: str, allowed: str
) -> None:
    with pytest.raises(ScenarioError) as refused:
        load_scenario(keys(**fence))
    assert found in str(refused.value)
    assert allowed in str(refused.value)


def test_the_run_in_counts_and_so_does_an_order() -> None:
    """The run-in begins 6 s before the path: 132 m."""
    short = [[-100, -300], [4200, -300], [4200, 300], [-100, 300]]
    with pytest.raises(ScenarioError, match="path at -132 m"):
        load_scenario(keys(corners_m=short))
