"""What stages of the core do, each with a cycle that has what it reads."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from gcs_formation.core import commanding
from gcs_formation.core.connecting import Begin, Commands, Links, Restarts, Start
from gcs_formation.core.cycle import Findings
from gcs_formation.core.each_second import Heartbeats, OwnParts, Strangers, commands_anybody
from gcs_formation.core.estimating import Estimates, Members, Samples
from gcs_formation.core.parts import Parts
from gcs_formation.core.recording import Events, LookOn, Record
from gcs_formation.core.sending import End, Phases, Setpoints, StandIns
from gcs_formation.link.link_health import LinkState
from gcs_formation.phases import Cause, Phase

NOW = after(Instant(0), 30.0)
COMMANDED = (Phase.ASSEMBLING, Phase.FLYING, Phase.ENDING)


def vehicle(column: int, **more: Any) -> Any:
    return SimpleNamespace(index=column, identity=column + 1, **more)


def cycle(phase: Phase = Phase.FLYING, **more: Any) -> Any:
    """Return a cycle that moves to another phase whenever it is asked to."""
    machine = Mock()
    machine.move.return_value = True
    flight = SimpleNamespace(phase=phase, ended=phase in (Phase.DONE, Phase.FAILED), mission_time_s=lambda _: 20.0)
    return SimpleNamespace(
        now=NOW, phase_machine=machine, flight=flight, phase=phase, log_event=Mock(), send=Mock(), **more
    )


def test_a_restart_is_said_once_and_only_that_vehicles_filter_begins_again() -> None:
    made = cycle(each=[vehicle(index, restarts=0, is_left=False) for index in (0, 1)], restarted=[], controller=Mock())
    stage = Restarts(made)
    stage.run(made)
    assert made.restarted == []
    made.each[1].restarts = 1
    stage.run(made)
    assert made.restarted == [1]
    made.controller.estimator.restart_filter.assert_called_once_with(1)
    made.log_event.assert_called_once_with(NOW, "restarted", "its clock has begun again", made.each[1])
    stage.run(made)
    assert made.restarted == [], "handled"
    made.each[1].restarts, made.each[1].is_left = 2, True
    stage.run(made)
    assert made.restarted == [1]
    assert "it stays its pilot's" in made.log_event.call_args.args[2]


@pytest.mark.parametrize("phase", list(Phase))
@pytest.mark.parametrize("ready", [True, False])
@pytest.mark.parametrize("passed", [True, False])
def test_the_formation_begins_to_be_commanded_once_its_leader_is_ready_and_the_gate_lets_it(
    phase: Phase, *, ready: bool, passed: bool
) -> None:
    made = cycle(phase, beginning=Mock(), decide=Mock(), begins=False)
    made.beginning.may_begin.return_value = ready
    gate: Any = SimpleNamespace(passed=passed)
    Begin(gate).run(made)
    begins = phase is Phase.CONNECTING and ready and passed
    assert made.begins is begins
    assert made.phase_machine.move.called is begins
    made.decide.assert_called_once_with()


def test_each_vehicle_gets_the_command_that_is_due_and_no_other() -> None:
    due = [Mock(), Mock(), Mock()]
    for commands, message in zip(due, ("first", None, "third"), strict=True):
        commands.due.return_value = message
    made = cycle(each=[vehicle(column, commands=commands) for column, commands in enumerate(due)])
    Commands().run(made)
    made.send.assert_called_once_with([(made.each[0], "first"), (made.each[2], "third")], NOW)


def test_samples_are_of_this_cycle_alone_and_the_leader_is_known_as_such() -> None:
    """A virtual leader, column 0, reports nothing; what a vehicle reported before isn't taken twice."""
    new = Mock(side_effect=["one", None])
    fliers = [vehicle(column, sampler=SimpleNamespace(new=new), flew=column == 1) for column in (1, 2)]
    made = cycle(each=fliers, samples=["old", "old", "old"], controller=SimpleNamespace(plan=SimpleNamespace(leader=2)))
    Samples().run(made)
    assert made.samples == [None, "one", None]
    assert [call.kwargs for call in new.call_args_list] == [
        {"flew": True, "leads": False},
        {"flew": False, "leads": True},
    ]


@pytest.mark.parametrize("phase", list(Phase))
def test_membership_is_decided_until_all_loiter(phase: Phase) -> None:
    findings = SimpleNamespace(beyond={2}, waiting={3})
    made = cycle(phase, reconfiguration=Mock(), controller=Mock(), findings=findings, membership=Mock())
    Members().run(made)
    assert made.membership.update.called is (phase is not Phase.LOITERING)
    assert made.membership.update_at_end.called is (phase is Phase.LOITERING)
    if made.membership.update.called:
        connecting, given = phase is Phase.CONNECTING, made.membership.update.call_args.kwargs
        assert given["connecting"] is connecting
        assert given["beyond"] == ({2, 3} if connecting else {2}), "who waits is led as soon as there is a leader"
    assert (findings.beyond, findings.waiting) == ({2}, {3})


def reported(state: LinkState, *, acted: bool = False, own: Any = None, failure: Any = None) -> Any:
    return vehicle(
        0,
        connection=SimpleNamespace(state=state),
        start_up=SimpleNamespace(acted=acted),
        round_trips=SimpleNamespace(own=own),
        autopilot=SimpleNamespace(failure=failure),
    )


@pytest.mark.parametrize("phase", list(Phase))
@pytest.mark.parametrize("acted", [True, False])
@pytest.mark.parametrize("state", list(LinkState))
def test_a_vehicle_is_commanded_from_the_first_step_of_its_start_up_until_all_is_over(
    phase: Phase, state: LinkState, *, acted: bool
) -> None:
    """One that was never heard isn't."""
    made = cycle(phase, each=[reported(state, acted=acted)])
    expected = state is not LinkState.SEARCHING and (acted or phase in (*COMMANDED, Phase.LOITERING))
    assert commands_anybody(made) is expected


@pytest.mark.parametrize("of", ["estimator", "family", "both", "neither"])
def test_a_part_of_an_extension_that_has_failed_ends_the_run_by_its_error(of: str) -> None:
    own = SimpleNamespace(failure="estimator" if of in ("estimator", "both") else None)
    failure = "family" if of in ("family", "both") else None
    made = cycle(each=[reported(LinkState.CONNECTED), reported(LinkState.CONNECTED, own=own, failure=failure)])
    OwnParts().run(made)
    if of == "neither":
        assert not made.phase_machine.fail_by.called
    else:
        made.phase_machine.fail_by.assert_called_once_with("family" if of == "family" else "estimator", NOW, begun=True)


@pytest.mark.parametrize("phase", COMMANDED)
@pytest.mark.parametrize("started", [True, False])
@pytest.mark.parametrize("mission_s", [math.nan, 59.9, 60.0])
def test_the_path_begins_once_as_the_leader_passes_its_start_unless_its_time_is_over(
    phase: Phase, mission_s: float, *, started: bool
) -> None:
    guidance = SimpleNamespace(guidance=SimpleNamespace(started=started))
    made = cycle(
        phase, opening=None, mission_s=mission_s, scenario=SimpleNamespace(duration_s=60.0), controller=guidance
    )
    heartbeats = Mock()
    Phases(heartbeats, 45.0).run(made)
    begins = phase is Phase.ASSEMBLING and started and not mission_s >= 60.0
    assert heartbeats.hasten.called is begins
    assert [call.args[0] for call in made.phase_machine.move.call_args_list] == [Cause.PATH_BEGUN] * begins
    made.phase_machine.end_in_time.assert_called_once_with(45.0, NOW)


@pytest.mark.parametrize("may_leave", [True, False])
def test_at_the_end_vehicles_leave_when_they_may_and_no_time_ends_it_again(*, may_leave: bool) -> None:
    opening = Mock()
    opening.may_leave.return_value = may_leave
    of = SimpleNamespace(guidance=SimpleNamespace(started=True))
    made = cycle(Phase.ENDING, opening=opening, mission_s=9.0, scenario=SimpleNamespace(duration_s=60.0), controller=of)
    Phases(Mock(), math.inf).run(made)
    assert [call.args[0] for call in made.phase_machine.move.call_args_list] == [Cause.OPENED] * may_leave
    assert not made.phase_machine.end_in_time.called


@pytest.mark.parametrize("phase", list(Phase))
def test_a_run_is_brought_to_its_end_where_it_is_over(phase: Phase) -> None:
    made = cycle(phase)
    End().run(made)
    assert made.phase_machine.bring_to_end.called is (phase in (Phase.ENDING, Phase.LOITERING))


@pytest.mark.parametrize("fault", [None, "the law's error"])
def test_a_ticks_events_are_recorded_and_a_law_that_failed_ends_the_run(fault: str | None) -> None:
    made = cycle(
        tick=SimpleNamespace(events=["held", "avoids"]), controlled_ticks=7, controller=SimpleNamespace(fault=fault)
    )
    recorder = Mock()
    Events(recorder).run(made)
    assert [call.args for call in recorder.event.call_args_list] == [("held",), ("avoids",)]
    assert made.controlled_ticks == 8
    assert [call.args for call in made.phase_machine.fail_by.call_args_list] == [(fault, NOW)] * (fault is not None)


@pytest.mark.parametrize(
    ("phase", "airborne", "recorded", "records", "orders"),
    [
        (Phase.CONNECTING, False, 0, False, True),
        (Phase.CONNECTING, True, 0, True, True),
        (Phase.LOITERING, False, 5, True, True),
        (Phase.DONE, True, 5, False, False),
        (Phase.FAILED, True, 0, False, False),
    ],
)
def test_who_is_not_commanded_is_recorded_from_the_first_take_off_to_the_end(
    phase: Phase, recorded: int, *, airborne: bool, records: bool, orders: bool
) -> None:
    """Of a vehicle that was never heard nothing is known."""
    heard = SimpleNamespace(extrapolated=lambda _: ("state", 0.1))
    never = SimpleNamespace(extrapolated=lambda _: None)
    fliers = [vehicle(0, airborne=False, sampler=never), vehicle(1, airborne=airborne, sampler=heard)]
    made = cycle(phase, each=fliers, recorded_ticks=recorded, newest=None, controller=Mock(), findings=Mock())
    given, dispatch, recorder = Mock(), Mock(), Mock()
    dispatch.links.return_value = ["links"], 0.0
    LookOn(given, dispatch, recorder).run(made)
    assert (given.advance.called, recorder.tick.called) == (orders, records)
    assert made.recorded_ticks == recorded + records
    if records:
        made.controller.look_on.assert_called_once_with(NOW, 20.0, phase.value, ["links"], {1: ("state", 0.1)})
        assert made.newest is recorder.tick.call_args.args[0]


def test_what_is_lost_of_the_leaders_frames_is_known_to_the_law_as_its_links_loss() -> None:
    """Followers' losses don't go into their links: the law follows the leader."""
    links = [SimpleNamespace(loss=0.0, mean_gap=1.0) for _ in range(2)]
    findings = SimpleNamespace(
        doubted=[False] * 2,
        losses={1: SimpleNamespace(loss=0.4, mean_gap=3.0), 2: SimpleNamespace(loss=0.2, mean_gap=2.0)},
    )
    of = SimpleNamespace(plan=SimpleNamespace(leader=1))
    made = cycle(controller=of, findings=findings, vehicles={1: vehicle(0), 2: vehicle(1)})
    dispatch = Mock()
    dispatch.links.return_value = links, 0.25
    commanding.Delays(dispatch).run(made)
    assert made.hold_s == 0.25
    assert [(each.loss, each.mean_gap) for each in made.links] == [(0.0, 1.0), (0.2, 2.0)]


@pytest.mark.parametrize(
    ("stage", "does"),
    [
        (commanding.OwnFilters(), "filter"),
        (commanding.SetpointsTaken(), "take_final"),
        (commanding.OwnMonitors(), "monitor"),
        (commanding.Assembled(), "conclude"),
    ],
)
def test_a_tick_passes_filters_history_monitors_and_the_watch_on_assembly(stage: Any, does: str) -> None:
    made = cycle(controller=Mock(), tick="tick")
    stage.run(made)
    assert [(name, given) for name, given, _ in made.controller.method_calls] == [(does, ("tick",))]


@pytest.mark.parametrize("led", [True, False])
def test_there_are_setpoints_where_there_is_a_leader_and_the_law_has_what_is_known_of_loops(*, led: bool) -> None:
    made = cycle(controller=Mock(), tick="tick", findings=Mock(bandwidth=[[0.5]]), late=True, follow_leader=Mock())
    made.controller.follow.return_value = led
    commanding.Leader().run(made)
    made.follow_leader.assert_called_once_with(led=led)
    commanding.Law().run(made)
    made.controller.decide.assert_called_once_with("tick", [[0.5]], begin_regardless=True)
    assert made.measured is made.controller.decide.return_value


@pytest.mark.parametrize("ends", [True, False])
def test_orders_are_given_at_any_time_and_shapes_change_until_the_flight_ends(*, ends: bool) -> None:
    made, orders = cycle(last_tick="before", reconfiguration=Mock()), Mock()
    made.phase_machine.opening = "ending" if ends else None
    commanding.Wanted(orders).run(made)
    orders.advance.assert_called_once_with(NOW)
    assert [call.args for call in made.reconfiguration.advance.call_args_list] == [(NOW, 20.0)] * (not ends)
    made.phase_machine.waited_long_enough.assert_called_once_with("before", NOW)
    assert (made.mission_s, made.opening) == (20.0, made.phase_machine.opening)


@pytest.mark.parametrize(("in_order", "changed"), [(True, True), (False, True), (False, False)])
def test_a_link_whose_state_changes_is_recorded_and_one_in_order_is_not_looked_at(
    *, in_order: bool, changed: bool
) -> None:
    connection, log_link, several = Mock(), Mock(), Mock()
    connection.in_order.return_value, connection.check.return_value = in_order, changed
    made = cycle(each=[vehicle(0, connection=connection, sequence=SimpleNamespace(loss=0.25))])
    Links(log_link, several).run(made)
    several.choose_link.assert_called_once_with(NOW)
    assert [call.args for call in connection.check.call_args_list] == [(NOW, 0.25)] * (not in_order)
    assert log_link.called is (changed and not in_order)


@pytest.mark.parametrize("rehearsed", [True, False])
def test_vehicles_are_asked_before_they_are_started_and_a_rehearsal_ends_then(*, rehearsed: bool) -> None:
    made, gate, starting = cycle(beginning=Mock()), Mock(rehearsed=rehearsed), Mock()
    gate.requests.return_value, made.beginning.requests.return_value = ["parameters"], ["mission"]
    Start(gate, starting).run(made)
    made.send.assert_called_once_with(["parameters", "mission"], NOW)
    gate.open_if_ready.assert_called_once_with()
    starting.advance.assert_called_once_with(NOW)
    assert [call.args for call in made.phase_machine.end_rehearsal.call_args_list] == [(NOW,)] * rehearsed


def test_what_is_due_once_a_second_is_sent() -> None:
    made, scheduler, dispatch, watch = cycle(), Mock(), Mock(), Mock()
    Strangers(watch).run(made)
    watch.assert_called_once_with(NOW)
    Heartbeats(scheduler, dispatch).run(made)
    scheduler.heartbeats.assert_called_once_with(20.0, dispatch.unguided.return_value, NOW)
    made.send.assert_called_once_with(scheduler.heartbeats.return_value, NOW)


def test_setpoints_are_handed_over_and_predicted_by_as_they_are_held() -> None:
    made, dispatch, recorder = cycle(tick="tick", hold_s=0.2, controller=Mock(), recorded_ticks=3), Mock(), Mock()
    Setpoints(dispatch).run(made)
    dispatch.accept.assert_called_once_with("tick", 0.2, NOW)
    made.controller.history.record.assert_called_once_with(dispatch.held.return_value)
    Record(recorder).run(made)
    recorder.tick.assert_called_once_with("tick")
    assert (made.last_tick, made.newest, made.recorded_ticks) == ("tick", "tick", 4)
    StandIns(dispatch).run(made)
    made.send.assert_called_once_with(dispatch.stand_ins.return_value, NOW)
    made.samples = ["a"]
    Estimates().run(made)
    made.controller.update_states.assert_called_once_with(["a"])


def test_at_first_nothing_is_known_of_any_loop_and_none_is_doubted() -> None:
    scenario: Any = "scenario"
    known = Findings(scenario, {}, 2)
    assert (known.doubted, known.bandwidth) == ([False, False], [[1.0] * 3, [1.0] * 3])
    assert all(math.isnan(each) for each in known.margin_used)
    assert len(known.margin_used) == 2
    assert known.time_constants_off == [[0.0, 0.0]] * 3
    assert known.bandwidth[0] is not known.bandwidth[1]
    known.lie([VehicleId(0, 3)])
    assert known.crashed == {VehicleId(0, 3)}


def test_a_flight_that_is_resumed_goes_on_in_all_its_parts() -> None:
    parts: Any = Mock()
    past: Any = SimpleNamespace(at=NOW, path_began=Instant(5), mission_s=12.0)
    Parts.resume(parts, past)
    parts.phase_machine.flight.resume.assert_called_once_with(NOW, 5)
    parts.phase_machine.gate.let_go_on.assert_called_once_with()
    parts.heartbeats.resume.assert_called_once_with(NOW)
    parts.reconfiguration.resume.assert_called_once_with(past)
    parts.orders.resume.assert_called_once_with(12.0)
    Parts._fail(parts, "in vain", NOW)
    parts.phase_machine.fail.assert_called_once_with("in vain", NOW)
