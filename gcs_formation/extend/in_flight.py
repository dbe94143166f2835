"""Runs a flight's filters, monitors and recorders from outside: what the station calls, at one place each."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any, Final

from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from flight_model.autopilot_model import AutopilotModel
from flight_model.slot import CHANNELS, Vector3
from formation_scenario import Scenario
from formation_scenario.extensions import FILTER, MONITOR, RECORDER, Registered
from formation_scenario.slot_assignment import ids_by_index
from gcs_formation.control.finite import require_setpoint
from gcs_formation.control.outside import guarded, made
from gcs_formation.control.setpoint import Envelope
from gcs_formation.errors import NotFiniteError
from gcs_formation.extend.cycle import Cycle, Replace, Wanted
from gcs_formation.recorder import Event, Tick

AGAIN_S: Final = 2.5
"""An event that was raised within so many seconds goes on, and isn't recorded again."""


def _begun(scenario: Scenario, kind: str) -> list[tuple[Registered, Any]]:
    """Return a new instance of each of the scenario's extensions of one kind, in its order."""
    known = scenario.registered
    named = ((known.get(name, kind), keys) for name, keys in scenario.extensions.items())
    return [(entry, made(entry, keys)) for entry, keys in named if entry is not None]


class OnTicks:
    """The filters and monitors of a flight."""

    def __init__(self, scenario: Scenario, models: list[AutopilotModel]) -> None:
        """Make an instance of each; `models`, (C,), limit what filters command.

        Raises:
            RunAbortedError: one can't begin.
        """
        self._identities: list[VehicleId | None] = list(ids_by_index(scenario))
        self._models, self._dt_s = models, 1.0 / scenario.law.rate_hz
        self._filters, self._monitors = _begun(scenario, FILTER), _begun(scenario, MONITOR)
        self._leads_by: tuple[float | None, ...] = (None,) * len(CHANNELS)
        """What filters commanded the leader last in place of its guidance, by channel."""
        self._raised = dict[tuple[str, str, str, VehicleId | None], Instant]()
        """When each event was raised last."""
        self.by_program = dict[int, Wanted]()
        """What a program that steps the flight commands in place of all others, by index, after every filter."""

    def filter(self, tick: Tick) -> NotFiniteError | None:
        """Let the filters change a tick's setpoints, in order; return the error of one that fails."""
        try:
            for entry, each in self._filters:
                replace = partial(self._replace, tick, f"{entry} ({entry.where})")
                guarded(entry, partial(each.apply, self._cycle(entry, tick, replace)))
        except NotFiniteError as error:
            return error
        for index, wanted in self.by_program.items():
            if tick.active[index]:
                self._replace(tick, "the program", index, wanted)
        sent, replaced = tick.setpoints[tick.leader], tick.replaced[tick.leader]
        self._leads_by = tuple(value if by else None for value, by in zip(sent, replaced, strict=True))
        return None

    def goes_on(self, guided: Vector3) -> Vector3:
        """Return how the leader is taken to be commanded now: in channels that filters replaced, as they did last.

        Filters come after the law, which needs to know the leader's command.
        """
        speed_mps, heading_rad, height_m = (
            value if by is None else by for value, by in zip(guided, self._leads_by, strict=True)
        )
        return speed_mps, heading_rad, height_m

    def reset(self) -> None:
        """Forget what the leader was commanded: another vehicle leads."""
        self._leads_by = (None,) * len(CHANNELS)

    def show(self, tick: Tick) -> NotFiniteError | None:
        """Show a tick to the monitors, as it is commanded in the end; return the error of one that fails."""
        try:
            for entry, each in self._monitors:
                guarded(entry, partial(each.watch, self._cycle(entry, tick, _only_filters)))
        except NotFiniteError as error:
            return error
        return None

    def _cycle(self, entry: Registered, tick: Tick, replace: Replace) -> Cycle:
        return Cycle(tick, self._identities, self._dt_s, replace, partial(self._tell, entry, tick))

    def _replace(self, tick: Tick, whose: str, index: int, wanted: Wanted) -> None:
        """Replace parts of a setpoint, limited to the vehicle's envelope; `whose` doing it is, for messages.

        Raises:
            NotFiniteError: a part isn't finite.
        """
        speed_mps, heading_rad, height_m = (
            now if part is None else float(part) for now, part in zip(tick.setpoints[index], wanted, strict=True)
        )
        require_setpoint(whose, index, (speed_mps, heading_rad, height_m))
        bounds = Envelope(heading_rad, tick.state[index], self._models[index])
        tick.replace(index, bounds.limit(speed_mps, heading_rad, height_m))

    def _tell(self, entry: Registered, tick: Tick, event: Event) -> None:
        """Record an event, unless the same was raised a moment ago."""
        what = entry.name, event.kind, event.text, event.vehicle
        last = self._raised.get(what)
        self._raised[what] = event.now
        if last is None or seconds_between(last, event.now) > AGAIN_S:
            tick.events.append(event)


def on_ticks(scenario: Scenario, models: list[AutopilotModel]) -> OnTicks | None:
    """Return the filters and monitors of a flight; None if it has none.

    Raises:
        RunAbortedError: one can't begin.
    """
    return OnTicks(scenario, models) if scenario.extensions else None


class Sinks:
    """The recorders of a flight; one that fails is the flight's failure, and gets nothing more."""

    def __init__(self, scenario: Scenario, directory: Path) -> None:
        """Make and open each.

        Raises:
            RunAbortedError: one can't begin.
        """
        self.failure: str | None = None
        self._identities: list[VehicleId | None] = list(ids_by_index(scenario))
        self._dt_s = 1.0 / scenario.law.rate_hz
        self._each = _begun(scenario, RECORDER)
        self._tell("open", directory)

    @property
    def any(self) -> bool:
        """Whether there is one, or was."""
        return bool(self._each) or self.failure is not None

    def tick(self, tick: Tick) -> None:
        """Show them a tick."""
        self._tell("tick", Cycle(tick, self._identities, self._dt_s, _only_filters, _no_events))

    def event(self, event: Event) -> None:
        """Show them an event."""
        self._tell("event", event)

    def close(self) -> None:
        """Close them."""
        self._tell("close")

    def _tell(self, method: str, *what: object) -> None:
        for entry, each in tuple(self._each):
            try:
                guarded(entry, partial(getattr(each, method), *what))
            except NotFiniteError as error:
                self._each.remove((entry, each))
                self.failure = self.failure or f"the {error.part} can't record: {error.found}"


def sinks(scenario: Scenario, directory: Path) -> Sinks | None:
    """Return the recorders of a flight into a directory; None if it has none.

    Raises:
        RunAbortedError: one can't begin.
    """
    found = Sinks(scenario, directory) if scenario.extensions else None
    return found if found is not None and found.any else None


def _only_filters(index: int, wanted: Wanted) -> None:
    del index, wanted
    raise PermissionError("replace is for filters alone")


def _no_events(event: Event) -> None:
    raise PermissionError(f"event {event.kind!r} of a recorder; events are for filters and monitors")
