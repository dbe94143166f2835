# Compiled by mypyc: it runs every tick.

"""Checks whether vehicles do what they acknowledged."""

from __future__ import annotations

import math
from typing import Final

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import VehicleId
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from formation_scenario import Scenario
from formation_scenario.navigation import NoisyNavigation
from formation_scenario.slot_assignment import models_by_index, vehicles_by_index
from gcs_formation.controller.controller import FormationController
from gcs_formation.estimation.sample import heading_shown
from gcs_formation.estimation.vehicle_filter import MIN_AIRSPEED_MPS
from gcs_formation.features.conformance.flown_setpoints import CHECK_S, FlownSetpoints, NonConformance
from gcs_formation.from_scenario import autopilot_models
from gcs_formation.recorder import Detail, LogEvent, Tick, unknown_state
from gcs_formation.vehicle.command_delivery import Outcome, SetpointChannel
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.reported_motion import ReportedMotion
from gcs_formation.vehicle.vehicle import Vehicle

STEP_DELAY_S: Final = 4.0
"""Least time constant of airspeed after a step under total-energy control, whose energy rate is limited. Tuned: s; 3 to
6; shown by `pytest tests/gcs_formation/features/conformance`."""


def _judged_by(scenario: Scenario) -> list[AutopilotModel]:
    """Return the models that predict changes; an airframe's time constants for slow changes are too short for steps."""
    models = autopilot_models(scenario)
    for model, keys in zip(models, models_by_index(scenario), strict=True):
        if keys.airframe is not None:
            model.tau_v_s = max(model.tau_v_s, STEP_DELAY_S)
    return models


def _noise(scenario: Scenario) -> list[tuple[float, float, float]]:
    """Return the standard deviations of airspeed, heading and position in telemetry, by index."""
    sources = [vehicle.navigation if vehicle else None for vehicle in vehicles_by_index(scenario)]
    return [
        (each.airspeed_sigma_mps, math.radians(each.heading_sigma_deg), each.position_sigma_m)
        if isinstance(each, NoisyNavigation)
        else (0.0, 0.0, 0.0)
        for each in sources
    ]


class ConformanceMonitor:
    """Reports vehicles that don't do what they acknowledged: events `disobeys`, and `obeys` when they do again."""

    def __init__(
        self,
        scenario: Scenario,
        controller: FormationController,
        vehicles: dict[VehicleId, Vehicle],
        log_event: LogEvent,
    ) -> None:
        """Compare `vehicles`."""
        self._controller = controller
        self._vehicles = list(vehicles.values())
        self._log_event = log_event
        models, noise = _judged_by(scenario), _noise(scenario)
        prompt = [each.prompt_share for each in models_by_index(scenario)]
        self._fliers = [
            FlownSetpoints(each, models[each.index], noise[each.index], prompt[each.index]) for each in self._vehicles
        ]
        self._next_check = Instant(0)
        self.doubted = [False] * len(models)
        """Vehicles whose setpoints are refused, unacknowledged or apparently not followed, (C,)."""
        self.sinking = set[VehicleId]()
        """Vehicles that lose height although commanded to climb."""
        self.saturated = [False] * len(models)
        """(C,) which can't be faster than they are: of these no change of speed is expected."""
        self._unanswered = set[VehicleId]()
        """Vehicles that answer nothing although commanded."""
        self._refused = set[SetpointChannel]()
        """Channels whose setpoints were refused, and haven't been accepted since."""
        self._silent = set[SetpointChannel]()
        """Channels whose setpoints aren't acknowledged, of vehicles that answer otherwise."""
        self._missed = [Instant(0)] * len(self._vehicles)
        """When each vehicle last left something unanswered, (V,)."""
        self._insisted = dict[VehicleId, tuple[int, str]]()
        """Command list and text of the last reported refusal of a command under insistence."""

    def judge_answers(self, now: Instant) -> None:
        """Check that vehicles in contact and commanded answer: an event `uplink` when a failure begins and ends."""
        for index, vehicle in enumerate(self._vehicles):
            missing = not vehicle.receives
            if missing:
                self._missed[index] = now
            if not missing and not self._unanswered:
                continue
            identity = vehicle.identity
            reported = identity in self._unanswered
            if missing and not reported and vehicle.member is Member.FLYING:
                self._unanswered.add(identity)
                self._log_event(now, "uplink", "is heard and answers nothing: it may not receive us", vehicle)
            elif reported and not missing:
                self._unanswered.remove(identity)
                self._log_event(now, "uplink", "answers again", vehicle)

    def judge_refusals(self, now: Instant) -> None:
        """Check that setpoints, and commands under insistence, are accepted.

        An event `disobeys` reports each that isn't, `obeys` that it is again.
        """
        for vehicle in self._vehicles:
            if vehicle.commands.insists or self._insisted:
                self._judge_insisted(vehicle, now)
            heartbeats = vehicle.telemetry.heartbeats
            for channel in vehicle.setpoint_channels:
                refused = channel.is_refused(heartbeats, now)
                reported = len(self._refused) > 0 and channel in self._refused
                if refused and not reported and vehicle.member is Member.FLYING:
                    self._refused.add(channel)
                    name = m.name_of("MAV_CMD", channel.command)
                    result = m.name_of("MAV_RESULT", channel.result)
                    text = f"refuses its setpoints: {name}: {result}{vehicle.telemetry.last_words}"
                    self._log_event(now, "disobeys", text, vehicle, {"order": name, "result": result})
                elif reported and channel.accepted:
                    self._refused.remove(channel)
                    name = m.name_of("MAV_CMD", channel.command)
                    self._log_event(now, "obeys", f"{name} is no longer refused", vehicle, {"order": name})

    def judge_silence(self, now: Instant) -> None:
        """Check that vehicles that answer also acknowledge their setpoints: events `uplink`, as in `judge_answers`."""
        for index, flier in enumerate(self._fliers):
            since, vehicle, missed = flier.since, flier.vehicle, self._missed[index]
            for channel in vehicle.setpoint_channels:
                silent = since is not None and channel.is_silent(max(since, missed), now)
                reported = len(self._silent) > 0 and channel in self._silent
                if silent == reported:
                    continue
                name = m.name_of("MAV_CMD", channel.command)
                if silent:
                    self._silent.add(channel)
                    text = f"answers, and doesn't acknowledge its setpoints: it may not receive {name}"
                    self._log_event(now, "uplink", text, vehicle, {"order": name})
                else:
                    self._silent.remove(channel)
                    text = "is acknowledged again" if since is not None else "is no longer sent"
                    self._log_event(now, "uplink", f"{name} {text}", vehicle, {"order": name})

    def _judge_insisted(self, vehicle: Vehicle, now: Instant) -> None:
        """Report a command under insistence that is refused, and when it has been carried out."""
        commands, reported = vehicle.commands, self._insisted.get(vehicle.identity)
        if commands.refused(now):
            words = vehicle.refusal
            if reported is None or reported[1] != words:
                text = f"refuses {words}, and is commanded again{vehicle.telemetry.last_words}"
                self._log_event(now, "disobeys", text, vehicle, {"order": words})
            self._insisted[vehicle.identity] = commands.lists, words
        elif reported is not None and commands.lists == reported[0]:
            self._log_event(now, "obeys", f"no longer refuses {reported[1]}", vehicle, {"order": reported[1]})
            del self._insisted[vehicle.identity]
        elif reported is not None and commands.outcome is not Outcome.WAITING:
            del self._insisted[vehicle.identity]

    def _refuses(self, vehicle: Vehicle, now: Instant) -> bool:
        if self._silent and any(channel in self._silent for channel in vehicle.setpoint_channels):
            return True
        heartbeats = vehicle.telemetry.heartbeats
        reported = (channel for channel in vehicle.setpoint_channels if channel in self._refused)
        return bool(self._refused) and any(channel.is_refused(heartbeats, now) for channel in reported)

    def judge_commands(self, now: Instant) -> None:
        """Check that acknowledged changes of mode and arming take effect."""
        for vehicle in self._vehicles:
            if not vehicle.effects.watching:
                continue
            before = vehicle.effects.missing
            vehicle.effects.update(vehicle.telemetry, now)
            missing, after_s = vehicle.effects.missing, vehicle.effects.missing_s
            if missing is not None and before is None:
                mode, armed = vehicle.autopilot.mode_name(vehicle.telemetry), vehicle.telemetry.armed
                text = f"acknowledged {missing} {after_s:.1f} s ago, and is still in {mode}"
                details: dict[str, Detail] = {"order": missing, "after_s": after_s, "mode": mode, "armed": armed}
                self._log_event(now, "disobeys", text, vehicle, details)
            elif missing is None and before is not None:
                self._log_event(now, "obeys", f"{before} is over", vehicle, {"order": before})

    def stand_down(self) -> None:
        """Stop expecting motion by setpoints: none are sent any more."""
        for flier in self._fliers:
            flier.since = None

    def judge_motion(self, tick: Tick, now: Instant) -> None:
        """Check that vehicles follow the setpoints of this and earlier ticks."""
        for flier in self._fliers:
            if not tick.active[flier.vehicle.index]:
                flier.since = None
            elif flier.since is None:
                flier.since = now
        if now < self._next_check:
            return
        self._next_check = Instant(now + round(CHECK_S * NANOSECONDS))
        filters, broken = self._controller.estimator.filters, [each for each in self._fliers if each.broken]
        for flier in self._fliers:
            vehicle, own = flier.vehicle, filters[flier.vehicle.index]
            state = unknown_state() if own.state is None else own.state
            if vehicle.autopilot.flies_courses:
                commanded_mps = self._controller.history.commanded(own.stamp, vehicle.index)[0]
                state = _by_course(state, vehicle.telemetry.motion, commanded_mps)
            at_limit = self.saturated[vehicle.index]
            found = flier.check(own.stamp, state, self._controller.history, now, saturated=at_limit)
            if found is not None:
                self._log_event(now, "disobeys", _words(found), vehicle, _figures(found))
            self.doubted[vehicle.index] = flier.doubted or self._refuses(vehicle, now)
            if flier.sinks:
                self.sinking.add(vehicle.identity)
            else:
                self.sinking.discard(vehicle.identity)
        for flier in broken:
            if not flier.broken:
                self._log_event(now, "obeys", "follows its setpoints again", flier.vehicle, {"order": "setpoints"})


def _by_course(state: FlightState, seen: ReportedMotion | None, commanded_mps: float) -> FlightState:
    """Return a state whose heading is that which has its course over ground at the airspeed commanded.

    The course was commanded for that airspeed: one that is slower keeps it by crabbing more.
    """
    shown = state.copy()
    if seen is not None:
        at_speed = state.copy()
        if commanded_mps > MIN_AIRSPEED_MPS:
            at_speed.airspeed_mps = commanded_mps
        shown.heading_rad = heading_shown(at_speed, seen.north_mps, seen.east_mps)
    return shown


def _words(found: NonConformance) -> str:
    scale, unit = {"airspeed": (1.0, "m/s"), "heading": (180 / math.pi, "°"), "height": (1.0, "m")}[found.channel]
    flown, expected = found.flown * scale, found.expected * scale
    return (
        f"acknowledges setpoints and doesn't follow them: {found.channel} changed by {flown:.1f} {unit} "
        f"in {found.over_s:.1f} s, {expected:.1f} {unit} expected"
    )


def _figures(found: NonConformance) -> dict[str, Detail]:
    return {"order": "setpoints", "channel": found.channel, "expected": found.expected, "flown": found.flown}
