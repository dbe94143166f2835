"""What a flight's events tell of pilots and ordered speeds."""

from __future__ import annotations

import math
from typing import Any

from gcs_formation.fleet.membership import PARTED
from gcs_formation.record.history import history


def member(at_s: float, text: str, vehicle: int = 2) -> dict[str, Any]:
    return {"t_s": at_s, "kind": "member", "text": text, "vehicle": str(vehicle)}


def order(at_s: float, text: str, *, accepted: bool = True) -> dict[str, Any]:
    return {"t_s": at_s, "kind": "order", "text": f"{text}: {'accepted' if accepted else 'no'}", "accepted": accepted}


def test_a_vehicle_is_its_pilots_from_when_it_parted_to_the_next_change_of_its_membership() -> None:
    """Or to the end of the flight; further texts of the same parting don't begin it again."""
    events = [
        member(1.0, "joined"),
        member(5.0, f"{PARTED}its pilot"),
        member(6.0, f"{PARTED}its failsafe"),
        member(6.5, f"{PARTED}its pilot", 3),
        {"t_s": 7.0, "kind": "mode", "text": "joined", "vehicle": "2"},
        member(9.0, "joined"),
        member(9.5, "waits"),
        member(20.0, f"{PARTED}its pilot"),
    ]
    assert history(events).pilots_s == {"2": [(5.0, 9.0), (20.0, math.inf)], "3": [(6.5, math.inf)]}


def test_speeds_are_those_of_accepted_orders() -> None:
    events = [
        order(2.0, "speed 20"),
        order(3.0, "speed 30", accepted=False),
        order(4.0, "shape line"),
        order(5.0, "speed 18.5"),
        {"t_s": 6.0, "kind": "order", "text": "speed 25: accepted"},
        {"t_s": 7.0, "kind": "mode", "text": "speed 26: accepted", "accepted": True},
    ]
    found = history(events)
    assert found.speeds_mps == [(2.0, 20.0), (5.0, 18.5)]
    assert found.pilots_s == {}
    assert (history([]).pilots_s, list(history([]).speeds_mps)) == ({}, [])
