"""What a predictor, the guidance or a law returns that isn't finite ends a flight; a vehicle's NaN doesn't."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from librt.strings import BytesWriter

import gcs_formation
from airlink.messages import Message
from flight_model.flight_state import FlightState
from flight_model.slot import UNKNOWN, Vector3
from formation_scenario import load_scenario
from gcs_formation.control import laws
from gcs_formation.control.follower import FollowerController
from gcs_formation.control.follower_loops import LawInput
from gcs_formation.control.law_interface import CycleInput, Law, LawOutput
from gcs_formation.control.laws import FormationLaw, LawKind, VelocityController, formation_law, law_parameters
from gcs_formation.estimation.projection import States
from gcs_formation.phases import Phase
from gcs_formation.studies import Study
from gcs_formation.studies.flight import Task, fly
from gcs_formation.studies.plan import Planned
from gcs_formation.vehicle.member import Member
from tests.flights.conftest import scenario
from tests.flights.in_memory import World

BEGINS_S = 10.0


class Broken(Law):
    """Another law, one number of which is replaced for vehicle 2 after a while."""

    def __init__(self, law: Law, change: Callable[[LawOutput], None]) -> None:
        self._law, self._change, self._passed_s = law, change, 0.0

    def decide(self, cycle_input: CycleInput, dt_s: float) -> list[LawOutput]:
        self._passed_s += dt_s
        decided = self._law.decide(cycle_input, dt_s)
        if self._passed_s > BEGINS_S:
            for each in decided:
                if each.index == 1:
                    self._change(each)
        return decided

    def retune(self, parameters: Any) -> None:
        self._law.retune(parameters)


class Feedback(FollowerController):
    """A law of one's own, which adds a number to its feedback."""

    more = 0.0

    def _output(self, slopes: Vector3, right_share: float, pair: LawInput, dt_s: float) -> Vector3:
        speed, heading, height = super()._output(slopes, right_share, pair, dt_s)
        return speed + self.more, heading, height


class HoveringFeedback(VelocityController):
    """The same of a multirotor, added to its height."""

    more = 0.0

    def _output(self, slopes: Vector3, right_share: float, pair: LawInput, dt_s: float) -> Vector3:
        speed, right, height = super()._output(slopes, right_share, pair, dt_s)
        return speed, right, height + self.more


class Predictor(States):
    """Another predictor's states, of which one vehicle's heading is replaced."""

    def __init__(self, states: States, which: int, value: float) -> None:
        self._states, self._which, self._value = states, which, value

    def of(self, which: int, whose: int) -> FlightState:
        state = self._states.of(which, whose).copy()
        if which == self._which:
            state.heading_rad = self._value
        return state

    def instant(self, whose: int) -> int:
        return self._states.instant(whose)


def ended_safely(flown: World) -> str:
    """Run to the end; return why the flight failed, which ended as failures do: every vehicle loiters, at its height.

    Until then all were commanded at every tick, by finite setpoints.
    """
    flown.run()
    station = flown.station
    assert station.flight.phase is Phase.FAILED
    heights_m = sorted(flown.vehicle(each).body.motion.height_m for each in (1, 2, 3))
    assert min(np.diff(heights_m)) > 10.0
    assert {event.vehicle: event.text for event in flown.recorder.events if event.kind == "mode"} == dict.fromkeys(
        station.vehicles, "LOITER"
    )
    flying = [tick for tick in flown.recorder.ticks if tick.phase in {"flying", "ending"}]
    assert np.isfinite([tick.setpoints for tick in flying]).all()
    assert len(flown.words("failure")) == 1
    assert station.phase_machine.failure is not None
    return station.phase_machine.failure


def changed(channel: int, value: float) -> Callable[[LawOutput], None]:
    """Return what replaces one channel of a setpoint."""

    def change(decided: LawOutput) -> None:
        speed, heading, height = (value if i == channel else each for i, each in enumerate(decided.setpoint))
        decided.setpoint = speed, heading, height

    return change


def error_lost(decided: LawOutput) -> None:
    decided.error_m = (0.0, math.nan, 0.0)


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (changed(0, math.nan), "setpoint: airspeed (m/s) nan, heading (rad) "),
        (changed(1, math.inf), ", heading (rad) inf, "),
        (error_lost, "error: forward (m) 0, right (m) nan, up (m) 0"),
    ],
)
def test_a_law_that_returns_what_is_not_finite_is_named(change: Callable[[LawOutput], None], found: str):
    flown = World()
    flown.station.controller._law = Broken(flown.station.controller._law, change)
    failure = ended_safely(flown)
    assert failure.startswith("what the law returned for vehicle 2 at 4.7 s is not finite: ")
    assert found in failure


def test_no_limit_hides_feedback_that_is_not_finite():
    flown = World()
    controller = flown.station.controller
    law = controller._law = FormationLaw(law_parameters(flown.station.scenario), controller.models, Feedback)
    flown.fly_to(3.0)
    third = law._controllers[2]
    assert isinstance(third, Feedback)
    third.more = math.inf
    assert ended_safely(flown).startswith("what the law returned for vehicle 3 at 3.0 s is not finite: setpoint: airs")


def test_hovering_vehicles_stop_first():
    flown = World(
        vehicles={"count": 3, "autopilot": "arducopter"},
        path={"speed_mps": 5, "waypoints_m": [[0, 0, 40], [500, 0, 40]]},
    )
    controller = flown.station.controller
    law = controller._law = FormationLaw(law_parameters(flown.station.scenario), controller.models, HoveringFeedback)
    flown.fly_to(3.0)
    second = law._controllers[1]
    assert isinstance(second, HoveringFeedback)
    second.more = math.inf
    flown.run()
    assert (flown.station.phase_machine.failure or "").startswith(
        "what the law returned for vehicle 2 at 3.0 s is not finite"
    )
    assert all(abs(flown.vehicle(each).body.motion.airspeed_mps) < 0.5 for each in (1, 2, 3))
    assert {each.setpoints[2][0] for each in flown.recorder.ticks if each.phase == "ending"} == {0.0}


@pytest.mark.parametrize(("which", "value"), [(0, math.inf), (2, math.nan)])
def test_a_predictor_that_returns_what_is_not_finite_is_named(which: int, value: float):
    flown = World()
    controller = flown.station.controller
    flown.fly_to(3.0)
    predict = controller._projection
    controller._projection = lambda measured: Predictor(predict(measured), which, value)
    failure = ended_safely(flown)
    assert failure.startswith(f"what the predictor returned for vehicle {which + 1} at 3.0 s is not finite: state: nor")
    assert f"heading (rad) {value:g}" in failure


def test_an_estimate_that_is_not_finite_leaves_its_vehicle_to_loiter_and_the_others_are_commanded():
    flown = World()
    filters = flown.station.controller.estimator.filters
    flown.fly_to(3.0)
    known = filters[1].state
    assert known is not None
    known.north_m = math.nan
    flown.run(0.2)
    assert "vehicle 2 at 3.0 s" in (flown.station.phase_machine.failure or "")
    assert [each is UNKNOWN for each in flown.recorder.ticks[-1].setpoints] in ([False, True, False], [False] * 3)


def guidance_setpoint(flown: World) -> None:
    guidance = flown.station.controller.guidance
    guidance.speed_mps = math.nan


def guidance_slot(flown: World) -> None:
    plan = flown.station.controller.plan
    slots = plan.at(flown.now_s, begun=True)
    slots.each[1].right_m = math.inf


@pytest.mark.parametrize(("breaks", "found"), [(guidance_setpoint, "vehicle 1"), (guidance_slot, "vehicle 2")])
def test_guidance_that_returns_what_is_not_finite_is_named(breaks: Callable[[World], None], found: str):
    flown = World()
    flown.fly_to(3.0)
    breaks(flown)
    assert ended_safely(flown).startswith(f"what the guidance returned for {found} at 3.0 s is not finite: ")


def test_a_law_that_divides_by_zero_ends_its_flight_in_words():
    flown = World()

    def divide(decided: LawOutput) -> None:
        decided.error_m = (1.0 / (decided.error_m[0] * 0.0), 0.0, 0.0)

    flown.station.controller._law = Broken(flown.station.controller._law, divide)
    assert ended_safely(flown).endswith(" s: ZeroDivisionError: float division by zero")


@pytest.mark.parametrize("value", [math.nan, -math.inf])
def test_what_a_vehicle_tells_never_ends_a_flight(value: float):
    """Every float of vehicle 2's messages from some time on: it is left to loiter, and the others fly on."""
    flown = World(law={"max_age_s": 2})
    flown.fly_to(3.0)
    spoilt = set[str]()
    for stream in flown.vehicle(2).streams._streams:

        def reported(vehicle: Any, build: Callable[[Any], Message] = stream.build) -> Message:
            message = build(vehicle)
            floats = {name: value for name, each in message.values().items() if isinstance(each, float)}
            floats = {name: each for name, each in floats.items() if _can_be_sent(message, name, each)}
            spoilt.update(f"{type(message).__name__}.{name}" for name in floats)
            return message.but(**floats)

        stream.build = reported
    flown.fly_to(12.0)
    station = flown.station
    assert {"Attitude.yaw_rad", "VfrHud.airspeed_mps", "VfrHud.climb_mps"} <= spoilt
    assert (station.flight.phase, station.phase_machine.failure, station.controller.fault) == (Phase.FLYING, None, None)
    assert [vehicle.member for vehicle in station.vehicles.values()] == [Member.FLYING, Member.HOLDING, Member.FLYING]


def _can_be_sent(message: Message, name: str, value: float) -> bool:
    """Return whether a field is a float on the wire too; integers have no NaN."""
    try:
        message.but(**{name: value}).write(BytesWriter())
    except (ValueError, OverflowError):
        return False
    return True


@pytest.mark.slow
def test_the_record_is_complete_and_the_command_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def make(scenario: Any, models: Any) -> Law:
        return Broken(formation_law(scenario, models), changed(0, math.nan))

    monkeypatch.setitem(laws.LAWS, "pid", LawKind("PID", make))
    with pytest.raises(gcs_formation.RunAbortedError, match=r"law returned for vehicle 2 at .* airspeed .* nan"):
        gcs_formation.run(scenario(law={"type": "pid"}), clock="virtual", out=tmp_path / "run")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert "airspeed (m/s) nan" in summary["failure"]
    assert summary["duration_s"] == pytest.approx(4.7, abs=0.05)
    assert len(pq.read_table(tmp_path / "run" / "timeseries.parquet")) > 100

    study = Study(record="none")
    rows = [
        fly(Task(Planned(i, 1, {}), study, load_scenario(scenario(law={"type": law}))))
        for i, law in enumerate(("pid", "fuzzy_pid"))
    ]
    assert [row["exit"] for row in rows] == [3, 0]
    assert "airspeed (m/s) nan" in rows[0]["words"]
