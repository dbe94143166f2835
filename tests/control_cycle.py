"""The page of docs that lists the stages of the control cycle: `python -m tests.control_cycle` writes it again."""

from __future__ import annotations

import inspect
from pathlib import Path
from unittest.mock import Mock

from formation_scenario import load_scenario
from gcs_formation.core.cycle import EACH_SECOND, IN_COMMAND, LED, NOT_IN_COMMAND
from gcs_formation.core.feature import features
from gcs_formation.station import Station

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "control-cycle.md"
RUNS = {
    EACH_SECOND: "once a second",
    IN_COMMAND: "in command",
    NOT_IN_COMMAND: "not in command",
    LED: "in command, with a leader",
}
HEAD = """# The control cycle

All that the station does at a tick, in its order. This page is written from the code by `python -m
tests.control_cycle`; the core's stages are listed in `gcs_formation/core/stages.py`, what they share is the `Cycle` of
`gcs_formation/core/cycle.py`. *In command* are cycles in which the formation is commanded: from when its leader is
ready until all loiter.

## Stages

"""
FEATURES = """
## Features

A feature is a folder of `gcs_formation/features`, found by being there: nothing else names it. Without it the core
flies, without what it brought; `check` and `summary.json` name those that are there. Its `feature.py` declares it, and
its stages name those that they stand behind, one of the core's among them.

"""


def page() -> str:
    """Return the page."""
    station = Station(load_scenario(ROOT / "configs" / "quickstart.yaml"), Mock())
    rows = ["| stage | runs | of feature | what, and why there |", "| --- | --- | --- | --- |"]
    for stage in station.cycle.stages:
        _, _, whose, *_ = type(stage).__module__.split(".")
        feature = whose if ".features." in type(stage).__module__ else ""
        does = " ".join((inspect.getdoc(type(stage)) or "").split())
        rows.append(f"| `{stage.name}` | {RUNS.get(stage.when, '')} | {feature} | {does} |")
    brought = ["| feature | what it does | events | figures |", "| --- | --- | --- | --- |"]
    for name, each in features().items():
        events, figures = (", ".join(f"`{kind}`" for kind in kinds) for kinds in (each.events, each.figures))
        brought.append(f"| `{name}` | {each.does} | {events} | {figures} |")
    return HEAD + "\n".join(rows) + "\n" + FEATURES + "\n".join(brought) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
