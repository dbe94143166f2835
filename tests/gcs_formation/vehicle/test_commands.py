"""MAVLink's command protocol: one command at a time, sent again until it's acknowledged."""

from __future__ import annotations

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.messages.command import CommandAck, CommandInt, CommandLong
from gcs_formation.vehicle.command_delivery import (
    MAX_CONFIRMATION,
    REFUSES_S,
    RETRY_REFUSED_S,
    RETRY_S,
    CommandQueue,
    Outcome,
)

ARM = CommandLong(7, 1, m.MAV_CMD_COMPONENT_ARM_DISARM, param1=1)
MODE = CommandLong(7, 1, m.MAV_CMD_DO_SET_MODE, param1=1, param2=15)
START = Instant(0)


def accepted(command: CommandLong) -> CommandAck:
    return CommandAck(command.command, m.MAV_RESULT_ACCEPTED)


@pytest.fixture
def queue() -> CommandQueue:
    commands = CommandQueue()
    commands.send((MODE, ARM), START)
    return commands


def test_commands_go_one_after_another_each_when_the_last_is_acknowledged(queue):
    assert queue.due(START) == MODE
    assert queue.due(START) is None
    queue.acknowledge(accepted(MODE), START)
    assert queue.due(START) == ARM
    assert queue.outcome is Outcome.WAITING
    queue.acknowledge(accepted(ARM), START)
    assert queue.outcome is Outcome.ACCEPTED
    assert queue.due(after(START, 60.0)) is None


def test_a_command_sent_twice_is_repeated_at_the_next_tick_and_then_as_any_other():
    queue = CommandQueue()
    queue.send((MODE, ARM), START, insist=True, twice=True)
    sent_s = [0.1 * tenth for tenth in range(20) if queue.due(after(START, 0.1 * tenth)) is not None]
    assert sent_s == pytest.approx([0.0, 0.1, 0.1 + RETRY_S, 0.1 + 2 * RETRY_S])
    queue.acknowledge(accepted(MODE), after(START, 2.0))
    assert [queue.due(after(START, at_s)) for at_s in (2.0, 2.1, 2.2)] == [ARM, ARM.but(confirmation=1), None]
    queue.spares = True
    queue.send((ARM,), after(START, 3.0), twice=True)
    assert [queue.due(after(START, at_s)) for at_s in (3.0, 3.1)] == [ARM, None], "a full link has no room for it"


def test_a_lost_acknowledgement_brings_the_command_again_with_a_higher_confirmation(queue):
    now, confirmations = START, []
    for _ in range(3):
        confirmations.append(queue.due(now).confirmation)
        assert queue.due(after(now, RETRY_S / 2)) is None
        now = after(now, RETRY_S)
    assert confirmations == [0, 1, 2]


def test_the_confirmation_stays_in_its_byte(queue):
    times = [after(START, i * RETRY_S) for i in range(MAX_CONFIRMATION + 20)]
    confirmations = [queue.due(now).confirmation for now in times]
    assert max(confirmations) == confirmations[-1] == MAX_CONFIRMATION


def test_a_second_acknowledgement_of_one_command_doesnt_stand_for_the_next(queue):
    queue.due(START)
    queue.acknowledge(accepted(MODE), START)
    queue.acknowledge(accepted(MODE), START)
    assert queue.due(START) == ARM
    assert queue.outcome is Outcome.WAITING


def test_an_acknowledgement_of_a_command_that_wasnt_sent_yet_counts_for_nothing(queue):
    queue.acknowledge(accepted(MODE), START)
    assert queue.due(START) == MODE


@pytest.mark.parametrize("result", [m.MAV_RESULT_FAILED, m.MAV_RESULT_TEMPORARILY_REJECTED])
def test_a_vehicle_that_cant_yet_is_asked_again(queue, result):
    queue.due(START)
    queue.acknowledge(CommandAck(MODE.command, result), START)
    assert queue.outcome is Outcome.WAITING
    assert queue.refusal == (MODE.command, result)
    assert queue.due(after(START, RETRY_S)).command == MODE.command


@pytest.mark.parametrize("result", [m.MAV_RESULT_DENIED, m.MAV_RESULT_UNSUPPORTED])
def test_a_refusal_ends_the_list(queue, result):
    queue.due(START)
    queue.acknowledge(CommandAck(MODE.command, result), START)
    assert queue.outcome is Outcome.REFUSED
    assert queue.refusal == (MODE.command, result)
    assert queue.due(after(START, RETRY_S)) is None


@pytest.fixture
def insisting() -> CommandQueue:
    commands = CommandQueue()
    commands.send((MODE, ARM), START, insist=True)
    return commands


@pytest.mark.parametrize("result", [m.MAV_RESULT_DENIED, m.MAV_RESULT_UNSUPPORTED, 6, 7, 8, 42])
def test_a_command_that_is_insisted_on_is_sent_again_until_it_is_accepted_whatever_was_answered(insisting, result):
    for attempt in range(5):
        now = after(START, attempt * RETRY_REFUSED_S)
        assert insisting.due(now).command == MODE.command
        insisting.acknowledge(CommandAck(MODE.command, result), now)
        assert insisting.due(after(now, RETRY_REFUSED_S - 0.1)) is None
        assert insisting.outcome is Outcome.WAITING
        assert insisting.refused_with == result
        assert insisting.refused(now) == (attempt > 0)
    insisting.due(after(START, 5 * RETRY_REFUSED_S))
    insisting.acknowledge(accepted(MODE), after(START, 5 * RETRY_REFUSED_S))
    assert not insisting.refused(after(START, 60.0))
    assert insisting.refused_with is None
    assert insisting.under_way == ARM


def test_one_that_is_refused_once_and_accepted_then_does_not_count_as_refused(insisting):
    insisting.due(START)
    insisting.acknowledge(CommandAck(MODE.command, m.MAV_RESULT_FAILED), START)
    assert not insisting.refused(after(START, REFUSES_S - 0.1))
    assert insisting.refused(after(START, REFUSES_S))
    insisting.due(after(START, REFUSES_S))
    insisting.acknowledge(accepted(MODE), after(START, REFUSES_S))
    assert not insisting.refused(after(START, REFUSES_S))


@pytest.mark.parametrize("refused", [True, False])
def test_a_command_whose_effect_two_heartbeats_show_is_done_without_being_accepted(insisting, refused):
    insisting.take_heartbeat(shown=True, known=False, now=START)  # not sent yet
    insisting.due(START)
    if refused:
        insisting.acknowledge(CommandAck(MODE.command, m.MAV_RESULT_DENIED), START)
    for at_s, shown in ((0.5, False), (1.5, True)):
        insisting.take_heartbeat(shown=shown, known=False, now=after(START, at_s))
        assert insisting.under_way == MODE
    insisting.take_heartbeat(shown=True, known=False, now=after(START, 2.5))
    assert insisting.under_way == ARM
    assert insisting.outcome is Outcome.WAITING


def test_what_heartbeats_may_have_shown_before_counts_once_there_is_an_answer(insisting):
    insisting.due(START)
    for at_s in (1.0, 2.0, 3.0, 4.0):
        insisting.take_heartbeat(shown=True, known=True, now=after(START, at_s))
    assert insisting.under_way == MODE
    insisting.acknowledge(CommandAck(MODE.command, m.MAV_RESULT_DENIED), after(START, 4.5))
    insisting.take_heartbeat(shown=True, known=True, now=after(START, 5.0))
    assert insisting.under_way == ARM


def test_a_command_in_progress_is_neither_done_nor_refused(queue):
    queue.due(START)
    queue.acknowledge(CommandAck(MODE.command, m.MAV_RESULT_IN_PROGRESS, progress=40), START)
    assert queue.outcome is Outcome.WAITING
    assert queue.refusal is None
    queue.acknowledge(accepted(MODE), START)
    assert queue.due(START) == ARM


def test_a_new_list_replaces_the_old_one_and_forgets_its_refusal(queue):
    queue.due(START)
    queue.acknowledge(CommandAck(MODE.command, m.MAV_RESULT_DENIED), START)
    queue.send((ARM,), START)
    assert queue.refusal is None
    assert queue.due(START) == ARM
    queue.send((), START)
    assert queue.outcome is Outcome.ACCEPTED


def test_a_command_int_has_no_confirmation_and_is_repeated_as_it_is():
    command = CommandInt(7, 1, m.MAV_FRAME_GLOBAL, m.MAV_CMD_DO_REPOSITION, 0, 0, 0.0, 0.0, 0.0, 0.0, 0, 0, 100.0)
    queue = CommandQueue()
    queue.send((command,), START)
    assert queue.due(START) == queue.due(after(START, RETRY_S)) == command


def test_a_repeated_acknowledgement_accepts_nothing_of_the_same_id() -> None:
    """Over a round trip of 1 s each request is sent twice, and answered twice."""
    first, second = (CommandLong(7, 1, m.MAV_CMD_SET_MESSAGE_INTERVAL, param1=id_) for id_ in (30, 33))
    queue = CommandQueue()
    queue.send((first, second), START)
    assert [queue.due(after(START, at_s)) is not None for at_s in (0.0, RETRY_S)] == [True, True]
    assert queue.acknowledge(accepted(first), after(START, 1.0)) is not None
    assert queue.due(after(START, 1.0)) == second
    assert queue.acknowledge(accepted(first), after(START, 1.0 + RETRY_S)) is None
    assert queue.acknowledge(accepted(second), after(START, 2.0)) == second
    assert queue.outcome is Outcome.ACCEPTED


def test_an_acknowledgement_that_was_lost_is_not_waited_for_longer_than_a_round_trip() -> None:
    first, second = (CommandLong(7, 1, m.MAV_CMD_SET_MESSAGE_INTERVAL, param1=id_) for id_ in (30, 33))
    queue = CommandQueue()
    queue.send((first, second), START)
    for at_s in (0.0, RETRY_S):
        queue.due(after(START, at_s))
    queue.acknowledge(accepted(first), after(START, RETRY_S + 0.1))  # to the second request; the first was lost
    queue.due(after(START, RETRY_S + 0.1))
    assert queue.acknowledge(accepted(second), after(START, 2 * RETRY_S + 0.2)) == second
