"""Self-contained HTML pages: their frame, and the texts, tables and cards of a run's page."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
import yaml

from formation_scenario.expectation import CHANNEL_UNITS
from formation_scenario.feature_folders import brought_texts
from formation_scenario.surroundings import StepDisturbance
from gcs_formation.record.expectations import FAILINGS
from gcs_formation.record.verdict import WORDS
from gcs_formation.report import RunData
from gcs_formation.report.gusts import gusts

MAX_EVENTS = 500
AXES = ("x", "y", "z")
NONE = "–"
STEP_MPS = 0.6
"""Disturbance that the paper adds north and east to every vehicle from 500 s on (figure 11)."""
REPORTED_M = {"x": 0.22, "y": 0.5}
"""Largest errors that the paper reads from figure 12, without the initial transient."""
WHOLE = "whole flight, take-off and end included"
"""What the limits of `safety` are judged over; an expectation's window may be a part of it."""
FROM_PATH = (
    "Over the scored flight. Across and height: from the path's nearest point; along: from where the path's time puts "
    "it. The centre is the mean of the members' positions less their own slots."
)
SIGNS = {"below": "<", "above": ">"}


def document(title: str, template: str, **parts: str) -> str:
    """Return a whole page. `template` is the body's file; it takes `title`, and `parts`, which are HTML already."""
    name = escape(title)
    body = Template(asset(template)).substitute(title=name, **parts)
    return Template(asset("page.html")).substitute(title=name, style=asset("report.css"), body=body)


def asset(name: str) -> str:
    """Return the text of a file that pages are made of."""
    return (files("gcs_formation.report") / "assets" / name).read_text(encoding="utf-8")


CAPTIONS: dict[str, dict[str, str]] = yaml.safe_load(asset("captions.yaml"))
for _text in brought_texts("captions.yaml"):
    CAPTIONS.update(yaml.safe_load(_text))


def figure(name: str, path: Path, title: str = "", first: str = "") -> str:
    """Return an embedded picture with its caption; `first` precedes the caption that all figures of a kind share."""
    caption, image = CAPTIONS[name.partition("-")[0]], b64encode(path.read_bytes()).decode("ascii")
    title = escape(title or caption["title"])
    return (
        f'<figure id="figure-{name}"><img alt="{title}" src="data:image/png;base64,{image}">'
        f"<figcaption><b>{title}.</b> {marked_up(first + caption['caption'])}</figcaption></figure>\n"
    )


def marked_up(text: str) -> str:
    """Return a text as HTML, with what stands in backquotes as code."""
    return re.sub("`([^`]+)`", r"<code>\1</code>", escape(text))


class Html(str):
    """Text that is HTML already."""

    __slots__ = ()


def number(value: float | None, digits: int = 3, unit: str = "") -> str:
    """Return a figure with a unit, or a dash for none."""
    return NONE if value is None else f"{value:.{digits}f}{unit}".replace("-", "−")


def brief(value: float | None) -> str:
    """Return a figure in four digits, or a dash for none."""
    return NONE if value is None else f"{value:.4g}".replace("-", "−")


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], text_columns: Iterable[int] = (0,)) -> str:
    """Return a table; text columns are left-aligned, figures right-aligned."""
    kinds = [' class="text"' if i in set(text_columns) else "" for i in range(len(heads))]
    head = "".join(f'<th scope="col"{kind}>{escape(name)}</th>' for kind, name in zip(kinds, heads, strict=True))
    body = "\n".join(
        "<tr>"
        + "".join(
            f"<td{kind}>{cell if isinstance(cell, Html) else escape(cell)}</td>"
            for kind, cell in zip(kinds, row, strict=True)
        )
        + "</tr>"
        for row in rows
    )
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table></div>'


def badge(held: bool | None, words: str) -> Html:
    """Return a verdict in its colour."""
    kind = {True: "held", False: "broken", None: "open"}[held]
    return Html(f'<span class="verdict {kind}">{escape(words)}</span>')


def verdict(summary: Mapping[str, Any]) -> str:
    """Return whether the run met all its expectations, and how many late ticks spoilt it."""
    verdicts, control = [entry["held"] for entry in summary["expect"]], summary["control"]
    broken, violations = verdicts.count(False), summary["safety"]["violations"]
    late = [f"{control['late_ticks']} of {control['ticks']} ticks late"] if control.get("lateness") else []
    words = [f"{broken} of {len(verdicts)} expectations broken"] if broken else []
    words += [f"{violations} safety violation{'s' * (violations != 1)}"] if violations else []
    words += [f"{len(summary[key])} {failing}" for key, failing in FAILINGS.items() if summary.get(key)]
    if words:
        return badge(False, ", ".join([*words, *late]))
    waiting = verdicts.count(None)
    outcome = "all held" if not waiting else f"none broken, {waiting} not judged"
    if waiting == len(verdicts):
        outcome = "nothing was judged" if verdicts else "nothing was expected"
    return badge(None if waiting or not verdicts else True, ", ".join([outcome, *late]))


def missing(texts: Sequence[str]) -> str:
    """Return what the record lacks."""
    items = "".join(f"<li>{escape(text)}</li>" for text in texts)
    return f'<section id="missing"><h2>Missing from this record</h2><ul>{items}</ul></section>' if items else ""


def cards(run: RunData) -> str:
    """Return the key figures."""
    summary, control, stability = run.summary, run.summary["control"], run.summary["stability"]
    factor, loop_delay_s = summary["real_time_factor"], number(stability["worst_loop_delay_s"], 2, " s")
    pace = f"{summary['clock']} clock" + (f", {factor:.1f} × real time" if factor else "")
    limits = {"separation": run.scenario.safety.separation_m, "clearance": run.scenario.safety.clearance_m}
    outside_m = summary["safety"].get("fence_m")
    found = [
        ("Flown", number(summary["duration_s"], 1, " s"), pace),
        *_settled(summary["followers"]),
        *(
            (f"Least {what}", number(summary["safety"][f"min_{what}_m"], 1, " m"), f"{WHOLE}; limit {limit:g} m")
            for what, limit in limits.items()
        ),
        *([("Outside the fence", number(outside_m, 1, " m"), WHOLE)] if outside_m is not None else []),
        *_off_path(summary.get("path")),
        ("Late ticks", _count(control["late_ticks"]), f"of {control['ticks']}; {number(control['rate_hz'], 0)} Hz"),
        ("Delay margin", number(stability["delay_margin_s"], 2, " s"), f"longest loop delay {loop_delay_s}"),
    ]
    return "\n".join(map(_card, found))


def _off_path(path: Mapping[str, Any] | None) -> list[tuple[str, str, str]]:
    if path is None or path["leader"]["across_m"]["max"] is None:
        return []
    across, height = (path["leader"][name]["max"] for name in ("across_m", "height_m"))
    return [("Leader from its path", number(across, 2, " m"), f"the most across; in height {number(height, 2, ' m')}")]


def from_path(summary: Mapping[str, Any]) -> str:
    """Return how far the leader and the formation's centre were from the path; nothing in an older record."""
    path, names = summary.get("path"), {"leader": "Leader", "centre": "Formation's centre"}
    if path is None:
        return ""
    keys = [(name, figure) for name in ("across_m", "along_m", "height_m") for figure in ("rms", "max")]
    heads = ["From the path, m", *(f"{name.removesuffix('_m')} {figure}" for name, figure in keys)]
    rows = [[words, *(number(path[who][name][figure]) for name, figure in keys)] for who, words in names.items()]
    return f'{table(heads, rows)}<p class="note">{escape(FROM_PATH)}</p>'


def _card(texts: tuple[str, str, str]) -> str:
    kinds = zip(("name", "value", "detail"), texts, strict=True)
    return f'<div class="card">{"".join(f"""<div class="{kind}">{escape(text)}</div>""" for kind, text in kinds)}</div>'


def _settled(followers: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    if not followers:
        return []
    times = [follower["settled_at_s"] for follower in followers.values()]
    settled = [time_s for time_s in times if time_s is not None]
    steady = [
        (figures["steady_max"], name, axis)
        for name, follower in followers.items()
        for axis in AXES
        if (figures := follower[f"error_{axis}_m"])["steady_max"] is not None
    ]
    largest, name, axis = max(steady, default=(None, "", ""))
    last = f"the last at {max(settled):.1f} s" if settled else "never within 0.5 m for 10 s"
    left = [follower["left_at_s"] for follower in followers.values() if follower["left_at_s"] is not None]
    last += f"; {len(left)} left again, the first at {min(left):.1f} s" if left else ""
    whose = f"vehicle {name}, axis {axis}" if name else "none settled"
    return [
        ("Settled", f"{len(settled)} of {len(times)}", last),
        ("Largest steady error", number(largest, 3, " m"), whose),
    ]


def followers(summary: Mapping[str, Any]) -> str:
    """Return the errors of every follower, and the steps of its setpoints."""
    keys = [(axis, key) for axis in AXES for key in ("rms", "max", "steady_max")]
    heads = ["Vehicle", *(f"{axis} {key.replace('_', ' ')}" for axis, key in keys)]
    rows = [
        [
            name,
            *(number(follower[f"error_{axis}_m"][key]) for axis, key in keys),
            *(number(follower[key], 1) for key in ("settled_at_s", "left_at_s")),
            *(_share(follower.get(key)) for key in ("in_slot_share", "followed_share")),
        ]
        for name, follower in summary["followers"].items()
    ]
    moved = {"step_p95": "steps, p95, {}", "variation_per_s": "variation a second, {}"}
    effort = [
        [name, *(number(follower["effort"][channel][figure]) for channel in CHANNEL_UNITS for figure in moved)]
        for name, follower in summary["followers"].items()
    ]
    channels = [f"{channel} {text.format(unit)}" for channel, unit in CHANNEL_UNITS.items() for text in moved.values()]
    errors = table([*heads, "settled, s", "left, s", "in slot", "followed"], rows)
    return errors + table(["Vehicle", *channels], effort) if rows else '<p class="note">No vehicle followed.</p>'


def expectations(summary: Mapping[str, Any]) -> str:
    """Return what was expected, and whether it held."""
    rows = [
        [
            entry["metric"],
            str(entry.get("follower", "")),
            f"{entry.get('from_s', 0):g} to {entry['to_s']:g}" if "to_s" in entry else NONE,
            " and ".join(f"{sign} {entry[key]:g}" for key, sign in SIGNS.items() if key in entry),
            brief(entry["value"]),
            _share(entry.get("judged_share")),
            badge(entry["held"], ": ".join(filter(None, (WORDS[entry["held"]], entry.get("reason"))))),
        ]
        for entry in summary["expect"]
    ]
    heads = ["Figure", "Vehicle", "Window, s", "Expected", "Found", "Judged", ""]
    return table(heads, rows, (0, 1, 6)) if rows else '<p class="note">The scenario expects nothing.</p>'


def links(summary: Mapping[str, Any]) -> str:
    """Return the counts of every link."""
    heads = [
        "Vehicle", "injected up, ms", "down, ms", "measured one way p50, ms", "p99, ms", "up p50, ms", "down p50, ms",
        "injected loss up", "down", "measured loss",
        "frames in", "out", "bad",
    ]  # fmt: skip
    each = [
        (f"{name}, link {one['link']}", one) for name, link in summary["links"].items() for one in link.get("each", ())
    ]
    rows = [
        [
            name,
            *(number(link[key], 1) for key in ("injected_up_ms", "injected_down_ms")),
            *(number(link["measured_delay_ms"][key], 1) for key in ("p50", "p99")),
            *(number(link[key], 1) for key in ("measured_up_ms", "measured_down_ms")),
            *(_share(link.get(key)) for key in ("injected_loss_up", "injected_loss", "measured_loss")),
            *(_count(link[key]) for key in ("frames_in", "frames_out", "frames_bad")),
        ]
        for name, link in (*summary["links"].items(), *each)
    ]
    return table(heads, rows)


def control(summary: Mapping[str, Any]) -> str:
    """Return the timing of the control loop."""
    found = summary["control"]
    heads = ["Rate, Hz", "ticks", "late", "period p50, ms", "p99, ms", "max, ms", "computing p50, ms", "p99, ms"]
    taken = [found["period_ms"][key] for key in ("p50", "p99", "max")]
    taken += [found["compute_ms"][key] for key in ("p50", "p99")]
    counts = str(found["ticks"]), _count(found["late_ticks"])
    rows = table(heads, [[number(found["rate_hz"], 1), *counts, *(number(each, 2) for each in taken)]], ())
    return rows + (f'<p class="note">{escape(found["lateness"])}</p>' if found.get("lateness") else "")


def events(run: RunData) -> str:
    """Return the events in order."""
    rows = [
        [number(float(event["t_s"]) - run.zero_s, 1), *(str(event.get(key, "")) for key in ("kind", "vehicle", "text"))]
        for event in run.events[:MAX_EVENTS]
    ]
    more = len(run.events) - MAX_EVENTS
    tail = f'<p class="note">… and {more} more in events.jsonl.</p>' if more > 0 else ""
    heads = ["Mission time, s" if run.begun else "Time, s", "Event", "Vehicle", "In words"]
    return table(heads, rows, (1, 2, 3)) + tail


def _count(value: int | None) -> str:
    return NONE if value is None else str(value)


def _share(value: float | None) -> str:
    return NONE if value is None else f"{100 * value:.2f} %"


def compared_with_paper(run: RunData) -> str:
    """Return the paper's figures beside the run's as HTML; nothing if they can't be compared."""
    step = _step(run)
    if step is None:
        return ""
    window = run.flown.window(step.at_s, float(run.time_s[-1]))
    errors_m = np.concatenate([run.flown.error(vehicle)[window] for vehicle in run.followers])
    largest = [float(each) if np.isfinite(each) else None for each in np.fmax.reduce(np.abs(errors_m))]
    rows = [
        [f"largest |error| {axis} from the step on, m", number(REPORTED_M.get(axis), 2), number(found)]
        for axis, found in zip(AXES, largest, strict=True)
    ]
    rows += [
        [f"least {what} of the whole run, m", "no collision", number(run.summary["safety"][f"min_{what}_m"], 1)]
        for what in ("separation", "clearance")
    ]
    heads = ["Worst follower", "paper", "this run"]
    return f'{table(heads, rows)}<p class="note">{escape(_conditions(run, step))}</p>'


def after_gusts(run: RunData) -> str:
    """Return as HTML the errors after gusts on followers only, beside their bounds; nothing without such gusts."""
    rows = [
        [
            f"{error.at_s:g} s, {error.axis}",
            str(error.vehicle),
            *(number(value) for value in error[4:]),
            badge(error.found_m <= error.allowed_m, "held" if error.found_m <= error.allowed_m else "broken"),
        ]
        for error in gusts(run)
    ]
    if not rows:
        return ""
    heads = ["Gust on followers only", "Vehicle", "T, s", "least possible, m", "held to, m", "largest |error|, m", ""]
    return f'{table(heads, rows, (0, 1, 6))}<p class="note">{escape(CAPTIONS["gusts"]["caption"])}</p>'


def _step(run: RunData) -> StepDisturbance | None:
    """Return the paper's disturbance in this run; None if there is none or the run ends within 60 s of it."""
    if not run.begun or not run.followers:
        return None
    alike = (
        each
        for each in run.scenario.disturbances
        if isinstance(each, StepDisturbance) and np.allclose(np.abs(each.velocity_mps), (STEP_MPS, STEP_MPS, 0.0))
    )
    return next((each for each in alike if each.at_s + 60.0 <= float(run.time_s[-1])), None)


def _conditions(run: RunData, step: StepDisturbance) -> str:
    """Return who is disturbed, the frame of the errors and the delay of the links, in this run and in the paper."""
    moved = [vehicle.vehicle_id for vehicle in run.scenario.selected(step.vehicles)]
    whom = "every vehicle" if len(moved) == len(run.scenario.vehicles) else "followers only, a relative disturbance"
    if run.leader in moved and len(moved) < len(run.scenario.vehicles):
        whom = f"vehicles {', '.join(map(str, moved))} only, the leader among them"
    delays_ms = (link["injected_delay_ms"] for link in run.summary["links"].values())
    known_ms = [delay_ms for delay_ms in delays_ms if delay_ms is not None]
    links = f"links take {max(known_ms):.0f} ms each way, or less" if known_ms else "nothing is injected into links"
    frame = run.scenario.formation.frame
    turns = "fixed to north and east" if frame == "north" else f"in the {frame.removesuffix('_heading')}'s frame"
    return (
        f"This run: the step acts on {whom}, from {step.at_s:g} s on; slots {turns}; {links}. "
        "The paper says that it acts on every vehicle; it gives "
        "neither the links' delay nor path, speed, slots or gains, and whether figure 12 shows formation errors or "
        "errors of an estimate can't be read from its text."
    )
