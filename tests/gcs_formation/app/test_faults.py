"""Injected faults are events of the record, at the mission times at which they are planned."""

from __future__ import annotations

from airlink.clock import Instant
from formation_scenario import load_scenario
from gcs_formation.app.link_injection import InjectedFaults
from gcs_formation.phases import Flight
from tests.flights.conftest import scenario
from tests.flights.in_memory import MemoryRecorder

FAULTS = [
    {"kind": "freeze", "vehicles": [3], "at_s": 4, "until_s": 6},
    {"kind": "crash", "vehicles": "all", "at_s": 5},
]
SECOND = 10**9


def test_each_vehicle_s_fault_is_an_event_when_it_begins_and_when_it_ends() -> None:
    recorder, flight = MemoryRecorder(), Flight()
    faults = InjectedFaults(load_scenario(scenario(faults=FAULTS)), recorder)
    faults.record_due(flight, Instant(30 * SECOND))
    assert not recorder.events  # the path hasn't begun
    flight.path_began = Instant(10 * SECOND)
    for at_s in range(10, 20):
        faults.record_due(flight, Instant(at_s * SECOND))
    told = [(event.now // SECOND - 10, str(event.vehicle), event.text) for event in recorder.events]
    assert told == [
        (4, "3", "freeze"),
        (5, "1", "crash"),
        (5, "2", "crash"),
        (5, "3", "crash"),
        (6, "3", "freeze is over"),
    ]
    assert [event.details["ends"] for event in recorder.events] == [False] * 4 + [True]
