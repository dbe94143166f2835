"""Separation in whole flights: followers whose straight ways to their new slots cross."""

from __future__ import annotations

import json
from pathlib import Path
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
def test_followers_that_swap_places_keep_their_distance(fly: Fly, tmp_path: Path, links: dict[str, Any]) -> None:
    safety = fly(**SWAP, links=links).to_dict()["safety"]
    assert safety["violations"] == 0
    assert safety["min_separation_m"] > 8.0
    if safety["avoidance_s"] > 0:
        lines = (tmp_path / "run" / "events.jsonl").read_text().splitlines()
        begins = [event["begins"] for event in map(json.loads, lines) if event["kind"] == "separation"]
        assert 0 < begins.count(True) == begins.count(False)
