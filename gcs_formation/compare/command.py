"""The command `compare`, from its options to its exit status."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from airlink.cli.directory import refusal
from formation_scenario import Problem, Scenario, ScenarioError, load_scenario
from gcs_formation.app.interrupt import Interrupts
from gcs_formation.compare.comparison import Comparison, Window, compare_flights
from gcs_formation.compare.flights import Flown, fly_trials, trials
from gcs_formation.compare.laws import named_laws
from gcs_formation.compare.table import comparison_text
from gcs_formation.compare.write import NAME, write_comparison
from gcs_formation.errors import RecordError


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
    jobs: int = 1
    overwrite: bool = False


@dataclass(frozen=True)
class Compared:
    """Result of `compare`."""

    comparison: Comparison
    flown: tuple[Flown, ...]
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
        return [
            f"{each.law}: {text}"
            for each in self.flown
            if each.summary is not None
            for text in (*(str(v) for v in each.summary.verdicts if v.held is False), *each.summary.breaches)
        ]

    def stopped(self) -> list[str]:
        """Return which flights could not go on, and why."""
        return [f"{each.law}: {each.aborted}" for each in self.flown if each.aborted]


def compare_laws(options: CompareOptions) -> Compared:
    """Fly a scenario by each law on one seed, and write and return the comparison.

    Raises:
        ScenarioError: the scenario, an override or a law's name is wrong; nothing was started.
        RecordError: the directory holds an earlier comparison or other files, or it can't be written.
        RunAbortedError: a process that flew was ended from outside.
    """
    laws = named_laws(options.laws)
    scenario = load_scenario(options.scenario, options.overrides)
    window = _window(scenario, options)
    _claim(options.out, overwrite=options.overwrite)
    planned = trials(options.scenario, options.overrides, laws, options.out)
    with Interrupts() as interrupts:
        flown = fly_trials(planned, options.until_s, min(options.jobs, len(planned)), interrupts)
        stopped = interrupts.count > 0 or any(each.interrupted for each in flown)
    comparison = compare_flights(
        [each for each in flown if not each.interrupted],
        scenario.name,
        scenario.seed,
        scenario.formation.frame,
        window,
    )
    return Compared(comparison, tuple(flown), write_comparison(comparison, options.out), stopped)


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
