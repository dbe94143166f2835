"""Which slots behind each other `check` calls too near to stop in, and at which speed."""

from __future__ import annotations

from typing import Any

import pytest

from formation_scenario import load_scenario
from gcs_formation.app.check import check_text

COPTERS: dict[str, Any] = {
    "vehicles": {"count": 3, "model": "arducopter"},
    "formation": {"shape": "custom", "slots_m": {2: [-12, 0, 0], 3: [-40, 0, 0]}},
    "path": {"speed_mps": 5, "waypoints_m": [[0, 0, 50], [900, 0, 50]]},
}


def warned(**keys: Any) -> list[str]:
    """Return the warnings of three multirotors 12 m and 28 m behind each other at 5 m/s; 9.5 m would be enough."""
    return [each for each in check_text(load_scenario(COPTERS | keys)).splitlines() if "behind each other" in each]


def test_the_fastest_of_path_and_orders_counts_and_the_nearest_two_slots() -> None:
    """5 m are kept; 9 m/s for 0.9 s are 8.1 m."""
    assert warned() == []
    orders = [{"at_s": 5, "order": "speed 9"}, {"at_s": 9, "order": "speed 3"}, {"at_s": 20, "order": "rtl"}]
    (found,) = warned(orders=orders)
    assert "slots 12 m behind each other" in found
    assert "at 9 m/s; 13.1 m or more leave 5 m" in found
    fast = {"speed_mps": 8, "waypoints_m": [[0, 0, 50], [900, 0, 50]]}
    assert "at 8 m/s; 12.2 m" in warned(path=fast, orders=orders[1:])[0]


def test_the_slowest_link_counts() -> None:
    """A round trip of 0.6 s and 0.9 s at 5 m/s are 7.5 m."""
    (found,) = warned(links={"changes": [{"at_s": 9, "vehicles": [3], "delay_ms": 300}]})
    assert "12.5 m or more" in found


def test_fixed_wings_are_not_warned_and_multirotors_not_where_the_rule_is_turned_off() -> None:
    slow = {"links": {"default": {"delay_ms": 300}}}
    assert len(warned(**slow)) == 1
    assert warned(**slow, safety={"avoidance": {"enabled": False}}) == []
    fixed_wings = {"vehicles": {"count": 3}, "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 50], [900, 0, 50]]}}
    assert warned(**slow, **fixed_wings) == []


@pytest.mark.parametrize(("frame", "count"), [("north", 1), ("leader_heading", 0)])
def test_slots_that_do_not_turn_are_behind_each_other_on_some_course(frame: str, count: int) -> None:
    formation = {"shape": "custom", "frame": frame, "slots_m": {2: [0, -9, 0], 3: [0, 30, 0]}}
    assert len(warned(formation=formation)) == count


def test_a_virtual_leader_needs_no_room() -> None:
    followers = [{"id": number, "role": "follower", "model": "arducopter"} for number in (1, 2)]
    near = {"shape": "custom", "slots_m": {1: [-6, 0, 0], 2: [-30, 0, 0]}}
    assert warned(vehicles=followers, formation=near) == []
    near["slots_m"] = {1: [-6, 0, 0], 2: [-15, 0, 0]}
    (found,) = warned(vehicles=followers, formation=near)
    assert "slots 9 m behind each other" in found
