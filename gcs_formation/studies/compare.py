"""The command `compare`, from its options to its exit status."""

from __future__ import annotations

import json
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from airlink.cli.commands import refusal
from airlink.cli.process import raised
from formation_scenario import Problem, Scenario, ScenarioError, load_scenario
from gcs_formation.errors import RecordError
from gcs_formation.studies.comparison import Comparison, Flown, Window, compare_flights
from gcs_formation.studies.comparison_page import LAWS, NAME, comparison_text, named_laws, write_comparison
from gcs_formation.studies.flight import COULD_NOT_GO_ON, EXPECTED, Task
from gcs_formation.studies.plan import Planned
from gcs_formation.studies.workers import Workers


@dataclass(frozen=True)
class CompareOptions:
    """Options on the command line of `compare`."""

    scenario: Path
    laws: str
    overrides: tuple[str, ...]
    out: Path
    from_s: float = 0.0
    to_s: float | None = None
    until_s: float | None = None
    overwrite: bool = False


@dataclass(frozen=True)
class Compared:
    """Result of `compare`."""

    comparison: Comparison
    said: tuple[tuple[str, int, str], ...]
    """Each law that was flown, its flight's exit status, and what was broken or why it could not go on, in lines."""
    page: Path
    interrupted: bool

    @property
    def text(self) -> str:
        """The table, and where its files are."""
        return f"{comparison_text(self.comparison)}\nwrote {self.page}"

    @property
    def json(self) -> str:
        """What comparison.json holds."""
        return json.dumps(self.comparison.to_dict(), indent=2)

    def broken(self) -> list[str]:
        """Return what each law broke of the scenario's expectations and safety limits."""
        return self._of(EXPECTED)

    def stopped(self) -> list[str]:
        """Return which flights could not go on, and why."""
        return self._of(COULD_NOT_GO_ON)

    def _of(self, exit_status: int) -> list[str]:
        return [
            f"{law}: {text}" for law, status, words in self.said if status == exit_status for text in words.splitlines()
        ]


def compare_laws(options: CompareOptions, workers: Workers) -> Compared:
    """Fly a scenario by each law on one seed, and write and return the comparison: a study of one parameter, the law.

    Raises:
        ScenarioError: the scenario, an override or a law's name is wrong; nothing was started.
        RecordError: the directory holds an earlier comparison or other files, or it can't be written.
        RunAbortedError: no flight can be flown.
    """
    laws = named_laws(options.laws)
    scenario = load_scenario(options.scenario, options.overrides)
    window = _window(scenario, options)
    _claim(options.out, overwrite=options.overwrite)
    tasks = [_task(number, law, options) for number, law in enumerate(laws)]
    rows = dict[int, dict[str, Any]]()
    interrupted = False
    try:
        with raised(), workers:
            for row in workers.rows(deque(tasks)):
                rows[row["flight"]] = row
    except KeyboardInterrupt:
        interrupted = True
    said = tuple((laws[flight], rows[flight]["exit"], rows[flight]["words"]) for flight in sorted(rows))
    flown = [Flown(law, options.out / law, words if status > EXPECTED else "") for law, status, words in said]
    comparison = compare_flights(flown, scenario.name, scenario.seed, scenario.formation.frame, window)
    return Compared(comparison, said, write_comparison(comparison, options.out), interrupted)


def _task(number: int, law: str, options: CompareOptions) -> Task:
    """Return a law's flight; its settings take precedence over the command line's."""
    scenario = load_scenario(options.scenario, (*options.overrides, *LAWS[law]))
    planned = Planned(number, scenario.seed, {})
    return Task(planned, scenario, {}, (), "full", str(options.out / law), options.until_s)


def _claim(out: Path, *, overwrite: bool) -> None:
    try:
        refused = refusal(out, overwrite=overwrite, mark=f"{NAME}.json")
    except OSError as error:
        raise RecordError(f"cannot read {out}: {error.strerror}; allowed: a directory that can be written") from error
    if refused is not None:
        raise RecordError(refused)


def _window(scenario: Scenario, options: CompareOptions) -> Window:
    end_s = scenario.duration_s if options.until_s is None else min(options.until_s, scenario.duration_s)
    window = Window(options.from_s, end_s if options.to_s is None else options.to_s)
    if not window.from_s < window.to_s <= end_s:
        found = f"found {window.from_s:g} s to {window.to_s:g} s"
        raise ScenarioError([Problem("--from, --to", None, None, "", found, f"a window within 0 s to {end_s:g} s")])
    return window
