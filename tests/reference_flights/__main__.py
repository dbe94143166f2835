"""Compares the reference flights of two revisions: `python -m tests.reference_flights BASE [HEAD]`."""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from tests.processes import free_port
from tests.reference_flights import protocol, records
from tests.reference_flights.flights import Flight, Stress, reference_flights

ROOT = Path(__file__).resolve().parents[2]
FLOWN = "flown.json"


@dataclass(frozen=True)
class Tree:
    """A source tree to fly, and where its records are kept."""

    path: Path
    records: Path

    def fly(self, flight: Flight | Stress, until_s: float | None, configs: Path) -> dict[str, Any]:
        """Fly with the tree's command line, unless the flight is on record; return how it ended.

        The packages are the tree's own; interpreter and other packages are the caller's.
        """
        out, asked = self.records / flight.name, f"{flight} {until_s}"
        if (out / FLOWN).is_file() and (flown := json.loads((out / FLOWN).read_text()))["asked"] == asked:
            return flown
        shutil.rmtree(out, ignore_errors=True)
        out.parent.mkdir(parents=True, exist_ok=True)
        command = [*_arguments(flight, until_s, configs, out.with_suffix(".yaml")), "--out", str(out)]
        used_s = _children_s()
        ended = subprocess.run(
            [sys.executable, "-m", "gcs_formation", *command],
            cwd=self.path,
            env=os.environ | {"PYTHONPATH": str(self.path)},
            capture_output=True,
            text=True,
            check=False,
        )
        flown = {"asked": asked, "exit": ended.returncode, "cpu_s": _children_s() - used_s, "said": ended.stderr}
        out.mkdir(exist_ok=True)
        (out / FLOWN).write_text(json.dumps(flown))
        return flown


def _children_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@click.command()
@click.argument("base")
@click.argument("head", required=False)
@click.option("--only", multiple=True, metavar="NAME", help="Flights whose names begin so (repeatable).")
@click.option("--until", "until_s", type=float, metavar="SECONDS", help="End flights at this time (but for stress).")
@click.option("--seeds", default=1, show_default=True, help="Flights of stress of each severity.")
@click.option("--keep", type=click.Path(path_type=Path), help="Keep the records of BASE here; don't fly them again.")
def main(
    base: str, head: str | None, only: tuple[str, ...], until_s: float | None, seeds: int, keep: Path | None
) -> None:
    """Fly the reference flights on revision BASE and on HEAD (by default the files as they are), and compare.

    Prints a line for each flight: the same, or the first difference; and the processor time of both. Exit status 1 at a
    difference.
    """
    flights = [each for each in reference_flights(seeds) if not only or each.name.startswith(only)]
    if not flights:
        raise click.BadParameter(f"found {', '.join(only)}; allowed: the beginnings of flights' names")
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        commit = _git("rev-parse", "--verify", f"{base}^{{commit}}")
        kept = keep.resolve() / commit if keep else work / "base-records"
        earlier = Tree(_check_out(commit, work / "base"), kept)
        later = Tree(_check_out(head, work / "head") if head else ROOT, work / "head-records")
        same = [_compare(each, earlier, later, until_s) for each in flights]
    click.echo(f"{same.count(True)} of {len(same)} flights are the same")
    sys.exit(0 if all(same) else 1)


def _compare(flight: Flight | Stress, earlier: Tree, later: Tree, until_s: float | None) -> bool:
    """Fly a flight in both trees and print the result; return whether both were the same."""
    before, now = (tree.fly(flight, until_s, earlier.path) for tree in (earlier, later))
    differing = _difference(flight, earlier.records / flight.name, later.records / flight.name, before, now)
    took = f"{before['cpu_s']:.1f} s, now {now['cpu_s']:.1f} s"
    click.echo(f"{flight.name:18} {'same' if differing is None else f'DIFFERS: {differing}'} ({took})")
    return differing is None


def _difference(
    flight: Flight | Stress, earlier: Path, later: Path, before: dict[str, Any], now: dict[str, Any]
) -> str | None:
    if before["exit"] != now["exit"]:
        return f"exit status {before['exit']}, now {now['exit']}: {now['said'].strip()}"
    if not (earlier / records.TLOG).is_file():
        return f"not flown, exit status {before['exit']}: {before['said'].strip()}"
    over_udp = isinstance(flight, Flight) and flight.clock == "real"
    return (protocol if over_udp else records).difference(earlier, later)


def _arguments(flight: Flight | Stress, until_s: float | None, configs: Path, file: Path) -> list[str]:
    """Return the command line of a flight; `file` is for a scenario that is given as keys."""
    if isinstance(flight, Stress):
        return ["stress", "--count", "1", "--seed", str(flight.seed), *(["--hard"] if flight.hard else [])]
    if isinstance(flight.scenario, str):
        file = configs / flight.scenario
    else:
        file.write_text(json.dumps(flight.scenario))
    ends_s = flight.until_s if until_s is None else until_s
    until = [] if ends_s is None else ["--until", str(ends_s)]
    port = [f"vehicles.endpoint=udpin:127.0.0.1:{free_port()}"] if flight.clock == "real" else []
    overrides = [word for each in (*flight.overrides, *port) for word in ("--set", each)]
    return ["run", str(file), "--clock", flight.clock, *until, *overrides]


def _check_out(revision: str, path: Path) -> Path:
    """Write the files of a revision into a directory."""
    archive = path.with_suffix(".tar")
    _git("archive", "--format=tar", "--output", str(archive), revision)
    shutil.unpack_archive(archive, path)
    return path


def _git(*arguments: str) -> str:
    ended = subprocess.run(["git", "-C", ROOT, *arguments], capture_output=True, text=True, check=False)
    if ended.returncode:
        raise click.ClickException(ended.stderr.strip())
    return ended.stdout.strip()


if __name__ == "__main__":
    main()
