"""Whose path back to its slot must be clear before a manoeuvre ends: a multirotor's, from uncommanded vehicles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flight_model.vehicle_arrays import AutopilotModels, Setpoints
from gcs_formation.features.separation.conflict_resolution import resolve
from gcs_formation.features.separation.traffic import TrafficPicture
from tests.gcs_formation.features.separation.encounters import Vehicles, picture, wanted
from tests.gcs_formation.features.separation.test_released import HOVERING


def leaving(other_north_m: float) -> TrafficPicture:
    """Return a multirotor that flies south at 3 m/s and is commanded north, and another that follows it uncommanded."""
    rows: list[list[float]] = [[0, 0, 100, 3, np.pi, 0], [other_north_m, 0, 100, 3, np.pi, 0]]
    vehicles = Vehicles(rows, commanded=[True, False])
    back = Setpoints(np.full(2, 6.0), np.zeros(2), np.full(2, 100.0))
    made = picture(vehicles, vehicles.state, back)
    models = AutopilotModels(*(np.full(2, value) for value in HOVERING.values()))
    return replace(made, traffic=replace(made.traffic, model=models, hovers=True))


@pytest.mark.parametrize(
    ("other_north_m", "manoeuvres"), [(14.5, True), (19.5, True), (20.5, False), (30.0, False), (-60.0, False)]
)
def test_a_multirotor_goes_on_while_its_path_back_comes_within_10_m_of_an_uncommanded_one_in_4_s(
    other_north_m: float, manoeuvres: bool
) -> None:
    """By 3.8 s, the last sample before 4 s, it has come 10 m closer; straight on it would be 3 m closer after 12 s."""
    made = leaving(other_north_m)
    assert bool(resolve(made, np.array((1.0, 0.0))).side[0]) is manoeuvres
    assert not resolve(made, np.zeros(2)).side.any()


def test_a_fixed_wing_ends_its_manoeuvre_where_it_is_clear_straight_on() -> None:
    """One that is met 15 m to the right after 2 s, where it is commanded: straight on it passes at more than 11 m."""
    vehicles = Vehicles([[0, 0, 100, 22, 0, 0], [88, 15, 100, 22, np.pi, 0]], commanded=[True, False])
    to_right = Setpoints(np.full(2, 22.0), np.array((0.6, np.nan)), np.full(2, 100.0))
    made = picture(vehicles, vehicles.state, to_right)
    assert not resolve(made, np.array((1.0, 0.0))).side.any()
    assert resolve(picture(vehicles, vehicles.state, wanted(vehicles, 0.0)), np.array((1.0, 0.0))).side[0] == 0.0
