"""Size and structure of the source tree: modules, classes, lines, import cycles, and a datagram's path.

The path is measured: the files that run, from the receipt of a position datagram to the setpoints that follow from it,
in a flight of configs/quickstart.yaml in memory.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from statistics import median
from types import FrameType
from unittest.mock import Mock

from airlink.clock import Instant, VirtualClock, seconds_between
from airlink.engine import Datagram, MemoryNetwork
from airlink.messages.telemetry import GlobalPositionInt
from airlink.stream_parser import StreamParser
from formation_scenario import load_scenario
from gcs_formation.phases import Phase
from gcs_formation.station import Station
from gcs_formation.studies.markdown import markdown
from sim_vehicles.config import fleet_config
from sim_vehicles.fleet import Fleet

ROOT = Path(__file__).parents[1]
PACKAGES = ("airlink", "flight_model", "formation_scenario", "sim_vehicles", "gcs_formation")
WRITTEN = "# Written by: "
"""First line of a module that a program has generated from a table."""
FLOWN_S = 300.0
"""Time by which the path must have begun."""


def sources(package: str) -> dict[str, str]:
    """Return the modules of a package, by dotted name."""
    paths = {path: path.relative_to(ROOT).with_suffix("").parts for path in sorted((ROOT / package).rglob("*.py"))}
    return {".".join(parts).removesuffix(".__init__"): path.read_text() for path, parts in paths.items()}


def counted(texts: list[str]) -> list[int]:
    """Return the numbers of modules, classes and lines."""
    classes = sum(isinstance(node, ast.ClassDef) for text in texts for node in ast.walk(ast.parse(text)))
    return [len(texts), classes, sum(len(text.splitlines()) for text in texts)]


def imported(tree: ast.Module, modules: set[str]) -> Iterator[str]:
    """Yield the modules that `tree` imports when it is imported: not for type checkers only, not inside functions."""
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and node.module:
            for name in node.names:
                whole = f"{node.module}.{name.name}"
                yield whole if whole in modules else node.module


def circle(modules: dict[str, ast.Module]) -> list[str] | None:
    """Return a cycle of modules that import each other; None if there is none."""
    names = set(modules)
    graph = {name: {other for other in imported(tree, names) if other in names} for name, tree in modules.items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return None


def closure(root: str, trees: dict[str, ast.Module]) -> set[str]:
    """Return the modules that importing `root` imports, itself among them, packages that hold them left out."""
    names, found, waiting = set(trees), set[str](), [root]
    while waiting:
        name = waiting.pop()
        if name in names and name not in found:
            found.add(name)
            waiting += imported(trees[name], names)
    return found


class Traced(Station):
    """A station that lists the files that run, from the first position datagram on the path to the end of a tick."""

    files: set[str] | None = None
    done = False

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        """Begin the list at a position."""
        begins = not self.done and self.files is None and self.flight.phase is Phase.FLYING
        if begins and any(map(_is_position, datagrams)):
            self.files = set()
            sys.setprofile(self._list)
        super().receive(datagrams, now)

    def tick(self, now: Instant) -> None:
        """End the list."""
        super().tick(now)
        sys.setprofile(None)
        self.done = self.files is not None

    def _list(self, frame: FrameType, event: str, _: object) -> None:
        if event == "call" and self.files is not None:
            self.files.add(frame.f_code.co_filename)


def _is_position(datagram: Datagram) -> bool:
    return any(isinstance(frame.message, GlobalPositionInt) for frame in StreamParser().feed(datagram.data))


def datagram_path() -> list[str]:
    """Return the files of station and wire that run from a position to the setpoints."""
    scenario = load_scenario(ROOT / "configs" / "quickstart.yaml")
    clock = VirtualClock()
    network, station = MemoryNetwork(clock), Traced(scenario, Mock())
    network.attach(Fleet(fleet_config(scenario)))
    network.attach(station)
    network.run(lambda: station.done or seconds_between(Instant(0), clock.now()) > FLOWN_S)
    paths = (Path(file) for file in station.files or ())
    within = (path.relative_to(ROOT) for path in paths if path.is_relative_to(ROOT))
    return sorted(str(path) for path in within if path.parts[0] in PACKAGES)


def main() -> None:
    """Print the figures."""
    packages = {package: sources(package) for package in PACKAGES}
    everything = {name: text for modules in packages.values() for name, text in modules.items()}
    rows = {package: counted(list(modules.values())) for package, modules in packages.items()}
    rows["all"] = counted(list(everything.values()))
    rows["of these, written from a table"] = counted([text for text in everything.values() if WRITTEN in text])
    head = ["package", "modules", "classes", "lines"]
    print(markdown(head, [[package, *map(str, counts)] for package, counts in rows.items()]))
    trees = {name: ast.parse(text) for name, text in everything.items()}
    functions = [node for tree in trees.values() for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    print(f"\nlines of a function, median: {median((f.end_lineno or 0) - f.lineno + 1 for f in functions):g}")
    closed = circle(trees)
    print(f"circle of imports: {' -> '.join(closed or ['none'])}")
    closed_over = closure("gcs_formation.station", trees)
    lines = sum(len(everything[name].splitlines()) for name in closed_over if WRITTEN not in everything[name])
    size = f"{len(closed_over)} modules, {lines} lines but for written ones"
    print(f"imported by the station, without features and families: {size}")
    files = datagram_path()
    own = [file for file in files if file.startswith("gcs_formation")]
    brought = sum("/features/" in file or "/families/" in file for file in own)
    of_station = f"{len(own)} of the station ({len(own) - brought} without features and families)"
    print(f"files that run from a position to the setpoints of its tick: {of_station}, {len(files)} in all")
    print("\n".join(f"  {file}" for file in files))


if __name__ == "__main__":
    main()
