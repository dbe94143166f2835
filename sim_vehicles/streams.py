"""Which message is due in which turn of the main loop."""

from __future__ import annotations

from collections import defaultdict

from airlink import mavlink as m
from sim_vehicles.telemetry import BUILDERS, UNASKED, UNASKED_HZ

LOOP_HZ = 50


class Streams:
    """One vehicle's message intervals, in whole turns of the main loop."""

    def __init__(self) -> None:
        """Start with what flows unasked."""
        self._turns = dict.fromkeys(UNASKED, round(LOOP_HZ / UNASKED_HZ))
        self._due: defaultdict[int, list[int]] = defaultdict(list)
        self._next: dict[int, int] = {}
        self.turn = 0
        for message_id in self._turns:
            self._schedule(message_id, 1)

    def set_interval(self, message_id: int, interval_s: float) -> bool:
        """Set an interval: 0 the default one, negative never; return False for one that the loop can't keep."""
        turns = round(interval_s * LOOP_HZ)
        if interval_s == 0.0:
            turns = round(LOOP_HZ / UNASKED_HZ) if message_id in UNASKED else -1
        elif interval_s > 0.0 and interval_s * LOOP_HZ < 1.0 - 1e-6:
            return False
        if turns <= 0:
            self._turns.pop(message_id, None)
            self._next.pop(message_id, None)
        else:
            self._turns[message_id] = turns
            self._schedule(message_id, self.turn + 1)
        return True

    def set_all(self, rate_hz: float) -> None:
        """Set every unasked stream but the heartbeat to one rate."""
        for message_id in UNASKED:
            if message_id != m.MAVLINK_MSG_ID_HEARTBEAT:
                self.set_interval(message_id, 1.0 / min(rate_hz, LOOP_HZ) if rate_hz > 0 else -1.0)

    def interval_s(self, message_id: int) -> float | None:
        """Return an interval in s, None for a message that doesn't flow."""
        turns = self._turns.get(message_id)
        return None if turns is None else turns / LOOP_HZ

    def take_due(self) -> list[int]:
        """Go on to the next turn; return its message ids in order."""
        self.turn += 1
        planned = self._due.pop(self.turn, None)
        if planned is None:
            return []
        due = sorted({message_id for message_id in planned if self._next.get(message_id) == self.turn})
        for message_id in due:
            self._schedule(message_id, self.turn + self._turns[message_id])
        return [message_id for message_id in due if message_id in BUILDERS]

    def _schedule(self, message_id: int, turn: int) -> None:
        self._next[message_id] = turn
        self._due[turn].append(message_id)
