"""The law where slots are fixed to north and east: errors along these, and no swing in the leader's turns."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flight_model.vehicle_arrays import FlightStates, Setpoints
from formation_scenario.fields import Frame
from gcs_formation.control.laws import FormationLaw, VelocityController
from tests.gcs_formation import tables
from tests.gcs_formation.control.law_ticks import (
    COUNT,
    DT_S,
    FOLLOWERS,
    MODEL,
    SLOTS_M,
    SPEED_MPS,
    Array,
    cycle_input,
    law,
    parameters,
    sent,
    state,
)
from tests.gcs_formation.tables import TableLaw

NORTH: Frame = "north"
OFF_M = np.array([3.0, -2.0, 1.0])


def in_slots(heading_rad: float, off_m: Array) -> FlightStates:
    """Return vehicles north and east of their leader, the followers `off_m` from their slots; all fly as it does."""
    north, east, up = (SLOTS_M + np.where(np.arange(COUNT)[:, None] > 0, off_m, 0.0)).T
    still = np.zeros(COUNT)
    return state(np.array((north, east, 100.0 + up, still, still + SPEED_MPS, still + heading_rad, still, still)))


@pytest.mark.parametrize("heading_rad", [0.0, 1.2, -2.8])
def test_errors_are_to_the_north_and_east_whatever_the_heading(heading_rad: float) -> None:
    found = law(frame=NORTH).decide(cycle_input(in_slots(heading_rad, OFF_M)), DT_S)
    assert found.error_m == pytest.approx(np.tile(-OFF_M, (COUNT - 1, 1)), abs=1e-9)


def test_so_are_those_of_vehicles_that_hover() -> None:
    own = TableLaw(FormationLaw(parameters(frame=NORTH), tables.models(MODEL), VelocityController))
    assert own.decide(cycle_input(in_slots(1.2, OFF_M)), DT_S).error_m == pytest.approx(
        np.tile(-OFF_M, (COUNT - 1, 1)), abs=1e-9
    )


@pytest.mark.parametrize("turn_rps", [-0.1, 0.1])
def test_in_a_turn_all_are_commanded_the_leaders_own(turn_rps: float) -> None:
    """A slot outside the turn isn't faster, one inside not slower: each setpoint leads the turn by its own lag."""
    states = in_slots(0.7, np.zeros(3))
    commanded = states.table.copy()
    found = law(frame=NORTH).decide(
        cycle_input(states, Setpoints(commanded[4], 0.7 + turn_rps * MODEL.tau_psi_s, commanded[2]), turn_rps), DT_S
    )
    speed_mps, heading_rad, _ = sent(found).T
    assert speed_mps == pytest.approx(np.full(COUNT - 1, SPEED_MPS), abs=1e-3)
    leads_rad = heading_rad - 0.7
    assert np.sign(leads_rad) == pytest.approx(np.full(COUNT - 1, math.copysign(1.0, turn_rps)))
    rates_rps = leads_rad / MODEL.tau_psi_s[FOLLOWERS]
    assert rates_rps == pytest.approx(np.full(COUNT - 1, rates_rps[0]), rel=0.05)
