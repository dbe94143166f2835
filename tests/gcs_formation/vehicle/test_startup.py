"""An ArduPlane's start-up: from first contact to following setpoints in the air."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.messages.command import CommandAck, CommandLong
from gcs_formation.vehicle.command_delivery import CommandQueue, Outcome
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.startup import StartUp
from gcs_formation.vehicle.startup_step import ASKED_S, StartUpStep
from gcs_formation.vehicle.telemetry import Telemetry

START = Instant(0)
MODE, ARM, INTERVAL = m.MAV_CMD_DO_SET_MODE, m.MAV_CMD_COMPONENT_ARM_DISARM, m.MAV_CMD_SET_MESSAGE_INTERVAL


class Walk:
    """A start-up whose commands are all accepted at once."""

    def __init__(self, plane: ArduPlane, telemetry: Telemetry) -> None:
        self.start_up = StartUp(plane.start_up(plane.rates_hz(10.0)))
        self.commands = CommandQueue()
        self.telemetry = telemetry
        self.now = START

    def go(self, result: int = m.MAV_RESULT_ACCEPTED) -> list[tuple[int, float]]:
        """Advance as far as the telemetry allows; return the commands sent, with what each sets."""
        sent: list[tuple[int, float]] = []
        for _ in range(20):
            self.start_up.advance(self.telemetry, self.commands, self.now)
            command = self.commands.due(self.now)
            if command is not None:
                sent.append((command.command, command.param2 if command.command == MODE else command.param1))
                self.commands.acknowledge(CommandAck(command.command, result), self.now)
        return sent

    def failure(self) -> str | None:
        return self.start_up.failure(self.commands, self.now)


@pytest.fixture
def walk(plane: ArduPlane, telemetry: Telemetry) -> Walk:
    return Walk(plane, telemetry)


def test_from_the_ground_streams_take_off_arming_and_guided_in_this_order(walk: Walk, tell: Callable[..., None]):
    assert [command for command, _ in walk.go()] == [INTERVAL] * 5
    tell(m.PLANE_MODE_MANUAL)
    assert walk.go() == [(MODE, m.PLANE_MODE_TAKEOFF)]
    tell(m.PLANE_MODE_TAKEOFF)
    assert walk.go() == [(ARM, 1.0)]
    tell(m.PLANE_MODE_TAKEOFF, armed=True, above_home_m=20.0, status=m.MAV_STATE_ACTIVE)
    assert walk.go() == []
    assert walk.start_up.doing == "waited for it to climb"
    tell(m.PLANE_MODE_TAKEOFF, armed=True, above_home_m=46.0, status=m.MAV_STATE_ACTIVE)
    assert walk.go() == [(MODE, m.PLANE_MODE_GUIDED)]
    tell(m.PLANE_MODE_GUIDED, armed=True, above_home_m=47.0, status=m.MAV_STATE_ACTIVE)
    assert walk.go() == []
    assert walk.start_up.finished


@pytest.mark.parametrize("mode", [m.PLANE_MODE_LOITER, m.PLANE_MODE_RTL, m.PLANE_MODE_AUTO])
def test_a_plane_in_the_air_is_asked_for_telemetry_and_guided_only(walk: Walk, tell: Callable[..., None], mode: int):
    tell(mode, armed=True, above_home_m=100.0, status=m.MAV_STATE_ACTIVE)
    assert walk.go() == [*((INTERVAL, message) for message in (30, 33, 74, 193, 1)), (MODE, m.PLANE_MODE_GUIDED)]


def test_a_plane_in_guided_in_the_air_needs_its_streams_alone(walk: Walk, tell: Callable[..., None]):
    tell(m.PLANE_MODE_GUIDED, armed=True, above_home_m=100.0, status=m.MAV_STATE_ACTIVE)
    assert {command for command, _ in walk.go()} == {INTERVAL}
    assert walk.start_up.finished


def test_a_plane_that_isnt_ready_is_neither_moved_to_take_off_nor_armed(
    walk: Walk, tell: Callable[..., None], telemetry: Telemetry
):
    tell(m.PLANE_MODE_MANUAL)
    telemetry.sensors_healthy = 0
    telemetry.ekf_flags &= ~m.EKF_POS_HORIZ_ABS
    assert {command for command, _ in walk.go()} == {INTERVAL}
    assert walk.failure() is None
    walk.now = after(START, 91.0)
    assert walk.failure() == "not done within 90 s after we waited for it to be ready to arm"
    lacking = "EKF_STATUS_REPORT: no EKF_POS_HORIZ_ABS; SYS_STATUS: PREARM_CHECK not passed"
    assert walk.start_up.lacks(telemetry) == lacking


def test_the_time_of_a_step_is_that_of_each_of_its_requests(walk: Walk):
    """It waits for answers that are lost and requested again for 19 s each; one that never comes ends the step."""
    for _ in range(4):
        walk.start_up.advance(walk.telemetry, walk.commands, walk.now)
        asked = walk.commands.due(walk.now)
        assert asked is not None
        walk.now = after(walk.now, 19.0)
        assert walk.failure() is None
        walk.commands.acknowledge(CommandAck(asked.command, m.MAV_RESULT_ACCEPTED), walk.now)
    walk.now = after(walk.now, ASKED_S - 0.1)
    assert walk.failure() is None
    walk.now = after(walk.now, 0.2)
    assert walk.failure() == "not done within 30 s after we asked for telemetry"


def test_telemetry_that_was_acknowledged_and_does_not_come_is_requested_again_once_in_its_time(walk: Walk):
    """An acknowledgement doesn't say of which message it is: a repeated request's may have stood for a lost one's."""
    step = StartUpStep(
        "asked for telemetry",
        lambda _: False,
        lambda _: (CommandLong(2, 1, INTERVAL, param1=74.0),),
        ASKED_S,
        every_command_acknowledged=True,
    )
    start_up, queue = StartUp((step,)), walk.commands
    asked_s = list[int]()
    for second in range(40):
        now = after(START, float(second))
        start_up.advance(walk.telemetry, queue, now)
        start_up.ask_again(walk.telemetry, queue, now)
        asked = queue.due(now)
        if asked is not None:
            asked_s.append(second)
            queue.acknowledge(CommandAck(INTERVAL, m.MAV_RESULT_ACCEPTED), now)
        failure = start_up.failure(queue, now)
        assert (failure is not None) is (second > ASKED_S), second
    assert asked_s == [0, 6]


def test_a_refused_command_is_why_it_failed(walk: Walk):
    walk.go(m.MAV_RESULT_DENIED)
    assert walk.commands.outcome is Outcome.REFUSED
    assert walk.failure() == "refused when we asked for telemetry"


def test_arming_that_fails_is_tried_again_until_its_time_is_over(walk: Walk, tell: Callable[..., None]):
    walk.go()
    tell(m.PLANE_MODE_TAKEOFF)
    walk.go(m.MAV_RESULT_FAILED)
    assert walk.commands.outcome is Outcome.WAITING
    assert walk.failure() is None
    walk.now = after(START, 31.0)
    assert walk.failure() == "not done within 30 s after we armed"
    assert walk.commands.refusal == (ARM, m.MAV_RESULT_FAILED)


@pytest.mark.parametrize(
    ("unfixed", "at_s", "words"),
    [
        (False, 31.0, "not done within 30 s after we asked for telemetry"),
        (True, 89.0, None),
        (True, 92.0, "not done within 90 s after we asked for telemetry"),
    ],
)
def test_a_position_fix_is_waited_for_longer_than_telemetry(
    walk: Walk, unfixed: bool, at_s: float, words: str | None
) -> None:
    """Its requests are acknowledged, and its positions are those of a receiver without a fix, latitude 0."""
    walk.telemetry = Telemetry(walk.telemetry.origin)
    walk.go()
    walk.telemetry.unfixed = unfixed
    walk.start_up.update_progress(walk.telemetry, START)
    walk.now = after(START, at_s)
    assert walk.failure() == words


def test_a_vehicle_that_makes_progress_is_waited_for_up_to_the_longest_time(walk: Walk) -> None:
    walk.telemetry = Telemetry(walk.telemetry.origin)
    walk.go()
    walk.telemetry.unfixed = True
    for at_s in range(0, 600, 60):
        walk.telemetry.fix = (1, at_s // 60)
        walk.now = after(START, float(at_s))
        walk.start_up.update_progress(walk.telemetry, walk.now)
        assert walk.failure() is None
    walk.now = after(START, 601.0)
    assert walk.failure() == "not done within 600 s after we asked for telemetry"
