"""What a vehicle is commanded, and the steps of its start-up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from airlink import mavlink as m
from airlink.messages.command import CommandInt, CommandLong
from gcs_formation.vehicle.telemetry import Telemetry

READY_S: Final = 90.0
"""Longest wait for a vehicle that gets ready to be armed without progress."""
ASKED_S: Final = 30.0
"""Longest wait for the answer to a request, 43 attempts. With a loss of half of all datagrams each way, some request
fails in four starts of a million."""
Command = CommandLong | CommandInt


def nothing(_: Telemetry) -> tuple[Command, ...]:
    """Return no commands."""
    return ()


@dataclass(frozen=True)
class StartUpStep:
    """A step of preparing a vehicle: commands, repeated until `done` holds, within `timeout_s`."""

    name: str
    done: Callable[[Telemetry], bool]
    commands: Callable[[Telemetry], tuple[Command, ...]] = nothing
    """Returns the commands to send, from the telemetry when the step begins."""
    timeout_s: float = 20.0
    every_command_acknowledged: bool = False
    """Whether to wait for each acknowledgement; `timeout_s` then applies to each command."""
    takes_off: bool = False
    """Whether its commands make the vehicle leave the ground."""
    arms: bool = False
    """Whether its commands arm the vehicle."""
    slow: bool = False
    """Whether it is waited for longer than `timeout_s` as long as the vehicle makes progress."""
    lost: Callable[[Telemetry], bool] = lambda _: False
    """Returns whether a failsafe has undone it since, so that it is begun again."""
    lacks: Callable[[Telemetry], str] = lambda _: ""
    """Returns what `done` waits for, in words, if that isn't plain from the name."""

    def acts(self, seen: Telemetry) -> bool:
        """Return whether its commands change what the vehicle does, not only which messages it sends."""
        return any(command.command != m.MAV_CMD_SET_MESSAGE_INTERVAL for command in self.commands(seen))
