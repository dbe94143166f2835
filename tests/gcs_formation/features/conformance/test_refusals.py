"""Whose refusals are reported, and how often where a command under insistence is replaced."""

from __future__ import annotations

import pytest

from airlink import mavlink as m
from airlink.clock import after
from airlink.messages.command import CommandAck
from gcs_formation.vehicle.member import Member
from tests.gcs_formation.features.conformance.test_monitor import START, Ground

DENIED = "refuses mode LOITER (DO_SET_MODE: DENIED), and is commanded again"


class Insisted:
    """The second vehicle refuses to loiter, as often as that is commanded."""

    def __init__(self) -> None:
        self.ground, self.at_s = Ground(), 0.0
        self.commands = self.ground.second().commands

    def loiter(self) -> None:
        """Command it."""
        loiter = self.ground.second().autopilot.set_mode(m.PLANE_MODE_LOITER)
        self.commands.send((loiter,), after(START, self.at_s), insist=True)

    def deny(self, seconds: float) -> None:
        """Refuse all that is sent for so long, and judge."""
        for _ in range(round(10 * seconds)):
            now = after(START, self.at_s)
            if self.commands.due(now) is not None:
                self.commands.acknowledge(CommandAck(m.MAV_CMD_DO_SET_MODE, m.MAV_RESULT_DENIED), now)
            self.ground.monitor.judge_refusals(now)
            self.at_s += 0.1

    @property
    def said(self) -> list[str]:
        """What has been reported."""
        return self.ground.logged.of("disobeys", 2) + self.ground.logged.of("obeys", 2)


def test_the_same_command_sent_again_and_refused_likewise_is_not_reported_again() -> None:
    insisted = Insisted()
    for _ in range(3):
        insisted.loiter()
        insisted.deny(2.5)
    assert insisted.said == [DENIED]


def test_after_it_was_replaced_by_one_that_is_done_a_refusal_is_reported_again() -> None:
    insisted = Insisted()
    for _ in range(3):
        insisted.loiter()
        insisted.deny(2.5)
        insisted.commands.send((), after(START, insisted.at_s))
        insisted.deny(0.5)
    assert insisted.said == [DENIED] * 3


@pytest.mark.parametrize("member", list(Member))
def test_refused_setpoints_are_reported_only_of_one_that_flies_in_the_formation(member: Member) -> None:
    """A pilot who takes it over has it refuse what was on its way."""
    ground = Ground()
    second, channel = ground.second(), ground.second().setpoint_channels[1]
    second.member = member
    for tenth in range(30):
        now = after(START, 0.1 * tenth)
        channel.refused(m.MAV_RESULT_DENIED, second.telemetry.heartbeats, now)
        second.telemetry.heartbeats += tenth % 10 == 5
        ground.monitor.judge_refusals(now)
    words = ["refuses its setpoints: GUIDED_CHANGE_HEADING: DENIED"]
    assert ground.logged.of("disobeys") == (words if member is Member.FLYING else [])
