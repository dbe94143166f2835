"""The MAVLink messages that we speak, typed and in SI units; a module for each of MAVLink's services.

A class is named after its message and has the fields of the XML definition in the same order, each with its SI unit
in the name: milliseconds become seconds, degE7 and cdeg radians, mm metres, cm/s metres per second. 64-bit integers and
intervals in microseconds stay integers, in the unit that their name says. Where the largest value of a 16-bit field
with a unit means "unknown", the field is NaN. Trailing fields that nothing here needs are left out and sent as 0.
"""

from airlink.messages.command import CommandMessage, ParameterMessage
from airlink.messages.mission import MissionMessage
from airlink.messages.system import SystemMessage
from airlink.messages.telemetry import TelemetryMessage

Message = SystemMessage | TelemetryMessage | CommandMessage | ParameterMessage | MissionMessage

__all__ = ["Message"]
