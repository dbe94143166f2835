"""Self-contained HTML pages: their frame, tables and cards."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

from gcs_formation.record.expectations import WORDS
from gcs_formation.report.run_data import RunData

MOST_EVENTS = 500
AXES = ("x", "y", "z")
NONE = "–"
SIGNS = {"below": "<", "above": ">"}


def document(title: str, template: str, **parts: str) -> str:
    """Return a whole page. The body's template, a file, takes `title` and `parts`, which are HTML already."""
    name = escape(title)
    body = Template(asset(template)).substitute(title=name, **parts)
    return Template(asset("page.html")).substitute(title=name, style=asset("report.css"), body=body)


def asset(name: str) -> str:
    """Return the text of a file that pages are made of."""
    return (files("gcs_formation.report") / "assets" / name).read_text(encoding="utf-8")


def figure(name: str, title: str, caption: str, path: Path) -> str:
    """Return a picture with its caption, its file embedded."""
    image = b64encode(path.read_bytes()).decode("ascii")
    return (
        f'<figure id="figure-{name}"><img alt="{escape(title)}" src="data:image/png;base64,{image}">'
        f"<figcaption><b>{escape(title)}.</b> {escape(caption)}</figcaption></figure>\n"
    )


class Html(str):
    """Text that is HTML already."""

    __slots__ = ()


def number(value: float | None, digits: int = 3, unit: str = "") -> str:
    """Return a figure with a unit, or a dash for none."""
    return NONE if value is None else f"{value:.{digits}f}{unit}".replace("-", "−")


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], text_columns: Iterable[int] = (0,)) -> str:
    """Return a table; columns of text are set left, figures right."""
    left = set(text_columns)
    head = "".join(f'<th scope="col"{_kind(i in left)}>{escape(name)}</th>' for i, name in enumerate(heads))
    body = "\n".join(
        "<tr>" + "".join(f"<td{_kind(i in left)}>{_inner(cell)}</td>" for i, cell in enumerate(row)) + "</tr>"
        for row in rows
    )
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table></div>'


def badge(held: bool | None, words: str) -> Html:
    """Return a verdict in its colour."""
    kind = {True: "held", False: "broken", None: "open"}[held]
    return Html(f'<span class="verdict {kind}">{escape(words)}</span>')


def verdict(summary: Mapping[str, Any]) -> str:
    """Return whether the run met all its expectations."""
    verdicts = [entry["held"] for entry in summary["expect"]]
    broken, violations = verdicts.count(False), summary["safety"]["violations"]
    words = [f"{broken} of {len(verdicts)} expectations broken"] if broken else []
    words += [f"{violations} safety violation{'s' * (violations != 1)}"] if violations else []
    words += [f"{len(undone)} not done as planned"] if (undone := summary.get("undone")) else []
    if words:
        return badge(False, ", ".join(words))
    if not verdicts:
        return badge(None, "nothing was expected")
    waiting = verdicts.count(None)
    return badge(True, "all held") if not waiting else badge(None, f"none broken, {waiting} not judged")


def missing(texts: Sequence[str]) -> str:
    """Return what the record of an unfinished run lacks."""
    items = "".join(f"<li>{escape(text)}</li>" for text in texts)
    return f'<section id="missing"><h2>Missing from this record</h2><ul>{items}</ul></section>' if items else ""


def count(value: int | None) -> str:
    """Return a count, or a dash where it isn't known."""
    return NONE if value is None else str(value)


def cards(run: RunData) -> str:
    """Return the key figures."""
    summary = run.summary
    control, safety, stability = summary["control"], summary["safety"], summary["stability"]
    limits = run.scenario.safety
    found = [
        _card("Flown", number(summary["duration_s"], 1, " s"), _pace(summary)),
        *_settled_cards(summary["followers"]),
        _safety_card("Least separation", safety["min_separation_m"], limits.separation_m),
        _safety_card("Least clearance", safety["min_clearance_m"], limits.clearance_m),
        _card(
            "Late ticks",
            count(control["late_ticks"]),
            f"of {control['ticks']}; {number(control['rate_hz'], 0)} Hz",
        ),
        _card(
            "Delay margin",
            number(stability["delay_margin_s"], 2, " s"),
            f"longest loop delay {number(stability['worst_loop_delay_s'], 2, ' s')}",
        ),
    ]
    return "\n".join(found)


def _card(name: str, value: str, detail: str) -> str:
    parts = {"name": name, "value": value, "detail": detail}
    inner = "".join(f'<div class="{kind}">{escape(text)}</div>' for kind, text in parts.items())
    return f'<div class="card">{inner}</div>'


def _safety_card(name: str, value: float | None, limit: float) -> str:
    return _card(name, number(value, 1, " m"), f"limit {limit:g} m")


def _pace(summary: Mapping[str, Any]) -> str:
    factor = summary["real_time_factor"]
    return f"{summary['clock']} clock" + (f", {factor:.1f} × real time" if factor else "")


def _settled_cards(followers: Mapping[str, Any]) -> list[str]:
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
    return [
        _card(
            "Settled",
            f"{len(settled)} of {len(times)}",
            f"the last at {max(settled):.1f} s" if settled else "never within 0.5 m for 10 s",
        ),
        _card(
            "Largest steady error",
            number(largest, 3, " m"),
            f"vehicle {name}, axis {axis}" if name else "none settled",
        ),
    ]


def followers(summary: Mapping[str, Any]) -> str:
    """Return the errors of every follower."""
    keys = [(axis, key) for axis in AXES for key in ("rms", "max", "steady_max")]
    times = "settled, s", "left, s", "in slot", "followed"
    heads = ["Vehicle", *(f"{axis} {key.replace('_', ' ')}" for axis, key in keys), *times]
    rows = [
        [
            name,
            *(number(follower[f"error_{axis}_m"][key]) for axis, key in keys),
            number(follower["settled_at_s"], 1),
            number(follower["left_at_s"], 1),
            _share(follower["in_slot_share"]),
            _share(follower.get("followed_share")),
        ]
        for name, follower in summary["followers"].items()
    ]
    return table(heads, rows) + _effort(summary) if rows else '<p class="note">No vehicle followed.</p>'


def _effort(summary: Mapping[str, Any]) -> str:
    """Return how much the setpoints of every follower moved."""
    units = {"speed": "m/s", "heading": "rad", "height": "m"}
    figures = {"step_p95": "steps, p95, {}", "variation_per_s": "variation a second, {}"}
    heads = [f"{channel} {text.format(unit)}" for channel, unit in units.items() for text in figures.values()]
    rows = [
        [name, *(number(follower["effort"][channel][figure]) for channel in units for figure in figures)]
        for name, follower in summary["followers"].items()
    ]
    return table(["Vehicle", *heads], rows)


def expectations(summary: Mapping[str, Any]) -> str:
    """Return what was expected, and whether it held."""
    rows = [
        [
            entry["metric"],
            str(entry.get("follower", "")),
            f"{entry.get('from_s', 0):g} to {entry['to_s']:g}" if "to_s" in entry else NONE,
            " and ".join(f"{sign} {entry[key]:g}" for key, sign in SIGNS.items() if key in entry),
            NONE if entry["value"] is None else f"{entry['value']:.4g}".replace("-", "−"),
            badge(entry["held"], ": ".join(filter(None, (WORDS[entry["held"]], entry.get("reason"))))),
        ]
        for entry in summary["expect"]
    ]
    heads = ["Figure", "Vehicle", "Window, s", "Expected", "Found", ""]
    return table(heads, rows, (0, 1, 5)) if rows else '<p class="note">The scenario expects nothing.</p>'


def links(summary: Mapping[str, Any]) -> str:
    """Return the counts of every link."""
    heads = [
        "Vehicle", "injected up, ms", "down, ms", "measured one way p50, ms", "p99, ms", "up p50, ms", "down p50, ms",
        "injected loss", "measured loss",
        "frames in", "out", "bad",
    ]  # fmt: skip
    rows = [
        [
            name,
            *(number(link[key], 1) for key in ("injected_up_ms", "injected_down_ms")),
            *(number(link["measured_delay_ms"][key], 1) for key in ("p50", "p99")),
            *(number(link[key], 1) for key in ("measured_up_ms", "measured_down_ms")),
            _share(link["injected_loss"]),
            _share(link["measured_loss"]),
            *(count(link[key]) for key in ("frames_in", "frames_out", "frames_bad")),
        ]
        for name, link in summary["links"].items()
    ]
    return table(heads, rows)


def control(summary: Mapping[str, Any]) -> str:
    """Return the timing of the control loop."""
    found = summary["control"]
    period, compute = found["period_ms"], found["compute_ms"]
    heads = [
        "Rate, Hz",
        "ticks",
        "late",
        "period p50, ms",
        "p99, ms",
        "max, ms",
        "computing p50, ms",
        "p99, ms",
    ]
    row = [
        number(found["rate_hz"], 1),
        str(found["ticks"]),
        count(found["late_ticks"]),
        *(number(period[key], 2) for key in ("p50", "p99", "max")),
        *(number(compute[key], 2) for key in ("p50", "p99")),
    ]
    return table(heads, [row], ())


def events(run: RunData) -> str:
    """Return the events in order."""
    rows = [
        [
            number(float(event["t_s"]) - run.zero_s, 1),
            str(event.get("kind", "")),
            str(event.get("vehicle", "")),
            str(event.get("text", "")),
        ]
        for event in run.events[:MOST_EVENTS]
    ]
    more = len(run.events) - MOST_EVENTS
    tail = f'<p class="note">… and {more} more in events.jsonl.</p>' if more > 0 else ""
    heads = ["Mission time, s" if run.begun else "Time, s", "Event", "Vehicle", "In words"]
    return table(heads, rows, (1, 2, 3)) + tail


def _share(value: float | None) -> str:
    return NONE if value is None else f"{100 * value:.2f} %"


def _kind(text: bool) -> str:
    return ' class="text"' if text else ""


def _inner(cell: str) -> str:
    return cell if isinstance(cell, Html) else escape(cell)
