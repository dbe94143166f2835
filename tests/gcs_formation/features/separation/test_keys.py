"""Keys of the separation rule: what they allow, what follows from others, and what `check` says of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from formation_scenario import Scenario, dump_scenario, load_scenario
from formation_scenario.kept_distance import KeepsDistance
from gcs_formation.app.check import check_text
from gcs_formation.features.separation.keys import SeparationKeys


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("distance_m=4", ".distance_m: found 4; at least separation_m, 5"),
        ("distance_m=0", ".distance_m: found 0; "),
        ("horizon_s=3", ".horizon_s: found 3; "),
        ("horizon_s=61", ".horizon_s: found 61; "),
        ("enabled=perhaps", ".enabled: found 'perhaps'; "),
        ("radius_m=5", ".radius_m: found an unknown key 'radius_m'; enabled, distance_m, horizon_s"),
    ],
)
def test_values_that_are_not_allowed_are_refused(
    refusal: Callable[..., list[str]], override: str, expected: str
) -> None:
    (line,) = refusal(f"safety.avoidance.{override}")
    assert line.startswith(f"safety.avoidance{expected}")


def test_a_group_is_no_number(refusal: Callable[..., list[str]]) -> None:
    (line,) = refusal("safety.avoidance=5")
    assert line == "safety.avoidance: found 5; a mapping with enabled, distance_m, horizon_s"


def test_a_rule_that_is_off_may_keep_less_and_the_formation_is_planned_by_the_limit(
    load: Callable[..., Scenario],
) -> None:
    scenario = load("safety.avoidance={enabled: false, distance_m: 4}")
    assert (SeparationKeys.of(scenario).avoidance.distance_m, scenario.safety.kept_m) == (4.0, 5.0)


def test_the_distance_kept_follows_from_the_least_one(load: Callable[..., Scenario]) -> None:
    safety = load("safety.separation_m=7").safety
    assert [each.kept_m for each in safety.each(KeepsDistance)] == [12.0]
    assert safety.kept_m == 12.0
    assert load("safety.avoidance.distance_m=30").safety.kept_m == 30.0


def test_they_are_written_where_they_stand_and_read_again(load: Callable[..., Scenario]) -> None:
    scenario = load("safety.avoidance.horizon_s=20")
    written = dump_scenario(scenario)
    assert written.index("separation_m:") < written.index("horizon_s: 20.0") < written.index("clearance_m:")
    assert load_scenario(scenario) == scenario


def test_a_key_that_stands_in_them_is_found_from_above(refusal: Callable[..., list[str]]) -> None:
    (line,) = refusal("safety.horizon_s=20")
    assert line.endswith("(did you mean 'safety.avoidance.horizon_s'?)")


@pytest.mark.parametrize(
    ("shape", "spacing_m", "delay_ms", "enough"),
    [
        ("follower", 12.0, 300, "8 m/s; 17 m"),
        ("follower", 12.0, 0, "8 m/s; 12.2 m"),
        ("follower", 17.5, 300, None),
        ("line", 12.0, 300, None),
    ],
)
def test_multirotors_too_near_behind_each_other_to_stop_are_warned_of_with_the_distance_that_is_enough(
    shape: str, spacing_m: float, delay_ms: float, enough: str | None
) -> None:
    """Behind one that ignored its setpoints, 12 m with 300 ms at 8 m/s became 2.4 m, and 10 m at 5 m/s 2.6 m."""
    copters: dict[str, Any] = {
        "vehicles": {"count": 3, "model": "arducopter"},
        "formation": {"shape": shape, "spacing_m": spacing_m},
        "path": {"speed_mps": 8, "waypoints_m": [[0, 0, 50], [900, 0, 50]]},
        "links": {"default": {"delay_ms": delay_ms}},
    }
    found = [each for each in check_text(load_scenario(copters)).splitlines() if "behind each other" in each]
    assert len(found) == (enough is not None)
    assert enough is None or enough in found[0]


@pytest.mark.parametrize(("beside_m", "warned"), [(2.9, True), (3.0, False)])
def test_slots_that_are_as_far_to_the_side_as_the_limit_are_not_behind_each_other(
    beside_m: float, warned: bool
) -> None:
    copters: dict[str, Any] = {
        "vehicles": {"count": 2, "model": "arducopter"},
        "formation": {"shape": "custom", "slots_m": {2: [-8, 0, beside_m]}},
        "path": {"speed_mps": 8, "waypoints_m": [[0, 0, 50], [900, 0, 50]]},
        "safety": {"separation_m": 3},
    }
    assert ("behind each other" in check_text(load_scenario(copters))) is warned
