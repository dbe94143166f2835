"""What ground stations read from and write to a vehicle: parameters, singly and as a file, and the mission."""

from __future__ import annotations

from airlink.clock import Instant
from airlink.messages import Message
from airlink.messages.mission import MissionMessage
from airlink.messages.parameter import FileTransferProtocol, ParamRequestList, ParamRequestRead, ParamSet
from sim_vehicles.files import Files
from sim_vehicles.missions import Missions, Sender
from sim_vehicles.parameters import ParameterServer


class Storage:
    """Answers requests to read or write."""

    def __init__(self, parameters: ParameterServer, missions: Missions) -> None:
        """Serve both."""
        self._parameters = parameters
        self._missions = missions
        self._files = Files(parameters.entries)

    def answers(self, message: Message | None, sender: Sender, now: Instant) -> list[Message]:
        """Return the answers to a message, none if it is no such request; a list of parameters is sent later."""
        match message:
            case ParamRequestList():
                self._parameters.begin_list(sender.peer)
                return []
            case ParamRequestRead():
                value = self._parameters.read(message)
            case ParamSet():
                value = self._parameters.set(message)
            case FileTransferProtocol():
                payloads = self._files.answer(bytes(message.payload))
                return [FileTransferProtocol(0, sender.system, sender.component, tuple(each)) for each in payloads]
            case _ if isinstance(message, MissionMessage):
                return self._missions.take(message, sender, now)
            case _:
                return []
        return [] if value is None else [value]
