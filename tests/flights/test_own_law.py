"""The law of docs/own-law.md is a file that flies."""

from __future__ import annotations

import re
from pathlib import Path

import gcs_formation

PAGE = Path(__file__).parents[2] / "docs" / "own-law.md"
SCENARIO = {
    "vehicles": {"count": 3},
    "duration_s": 25,
    "start": {"in_air": True, "run_in_s": 6},
    "path": {"waypoints_m": [[0, 0, 100], [2000, 0, 100], [4000, 0, 100]]},
    "law": {"type": "lqr", "parameters": {"share": 0.9}},
}


def test_the_documents_law_keeps_a_formation_in_its_slots(tmp_path):
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)
    file = tmp_path / "lqr.py"
    file.write_text(code, encoding="utf-8")
    summary = gcs_formation.run(SCENARIO, clock="virtual", out=tmp_path / "run", plugins=[file])
    for follower in summary.figures["followers"].values():
        assert follower["error_x_m"]["max"] < 0.1
        assert follower["error_y_m"]["max"] < 0.1
