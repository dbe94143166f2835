"""The command `link`: measures links without a flight."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click

from airlink.cli import Number, Status, examples, fail, say, tell
from airlink.cli.output_directory import OUT, refusal
from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import Endpoint
from gcs_formation.cli.interrupts import Interrupts
from gcs_formation.cli.run_and_fly import EndpointType
from gcs_formation.errors import RecordError, RunAbortedError
from gcs_formation.link_survey import report
from gcs_formation.link_survey.meaning import meaning
from gcs_formation.link_survey.session import surveyed
from gcs_formation.link_survey.survey import LinkSurvey
from gcs_formation.link_survey.text import lines

LINK_EXAMPLES = examples(
    "gcs-formation link udpin:0.0.0.0:14550                          for five minutes",
    "gcs-formation link serial:/dev/ttyUSB0:57600 --minutes 2 --out surveys/field",
    "gcs-formation link tcp:127.0.0.1:5760 --probe-capacity 200      fills the link, at the end",
)
FIGURES = "link.json"
NO_LINK_S = 30.0
"""Without any vehicle the survey ends after this time."""


@click.command(epilog=LINK_EXAMPLES)
@click.argument("endpoints", type=EndpointType(), nargs=-1, required=True, metavar="ENDPOINT...")
@click.option("--minutes", type=Number(0.05, 1440), default=5.0, show_default=True, help="How long to measure.")
@click.option(
    "--probe-hz", type=Number(0.5, 50), default=10.0, show_default=True, help="Requests a second and vehicle."
)
@click.option(
    "--probe-capacity",
    "load_kbps",
    type=Number(1, 100_000),
    metavar="KBPS",
    help="At the end fill the links, with up to so much each way, to find what they carry. Not in flight.",
)
@click.option("--no-rehearsal", "rehearsed", flag_value=False, default=True, help="Don't say what it means.")
@click.option("--out", type=OUT, help="Directory of the figures, the traces and the rehearsal's scenario.")
@click.option("--overwrite", is_flag=True, help="Replace an earlier survey in --out.")
@click.option("--json", "as_json", is_flag=True, help="The figures alone on standard output.")
def link(
    endpoints: tuple[Endpoint, ...],
    minutes: float,
    probe_hz: float,
    load_kbps: float | None,
    rehearsed: bool,
    out: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Measure the links of all vehicles received at each ENDPOINT, and say what formation they carry.

    Nothing is commanded: it listens, sends heartbeats, and asks for the vehicles' time (TIMESYNC). Exit status 3:
    none answered.
    """
    if out is not None:
        try:
            refused = refusal(out, overwrite=overwrite, mark=FIGURES)
        except OSError as error:
            refused = f"cannot read {out}: {error.strerror}"
        if refused is not None:
            fail(f"--out: {refused}")
    interrupted = _Interrupts()
    say(f"measuring for {minutes:g} min; an interrupt (Ctrl-C) ends that early", Status.FINE)
    try:
        with interrupted:
            survey, now = surveyed(endpoints, 60.0 * minutes, probe_hz, load_kbps, interrupted.ends)
        found = report.figures(survey, now)
        if not any(each.answers for each in survey.links.values()):
            status = Status.INTERRUPTED if interrupted.count else Status.COULD_NOT_GO_ON
            fail(_no_vehicle(survey), status)
        with TemporaryDirectory() as scratch:
            directory = out or Path(scratch)
            _write_traces(survey, found, now, directory)
            if rehearsed:
                say("rehearsing what that means …", Status.FINE)
                found["meaning"] = meaning(found, directory)
            report.write(json.dumps(found, indent=1) + "\n", directory / FIGURES)
    except (RunAbortedError, RecordError) as error:
        fail(str(error), Status.COULD_NOT_GO_ON)
    tell(json.dumps(found, indent=1) if as_json else "\n".join(lines(found)))
    sys.exit(Status.INTERRUPTED if interrupted.count else Status.FINE)


class _Interrupts(Interrupts):
    """While entered, a termination signal ends the survey; what was measured so far is printed."""

    def ends(self, survey: LinkSurvey, now: Instant) -> bool:
        """Return whether to end: by a signal, or as no vehicle is there."""
        return self.count > 0 or (not survey.links and now > NO_LINK_S * NANOSECONDS)


def _no_vehicle(survey: LinkSurvey) -> str:
    where = ", ".join(str(each) for each in survey.endpoints())
    if not survey.links:
        return f"found no autopilot at {where}; allowed: endpoints at which an autopilot's heartbeats arrive"
    who = ", ".join(str(system) for _, system in survey.links)
    return f"vehicle {who} at {where} answered no TIMESYNC; allowed: vehicles that receive it, and answer"


def _write_traces(survey: LinkSurvey, found: dict[str, Any], now: Instant, out: Path) -> None:
    for (name, each), key in zip(found["vehicles"].items(), sorted(survey.links), strict=True):
        file = f"trace-{name.partition('@')[0]}{'-' + str(key[0]) if '@' in name else ''}.csv"
        report.write(report.trace(survey.links[key], each["loss"], min(now, survey.until)), out / file)
        each["trace"] = file
