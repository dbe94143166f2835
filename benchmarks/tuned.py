"""What tuned numbers decide: flights with one of them multiplied, beside those with all as they stand.

`python -m benchmarks.tuned gcs_formation.features.airspace.airspace.HELD_M --factors 0.5 2 --only fence` flies those of
`benchmarks/tuned_flights.py` whose names have a text in them; several numbers may be given. What is computed from a
number changes with it. Where a flight stays the same in all these figures, it has no row.
Figures are the truth's: rms is the worst follower's horizontal error. Behind each kind of event stand their number and
the time of the first, from the start of the run. Some seconds of processor time for each flight.
"""

from __future__ import annotations

import ast
import importlib
import itertools
import json
import math
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from multiprocessing import get_context
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from airlink.cli import COMPILED
from benchmarks import parser
from benchmarks.tuned_flights import FLIGHTS
from gcs_formation import Summary
from gcs_formation.studies.markdown import markdown

OURS = ("airlink", "flight_model", "formation_scenario", "sim_vehicles", "gcs_formation")
ROUTINE = {"recording", "phase", "mode", "link", "ready", "fault", "formation"}
"""Kinds of events that say nothing of what a number decides."""
HEADS = ("flight", "number", "×", "rms, m", "separation, m", "clearance, m", "in fence, m", "manoeuvring, s", "events")


Number = int | float | tuple["Number", ...] | list["Number"]


def multiplied(value: Number, factor: float) -> Number:
    """Return a number, or each of several, multiplied; a whole one stays whole, and at least 1."""
    if isinstance(value, (tuple, list)):
        return type(value)(multiplied(each, factor) for each in value)
    return max(1, round(value * factor)) if isinstance(value, int) else value * factor


def defines(statement: ast.stmt, number: str) -> bool:
    """Return whether a statement gives a name its value."""
    names = (each for each in ast.walk(statement) if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store))
    return isinstance(statement, (ast.Assign, ast.AnnAssign)) and number in {each.id for each in names}


class Loader(SourceFileLoader):
    """Loads a module with one of its numbers multiplied where it is defined."""

    number, factor = "", 1.0

    def get_code(self, fullname: str) -> CodeType:  # noqa: ARG002
        """Compile the module with one more statement, behind the number's."""
        tree = ast.parse(Path(self.path).read_bytes())
        behind = 1 + next(index for index, each in enumerate(tree.body) if defines(each, self.number))
        tree.body[behind:behind] = ast.parse(f"{self.number} = __multiplied__({self.number}, {self.factor!r})").body
        return compile(tree, self.path, "exec")

    def exec_module(self, module: ModuleType) -> None:
        """Execute it, knowing how to multiply."""
        vars(module)["__multiplied__"] = multiplied
        super().exec_module(module)


class Finder(MetaPathFinder):
    """Finds the module of the number."""

    def __init__(self, module: str, number: str, factor: float) -> None:
        """Take names of module and number, and the factor."""
        self._module, self._number, self._factor = module, number, factor

    def find_spec(self, fullname: str, path: Sequence[str] | None, _: ModuleType | None = None) -> ModuleSpec | None:
        """Return the module's specification with a loader that multiplies; None for other modules."""
        spec = PathFinder.find_spec(fullname, path) if fullname == self._module else None
        if spec is not None:
            spec.loader = loader = Loader(fullname, str(spec.origin))
            loader.number, loader.factor = self._number, self._factor
        return spec


def flown(name: str, factor: float, flights: Sequence[str]) -> list[list[str]]:
    """Return the figures of each flight with a number multiplied, in a process of its own: all is imported again."""
    for loaded in [each for each in sys.modules if each.partition(".")[0] in OURS]:
        del sys.modules[loaded]
    module, _, number = name.rpartition(".")
    if number:
        sys.meta_path.insert(0, Finder(module, number, factor))
        importlib.import_module(module)
    fly = importlib.import_module("gcs_formation").run
    return [figures(fly, flight) for flight in flights]


def figures(fly: Callable[..., Summary], flight: str) -> list[str]:
    """Return the figures of a flight."""
    with tempfile.TemporaryDirectory() as directory:
        out = Path(directory) / "run"
        found = fly({"schema": 1, **FLIGHTS[flight]}, clock="virtual", out=out).to_dict()
        events = [json.loads(line) for line in (out / "events.jsonl").read_text().splitlines()]
    errors_m = [[each[f"error_{axis}_m"]["rms"] or 0.0 for axis in "xy"] for each in found["followers"].values()]
    safety = found["safety"]
    of_safety = (safety[each] for each in ("min_separation_m", "min_clearance_m", "fence_m", "avoidance_s"))
    numbers = [max(math.hypot(*each) for each in errors_m), *of_safety]
    return [*("—" if each is None else f"{each:.2f}" for each in numbers), ", ".join(counted(events))]


def counted(events: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Yield each kind of event with its number, and the time of the first one."""
    for kind in sorted({each["kind"] for each in events} - ROUTINE):
        times_s = [each["t_s"] for each in events if each["kind"] == kind]
        yield f"{kind} {len(times_s)} ({times_s[0]:.1f} s)"


def main() -> None:
    """Fly, and print what differs."""
    parsing = parser(__doc__, only="flights whose name has TEXT in it")
    parsing.add_argument("numbers", nargs="+", help="module and name of each, such as gcs_formation.core.cycle.NUMBER")
    parsing.add_argument("--factors", type=float, nargs="+", default=[0.5, 2.0])
    given = parsing.parse_args()
    if COMPILED:
        parsing.error("compiled modules have their numbers built in; run it where they are Python")
    flights = [each for each in FLIGHTS if given.only in each]
    changes = [("", 1.0), *itertools.product(given.numbers, given.factors)]
    with ProcessPoolExecutor(given.processes, get_context("spawn"), max_tasks_per_child=1) as pool:
        found = list(pool.map(flown, *zip(*changes, strict=True), [flights] * len(changes)))
    rows = list[list[str]]()
    for flight, usual, *changed in zip(flights, *found, strict=True):
        rows.append([flight, "", "", *usual])
        for (name, factor), cells in zip(changes[1:], changed, strict=True):
            if cells != usual:
                rows.append(["", name.rpartition(".")[2], f"{factor:g}", *cells])
    print(markdown(HEADS, rows))


if __name__ == "__main__":
    main()
