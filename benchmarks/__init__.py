"""Common parts of the benchmarks; README.md says what each of them measures."""

from __future__ import annotations

import argparse
import importlib.machinery
import json
import os
import sys
import tempfile
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

ROOT = Path(__file__).parents[1]


def _prefer_compiled() -> None:
    """Have an installed, compiled package win over the sources beside us: that's what is measured."""
    elsewhere = [directory for directory in sys.path if Path(directory or ".").resolve() != ROOT]
    spec = importlib.machinery.PathFinder.find_spec("airlink", elsewhere)
    folders = [] if spec is None else spec.submodule_search_locations or []
    if any(any(Path(folder).glob("clock.*.so")) for folder in folders):
        sys.path[:] = [*elsewhere, str(ROOT)]


_prefer_compiled()

import gcs_formation  # noqa: E402
from airlink.cli import COMPILED  # noqa: E402
from gcs_formation.record.run_directory import EVENTS  # noqa: E402

if TYPE_CHECKING:
    from gcs_formation.app.run_options import ClockName

PAPER = ROOT / "configs" / "paper.yaml"
Result = TypeVar("Result")


@contextmanager
def flown(
    scenario: Path | Mapping[str, Any], clock: ClockName = "virtual", **keys: Any
) -> Generator[gcs_formation.Summary]:
    """Fly a scenario with these keys changed; its record is deleted on exit."""
    with tempfile.TemporaryDirectory() as out:
        yield gcs_formation.run(scenario, clock=clock, out=Path(out) / "run", **keys)


def events_of(summary: gcs_formation.Summary, kind: str) -> list[dict[str, Any]]:
    """Return a run's events of a kind."""
    events = map(json.loads, (summary.run_dir / EVENTS).read_text().splitlines())
    return [event for event in events if event["kind"] == kind]


def both_directions(delay_ms: float) -> dict[str, Any]:
    """Return links with one delay in each direction."""
    return {"default": {"delay_ms": delay_ms}}


def parser(about: str | None, counts: Sequence[int] = (), **only: str) -> argparse.ArgumentParser:
    """Return a parser for numbers of vehicles, or of processes; `only`: options that filter by part of a name."""
    made = argparse.ArgumentParser(description=about)
    if counts:
        made.add_argument("--counts", type=int, nargs="+", default=counts)
    else:
        made.add_argument("--processes", type=int, default=2)
    for name, text in only.items():
        made.add_argument(f"--{name}", default="", metavar="TEXT", help=text)
    return made


def alone(work: Callable[..., Result], *given: Any) -> Result:
    """Return the result of work in a process of its own."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(work, *given).result()


def which_package() -> str:
    """Return in words what was measured: the package's version, where it is, and whether it's compiled."""
    where = Path(gcs_formation.__file__).parent
    return f"measured: {where}, {'compiled' if COMPILED else 'not compiled'}"


def print_load() -> None:
    """Print the load of the machine, which other processes add to."""
    load = ", ".join(f"{load:.1f}" for load in os.getloadavg())
    print(f"\n{os.cpu_count()} cores; their load over 1, 5 and 15 minutes: {load}")
