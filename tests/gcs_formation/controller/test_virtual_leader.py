"""At whose centroid a virtual leader is under the consensus law: at that of the vehicles that fly in the formation."""

from __future__ import annotations

import math

import pytest

from airlink.clock import NANOSECONDS, Instant, after
from flight_model.flight_state import FlightState
from formation_scenario import load_scenario
from gcs_formation.control.law_interface import LawOutput
from gcs_formation.controller.controller import FormationController
from gcs_formation.recorder import Tick, VehicleLink, unknown_state
from tests.flights.conftest import scenario

COUNT = 4
"""The virtual leader and three followers."""
NORTH_M, EAST_M, HEIGHT_M = 400.0, -300.0, 100.0
"""Where the leader is whose slots they fly in."""
SPEED_MPS, NOW = 22.0, after(Instant(0), 100.0)
UPLINK_S = (0.0, 0.1, 0.2, 0.6)
LEADER = NORTH_M, EAST_M, HEIGHT_M


class Formation:
    """Three vehicles in the slots of a leader that flies north; their states are 0.1, 0.2 and 0.3 s old."""

    def __init__(self) -> None:
        followers = [{"id": number, "role": "follower"} for number in (1, 2, 3)]
        shape = {"shape": "triangle", "spacing_m": 30}
        planned = load_scenario(scenario(vehicles=followers, law={"type": "consensus"}, formation=shape))
        self.controller = FormationController(planned)
        self.ready, self.off_m = [True] * COUNT, [0.0] * COUNT
        self.known = [False, True, True, True]

    def begin_tick(self) -> Tick:
        """Begin a tick with these vehicles in the formation, each as far east of its slot as it is."""
        slots_m, links = self.controller.plan.goal_m, list[VehicleLink]()
        for index, known in enumerate(self.controller.estimator.filters):
            link = VehicleLink(NOW)
            link.ready, link.delay_s = self.ready[index], UPLINK_S[index]
            links.append(link)
            forward_m, right_m, up_m = map(float, slots_m[index])
            if self.known[index]:
                east_m = EAST_M + right_m + self.off_m[index]
                place = NORTH_M + forward_m, east_m, HEIGHT_M + up_m
                known.place(FlightState(*place, 0.0, SPEED_MPS, 0.0, 0.0, 0.0), after(NOW, -0.1 * index))
        return self.controller.begin_tick(NOW, math.nan, "flying", links, [math.nan] * COUNT)

    def flown(self) -> None:
        """Let a tick be flown, at which the law saw the present errors of those in the formation."""
        tick = self.begin_tick()
        assert self.controller.follow(tick)
        for index in range(1, COUNT):
            if tick.active[index]:
                error_m = 0.0, -self.off_m[index], 0.0
                tick.decided[index] = LawOutput(index, unknown_state(), error_m, error_m, error_m, (0.0,) * 9)
        self.controller.take_final(tick)
        self.controller.last_tick = tick

    def placed(self) -> tuple[float, float, float]:
        """Begin another tick; return where the leader is then."""
        self.begin_tick()
        state = self.controller.estimator.filters[0].state
        assert state is not None
        return state.north_m, state.east_m, state.height_m

    @property
    def age_s(self) -> float:
        """How old the leader's state is."""
        return self.controller.estimator.age_s(0, NOW)

    @property
    def acts_s(self) -> float:
        """After what time the leader's setpoint of the last tick acts."""
        sent = self.controller.history.of(0)
        return (sent.acts[sent.end - 1] - NOW) / NANOSECONDS


@pytest.mark.parametrize("leaves", [1, 2, 3])
def test_it_stays_where_it_is_when_a_vehicle_leaves(leaves: int) -> None:
    formation = Formation()
    formation.flown()
    assert formation.placed() == pytest.approx(LEADER)
    formation.ready[leaves] = False
    assert formation.placed() == pytest.approx(LEADER)
    formation.off_m[leaves] = 300.0
    assert formation.placed() == pytest.approx(LEADER)


def test_its_state_is_as_old_as_those_of_the_vehicles_in_the_formation() -> None:
    formation = Formation()
    formation.flown()
    assert formation.age_s == pytest.approx(0.2)
    formation.ready[3] = False
    formation.flown()
    assert formation.age_s == pytest.approx(0.15)


def test_its_setpoint_acts_when_those_of_the_vehicles_in_the_formation_act_on_average() -> None:
    formation = Formation()
    formation.flown()
    assert formation.acts_s == pytest.approx(0.3)
    formation.ready[3] = False
    formation.flown()
    assert formation.acts_s == pytest.approx(0.15)


def test_a_vehicle_that_comes_back_counts_from_when_it_is_in_its_slot() -> None:
    formation = Formation()
    formation.flown()
    formation.ready[2] = False
    formation.flown()
    formation.ready[2], formation.off_m[2] = True, 300.0
    formation.flown()
    assert formation.placed() == pytest.approx(LEADER)
    formation.off_m[2] = 1.5
    formation.flown()
    assert formation.placed() == pytest.approx((NORTH_M, EAST_M + 0.5, HEIGHT_M))
    formation.off_m[2] = 30.0
    formation.flown()
    assert formation.placed() == pytest.approx((NORTH_M, EAST_M + 10.0, HEIGHT_M)), "from then on wherever it is"


def test_one_of_which_nothing_is_known_does_not_hold_it_up() -> None:
    formation = Formation()
    formation.known[2] = False
    formation.flown()
    assert formation.placed() == pytest.approx(LEADER)
    assert formation.age_s == pytest.approx(0.2)


def test_without_any_vehicle_it_flies_on_by_its_setpoints() -> None:
    formation = Formation()
    formation.flown()
    formation.ready[1:] = [False] * 3
    north_m, east_m, _ = formation.placed()
    assert (north_m, east_m) == pytest.approx((NORTH_M + 0.2 * SPEED_MPS, EAST_M))
    assert formation.age_s == 0.0


def test_without_any_vehicle_from_the_beginning_it_is_nowhere() -> None:
    formation = Formation()
    formation.ready[1:] = [False] * 3
    assert math.isnan(formation.begin_tick().age_s[0])


def test_when_all_come_back_it_is_where_they_are() -> None:
    formation = Formation()
    formation.flown()
    formation.ready[1:] = [False] * 3
    formation.flown()
    formation.ready[1:], formation.off_m[1:] = [True] * 3, [90.0] * 3
    assert formation.placed() == pytest.approx((NORTH_M, EAST_M + 90.0, HEIGHT_M))
