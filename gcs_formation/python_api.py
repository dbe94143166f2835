"""`gcs_formation.run` and `gcs_formation.tell`: what the commands do, from Python."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from formation_scenario import Scenario, load_scenario
from formation_scenario.orders import parse_order
from gcs_formation.answer import Answer
from gcs_formation.app.directory import default_directory
from gcs_formation.app.interrupt import Interrupts
from gcs_formation.app.options import ClockName, RunOptions
from gcs_formation.app.progress import Silent
from gcs_formation.app.run import run as run_scenario
from gcs_formation.app.steering import tell as give_order
from gcs_formation.record.summary import Summary

__all__ = ["Answer", "Summary", "run", "tell"]


def run(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    *,
    clock: ClockName = "real",
    speedup: float = 1.0,
    until: float | None = None,
    out: str | Path | None = None,
    **overrides: Any,
) -> Summary:
    """Fly a scenario with emulated vehicles and return its summary.

    Args:
        scenario: a path, a mapping with the scenario's keys, or a Scenario.
        clock: "real" or "virtual", as the command's option.
        speedup: under the real clock, how many times faster.
        until: mission time in seconds at which to end early.
        out: the run directory; default: runs/NAME-TIME.
        **overrides: scenario keys instead of the scenario's own; `__` stands for a dot: `law__rate_hz=5`.

    Raises:
        ScenarioError: the scenario or an override is wrong; nothing was started.
        ValueError: `clock`, `speedup` or `until` is wrong.
        RunAbortedError: a port is taken, a vehicle refused, the emulators ended.
        RecordError: the run directory can't be written.
    """
    settings = [f"{key.replace('__', '.')}={_as_yaml(value)}" for key, value in overrides.items()]
    loaded = load_scenario(scenario, settings)
    directory = default_directory(loaded.name) if out is None else Path(out)
    with Interrupts() as interrupts:
        summary = run_scenario(loaded, RunOptions(directory, clock, speedup, until), Silent(), interrupts)
    if interrupts.count:
        raise KeyboardInterrupt
    return summary


def tell(run_dir: str | Path, order: str) -> Answer:
    """Give the flight that records into a directory an order, and return what came of it.

    Args:
        run_dir: the directory of a flight that is running under the real clock.
        order: `shape line`, `shape line 40`, `spacing 40`, `speed 24`, `leader 3`, `loiter`, `rtl` or `land`.

    Raises:
        OrderError: the words are no order.
        NothingRunningError: no flight answers there.
    """
    parse_order(order)
    return give_order(Path(run_dir), order)


def _as_yaml(value: object) -> str:
    return yaml.safe_dump(value, default_flow_style=True, width=10**9).removesuffix("\n...\n").strip()
