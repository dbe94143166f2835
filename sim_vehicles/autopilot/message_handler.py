"""What an emulated autopilot does with each message that it receives; where PX4 differs: `families/px4/services`.

Source: MAVLink guide, "Microservices"; answers of ArduPlane 4.7 and ArduCopter 4.7.
"""

from __future__ import annotations

import math

from airlink import mavlink as m
from airlink.endpoint import Address
from airlink.frame import Frame
from airlink.messages import MISSION_TIME, Message
from airlink.messages.command import (
    CommandAck,
    CommandInt,
    CommandLong,
    LogEntry,
    LogRequestData,
    LogRequestEnd,
    LogRequestList,
    RequestDataStream,
    SetMode,
    SetPositionTargetGlobalInt,
    SetPositionTargetLocalNed,
)
from airlink.messages.mission import MissionAck, MissionItem, MissionItemInt
from airlink.messages.system import Heartbeat, NamedValueFloat, Ping, SetupSigning, Timesync
from sim_vehicles.autopilot import commands
from sim_vehicles.autopilot.autopilot import Autopilot
from sim_vehicles.autopilot.missions import Sender
from sim_vehicles.autopilot.signing import set_up_signing


class MessageHandler:
    """Passes each message to the part of the vehicle that it concerns, and answers its sender, as ArduPilot does."""

    def __init__(self, vehicle: Autopilot) -> None:
        """Handle the messages of `vehicle`."""
        self._vehicle = vehicle

    def handle(self, sender: Address, frame: Frame) -> None:
        """Handle one frame. The frequent kinds of messages come first; the others are in `_take_seldom`."""
        vehicle, message = self._vehicle, frame.message
        vehicle.sender = sender
        if isinstance(message, (CommandInt, CommandLong)):
            for result in self._results_of(message):
                vehicle.answer(CommandAck(message.command, result, 0, 0, frame.system, frame.component))
        elif isinstance(message, (SetPositionTargetLocalNed, SetPositionTargetGlobalInt)):
            if not vehicle.ignores:
                vehicle.take_setpoint(message)
        elif isinstance(message, Timesync) and message.tc1_ns == 0:
            vehicle.answer(Timesync(vehicle.time_ns, message.ts1_ns, frame.system, frame.component))
        elif isinstance(message, Heartbeat):
            vehicle.take_heartbeat(frame.system, message.type)
        else:
            self._take_seldom(frame)

    def _take_seldom(self, frame: Frame) -> None:
        vehicle = self._vehicle
        match message := frame.message:
            case RequestDataStream():
                rate_hz = message.req_message_rate if message.start_stop else 0
                vehicle.streams.set_group(message.req_stream_id, rate_hz, vehicle.now)
            case SetMode():
                self._take_mode(message, frame)
            case Ping():
                self._take_ping(message, frame)
            case SetupSigning():
                set_up_signing(vehicle, message)
            case LogRequestList() | LogRequestData() | LogRequestEnd():
                self._take_log_request(message)
            case NamedValueFloat(name=name, value=value) if name == MISSION_TIME and math.isfinite(value):
                vehicle.environment.receive_mission_time(value, vehicle.now)
            case MissionItem() | MissionItemInt() if message.current in commands.AT_ONCE:
                result = m.MAV_MISSION_ACCEPTED if vehicle.ignores else self._fly_to(message)
                vehicle.answer(MissionAck(frame.system, frame.component, result))
            case Message():
                sender = Sender(vehicle.sender, frame.system, frame.component)
                answers = vehicle.parameters.answers(message, sender)
                for answer in answers or vehicle.missions.handle(message, sender, vehicle.now):
                    vehicle.answer(answer)
            case _:
                pass

    def _take_log_request(self, message: LogRequestList | LogRequestData | LogRequestEnd) -> None:
        vehicle, log = self._vehicle, self._vehicle.onboard_log
        if isinstance(message, LogRequestList):
            vehicle.answer(LogEntry(0, 0, 0, 0, 0) if log is None else log.entry)
        elif log is not None and isinstance(message, LogRequestData):
            log.ask(vehicle.sender, message)
        elif log is not None:
            log.stop(vehicle.sender)

    def _results_of(self, message: CommandInt | CommandLong) -> tuple[int, ...]:
        """Carry out a command; return each MAV_RESULT to acknowledge it with."""
        vehicle = self._vehicle
        handler = vehicle.handlers.get(message.command)
        if handler is None:
            return (commands.UNSUPPORTED,)
        if vehicle.ignores and message.command not in commands.REQUESTS:
            return (commands.ACCEPTED,)
        return (handler(vehicle, commands.received(message)),)

    def _take_mode(self, message: SetMode, frame: Frame) -> bool:  # noqa: ARG002 - no one is answered
        """Change to a mode by SET_MODE; return whether that was allowed."""
        custom = bool(message.base_mode & m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
        return custom and (self._vehicle.ignores or self._vehicle.switch(message.custom_mode))

    def _take_ping(self, message: Ping, frame: Frame) -> None:  # noqa: ARG002 - ArduPilot answers none
        return

    def _fly_to(self, item: MissionItem | MissionItemInt) -> int:
        """Fly at once to a position or a height that came as a mission item; return the MAV_MISSION_RESULT."""
        return commands.fly_to(self._vehicle, item)
