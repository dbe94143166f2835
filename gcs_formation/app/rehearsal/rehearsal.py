"""A rehearsal: the worst stretch and the start of a flight, flown, its links' channels, and its navigators' drift."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final, NamedTuple

from airlink.clock import Stopwatch
from formation_scenario import Scenario, ScenarioError
from gcs_formation.app.rehearsal.drift import Drift, drift, drifts
from gcs_formation.app.rehearsal.flying import Flown, flown
from gcs_formation.app.rehearsal.silences import Silences, long_silences, silences
from gcs_formation.app.rehearsal.starts import Starts, goes_round, starts
from gcs_formation.app.rehearsal.stretches import from_there, gusting, worst_s
from gcs_formation.app.session import Session
from gcs_formation.core.feature import features
from gcs_formation.errors import RunAbortedError

WALL_S: Final = 2.0
"""Wall time of a whole rehearsal."""
SILENCES_SHARE, STARTS_SHARE, STRETCH_SHARE = 0.1, 0.4, 0.95
"""By which share of it each part is over, one after the other."""
SETTLE_S: Final = 10.0
"""Time from a stretch's beginning until its errors count, s: gusts begin with it."""
MAX_S: Final = 240.0
"""Longest stretch, s."""
MIN_S: Final = 10.0
"""Shortest time of errors by which gusts are judged, s."""
WORTH_M: Final = 2.0
"""Error in gusts from which a warning is given."""
NAMES: Final = {"x": "along the path", "y": "across it", "z": "in height"}


class Rehearsal(NamedTuple):
    """What was flown, and what it showed; parts that the scenario doesn't need or that couldn't be flown are None."""

    stretch_from_s: float
    stretch: Flown | None
    starts: Starts | None
    silences: Silences | None
    drift: Drift | None
    not_flown: str | None
    """Why nothing was flown."""

    @property
    def min_run_in_s(self) -> float | None:
        """The shortest run-in after which the path begins at once, s; None if no start showed it."""
        return None if self.starts is None else self.starts.min_run_in_s


def rehearse(scenario: Scenario, wall_s: float = WALL_S) -> Rehearsal:
    """Fly what is worth flying before a flight, in at most `wall_s` of wall time, imports left out."""
    features()
    watch = Stopwatch()

    def over(share: float) -> bool:
        return watch.wall_s > share * wall_s

    silent, drifted = silences(scenario, partial(over, SILENCES_SHARE)), drift(scenario)
    from_s, stretch, begun, not_flown = worst_s(scenario), None, None, None
    try:
        begun = starts(scenario, partial(over, STARTS_SHARE)) if scenario.followers else None
        min_s = (begun and begun.min_run_in_s) or 0.0
        there = from_there(scenario, from_s, min_s)
        stretch = _stretch(there, partial(over, STRETCH_SHARE)) if scenario.followers else None
    except (RunAbortedError, ScenarioError) as error:
        not_flown = str(error)
    return Rehearsal(from_s, stretch, begun, silent, drifted, not_flown)


def _stretch(scenario: Scenario, over: Callable[[], bool]) -> Flown:
    def enough(session: Session) -> bool:
        return over() or session.station.flight.mission_time_s(session.clock.now()) > SETTLE_S + MAX_S

    return flown(scenario, enough, SETTLE_S)


def rehearsal_report(found: Rehearsal) -> dict[str, Any]:
    """Return what `check --json` prints."""
    stretch, begun = found.stretch, found.starts
    return {
        "stretch": stretch and {"from_s": found.stretch_from_s, **stretch._asdict()},
        "starts": begun and [each._asdict() for each in begun.each],
        "silences": found.silences and found.silences._asdict(),
        "drift": found.drift and found.drift._asdict(),
        "not_flown": found.not_flown,
    }


def rehearsal_text(found: Rehearsal) -> Iterator[str]:
    """Yield the same as lines of text: how long was flown, and what that showed."""
    if found.not_flown is not None:
        yield f"flown ahead: nothing: {found.not_flown}"
    if found.stretch is not None:
        yield _stretch_text(found.stretch, found.stretch_from_s)
    if found.starts is not None:
        yield f"flown ahead: {found.starts}"
    if found.silences is not None:
        yield f"losses of every uplink: {found.silences}"


def _stretch_text(stretch: Flown, from_s: float) -> str:
    since = f"from {from_s:g} s on, as things stand then" if from_s else "from the path's start on"
    errors = ", ".join(f"{each_m:.1f} m {NAMES[axis]}" for axis, each_m in stretch.errors_m.items())
    within = f", of which {stretch.scored_s:.0f} s count: 95% of the time within {errors}" if errors else ""
    return f"flown ahead: {stretch.seconds:.0f} s {since}{within}"


def rehearsal_warnings(scenario: Scenario, found: Rehearsal, pattern_s: float) -> Iterator[str]:
    """Yield what a user should know of it before flying; `pattern_s`: duration of a holding pattern before the path."""
    if found.starts is not None and (text := goes_round(scenario, found.starts, pattern_s)):
        yield text
    if found.stretch is not None:
        yield from _gusts(scenario, found.stretch_from_s, found.stretch)
        if found.stretch.failure is not None:
            yield f"flown ahead from {found.stretch_from_s:g} s on, the flight can't go on: {found.stretch.failure}"
    if found.silences is not None and (text := long_silences(found.silences)):
        yield text
    if found.drift is not None:
        yield from drifts(scenario, found.drift)


def _gusts(scenario: Scenario, from_s: float, stretch: Flown) -> Iterator[str]:
    """Yield the errors that each entry of turbulence leaves."""
    errors_m = stretch.errors_m
    if stretch.scored_s < MIN_S or max(errors_m.values(), default=0.0) < WORTH_M or scenario.hovers:
        return
    for index, _ in gusting(scenario, from_s):
        found = ", ".join(f"{each_m:.1f} m {NAMES[axis]}" for axis, each_m in errors_m.items())
        flown_s = f"{stretch.scored_s:.0f} s flown"
        yield f"disturbances.{index}: gusts leave errors of up to {found} for 95% of the time ({flown_s})"
