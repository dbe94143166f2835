"""Flies a scenario by several laws and compares them over one window of time: as table, figure and page."""

from __future__ import annotations

import json
import shutil
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from airlink.cli import Status, interruptible
from airlink.cli.output_directory import refusal
from flight_model.slot import CHANNELS
from formation_scenario import Problem, Scenario, ScenarioError, load_scenario
from formation_scenario.extensions import LAW_KINDS
from formation_scenario.fields import did_you_mean
from formation_scenario.registry import Registry
from gcs_formation.app.check import tau_margins
from gcs_formation.app.check_warnings import warnings
from gcs_formation.app.result_text import WHOLE, WIDE, ColumnGroup
from gcs_formation.app.result_text import table as text_table
from gcs_formation.control import laws
from gcs_formation.errors import RecordError
from gcs_formation.record import path_distance
from gcs_formation.record.expectations import figure_of as figure_in
from gcs_formation.record.figures_of_merit import minimum, of_follower, separation_m
from gcs_formation.record.history import history
from gcs_formation.record.run_directory import SCENARIO
from gcs_formation.record.timeseries import ERROR
from gcs_formation.report import RunData, load_run
from gcs_formation.report.error_figures import law_errors
from gcs_formation.report.page_parts import document, figure, number, table
from gcs_formation.report.style import print_style, save
from gcs_formation.stability import law_margins
from gcs_formation.studies import Study
from gcs_formation.studies.cluster import Workers
from gcs_formation.studies.flight import Task, worst
from gcs_formation.studies.flight import figure as figure_of
from gcs_formation.studies.plan import Planned

SCHEMA = 1
COMPENSATIONS = (("", "law.delay_compensation=true"), ("_uncompensated", "law.delay_compensation=false"))
LAWS: dict[str, tuple[str, ...]] = {
    f"{law}{variant}{suffix}": (f"law.type={law}", *overrides, compensated)
    for law, kind in laws.LAWS.items()
    for variant, overrides in kind.variants
    for suffix, compensated in COMPENSATIONS
}
"""Overrides of each law, as for `--set`; gains stay the scenario's, and the consensus law has its own."""
SETTLING_S = 60.0
"""Length of the figure's left column, if the window begins later."""
HEADS = {"rms": "rms x / y / z, m", "max": "max x / y / z, m", "steady_max": "steady x / y / z, m"}
EFFORTS = ("variation_per_s", "step_p95")
NAME = "comparison"
TWO_SPANS = "Left: how each law settles; right: the window of the table. "
Comparison = Mapping[str, Any]
"""Content of comparison.json: what was flown, the window (s), and each law's figures.

Errors and effort are the worst follower's; `settled_at_s` is that of the last follower, over the whole flight; None if
there is no figure. `aborted` says why a law has none; `warnings` are those of `check`.
"""


def compare_laws(  # noqa: PLR0913 - the command's options
    file: Path,
    overrides: tuple[str, ...],
    out: Path,
    workers: Workers,
    *,
    laws: str,
    between_s: tuple[float, float | None],
    until_s: float | None,
    overwrite: bool,
    registry: Registry,
) -> tuple[Comparison, list[tuple[str, int, str]], Path, bool]:
    """Fly a scenario by each law on one seed, write the comparison and its page: a study of one parameter, the law.

    Errors count between two mission times (None: the end of the flights, `until_s` at the latest). Return the
    comparison, each law's exit status and words, the page, and whether the flights were interrupted. `registry`: what
    extensions register, laws among it.

    Raises:
        ScenarioError: the scenario, an override or a law's name is wrong; nothing was started.
        RecordError: the directory holds an earlier comparison or other files, or it can't be written.
        RunAbortedError: no flight can be flown.
    """
    names = named_laws(laws, registry)
    scenario = load_scenario(file, overrides, plugins=registry)
    window_s = _window(scenario, *between_s, until_s)
    sets = {law: _settings(law, scenario, registry) for law in names}
    # A law's settings take precedence.
    flights = [load_scenario(file, (*overrides, *sets[law]), plugins=registry) for law in names]
    study = Study(record="full", until_s=until_s)
    tasks = [
        Task(Planned(number, flight.seed, {}), study, flight, str(out / law))
        for number, (law, flight) in enumerate(zip(names, flights, strict=True))
    ]
    _claim(out, [*laws_of(registry)], overwrite=overwrite)
    rows = dict[int, dict[str, Any]]()
    interrupted = False
    try:
        with interruptible(), workers:
            for row in workers.rows(deque(tasks)):
                rows[row["flight"]] = row
    except KeyboardInterrupt:
        interrupted = True
    outcomes = [(names[flight], rows[flight]["exit"], rows[flight]["words"]) for flight in sorted(rows)]
    flown = {law: words if status > Status.EXPECTATION_BROKEN else "" for law, status, words in outcomes}
    runs = {law: load_run(out / law, registry) for law, aborted in flown.items() if not aborted}
    comparison = compared(flown, runs, scenario, window_s)
    return comparison, outcomes, _write(comparison, runs, out, sets), interrupted


def laws_of(registry: Registry) -> dict[str, tuple[str, ...]]:
    """Return the laws that can be compared, with the overrides of each: those of `LAWS`, and those of extensions."""
    own = {
        f"{name}{suffix}": (f"law.type={name}", how)
        for name in registry.names(*LAW_KINDS)
        for suffix, how in COMPENSATIONS
    }
    return {**LAWS, **own}


def _settings(law: str, scenario: Scenario, registry: Registry) -> tuple[str, ...]:
    """Return the overrides of a law; `law.parameters` are of the scenario's own law alone."""
    found = laws_of(registry)[law]
    own = found[0] == f"law.type={scenario.law.type}"
    return found if own or not scenario.law.parameters else (*found, "law.parameters={}")


def named_laws(names: str, registry: Registry) -> tuple[str, ...]:
    """Return the laws of a list like "pid,fuzzy_pid".

    Raises:
        ScenarioError: a name isn't that of a law, or is there twice.
    """
    known = laws_of(registry)
    found = tuple(name.strip() for name in names.split(","))
    counts = Counter(found)
    wrong = [(f"found '{each}'{did_you_mean(each, known)}", ", ".join(known)) for each in counts if each not in known]
    wrong += [(f"found '{each}' {count} times", "each law once") for each, count in counts.items() if count > 1]
    if wrong:
        raise ScenarioError([Problem("--laws", None, None, "", *each) for each in wrong])
    return found


def _window(scenario: Scenario, from_s: float, to_s: float | None, until_s: float | None) -> tuple[float, float]:
    end_s = scenario.duration_s if until_s is None else min(until_s, scenario.duration_s)
    last_s = end_s if to_s is None else to_s
    if not from_s < last_s <= end_s:
        found = f"found {from_s:g} s to {last_s:g} s"
        raise ScenarioError([Problem("--from, --to", None, None, "", found, f"a window within 0 s to {end_s:g} s")])
    return from_s, last_s


def _claim(out: Path, laws: Sequence[str], *, overwrite: bool) -> None:
    """Make the directory and remove an earlier comparison from it; RecordError if that isn't allowed or possible."""
    try:
        refused = refusal(out, overwrite=overwrite, mark=f"{NAME}.json")
        if refused is not None:
            raise RecordError(refused)
        out.mkdir(parents=True, exist_ok=True)
        for stale in out.glob(f"{NAME}.*"):
            stale.unlink()
        for law in laws:
            if (out / law / SCENARIO).is_file():
                shutil.rmtree(out / law)
    except OSError as error:
        raise RecordError(f"cannot write {out}: {error.strerror}; allowed: a directory that can be written") from error


def compared(
    flown: Mapping[str, str], runs: Mapping[str, RunData], scenario: Scenario, window_s: tuple[float, float]
) -> Comparison:
    """Return the comparison of a scenario's runs, with errors from one mission time to another, both included.

    `flown`: why each law's run could not go on, "" if it could.
    """
    named = {"schema": SCHEMA, "name": scenario.name, "seed": scenario.seed, "frame": scenario.formation.frame}
    each = {
        law: _figures(runs[law], window_s) if law in runs else _none() | {"aborted": why} for law, why in flown.items()
    }
    return {**named, "from_s": window_s[0], "to_s": window_s[1], "laws": each}


def _none() -> dict[str, Any]:
    nothing = {"settled_at_s": None, **{name: dict.fromkeys(HEADS) for name in ERROR}, "effort": {}}
    return {
        **nothing,
        "path": {"leader": None, "centre": None},
        "followed_share": None,
        "min_separation_m": None,
        "delay_margin_s": None,
        "margin_used": None,
        "warnings": (),
    }


def _figures(run: RunData, window_s: tuple[float, float]) -> dict[str, Any]:
    within, stability, scenario = run.flown.window(*window_s), run.summary["stability"], run.scenario
    settled_s = figure_of(run.summary, "settled_at_s")  # the last one's: no steady figure unless all have settled
    found = [of_follower(run.flown, vehicle, within, settled_s) for vehicle in run.followers]
    off = path_distance.path_distances(scenario, run.flown.vehicles, history(run.events).speeds_mps)

    def worst_of(metric: str) -> float | None:
        return worst(metric, [figure_in(each, metric) for each in found])

    return {
        "settled_at_s": settled_s,
        **{error: {name: worst_of(f"{error}.{name}") for name in HEADS} for error in ERROR},
        "path": {who: path_distance.figures(each, within) for who, each in off.items()},
        "effort": {channel: {name: worst_of(f"effort.{channel}.{name}") for name in EFFORTS} for channel in CHANNELS},
        "followed_share": worst("in_slot_share", [each["followed_share"] for each in found]),
        "min_separation_m": minimum(separation_m(run.flown, within)),
        "delay_margin_s": stability["delay_margin_s"],
        "margin_used": stability.get("margin_used"),
        "warnings": tuple(warnings(scenario, law_margins(scenario), tau_margins(scenario)[0])),
        "aborted": "",
    }


def _spans(comparison: Comparison) -> list[tuple[float, float]]:
    """Return the spans of time that are drawn side by side; a single one if it includes the settling."""
    from_s, to_s = comparison["from_s"], comparison["to_s"]
    return [(0.0, SETTLING_S), (from_s, to_s)] if from_s > 0.0 and to_s > SETTLING_S else [(0.0, to_s)]


def comparison_text(comparison: Comparison) -> str:
    """Return the table for a terminal, with an explanation of its figures and the notes on each law."""
    about = (
        f"{comparison['name']}, seed {comparison['seed']}: errors of the worst follower, frame {comparison['frame']}, "
        f"{comparison['from_s']:g} to {comparison['to_s']:g} s; settled: all within 0.5 m for 10 s; steady: max from "
        "30 s after that on; steps: of the setpoints from tick to tick, 95th percentile"
    )
    heads, rows = _table(comparison)
    lines = text_table([ColumnGroup(("law", *heads), rows, 0)], WIDE) if rows else []
    return "\n".join([about, *lines, *(f"{law}: {text}" for law, text in _notes(comparison))])


def _table(comparison: Comparison) -> tuple[list[str], list[list[str]]]:
    """Return the column heads, and a row for each law that has figures, its name first."""
    cells = {law: _cells(each) for law, each in comparison["laws"].items() if not each["aborted"]}
    return list(next(iter(cells.values()), ())), [[law, *each.values()] for law, each in cells.items()]


def _cells(figures: Mapping[str, Any]) -> dict[str, str]:
    """Return a law's figures by column head."""
    errors = [figures[name] for name in ERROR]
    used = None if figures["margin_used"] is None else 100.0 * figures["margin_used"]
    return {
        "settled, s": number(figures["settled_at_s"], 1),
        **{head: " / ".join(number(axis[name]) for axis in errors) for name, head in HEADS.items()},
        "steps, m/s / rad / m": " / ".join(number(each["step_p95"]) for each in figures["effort"].values()),
        "leader from its path, max across / height, m": " / ".join(
            number(figures["path"]["leader"][name]["max"], 2) for name in ("across_m", "height_m")
        ),
        "separation, m": number(figures["min_separation_m"], 1),
        "margin, s": number(figures["delay_margin_s"], 2),
        "used, %": number(used, 0),
    }


def _notes(comparison: Comparison) -> list[tuple[str, str]]:
    """Return the notes on each law."""
    notes = list[tuple[str, str]]()
    for law, each in comparison["laws"].items():
        notes += [(law, text) for text in each["warnings"]]
        share = each["followed_share"]
        if share is not None and share < WHOLE:
            notes.append((law, f"errors are of a part of the window: a follower had a leader for {share:.0%} of it"))
        if each["aborted"]:
            notes.append((law, f"could not go on: {each['aborted']}"))
    return notes


def _write(comparison: Comparison, runs: Mapping[str, RunData], out: Path, sets: Mapping[str, tuple[str, ...]]) -> Path:
    """Write a comparison's three files into a directory; return the page's path. RecordError: they can't be written."""
    picture, target = out / f"{NAME}.png", out / f"{NAME}.html"
    try:
        (out / f"{NAME}.json").write_text(json.dumps(comparison, indent=2), encoding="utf-8")
        with print_style():
            save(law_errors(runs, _spans(comparison)), picture)
        target.write_text(_page(comparison, picture, sets), encoding="utf-8")
    except OSError as error:
        raise RecordError(f"cannot write the comparison into {out}: {error.strerror}") from error
    return target


def _page(comparison: Comparison, picture: Path, settings: Mapping[str, tuple[str, ...]]) -> str:
    (heads, rows), notes = _table(comparison), _notes(comparison)
    sets = [[law, ", ".join(settings[law])] for law in comparison["laws"]]
    return document(
        f"{comparison['name']}: laws side by side",
        "comparison.html",
        seed=str(comparison["seed"]),
        frame=escape(comparison["frame"].replace("_heading", "")),
        from_s=f"{comparison['from_s']:g}",
        to_s=f"{comparison['to_s']:g}",
        table=(table(["Law", *heads], rows) if rows else "") + (table(["Law", "note"], notes, (0, 1)) if notes else ""),
        figure=figure(NAME, picture, first=TWO_SPANS if len(_spans(comparison)) > 1 else ""),
        laws=table(["Law", "What it sets in the scenario"], sets, (0, 1)),
    )
