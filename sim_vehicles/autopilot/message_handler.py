"""What an emulated autopilot does with each message that it receives, and whom it answers: ArduPilot's, and PX4's.

Source: MAVLink guide, "Microservices"; answers of ArduPlane 4.7, ArduCopter 4.7 and PX4 1.17.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from airlink import mavlink as m
from airlink.endpoint import Address
from airlink.frame import Frame
from airlink.messages import MISSION_TIME, Message
from airlink.messages.command import (
    CommandAck,
    CommandInt,
    CommandLong,
    LogEntry,
    LogRequestList,
    RequestDataStream,
    SetMode,
    SetPositionTargetGlobalInt,
    SetPositionTargetLocalNed,
)
from airlink.messages.mission import MissionAck, MissionItem, MissionItemInt
from airlink.messages.system import Heartbeat, NamedValueFloat, Ping, Timesync
from sim_vehicles.autopilot import commands
from sim_vehicles.autopilot.commands import CommandHandlers
from sim_vehicles.autopilot.missions import Sender

if TYPE_CHECKING:
    from sim_vehicles.px4 import Px4
    from sim_vehicles.vehicle import Vehicle

PX4_COMPONENTS: Final = (m.MAV_COMP_ID_ALL, m.MAV_COMP_ID_AUTOPILOT1)
WRONG_FRAME: Final = 9
"""MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME, which not every dialect names yet."""


class MessageHandler:
    """Passes each message to the part of the vehicle that it concerns, and answers its sender, as ArduPilot does."""

    def __init__(self, vehicle: Vehicle, handlers: CommandHandlers) -> None:
        """Handle the messages of `vehicle`; `handlers` carry out the commands that it knows."""
        self._vehicle = vehicle
        self._handlers = handlers
        self._sender = vehicle.config.endpoint.address

    def take(self, sender: Address, frame: Frame) -> None:
        """Handle one frame. The frequent kinds of messages come first; the others are in `_take_seldom`."""
        self._sender = sender
        message = frame.message
        if isinstance(message, (CommandInt, CommandLong)):
            for result in self._results_of(message):
                self.answer(CommandAck(message.command, result, 0, 0, frame.system, frame.component))
        elif isinstance(message, (SetPositionTargetLocalNed, SetPositionTargetGlobalInt)):
            if not self._vehicle.ignores:
                self._vehicle.take_setpoint(message)
        elif isinstance(message, Timesync) and message.tc1_ns == 0:
            self.answer(Timesync(self._vehicle.time_ns, message.ts1_ns))
        elif isinstance(message, Heartbeat):
            self._take_heartbeat(frame.system, message)
        else:
            self._take_seldom(frame)

    def answer(self, message: Message | None) -> None:
        """Send a message to the sender of the last frame; nothing for None."""
        if message is not None:
            self._vehicle.link.answer(self._sender, message)

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
            case LogRequestList():
                self.answer(LogEntry(0, 0, 0, 0, 0))
            case NamedValueFloat(name=name, value=value) if name == MISSION_TIME and math.isfinite(value):
                vehicle.fleet.environment.hear_mission_time(value, vehicle.now)
            case MissionItem() | MissionItemInt() if message.current in commands.AT_ONCE:
                result = m.MAV_MISSION_ACCEPTED if vehicle.ignores else self._fly_to(message)
                self.answer(MissionAck(frame.system, frame.component, result))
            case Message():
                sender = Sender(self._sender, frame.system, frame.component)
                answers = vehicle.parameters.answers(message, sender)
                for answer in answers or vehicle.missions.take(message, sender, vehicle.now):
                    self.answer(answer)
            case _:
                pass

    def _results_of(self, message: CommandInt | CommandLong) -> tuple[int, ...]:
        """Carry out a command; return each MAV_RESULT to acknowledge it with."""
        given = commands.received(message)
        if self._vehicle.ignores and given.command in commands.ORDERS:
            return (commands.ACCEPTED,)
        handler = self._handlers.get(given.command)
        return (commands.UNSUPPORTED if handler is None else handler(self._vehicle, given),)

    def _take_heartbeat(self, system: int, message: Heartbeat) -> None:  # noqa: ARG002 - the sender alone counts
        self._vehicle.failsafe.heartbeat(system, self._vehicle.now)

    def _take_mode(self, message: SetMode, frame: Frame) -> bool:  # noqa: ARG002 - nobody is answered
        """Change to a mode by SET_MODE; return whether that was allowed."""
        custom = bool(message.base_mode & m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
        return custom and (self._vehicle.ignores or self._vehicle.switch(message.custom_mode))

    def _take_ping(self, message: Ping, frame: Frame) -> None:  # noqa: ARG002 - ArduPilot answers none
        return

    def _fly_to(self, item: MissionItem | MissionItemInt) -> int:
        """Fly at once to a position or a height that came as a mission item; return the MAV_MISSION_RESULT."""
        return commands.fly_to(self._vehicle, item)


class Px4MessageHandler(MessageHandler):
    """Handles the messages with which PX4 differs: commands, heartbeats, SET_MODE, PING and mission items."""

    def __init__(self, vehicle: Px4, handlers: CommandHandlers) -> None:
        """Handle the messages of `vehicle`; `handlers` carry out the commands that it knows."""
        super().__init__(vehicle, handlers)
        self._px4 = vehicle

    def _results_of(self, message: CommandInt | CommandLong) -> tuple[int, ...]:
        """Carry out a command; a change of mode is acknowledged twice, the first time before it is decided on.

        Nobody answers for other components, nor an order that neither arms nor disarms.
        """
        if message.target_component not in PX4_COMPONENTS:
            return ()
        if isinstance(message, CommandInt) and message.frame != m.MAV_FRAME_GLOBAL_INT:
            return (WRONG_FRAME,)
        if message.command == m.MAV_CMD_COMPONENT_ARM_DISARM and message.param1 not in (0.0, 1.0):
            self._vehicle.say(m.MAV_SEVERITY_CRITICAL, f"Unsupported ARM_DISARM param: {message.param1:.3f}")
            return ()
        results = super()._results_of(message)
        return (commands.ACCEPTED, *results) if message.command == m.MAV_CMD_DO_SET_MODE else results

    def _take_heartbeat(self, system: int, message: Heartbeat) -> None:
        """Take a ground station's heartbeat, before the first of which texts are kept."""
        if message.type == m.MAV_TYPE_GCS:
            super()._take_heartbeat(system, message)
            self._px4.say_kept()

    def _take_mode(self, message: SetMode, frame: Frame) -> bool:
        """Change to a mode by SET_MODE, which is acknowledged like the command, but once."""
        allowed = super()._take_mode(message, frame)
        result = commands.ACCEPTED if allowed else m.MAV_RESULT_TEMPORARILY_REJECTED
        self.answer(CommandAck(m.MAV_CMD_DO_SET_MODE, result, 0, 0, frame.system, frame.component))
        return allowed

    def _take_ping(self, message: Ping, frame: Frame) -> None:
        """Answer a PING that is for everyone."""
        if not message.target_system:
            self.answer(message.but(target_system=frame.system, target_component=frame.component))

    def _fly_to(self, item: MissionItem | MissionItemInt) -> int:  # noqa: ARG002 - none is followed
        """Refuse: PX4 knows no item that is flown at once."""
        return m.MAV_MISSION_ERROR
