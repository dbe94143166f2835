"""Lists that would take a check minutes are refused by their length; what is accepted is shared and checked once."""

from __future__ import annotations

from typing import Any

import pytest

from formation_scenario import ScenarioError, load_scenario
from formation_scenario.source import LONG_TEXT, read_text

PATH: dict[str, Any] = {"waypoints_m": [[0, 0, 100], [3000, 0, 100]]}


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (
            {"path": {"waypoints_m": [[60.0 * i, 0, 100] for i in range(5001)]}},
            r"path\.waypoints_m: found 5001 entries; allowed: up to 5000",
        ),
        (
            {"links": {"changes": [{"at_s": i, "loss": 0.1} for i in range(5001)]}},
            r"links\.changes: found 5001 entries; allowed: up to 5000",
        ),
        ({"orders": [{"at_s": i, "order": "loiter"} for i in range(1001)]}, "found 1001 entries; allowed: up to 1000"),
        ({"expect": [{"metric": "error_x_m.max", "below": 1}] * 1001}, "found 1001 entries; allowed: up to 1000"),
        (
            {
                "vehicles": {"count": 100},
                "formation": {"changes": [{"at_s": i, "spacing_m": 30 + i} for i in range(89)]},
            },
            r"formation\.changes: found 89 changes with 100 vehicles; allowed: up to 88 with so many",
        ),
        (
            {
                "vehicles": {"count": 7},
                "path": {"waypoints_m": [[0, 0, 100], [500e3, 0, 100]]},
                "formation": {"changes": [{"at_s": i, "spacing_m": 30 + i} for i in range(51)]},
            },
            r"formation\.changes: found 51 changes with 7 vehicles on a path of 500 km; allowed: up to 50 with so many",
        ),
        (
            {"vehicles": {"count": 7}, "orders": [{"at_s": i, "order": f"spacing {30 + i}"} for i in range(501)]},
            r"orders: found 501 orders that change the formation with 7 vehicles; allowed: up to 500 with so many",
        ),
        (
            {
                "vehicles": {"count": 87},
                "formation": {"changes": [{"at_s": i, "spacing_m": 30 + i} for i in range(60)]},
                "orders": [
                    *({"at_s": i, "order": f"shape {('line', 'square')[i % 2]}"} for i in range(41)),
                    *({"at_s": 50 + i, "order": "speed 21"} for i in range(100)),
                ],
            },
            "orders: found 41 orders that change the formation with 87 vehicles; "
            "allowed: up to 40 with so many beside 60 changes",
        ),
    ],
)
def test_a_list_too_long_is_refused_by_its_length(keys: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        load_scenario({"vehicles": {"count": 2}, "path": PATH} | keys)


def test_vehicles_with_the_same_changes_share_their_links_states() -> None:
    changes = list[dict[str, Any]]({"at_s": 1 + i, "delay_ms": 50 + i} for i in range(20))
    changes.append({"at_s": 40, "vehicles": [3], "loss": 0.1})
    scenario = load_scenario({"vehicles": {"count": 4}, "path": PATH, "links": {"changes": changes}})
    one, two, three, four = (scenario.link_steps(each) for each in scenario.vehicles)
    assert one is two is four
    assert len(one) == 21
    assert [step.at_s for step in three] == [*(step.at_s for step in one), 40.0]


def test_long_text_is_read_like_short_text() -> None:
    text = "a: [1e3, 0x10, 1:30, 010, 2024-01-01, .nan, yes, 'x', null]\nb: {c: &c [1, 2], d: *c}\n"
    short, long = read_text(text), read_text(text + "#" * LONG_TEXT + "\n")
    assert str(long.data) == str(short.data)
    assert long.positions == short.positions
