"""Compares what was commanded and acknowledged with what the vehicles do."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from airlink.clock import Instant, after, seconds_between
from airlink.identity import VehicleId
from formation_scenario import Scenario
from gcs_formation.arrays import Mask
from gcs_formation.controller import FormationController
from gcs_formation.membership import Member
from gcs_formation.obedience import CHANNELS, SETTLED_S, WINDOW_S, Disobedience, Obedience
from gcs_formation.recorder import Detail, Note, Tick
from gcs_formation.vehicle.vehicle import UNANSWERED_S, Vehicle

GAP_S = 0.5
"""Longer gaps between acknowledgements of setpoints may mean that setpoints didn't arrive."""


class CommandLedger:
    """Reports vehicles that don't do what they acknowledged: events `disobeys`, and `obeys` when they do again."""

    def __init__(
        self,
        scenario: Scenario,
        controller: FormationController,
        vehicles: Mapping[VehicleId, Vehicle],
        columns: Mapping[VehicleId, int],
        note: Note,
    ) -> None:
        """Compare `vehicles`; `columns` are theirs in the controller."""
        self._controller = controller
        self._vehicles = vehicles
        self._columns = columns
        self._note = note
        self._obedience = Obedience(scenario, controller.history)
        self._gap_s = max(GAP_S, 2.5 / scenario.law.rate_hz)
        self._unanswered = set[VehicleId]()
        """Those that were commanded and answered nothing."""
        self._commanded: dict[VehicleId, Instant] = {}
        """Since when each vehicle has been commanded without interruption."""

    @property
    def doubted(self) -> Mask:
        """Columns that don't seem to follow the setpoints that they acknowledge, (C,)."""
        return self._obedience.doubted

    def judge_answers(self, now: Instant) -> None:
        """Check that vehicles that are commanded and heard answer: events `uplink`, at the beginning and at the end."""
        for identity, vehicle in self._vehicles.items():
            reported, missing = identity in self._unanswered, vehicle.talks_on_s > UNANSWERED_S
            if missing and not reported and vehicle.member is Member.FLYING:
                self._unanswered.add(identity)
                self._note(now, "uplink", "is heard and answers nothing: it may not hear us", vehicle)
            elif reported and not missing:
                self._unanswered.remove(identity)
                self._note(now, "uplink", "answers again", vehicle)

    def judge_commands(self, now: Instant) -> None:
        """Check modes and arming."""
        for vehicle in self._vehicles.values():
            before = vehicle.effects.missing
            vehicle.effects.judge(vehicle.telemetry, now)
            missing = vehicle.effects.missing
            if missing is not None and missing is not before:
                mode = vehicle.autopilot.mode_name(vehicle.telemetry)
                text = f"acknowledged {missing.description} {missing.after_s:.1f} s ago, and is still in {mode}"
                armed = vehicle.telemetry.armed
                details = {"order": missing.description, "after_s": missing.after_s, "mode": mode, "armed": armed}
                self._note(now, "disobeys", text, vehicle, details)
            elif missing is None and before is not None:
                self._note(now, "obeys", f"{before.description} is over", vehicle, {"order": before.description})

    def judge_motion(self, tick: Tick, now: Instant) -> None:
        """Check how the vehicles follow this and earlier ticks' setpoints."""
        for identity, column in self._columns.items():
            if not tick.active[column]:
                self._commanded.pop(identity, None)
            elif identity not in self._commanded:
                self._commanded[identity] = now
        if not self._obedience.due(now):
            return
        estimator, settled = self._controller.estimator, np.zeros((len(CHANNELS), tick.active.size), dtype=bool)
        commanded_s = np.zeros(tick.active.size)
        for identity, column in self._columns.items():
            commanded_s[column] = seconds_between(self._commanded.get(identity, now), now)
            settled[:, column] = self._settled(identity, now)
        before = self._obedience.broken
        found = self._obedience.check(now, estimator.stamps, estimator.state, settled, commanded_s)
        for each in found:
            self._note(now, "disobeys", _words(each), self._at(each.column), _figures(each))
        for column in np.flatnonzero(before & ~self._obedience.broken):
            self._note(now, "obeys", "follows its setpoints again", self._at(int(column)), {"order": "setpoints"})

    def _settled(self, identity: VehicleId, now: Instant) -> list[bool]:
        """Return which channels have been commanded, and acknowledged, for long enough."""
        vehicle = self._vehicles[identity]
        runs = [vehicle.setpoints_taken[i].since(now, self._gap_s) for i in vehicle.autopilot.setpoint_commands]
        since, latest = self._commanded.get(identity, now), after(now, -SETTLED_S)
        return [run is not None and max(since, run) <= latest for run in runs]

    def _at(self, column: int) -> Vehicle:
        return next(self._vehicles[identity] for identity, its in self._columns.items() if its == column)


def _words(found: Disobedience) -> str:
    scale, unit = {"airspeed": (1.0, "m/s"), "heading": (180 / np.pi, "°"), "height": (1.0, "m")}[found.channel]
    flown, expected = found.flown * scale, found.expected * scale
    return (
        f"acknowledges setpoints and doesn't follow them: {found.channel} changed by {flown:.1f} {unit} "
        f"in {WINDOW_S:g} s, {expected:.1f} {unit} expected"
    )


def _figures(found: Disobedience) -> dict[str, Detail]:
    return {"order": "setpoints", "channel": found.channel, "expected": found.expected, "flown": found.flown}
