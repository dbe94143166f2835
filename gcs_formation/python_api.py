"""`gcs_formation.run`, `study` and `tell`: the commands of the same names in Python."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from airlink.cli.output_directory import default_directory
from formation_scenario import Scenario, load_scenario
from formation_scenario.fields import did_you_mean, refused
from formation_scenario.orders import Answer, read_order
from formation_scenario.overrides import settings
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.order_socket import STATUS
from gcs_formation.app.order_socket import tell as give_order
from gcs_formation.app.progress import Progress
from gcs_formation.app.result_text import held_text
from gcs_formation.app.run import run as run_scenario
from gcs_formation.app.run_options import ClockName, RunOptions
from gcs_formation.record.run_directory import recorded_in
from gcs_formation.record.summary import Summary as RecordedSummary
from gcs_formation.station import Station

if TYPE_CHECKING:
    from gcs_formation.app.sitl.run import Fly
    from gcs_formation.notebook import Picture

OPTIONS = ("clock", "speedup", "until", "out", "overwrite", "overrides", "progress", "plugins")
"""Options of `run` besides scenario keys."""

__all__ = ["Answer", "Summary", "run", "study", "tell"]


@dataclass(frozen=True)
class Summary(RecordedSummary):
    """The figures of a finished run, and where it is recorded."""

    run_dir: Path
    """Directory of run.yaml, flight.tlog, timeseries.parquet, events.jsonl and summary.json."""

    def report(self) -> Path:
        """Draw the figures and the page, as `gcs-formation report` does; return the path of report.html.

        Raises:
            RecordError: the run directory can't be read or written.
        """
        from gcs_formation.report.page import write_report  # noqa: PLC0415 - drawing needs twice the imports of flying

        return write_report(self.run_dir)

    def figure(self, name: str = "errors") -> Picture:
        """Return one of the report's figures, which a notebook shows inline: errors, plan, trajectory, separation, ….

        Raises:
            ValueError: no figure has that name, or this run has nothing to show in it.
            RecordError: the run directory can't be read.
        """
        from gcs_formation.notebook import run_figure  # noqa: PLC0415 - as for `report`

        return run_figure(self.run_dir, name)

    def _repr_html_(self) -> str:
        from gcs_formation.notebook import table_html  # noqa: PLC0415 - as for `report`

        return table_html(self.table(), held_text(self), str(self.run_dir))

    def table(self) -> str:
        """Return a row of text for each follower: its errors' RMS and maximum, m, when it settled, s, its delay, ms."""
        found = self.to_dict()
        head = ["follower", *(f"{axis} {what}" for axis in "xyz" for what in ("RMS", "max")), "settled", "delay"]
        rows = [head]
        for follower, each in found["followers"].items():
            errors = [each[f"error_{axis}_m"].get(what) for axis in "xyz" for what in ("rms", "max")]
            link = found.get("links", {}).get(follower, {})
            late = each.get("settled_at_s"), link.get("measured_delay_ms", {}).get("p50")
            numbers = [*(_number(error, 2) for error in errors), *(_number(value, 0) for value in late)]
            rows.append([follower, *numbers])
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        return "\n".join("  ".join(map(str.rjust, row, widths)) for row in rows)

    def __repr__(self) -> str:
        """Return the run's result in a line; `to_dict()` has the figures."""
        found, parts = self.to_dict(), [str(self.run_dir), held_text(self)]
        parts.append(f"{found['duration_s']:.1f} s")
        for follower, each in found["followers"].items():
            rms = [each[f"error_{axis}_m"]["rms"] for axis in "xyz"]
            figures = " / ".join("-" if value is None else f"{value:.2f}" for value in rms)
            parts.append(f"{follower}: {figures} m RMS")
        return f"Summary({', '.join(parts)})"


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def run(  # noqa: PLR0913 - options by name, as the command's
    scenario: str | Path | Mapping[str, Any] | Scenario,
    *,
    clock: ClockName = "real",
    speedup: float = 1.0,
    until: float | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    overrides: Mapping[str, Any] | None = None,
    progress: Callable[[float, float], None] | None = None,
    plugins: Sequence[str | Path] = (),
    sitl: Mapping[str, str | Path] | None = None,
    **keys: Any,
) -> Summary:
    """Fly a scenario with emulated vehicles, or with simulators of real autopilots, and return its summary.

    Args:
        scenario: a path, a mapping with the scenario's keys, or a Scenario.
        clock: "real" or "virtual", as the command's option.
        speedup: under the real clock, how many times faster.
        until: mission time in seconds at which to end early.
        out: the run directory, new or empty; default: runs/NAME-TIME.
        overwrite: replace an earlier run in `out` when this one begins.
        overrides: scenario keys instead of the scenario's own, by their dotted names: {"law.rate_hz": 5}.
        progress: called a few times a second with the mission time, s (NaN before the path), and when it ends, s.
        plugins: files of extensions that the scenario names, as `--plugin`.
        sitl: your simulators of real autopilots by their families, as `--sitl`: {"arduplane": "bin/arduplane"}.
        **keys: the same as `overrides`; `__` stands for a dot: `law__rate_hz=5`.

    Raises:
        ScenarioError: the scenario or an override is wrong; nothing was started.
        ValueError: `clock`, `speedup`, `until`, `out` or `sitl` is wrong.
        RunAbortedError: a port is taken, a vehicle refused, the emulators or a simulator ended.
        RecordError: the run directory holds other files or an earlier run, or it can't be written.
    """
    given = {"clock": clock, "speedup": speedup, "until_s": until, "overwrite": overwrite}
    loaded, options = flown_by(scenario, dict(overrides or {}) | keys, out, given, plugins)
    flies = _with_simulators(sitl, clock) if sitl else run_scenario
    with Interrupts() as interrupts:
        summary = flies(loaded, options, Progress() if progress is None else _Callback(progress), interrupts)
    if interrupts.count:
        raise KeyboardInterrupt
    return summary_of(summary, options.out)


def _with_simulators(sitl: Mapping[str, str | Path], clock: ClockName) -> Fly:
    from gcs_formation.app.sitl.fleet import programs_at  # noqa: PLC0415 - only with `sitl` any are started
    from gcs_formation.app.sitl.run import with_simulators  # noqa: PLC0415

    return with_simulators(programs_at(sitl), clock)


class _Callback(Progress):
    """Passes the progress on to a function."""

    def __init__(self, tell: Callable[[float, float], None]) -> None:
        super().__init__()
        self._tell = tell

    def show(self, station: Station) -> None:
        """Pass on the mission time, and when it ends."""
        tick = station.newest
        self._tell(math.nan if tick is None else tick.mission_time_s, station.scenario.duration_s)


def flown_by(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    overrides: Mapping[str, Any],
    out: str | Path | None,
    options: Mapping[str, Any],
    plugins: Sequence[str | Path] = (),
) -> tuple[Scenario, RunOptions]:
    """Return the scenario and the options of a flight, as `run` and `Flight` are given them.

    Raises:
        ScenarioError: the scenario or an override is wrong.
        ValueError: an option is wrong.
    """
    if out == "":
        raise ValueError("out: found ''; allowed: a directory")
    _require_known(overrides)
    loaded = load_scenario(scenario, settings(overrides), option="", plugins=plugins)
    directory = default_directory(loaded.name) if out is None else Path(out)
    return loaded, RunOptions(directory, **options)


def summary_of(summary: RecordedSummary, directory: Path) -> Summary:
    """Return a summary with where its run is recorded."""
    return Summary(summary.figures, summary.verdicts, summary.breaches, recorded_in(directory))


def _require_known(overrides: Mapping[str, Any]) -> None:
    """Refuse a keyword that is neither an option of `run` nor begins with a scenario key."""
    keys = [field.alias or name for name, field in Scenario.model_fields.items()]
    for name in overrides:
        first = name.replace("__", ".").split(".")[0]
        if first not in keys:
            near = did_you_mean(first, [*OPTIONS, *keys])
            options = f"an option of run ({', '.join(OPTIONS)}), or a key: {', '.join(keys)}"
            raise refused(name, f"found an unknown key '{first}'", f"{options}{near}")


def study(  # noqa: PLR0913 - options by name, as the command's
    source: str | Path | Mapping[str, Any],
    out: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    records: str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    quiet: bool = False,
    progress: Callable[[int, int], None] | None = None,
    plugins: Sequence[str | Path] = (),
) -> pa.Table:
    """Fly a study and return its flights, a row each, as `gcs-formation study` does.

    Call it in a script below `if __name__ == "__main__":`, because its workers import that script.

    Args:
        source: a study file, or a mapping with its keys; a scenario file in a mapping is relative to here.
        out: the study's directory: flights.parquet, study.json and the records kept of each flight.
        workers: number of local processes; default: the number of cores.
        scheduler: fly on the cluster of this Dask scheduler instead, tcp://HOST:PORT.
        records: a URL of fsspec to keep the flights' records at, such as s3://BUCKET/PATH, instead of `out`.
        resume: fly what an interrupted study in `out` lacks.
        overwrite: replace an earlier study in `out`.
        quiet: show no progress on standard error.
        progress: called after every flight with how many are done, and how many there are at most.
        plugins: files of extensions that the study names, as `--plugin`; workers get them by content.

    Raises:
        ScenarioError: the study is wrong; nothing was started.
        RecordError: `out` holds other files or another study, or it can't be written.
        RunAbortedError: no further flight can be flown; `resume` continues with those flown so far.
    """
    from gcs_formation.studies.campaign import StudyProgress, fly_study  # noqa: PLC0415 - what `run` needn't import
    from gcs_formation.studies.cluster import Cluster  # noqa: PLC0415
    from gcs_formation.studies.preparation import prepare  # noqa: PLC0415
    from gcs_formation.studies.workers import Processes  # noqa: PLC0415

    planned, base = prepare(Path(source) if isinstance(source, str) else source, plugins=plugins)
    chosen = Cluster(scheduler) if scheduler else Processes(workers or os.cpu_count() or 1)
    with StudyProgress(quiet=quiet, tell=progress) as shown:
        kept = {"resume": resume, "overwrite": overwrite}
        return fly_study(planned, base, Path(out), chosen, shown, records=records, **kept).table


def tell(run_dir: str | Path, order: str) -> Answer:
    """Give an order to the flight that records into a directory, and return its answer.

    Args:
        run_dir: the directory of a flight that is running under the real clock.
        order: `shape line`, `shape line 40`, `spacing 40`, `speed 24`, `leader 3`, `loiter`, `rtl` or `land`; or
            `status`, which is answered by a page on the flight.

    Raises:
        OrderError: the text isn't an order.
        NothingRunningError: no flight answers there.
    """
    if order != STATUS:
        read_order(order, (STATUS,))
    return give_order(Path(run_dir), order)
