"""Sequence numbers count by channel: as a log of one channel shows them, no frame is missing."""

from __future__ import annotations

from collections import defaultdict

from airlink.clock import Instant
from airlink.stream_parser import StreamParser
from formation_scenario import Scenario
from tests.flights.in_memory import MemoryRecorder, World

MODULUS = 256
ENDPOINT = "udpin:127.0.0.1:14550"


class Log(MemoryRecorder):
    """Counts the numbers that a log lacks, as pymavlink's mavloss does: by system and component."""

    def __init__(self, _: Scenario) -> None:
        super().__init__()
        self.frame_count, self.missing = 0, 0
        self._parser, self._last = StreamParser(), defaultdict[tuple[int, int], int](lambda: -1)

    def frames(self, now: Instant, raws: list[bytes]) -> None:
        for frame in self._parser.feed(b"".join(raws)):
            sender = frame.system, frame.component
            if self._last[sender] >= 0:
                self.missing += (frame.sequence - self._last[sender] - 1) % MODULUS
            self._last[sender] = frame.sequence
            self.frame_count += 1


def test_the_log_of_a_flight_at_one_endpoint_shows_no_loss() -> None:
    vehicles = [
        {"id": number, "role": "follower" if number > 1 else "leader", "endpoint": ENDPOINT} for number in (1, 2, 3)
    ]
    world = World(recorder=Log, vehicles=vehicles)
    world.run(12.0)
    assert isinstance(world.recorder, Log)
    assert world.recorder.frame_count > 1000
    assert world.recorder.missing == 0
