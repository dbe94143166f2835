"""Separation in whole flights: the rule doesn't act on followers that swap their slots."""

from __future__ import annotations

from typing import Any

import pytest

from tests.flights.conftest import Fly

LEFT, RIGHT = [-30, -30, 0], [-30, 30, 0]
SWAP: dict[str, Any] = {
    "duration_s": 45,
    "formation": {
        "shape": "custom",
        "slots_m": {2: LEFT, 3: RIGHT},
        "changes": [{"at_s": 2, "shape": "custom", "slots_m": {2: RIGHT, 3: LEFT}}],
    },
}
LINKS = [{}, {"default": {"delay_ms": 300}}, {"default": {"delay_ms": 150, "jitter_ms": 30, "loss": 0.1}}]


@pytest.mark.slow
@pytest.mark.parametrize("links", LINKS)
def test_a_change_of_formation_keeps_apart_by_itself(fly: Fly, links: dict[str, Any]) -> None:
    safety = fly(**SWAP, links=links).to_dict()["safety"]
    assert safety["violations"] == 0
    assert safety["min_separation_m"] > 20.0
    assert safety["avoidance_s"] == 0.0
