"""Who is reported outside the fence, when, and by how much; vehicles are mere telemetry here."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from formation_scenario import load_scenario
from gcs_formation.features.pilots_outside_fence.feature import FEATURE
from gcs_formation.features.pilots_outside_fence.watch import PilotsOutsideFence
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.reported_motion import ReportedMotion
from tests.flights.conftest import scenario
from tests.gcs_formation.event_log import EventLog

SQUARE_M = [[-5000, -3000], [5000, -3000], [5000, 3000], [-5000, 3000]]
FENCE = {"corners_m": SQUARE_M, "height_min_m": 40, "height_max_m": 140}
INSIDE_M, ABOVE_M = (20.0, 30.0, 100.0), (20.0, 30.0, 152.5)
BEGINS, ENDS = (
    "flown outside by its pilot or its failsafe, {:.1f} m",
    "no longer flown outside by its pilot or its failsafe",
)


class Watched:
    """Three vehicles, parted by their pilots, inside."""

    def __init__(self, fence: dict[str, Any] | None = FENCE) -> None:
        self.logged, self.now = EventLog(), Instant(0)
        self.vehicles = {
            VehicleId(1, number): SimpleNamespace(
                identity=VehicleId(1, number), member=Member.PARTED, airborne=True, telemetry=SimpleNamespace()
            )
            for number in (1, 2, 3)
        }
        for number in (1, 2, 3):
            self.moves(number, INSIDE_M)
        keys: dict[str, Any] = {} if fence is None else {"safety": {"fence": fence}}
        cycle: Any = SimpleNamespace(
            scenario=load_scenario(scenario(**keys)), vehicles=self.vehicles, log_event=self.logged
        )
        self.cycle, self.watch = cycle, PilotsOutsideFence(cycle)

    def of(self, number: int) -> Any:
        """Return one of them."""
        return self.vehicles[VehicleId(1, number)]

    def moves(self, number: int, at_m: tuple[float, float, float]) -> None:
        """Let one report a position: north, east and height."""
        self.of(number).telemetry.motion = ReportedMotion(0.0, *at_m, 21.0, 3.0, -1.0, 7.0)

    def look(self) -> list[str]:
        """Look at all once, a second later; return what is said."""
        begun, self.now = len(self.logged), after(self.now, 1.0)
        self.cycle.now = self.now
        self.watch.run(self.cycle)
        return [each.text for each in self.logged[begun:]]


@pytest.mark.parametrize(
    ("at_m", "away_m"),
    [
        ((20.0, 30.0, 152.5), 12.5),
        ((20.0, 30.0, 140.3), 0.3),
        ((20.0, 30.0, 33.0), 7.0),
        ((5008.0, 30.0, 100.0), 8.0),
        ((-20.0, -3006.0, 100.0), 6.0),
        ((5008.0, 30.0, 146.0), 10.0),
    ],
    ids=["above", "just above", "below", "north", "west", "north and above"],
)
def test_one_that_its_pilot_flies_outside_is_reported_once_with_its_distance_and_when_it_is_back(
    at_m: tuple[float, float, float], away_m: float
) -> None:
    watched = Watched()
    assert watched.look() == []
    watched.moves(2, at_m)
    assert watched.look() == [BEGINS.format(away_m)]
    assert watched.look() == watched.look() == []
    watched.moves(2, INSIDE_M)
    assert watched.look() == [ENDS]
    assert watched.look() == []
    assert [(each.at_s, each.kind, each.vehicle, each.details) for each in watched.logged] == [
        (2.0, "fence", 2, {"begins": True}),
        (5.0, "fence", 2, {"begins": False}),
    ]


def test_each_that_is_outside_again_is_reported_again_and_each_by_itself() -> None:
    watched = Watched()
    watched.moves(1, ABOVE_M)
    assert watched.look() == [BEGINS.format(12.5)]
    watched.moves(3, ABOVE_M)
    assert watched.look() == [BEGINS.format(12.5)]
    watched.moves(1, INSIDE_M)
    assert watched.look() == [ENDS]
    watched.moves(1, ABOVE_M)
    assert watched.look() == [BEGINS.format(12.5)]
    assert [each.vehicle for each in watched.logged] == [1, 3, 1, 1]


def test_one_that_comes_back_is_outside_until_it_has_crossed_the_fence() -> None:
    watched = Watched()
    for height_m, found in ((152.5, [BEGINS.format(12.5)]), (140.3, []), (139.9, [ENDS])):
        watched.moves(2, (20.0, 30.0, height_m))
        assert watched.look() == found


@pytest.mark.parametrize("height_m", [40.0, 90.0, 140.0])
def test_its_limits_are_inside(height_m: float) -> None:
    watched = Watched()
    watched.moves(1, (20.0, 30.0, height_m))
    assert watched.look() == []


@pytest.mark.parametrize("why", ["in the formation", "on the ground", "not seen"])
def test_only_one_that_is_seen_to_fly_in_its_pilots_hands_is_reported_and_no_longer_afterwards(why: str) -> None:
    watched = Watched()

    def excused(excused: bool) -> None:
        second = watched.of(2)
        second.member = Member.FLYING if excused and why == "in the formation" else Member.PARTED
        second.airborne = not (excused and why == "on the ground")
        watched.moves(2, ABOVE_M)
        if excused and why == "not seen":
            second.telemetry.motion = None

    excused(True)
    assert watched.look() == []
    excused(False)
    assert watched.look() == [BEGINS.format(12.5)]
    excused(True)
    assert watched.look() == [ENDS]


@pytest.mark.parametrize("member", [each for each in Member if each is not Member.PARTED])
def test_what_the_station_commands_or_waits_for_is_not_its_pilots(member: Member) -> None:
    watched = Watched()
    watched.of(2).member = member
    watched.moves(2, ABOVE_M)
    assert watched.look() == []


def test_without_a_fence_none_is_outside() -> None:
    watched = Watched(None)
    watched.moves(2, (9e5, -8e5, 7000.0))
    assert watched.look() == []


def test_the_feature_is_this_stage() -> None:
    (stage,) = FEATURE.stages(Watched().cycle)
    assert isinstance(stage, PilotsOutsideFence)
