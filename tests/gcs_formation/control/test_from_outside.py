"""What code from outside gets and may return: a law over all followers, a follower's feedback, a guidance, a predictor.

Its names, numbers and units are those of the documents; what it returns is checked and kept within the envelope.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

import pytest
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import VehicleId
from flight_model.autopilot_model import AutopilotModel, advance
from flight_model.curve import PathPoint
from flight_model.flight_state import FlightState
from flight_model.flight_state import Setpoint as Commanded
from flight_model.slot import UNKNOWN, Slot, Vector3
from formation_scenario import Scenario
from formation_scenario.extensions import Origin, Registered
from gcs_formation.control.law_interface import CycleInput, Lead
from gcs_formation.control.law_over_all import LawOverAll
from gcs_formation.control.outside import Feedback, three_numbers
from gcs_formation.control.own_guidance import OwnGuidance
from gcs_formation.control.own_predictor import OwnPrediction
from gcs_formation.control.plain_values import FollowerSlot, GuidedLeader, MeasuredVehicle, State, vehicle_name
from gcs_formation.control.setpoint import AS_DECIDED
from gcs_formation.errors import NotFiniteError, RunAbortedError
from gcs_formation.estimation.projection import MeasuredStates
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.guidance.leader_commands import LeaderCommand
from gcs_formation.guidance.leader_guidance import LeaderGuidance
from gcs_formation.guidance.tracking import RouteHeading
from tests.gcs_formation.control.scenarios import usual, with_vehicles

MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)
FINE = AutopilotModel(4.0, 1.5, 1.0, 3.0, 18.0, 25.0, 1.5, 0.25, 3.0)
LEADER = FlightState(10.0, 20.0, 100.0, 0.5, 22.0, 0.3, 1.0, -2.0)
FOLLOWERS = FlightState(-30.0, 5.0, 96.0, 0.0, 21.0, 0.2, 1.5, -2.5), FlightState(-60.0, 9.0, 0.0, 0.0, 20.0, 0.1, 0, 0)
SLOTS = Slot([0.0] * 3, [0.0] * 3, [0.0] * 3), Slot([-30.0, 20.0, -4.0], [0.0] * 3, [0.0] * 3)
DT_S = 0.1


def registered(kind: str, made: type[Any]) -> Registered:
    return Registered(kind, "it", made, 7, Origin("it.py", ""))


def three() -> Scenario:
    """Return a scenario in which vehicle 9 leads 4 and, in another network, 7: indices 0, 1 and 2."""
    return with_vehicles({"id": 4}, {"id": 7, "network": 2}, {"id": 9, "role": "leader"})


def three_by(frame: str) -> Scenario:
    """Return that scenario with its slots in another frame."""
    formation = three().formation.model_copy(update={"frame": frame})
    return three().model_copy(update={"formation": formation})


def plain(state: FlightState) -> State:
    """Return a state's eight numbers in the documents' order."""
    position = state.north_m, state.east_m, state.height_m
    return State(
        *position, state.airspeed_mps, state.heading_rad, state.climb_mps, state.wind_north_mps, state.wind_east_mps
    )


def measured(*states: FlightState, active: Sequence[bool] = (True, True, True)) -> MeasuredStates:
    count = len(states)
    stamps, acts = vec[i64]([2 * NANOSECONDS] * count), vec[i64]([3 * NANOSECONDS] * count)
    return MeasuredStates(list(states), stamps, list(active), acts)


def cycle(*, active: Sequence[bool] = (True, True, True), leader: int = 0) -> CycleInput:
    commands = [LeaderCommand(22.0, 0.3, 100.0, 0.0)] * 3
    return CycleInput(
        states=measured(LEADER, *FOLLOWERS, active=active),
        lead=Lead(leader, Instant(0), commands, RouteHeading(0.3, 0.0, 0.0, 0.0, 22.0)),
        slots=[*SLOTS, SLOTS[1]],
        history=SetpointHistory(10.0),
        wind_variance=[0.0] * 3,
        active=list(active),
        bandwidth=[[1.0] * 3] * 3,
        replaced=[AS_DECIDED] * 3,
    )


class Answering:
    """A law over all that answers what it is stated, and keeps what it is given."""

    def __init__(self, keys: Any) -> None:
        self.seen, self.answers = list[FollowerSlot](), dict[Any, Any]()

    def reset(self) -> None:
        self.answers = {}

    def setpoints(self, followers: list[FollowerSlot], dt_s: float) -> Mapping[Any, Any]:
        self.seen = followers
        return self.answers


def answering(answers: dict[Any, Any], frame: str = "leader_heading") -> tuple[LawOverAll, Answering]:
    law = LawOverAll(registered("law", Answering), three_by(frame), [MODEL, MODEL, FINE])
    inner = cast("Answering", law._law)
    inner.answers = answers
    return law, inner


@pytest.mark.parametrize("frame", ["leader_heading", "follower_heading", "north"])
def test_a_law_over_all_sees_each_active_follower_by_its_name_with_its_leader_slot_and_error(frame: str) -> None:
    """The error is where the slot is less where the follower is, along the frame's axes: forward, right and up."""
    law, inner = answering({4: (22.0, 0.2, 97.0)}, frame)
    decided = law.decide(cycle(active=(True, True, False)), DT_S)
    axis = {"leader_heading": 0.3, "follower_heading": 0.2, "north": 0.0}[frame]
    cos, sin = math.cos(axis), math.sin(axis)
    error_m = 40.0 * cos + 15.0 * sin - 30.0, 15.0 * cos - 40.0 * sin + 20.0, 100.0 - 96.0 - 4.0
    (seen,) = inner.seen
    assert (seen.id, seen.state, seen.leader) == (4, plain(FOLLOWERS[0]), plain(LEADER))
    assert (seen.slot_m, seen.speed_mps) == ((-30.0, 20.0, -4.0), (16.0, 28.0))
    assert seen.error_m == pytest.approx(error_m)
    assert [each.index for each in decided] == [1, 2]
    assert decided[0].setpoint == (22.0, 0.2, 97.0)
    assert decided[0].error_m == pytest.approx(error_m)
    assert decided[0].state is FOLLOWERS[0]
    assert math.isnan(decided[1].setpoint[0])
    assert all(math.isnan(each) for each in (*decided[0].mixed, *decided[0].gains))


def test_what_a_law_over_all_asks_for_is_kept_within_each_vehicles_speeds_and_heights() -> None:
    """By 3 m/s over 1 s + 3 s, a height setpoint is at most 12 m off; a vehicle of network 2 is named "2:7"."""
    law, _ = answering({4: (30.0, 3.0, 200.0), "2:7": (30.0, -9.0, -5.0)})
    first, second = law.decide(cycle(), DT_S)
    assert first.setpoint == (28.0, 3.0, 108.0)
    assert second.setpoint == (25.0, -9.0, -5.0)


def test_the_leader_is_not_commanded_by_a_law_over_all_whoever_leads() -> None:
    law, inner = answering({})
    inner.reset = lambda: inner.answers.update({9: (22.0, 0.0, 100.0), 4: (21.0, 0.0, 96.0)})  # type: ignore[method-assign]
    assert [each.index for each in law.decide(cycle(leader=2), DT_S)] == [0, 1]
    assert [each.id for each in inner.seen] == [9, 4]


def test_a_law_over_all_commands_those_behind_a_virtual_leader() -> None:
    law = LawOverAll(registered("law", Answering), with_vehicles({"id": 2}, {"id": 3}), [MODEL] * 3)
    cast("Answering", law._law).answers = {2: (22.0, 0.0, 96.0), 3: (22.0, 0.0, 0.0)}
    assert [each.setpoint for each in law.decide(cycle(), DT_S)] == [(22.0, 0.0, 96.0), (22.0, 0.0, 0.0)]


@pytest.mark.parametrize(
    ("answer", "words", "index"),
    [
        ((22.0, math.nan, 97.0), "setpoint: speed 22 m/s, heading nan rad, height 97 m", 1),
        ((math.inf, 0.5, 97.0), "setpoint: speed inf m/s, heading 0.5 rad, height 97 m", 1),
        ((22.0, 0.2), "no three numbers for vehicle 4: ValueError", None),
        (("fast", 0.2, 97.0), "no three numbers for vehicle 4: ValueError", None),
    ],
)
def test_a_law_over_all_owes_three_finite_numbers(answer: Any, words: str, index: int | None) -> None:
    law, _ = answering({4: answer, "2:7": (22.0, 0.0, 0.0)})
    with pytest.raises(NotFiniteError) as raised:
        law.decide(cycle(), DT_S)
    assert raised.value.found.startswith(words)
    assert raised.value.index == index


def test_names_are_those_that_a_scenario_writes() -> None:
    assert vehicle_name(VehicleId(1, 7)) == 7
    assert vehicle_name(VehicleId(2, 7)) == "2:7"


def test_three_numbers_are_floats_of_whatever_converts() -> None:
    assert three_numbers(iter((1, "2.5", True))) == (1.0, 2.5, 1.0)
    for wrong in ((1.0, 2.0), (1.0, 2.0, 3.0, 4.0)):
        with pytest.raises(ValueError, match="unpack"):
            three_numbers(wrong)


class Adding:
    """A feedback that returns what `answer` is."""

    answer: Any = (0.5, -0.1, 2.0)

    def __init__(self, keys: Any) -> None:
        self.given: Any = None
        self.excess: Any = None
        self.replaced: Any = None
        self.resets = 0

    def feedback(self, mixed: Vector3, slopes: Vector3, dt_s: float) -> Any:
        self.given = mixed, slopes, dt_s
        return self.answer

    def reset(self) -> None:
        self.resets += 1


def test_a_feedback_gets_errors_and_rates_and_what_limits_and_the_separation_rule_did() -> None:
    feedback = Feedback(registered("law", Adding), {}, 2)
    inner = cast("Adding", feedback._law)
    assert feedback.output((1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (True, False, True), DT_S) == (0.5, -0.1, 2.0)
    assert inner.given == ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0), DT_S)
    assert inner.replaced == (True, False, True)
    feedback.limited((0.1, 0.2, 0.3))
    assert inner.excess == (0.1, 0.2, 0.3)
    feedback.reset()
    assert (inner.excess, inner.replaced, inner.resets) == ((0.0, 0.0, 0.0), (False, False, False), 1)


@pytest.mark.parametrize(
    ("answer", "words", "index"),
    [
        ((0.5, math.nan, 2.0), "feedback: speed 0.5 m/s, heading nan rad, height 2 m", 2),
        ((0.5, 0.1), "TypeError: returned (0.5, 0.1); allowed: three numbers: speed m/s, heading rad, height m", None),
        (None, "TypeError: returned None; allowed: three numbers", None),
    ],
)
def test_a_feedback_owes_three_finite_numbers(answer: Any, words: str, index: int | None) -> None:
    feedback = Feedback(registered("law", Adding), {}, 2)
    cast("Adding", feedback._law).answer = answer
    with pytest.raises(NotFiniteError, match=r"law 'it'") as raised:
        feedback.output(UNKNOWN, UNKNOWN, AS_DECIDED, DT_S)
    assert raised.value.found.startswith(words)
    assert raised.value.index == index


class Broken:
    """It can't begin."""

    def __init__(self, keys: Any) -> None:
        raise KeyError("gone")


def test_what_cannot_begin_ends_the_run_with_its_file_and_line() -> None:
    with pytest.raises(RunAbortedError, match=r"law 'it' can't begin: KeyError: 'gone' \(it.py, line 7\)"):
        Feedback(registered("law", Broken), {}, 0)


class Steering:
    """A guidance that answers by what it is given."""

    def __init__(self, keys: Any) -> None:
        self.answer: Callable[[GuidedLeader], Any] = lambda leader: (21, leader.usual.heading_rad + 0.1, 99.0)
        self.failing = False
        self.seen: list[GuidedLeader] = []

    def steer(self, leader: GuidedLeader) -> Any:
        self.seen.append(leader)
        return self.answer(leader)

    def reset(self) -> None:
        if self.failing:
            raise RuntimeError("no")


class Curve:
    """A route of 500 m that bends to the right and rises."""

    length_m = 500.0

    def at(self, distance_m: float) -> PathPoint:
        return PathPoint(distance_m, 2.0, 103.0, 0.25, 0.004, 1e-9, 0.05)


def steering() -> tuple[OwnGuidance, Steering, LeaderGuidance]:
    own = OwnGuidance(registered("guidance", Steering), {}, DT_S)
    guidance = LeaderGuidance(usual().written_path, 22.0, 100.0, 20.0, 0.1, 3.0)
    guidance.route, guidance.distance_m = guidance.path, 60.0
    return own, cast("Steering", own._own), guidance


def test_a_guidance_gets_the_leader_its_route_and_what_our_own_commands() -> None:
    own, inner, guidance = steering()
    found = own.steer(guidance, Commanded(22.5, 0.4, 101.0), LEADER, MODEL)
    assert (found.speed_mps, found.heading_rad, found.height_m) == (21.0, 0.5, 99.0)
    (leader,) = inner.seen
    assert leader.state == plain(LEADER)
    assert (leader.distance_m, leader.length_m, leader.on_path) == (60.0, pytest.approx(4000.0), True)
    assert (leader.speed_mps, leader.turn_rate_max_rps, leader.tau_psi_s, leader.dt_s) == (22.0, 0.25, 1.5, DT_S)
    assert leader.usual == (22.5, 0.4, 101.0)


def test_a_guidance_sees_its_routes_points_on_the_way_to_the_path_too() -> None:
    own, inner, guidance = steering()
    guidance.route = Curve()
    own.steer(guidance, Commanded(22.5, 0.4, 101.0), LEADER, MODEL)
    assert (inner.seen[0].length_m, inner.seen[0].on_path) == (500.0, False)
    assert inner.seen[0].route(75.0) == (75.0, 2.0, 103.0, 0.25, 0.004, 0.05)


def test_a_guidance_owes_three_finite_numbers_and_a_reset_that_works() -> None:
    own, inner, guidance = steering()
    inner.answer = lambda _: (21.0, math.inf, 99.0)
    with pytest.raises(NotFiniteError) as raised:
        own.steer(guidance, Commanded(22.5, 0.4, 101.0), LEADER, MODEL)
    assert raised.value.found == "setpoint: speed 21 m/s, heading inf rad, height 99 m"
    assert raised.value.index is None
    inner.answer = lambda _: (21.0, 0.0)
    with pytest.raises(NotFiniteError, match="guidance 'it': ValueError"):
        own.steer(guidance, Commanded(22.5, 0.4, 101.0), LEADER, MODEL)
    assert own.reset() is None
    inner.failing = True
    assert str(own.reset()).startswith("guidance 'it': RuntimeError: no")


class Predicting:
    """A predictor that counts its calls, and says that everything stays, 1 m to the north."""

    def __init__(self, keys: Any) -> None:
        self.taken: tuple[MeasuredVehicle, ...] = ()
        self.calls = list[tuple[MeasuredVehicle, float, MeasuredVehicle]]()
        self.answer: Callable[[State], Sequence[Any]] = lambda state: (state.north_m + 1.0, *state[1:])

    def take(self, vehicles: tuple[MeasuredVehicle, ...]) -> None:
        self.taken = vehicles

    def predict(self, vehicle: MeasuredVehicle, to_s: float, follower: MeasuredVehicle) -> Sequence[Any]:
        self.calls.append((vehicle, to_s, follower))
        return self.answer(vehicle.state)


def predicting(history: SetpointHistory) -> tuple[OwnPrediction, Predicting]:
    own = OwnPrediction(registered("predictor", Predicting), {}, three(), history, [MODEL] * 3)
    return own, cast("Predicting", own._own)


def at_once() -> MeasuredStates:
    """Return states stamped at 1.5 s, 1.6 s and 1.7 s, for setpoints that act at 2, 2.25 and 2.5 s."""
    stamps, acts = ([round(each * NANOSECONDS) for each in times] for times in ((1.5, 1.6, 1.7), (2.0, 2.25, 2.5)))
    return MeasuredStates([LEADER, *FOLLOWERS], vec[i64](stamps), [True, True, False], vec[i64](acts))


def test_a_predictor_gets_what_is_measured_and_its_states_are_used_with_the_updraught_kept() -> None:
    own, inner = predicting(SetpointHistory(10.0))
    assert own.predict(at_once()) is own
    assert [each.id for each in inner.taken] == [9, 4, "2:7"]
    assert [each.stamp_s for each in inner.taken] == [1.5, 1.6, 1.7]
    assert [each.acts_s for each in inner.taken] == [2.0, 2.25, 2.5]
    assert [each.active for each in inner.taken] == [True, True, False]
    assert [each.state for each in inner.taken] == [plain(each) for each in (LEADER, *FOLLOWERS)]
    assert own.instant(1) == 2_250_000_000
    found = own.of(0, 1)
    assert plain(found) == (11.0, *plain(LEADER)[1:])
    assert own.of(0, 1) is found
    assert [(vehicle.id, to_s, follower.id) for vehicle, to_s, follower in inner.calls] == [(9, 2.25, 4)]
    own.predict(at_once())
    assert own.of(0, 1) is not found, "a new tick is predicted again"


def test_a_predictor_can_ask_for_the_model_and_for_the_setpoints_in_flight() -> None:
    """By (7) from 1.6 s on, with the setpoint that acts from 1.8 s; before its stamp a state is the measured one."""
    history = SetpointHistory(10.0)
    own, inner = predicting(history)
    own.predict(at_once())
    assert all(math.isnan(each) for each in inner.taken[1].setpoint_at(2.0)), "nothing was sent"
    for acts_s, speed_mps in ((1.0, 21.0), (1.8, 24.0)):
        history.begin_tick(vec[i64]([round(acts_s * NANOSECONDS)] * 3))
        history.record([(22.0, 0.3, 100.0), (speed_mps, 0.2, 96.0), (22.0, 0.0, 100.0)])
    follower = inner.taken[1]
    assert [follower.setpoint_at(at_s).speed_mps for at_s in (1.7, 1.8, 2.2)] == [21.0, 24.0, 24.0]
    by_model = FOLLOWERS[0].copy()
    advance(by_model, MODEL, 21.0, 0.2, 96.0, 0.2)
    advance(by_model, MODEL, 24.0, 0.2, 96.0, 0.4)
    assert follower.by_model(2.2) == pytest.approx(plain(by_model))
    assert follower.by_model(1.0) == plain(FOLLOWERS[0]) == follower.state


@pytest.mark.parametrize(
    ("answer", "words", "index"),
    [
        (lambda state: [math.nan, *state[1:]], "state: north_m nan, east_m 20, height_m 100, airspeed_mps 22", 0),
        (lambda state: state[:7], "ValueError: found 7 numbers; allowed: 8", None),
        (lambda state: [*state, 1.0], "ValueError: found 9 numbers; allowed: 8", None),
    ],
)
def test_a_predictor_owes_eight_finite_numbers(answer: Any, words: str, index: int | None) -> None:
    own, inner = predicting(SetpointHistory(10.0))
    own.predict(at_once())
    inner.answer = answer
    with pytest.raises(NotFiniteError) as raised:
        own.of(0, 1)
    assert raised.value.found.startswith(words)
    assert raised.value.index == index


def test_each_number_of_a_predictors_state_has_its_place() -> None:
    own, inner = predicting(SetpointHistory(10.0))
    own.predict(at_once())
    inner.answer = lambda _: (1, 2, 3, 4, 5, 6, 7, 8)
    assert own.of(2, 1).values() == (1.0, 2.0, 3.0, 6.0, 4.0, 5.0, 7.0, 8.0, 0.0)
