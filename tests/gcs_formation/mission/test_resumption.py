"""Which vehicles are taken over after the ground station was killed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from airlink.clock import Instant
from formation_scenario import load_scenario
from formation_scenario.slot_assignment import first_arrangement
from gcs_formation.mission.resumption import RecordedVehicle, Resumption, why_left
from tests.flights.conftest import scenario


def resumed(*, ending: bool = False, retake: bool = False) -> Resumption:
    return Resumption(
        at=Instant(70_000_000_000),
        vehicles={},
        mission_s=40.0,
        path_began=Instant(20_000_000_000),
        distance_m=880.0,
        heading_rad=None,
        speed_mps=22.0,
        arrangement=first_arrangement(load_scenario(scenario())),
        slots_m=np.zeros((3, 3)),
        ending=ending,
        retake=retake,
    )


def found(mode: str, *, airborne: bool = True) -> dict[str, Any]:
    guided = mode == "GUIDED" and airborne
    return {"mode": mode, "airborne": airborne, "guided": guided, "homeward": mode == "RTL"}


GUIDED, LOITER = RecordedVehicle("GUIDED", parted=False, flew=True), RecordedVehicle("LOITER", parted=False, flew=True)
PILOTS = RecordedVehicle("LOITER", parted=True, flew=True)


@pytest.mark.parametrize(
    ("known", "now", "flight", "left"),
    [
        (GUIDED, found("GUIDED"), resumed(), None),
        (GUIDED, found("GUIDED", airborne=False), resumed(), "on the ground"),
        (GUIDED, found("LOITER"), resumed(), "in LOITER, and the flight had left it in GUIDED"),
        (GUIDED, found("RTL"), resumed(), "in RTL, and the flight had left it in GUIDED; --retake takes it"),
        (GUIDED, found("RTL"), resumed(retake=True), None),
        (GUIDED, found("LOITER"), resumed(retake=True), "in LOITER, and the flight had left it in GUIDED"),
        (LOITER, found("LOITER"), resumed(), None),  # commanded by the station itself
        (PILOTS, found("LOITER"), resumed(), "in LOITER, its pilot's or its failsafe's already before"),
        (PILOTS, found("RTL"), resumed(retake=True), "in RTL, its pilot's or its failsafe's already before"),
        (PILOTS, found("GUIDED"), resumed(), None),  # given back by its pilot
        (RecordedVehicle("TAKEOFF", parted=False, flew=True), found("TAKEOFF"), resumed(), None),
        (
            RecordedVehicle(None, parted=False, flew=False),
            found("MANUAL"),
            resumed(),
            "in MANUAL, and the flight had left it in an",
        ),
        (LOITER, found("LOITER"), resumed(ending=True), "in LOITER at the flight's end"),
        (GUIDED, found("GUIDED"), resumed(ending=True), None),
    ],
)
def test_only_who_flies_as_the_flight_had_left_it_is_taken(
    known: RecordedVehicle, now: dict[str, Any], flight: Resumption, left: str | None
) -> None:
    reason = why_left(known, flight, **now)
    assert (reason is None) == (left is None)
    assert (reason or "").startswith(left or "")


def test_the_leader_is_looked_for_where_it_may_have_come_to() -> None:
    """10 s after the last tick, 50 s after the path's start: 220 m farther, plus 100 m, plus half of that."""
    assert resumed().reach_m == (880.0 - 100.0, 880.0 + 1.5 * 220.0 + 100.0)
