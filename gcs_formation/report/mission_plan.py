"""The plan of a mission: its path from above and its heights, with what can't be flown marked, before any flight."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from textwrap import wrap

import numpy as np
from matplotlib.axes import Axes

from flight_model.arrays import Array
from flight_model.fence_geometry import FenceAreas
from flight_model.path import FlightPath, PathError
from flight_model.stops.timetable import Timetable
from formation_scenario import Scenario
from formation_scenario.repair import Repair
from formation_scenario.violations import Violation
from gcs_formation.report import style

POINTS = 4000
NUMBERED = 60
"""Up to this number of waypoints they are numbered."""
MIN_SPACING = 0.02
"""Distance of numbered waypoints, as a share of the mission's extent."""
LISTED = 12
"""Number of marks that are explained below."""
HEIGHT_CM, LINE_CM = 15.0, 0.32
WIDTH = 112
"""Longest line of a text, characters."""


def draw_plan(scenario: Scenario, violations: Sequence[Violation], file: Path, repair: Repair | None = None) -> None:
    """Draw the plan of a scenario into a PNG.

    Args:
        scenario: the mission as given.
        violations: what can't be flown in it.
        file: the PNG.
        repair: the nearest scenario that flies; its path is drawn beside it, and what would do is said.

    Raises:
        OSError: a file that can't be written.
    """
    repaired = repair.found.scenario if repair is not None and repair.changes and repair.flies else None
    located = (each for each in violations if each.waypoint is not None or np.isfinite(each.at_m))
    marked = sorted(located, key=lambda each: (each.at_m if np.isfinite(each.at_m) else 0.0, each.waypoint or 0))
    lines = [line for number, each in enumerate(marked[:LISTED], 1) for line in _lines(f"{number}", each, repair)]
    lines += [f"{len(marked) - LISTED} more places"] if len(marked) > LISTED else []
    lines += [line for each in violations if each not in marked for line in _lines("–", each, repair)]
    with style.print_style():
        figure = style.new_figure(HEIGHT_CM + LINE_CM * len(lines))
        axes = figure.subplots(3, 1, height_ratios=(9.0, 3.5, 0.2 + LINE_CM * len(lines))).tolist()
        _from_above(axes[0], scenario, marked, repaired)
        _heights(axes[1], scenario, marked, repaired)
        axes[2].axis("off")
        text = "\n".join(lines) or "all of it can be flown"
        axes[2].text(0.0, 1.0, text, va="top", fontsize=style.FONT_PT - 1.5)
        style.save(figure, file)


def _lines(number: str, violation: Violation, repair: Repair | None) -> list[str]:
    """Return the lines that explain a mark: what was found, what is allowed, and what would do."""
    would_do = "" if repair is None else repair.would_do(violation)
    text = f"{violation.found}; allowed: {violation.allowed}" + (f"; would do: {would_do}" if would_do else "")
    return wrap(text, WIDTH, initial_indent=f"{number}  ", subsequent_indent="     ")


def _path(scenario: Scenario) -> FlightPath | None:
    try:
        return scenario.leader_path
    except PathError:
        return None


def _from_above(axes: Axes, scenario: Scenario, marked: Sequence[Violation], repaired: Scenario | None) -> None:
    waypoints = np.array(scenario.path.waypoints_m)
    _fence(axes, None if scenario.fence is None else scenario.fence.sides)
    axes.plot(waypoints[:, 1], waypoints[:, 0], color=style.LIGHT, lw=style.THIN, label="legs")
    for each, colour, name in ((repaired, style.FOLLOWERS[2], "repaired"), (scenario, style.FOLLOWERS[0], "path")):
        path = None if each is None else _path(each)
        if path is not None:
            points = path.at(np.linspace(0.0, path.length_m, POINTS))
            axes.plot(points.east_m, points.north_m, color=colour, lw=style.LINE, label=name)
    axes.plot(waypoints[:, 1], waypoints[:, 0], ".", color=style.INK, ms=3.0)
    for index in _numbered(waypoints[:, :2]) if len(waypoints) <= NUMBERED else ():
        north_m, east_m, _ = waypoints[index]
        axes.annotate(str(index), (east_m, north_m), (3, 3), textcoords="offset points", fontsize=style.FONT_PT - 2.0)
    _stops(axes, scenario)
    _marks(axes, [(east_m, north_m) for north_m, east_m in _positions(scenario, marked)])
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="east, m", ylabel="north, m")
    axes.legend(loc="best", fontsize=style.FONT_PT - 1.5)


def _stops(axes: Axes, scenario: Scenario) -> None:
    """Draw where vehicles that hover stop, and for how long they do so beside turning."""
    planned = None if _path(scenario) is None else scenario.speeds
    for index, stop in enumerate(planned.stops if isinstance(planned, Timetable) else ()):
        north_m, east_m, _ = scenario.path.waypoints_m[stop.waypoint]
        label = None if index else "stops"
        axes.plot([east_m], [north_m], "s", ms=5.0, mfc="none", mec=style.INK, mew=0.8, ls="", label=label)
        if stop.hold_s:
            held = f"{stop.hold_s:g} s"
            axes.annotate(held, (east_m, north_m), (3, -9), textcoords="offset points", fontsize=style.FONT_PT - 2.0)


def _numbered(positions: Array) -> list[int]:
    """Return the waypoints that are numbered: of those whose numbers would lie on one another, the first."""
    spacing_m, found = MIN_SPACING * float(np.ptp(positions, axis=0).max()), list[int]()
    for index, position in enumerate(positions):
        if all(np.hypot(*(position - positions[other])) >= spacing_m for other in found):
            found.append(index)
    return found


def _fence(axes: Axes, sides: FenceAreas | None) -> None:
    """Draw the edges of areas to stay in, and areas to stay out of."""
    labelled = set[bool]()
    for area in () if sides is None else sides.areas:
        north_m, east_m = area.shape.edge_m().T
        label = None if area.inclusion in labelled else "fence" if area.inclusion else "exclusion"
        labelled.add(area.inclusion)
        axes.plot(east_m, north_m, color=style.LIMIT, lw=style.LINE, ls="--" if area.inclusion else "-", label=label)
        if not area.inclusion:
            axes.fill(east_m, north_m, color=style.LIMIT, alpha=0.15, lw=0.0)


def _heights(axes: Axes, scenario: Scenario, marked: Sequence[Violation], repaired: Scenario | None) -> None:
    """Draw the heights over the path's length; the repaired path's over its own."""
    for each, colour in ((repaired, style.FOLLOWERS[2]), (scenario, style.FOLLOWERS[0])):
        path = None if each is None else _path(each)
        if path is None or each is None:
            continue
        at_m = np.linspace(0.0, path.length_m, POINTS)
        points = path.at(at_m)
        axes.plot(at_m, points.height_m, color=colour, lw=style.LINE)
        if each is scenario:
            ground_m = scenario.ground.height(points.north_m, points.east_m)
            axes.fill_between(at_m, ground_m, min(float(np.nanmin(ground_m)), 0.0), color=style.LIGHT, lw=0.0)
            known = [mark for mark in marked if np.isfinite(mark.at_m)]
            numbers = [number for number, mark in enumerate(marked, 1) if np.isfinite(mark.at_m)]
            _marks(axes, [(mark.at_m, float(path.at(mark.at_m).height_m)) for mark in known], numbers)
    axes.set(xlabel="along the path, m", ylabel="height, m")


def _positions(scenario: Scenario, marked: Sequence[Violation]) -> list[tuple[float, float]]:
    """Return where marks are, north and east: on the path where that is known, else at the waypoint."""
    path, found = _path(scenario), list[tuple[float, float]]()
    for each in marked:
        if path is not None and np.isfinite(each.at_m):
            point = path.at(each.at_m)
            found.append((float(point.north_m), float(point.east_m)))
        else:
            north_m, east_m, _ = scenario.path.waypoints_m[each.waypoint or 0]
            found.append((north_m, east_m))
    return found


def _marks(axes: Axes, positions: Iterable[tuple[float, float]], numbers: Sequence[int] | None = None) -> None:
    for at, (x, y) in enumerate(positions):
        number = at + 1 if numbers is None else numbers[at]
        axes.plot([x], [y], "o", ms=9.0, mfc="none", mec=style.LIMIT, mew=1.2)
        if number <= LISTED:
            axes.annotate(str(number), (x, y), (-9, 5), textcoords="offset points", color=style.LIMIT, weight="bold")
