"""Another ground station, which tells our vehicles something."""

from __future__ import annotations

from airlink import mavlink as m
from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.frame import FrameWriter
from airlink.messages import Message
from airlink.messages.command import CommandLong
from tests.flights.in_memory import World

OTHER = Address("127.0.0.1", 50000)


def interval(number: int, message_id: int, interval_us: float) -> CommandLong:
    return CommandLong(number, 1, m.MAV_CMD_SET_MESSAGE_INTERVAL, param1=message_id, param2=interval_us)


def tell(world: World, number: int, messages: list[Message]) -> float:
    """Send a vehicle messages from another ground station; return when."""
    writer = FrameWriter(254, 190)
    for message in messages:
        world.fleet.receive([Datagram(number - 1, OTHER, writer.encode(message))], world.clock.now())
    return world.now_s
