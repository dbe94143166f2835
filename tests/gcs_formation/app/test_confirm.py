"""The question before vehicles are armed, and its answer."""

from __future__ import annotations

import os
from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant
from gcs_formation.app.operator_at_terminal import DECLINED, Confirmation
from tests.flights.in_memory import MemoryRecorder

NOW = Instant(0)


class Gate:
    """Stands in for a `Gate`."""

    def __init__(self) -> None:
        self.due = self.confirmed = False
        self.vehicles = {number: SimpleNamespace(airborne=number == 1) for number in (1, 2, 3)}
        self.flown_by_others = [(SimpleNamespace(identity=1), "AUTO")]
        self.warnings = {1: (), 2: ("FS_GCS_ENABL: found 0",)}

    @property
    def awaits_word(self) -> bool:
        return self.due

    def confirm(self) -> None:
        self.confirmed = True


@pytest.mark.parametrize(
    ("typed", "confirmed"), [(b"yes\n", True), (b" Y \n", True), (b"no\n", False), (b"\n", False), (b"", False)]
)
def test_only_yes_confirms_and_only_after_the_question(typed: bytes, confirmed: bool) -> None:
    terminal, keyboard = os.pipe()
    gate: Any = Gate()
    recorder, declined = MemoryRecorder(), list[str]()
    confirmation = Confirmation(gate, recorder, terminal, declined.append)
    os.write(keyboard, b"yes\n")
    confirmation.poll(NOW)
    assert recorder.events == []
    gate.due = True
    confirmation.poll(NOW)
    asked = "3 vehicles are connected, ready and checked (1 with warnings). Type yes to arm 2 and take off, take over 1"
    asked += " (vehicle 1 from AUTO, under somebody's command)"
    assert [event.text for event in recorder.events] == [f"{asked}; anything else ends the run"]
    assert (gate.confirmed, declined) == (False, [])
    if typed:
        os.write(keyboard, typed[:2])
        confirmation.poll(NOW)
        os.write(keyboard, typed[2:])
    else:
        os.close(keyboard)
    confirmation.poll(NOW)
    assert gate.confirmed == confirmed
    assert declined == ([] if confirmed else [DECLINED])
    confirmation.poll(NOW)
    assert len(recorder.events) == 2
    os.close(terminal)
