"""The law of docs/own-law.md is Python that flies."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from gcs_formation.control.laws import FormationLaw, LawKind, law_parameters
from tests.flights.in_memory import World

PAGE = Path(__file__).parents[2] / "docs" / "own-law.md"


def test_the_documents_law_keeps_a_formation_in_its_slots():
    law, row = (block.replace("\n   ", "\n") for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.S))
    names: dict[str, Any] = {"FormationLaw": FormationLaw, "LawKind": LawKind, "law_parameters": law_parameters}
    exec(law.removeprefix("   "), names)
    world = World(start={"in_air": True, "run_in_s": 6, "offset_m": [5, 4, 3]}, links={"default": {"delay_ms": 200}})
    controller = world.station.controller
    kind = eval("{" + row.strip() + "}", names)["lqr"]
    assert kind.name == "LQR"
    controller._law = kind.make(world.station.scenario, controller.models)
    world.fly_to(25.0)
    errors_m = np.array([tick.error_m for tick in world.notes.ticks[-50:]])
    assert np.nanmax(np.abs(errors_m)) < 0.1
