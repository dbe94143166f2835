"""Which vehicles are taken over after the ground station was killed."""

from __future__ import annotations

import numpy as np
import pytest

from airlink.clock import Instant
from formation_scenario import load_scenario
from formation_scenario.slot_assignment import first_arrangement
from gcs_formation.features.resumption.takeover import Found, why_left
from gcs_formation.mission.past_flight import PastFlight, RecordedVehicle
from tests.flights.conftest import scenario


def resumed(*, ending: bool = False, take: bool = False) -> PastFlight:
    return PastFlight(
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
        take=take,
    )


def found(mode: str, *, airborne: bool = True, by_failsafe: bool = False) -> Found:
    return Found(mode, airborne, mode == "GUIDED" and airborne, mode in ("LOITER", "RTL"), by_failsafe)


GUIDED, LOITER = RecordedVehicle("GUIDED", parted=False, flew=True), RecordedVehicle("LOITER", parted=False, flew=True)
PILOTS = RecordedVehicle("LOITER", parted=True, flew=True)


@pytest.mark.parametrize(
    ("known", "now", "flight", "left"),
    [
        (GUIDED, found("GUIDED"), resumed(), None),
        (GUIDED, found("GUIDED", airborne=False), resumed(), "on the ground"),
        (GUIDED, found("LOITER"), resumed(), "in LOITER, and the flight had left it in GUIDED"),
        (GUIDED, found("RTL"), resumed(), "in RTL, and the flight had left it in GUIDED; --take takes it"),
        (GUIDED, found("RTL"), resumed(take=True), None),
        (GUIDED, found("RTL", by_failsafe=True), resumed(), None),
        (GUIDED, found("LOITER"), resumed(take=True), None),
        (LOITER, found("LOITER"), resumed(), None),  # commanded by the station itself
        (PILOTS, found("LOITER"), resumed(), "in LOITER, its pilot's or its failsafe's already before"),
        (PILOTS, found("RTL", by_failsafe=True), resumed(), "in RTL, its pilot's or its failsafe's already before"),
        (PILOTS, found("RTL"), resumed(take=True), None),
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
        (GUIDED, found("LOITER"), resumed(ending=True), "in LOITER at the flight's end"),
        (GUIDED, found("RTL", by_failsafe=True), resumed(ending=True), None),
        (LOITER, found("LOITER"), resumed(ending=True, take=True), "in LOITER at the flight's end"),
        (GUIDED, found("FBWA"), resumed(ending=True, take=True), None),
    ],
)
def test_who_flies_as_the_flight_or_its_failsafe_left_it_is_taken_and_others_with_take(
    known: RecordedVehicle, now: Found, flight: PastFlight, left: str | None
) -> None:
    reason = why_left(known, flight, now)
    assert (reason is None) == (left is None)
    assert (reason or "").startswith(left or "")


def test_the_leader_is_looked_for_where_it_may_have_come_to() -> None:
    """10 s after the last tick, 50 s after the path's start: 220 m farther, plus 100 m, plus half of that."""
    assert resumed().reach_m == (880.0 - 100.0, 880.0 + 1.5 * 220.0 + 100.0)
