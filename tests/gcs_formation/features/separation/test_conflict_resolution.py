"""The separation rule: encounters flown by model (7), with and without it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight_model.vehicle_arrays import Setpoints
from gcs_formation.features.separation.conflict_resolution import resolve
from gcs_formation.features.separation.traffic import MARGIN_M
from tests.gcs_formation.features.separation.encounters import KEPT_M, Vehicles, encounter, picture, wanted

LIMIT_M = 5.0
PI = math.pi
ENCOUNTERS: dict[str, list[list[float]]] = {
    "head-on": [[0, 0, 100, 22, 0, 0], [600, 0, 100, 22, PI, 0]],
    "crossing": [[0, 0, 100, 22, 0, 0], [300, -300, 100, 22, PI / 2, 0]],
    "overtaking": [[0, 0, 100, 16, 0, 0], [-150, 0, 100, 28, 0, 0]],
    "in a turn": [[0, 0, 100, 22, 0, 0.05], [0, 60, 100, 22, 0, -0.02]],
}
LINKS = [*(pytest.param(delay_s, 0.0, 0.0, marks=pytest.mark.slow) for delay_s in (0.0, 0.3)), (0.3, 0.05, 0.1)]
NIGHTLY = [pytest.param(name, marks=pytest.mark.slow) for name in ("overtaking", "in a turn")]


@pytest.mark.parametrize(("delay_s", "jitter_s", "loss"), LINKS)
@pytest.mark.parametrize("name", ["head-on", "crossing", *NIGHTLY])
def test_the_distance_is_kept_where_it_would_be_broken(name: str, delay_s: float, jitter_s: float, loss: float) -> None:
    vehicles = Vehicles(ENCOUNTERS[name], delay_s=delay_s, jitter_s=jitter_s, loss=loss)
    assert encounter(vehicles, 16, rule=False).min_m < 6.0
    flown = encounter(vehicles, 18)
    assert flown.min_m > 0.9 * KEPT_M
    assert not flown.gave_way[0], "the leader yields last"
    if not loss:
        assert flown.changes.max() <= 2, "it begins once and ends once"


@pytest.mark.slow
def test_four_that_meet_at_one_point_pass_on_levels_of_their_own() -> None:
    across: list[list[float]] = [[300, 300, 100, 22, -PI / 2, 0], [300, -300, 100, 22, PI / 2, 0]]
    flown = encounter(Vehicles(ENCOUNTERS["head-on"] + across), 25)
    assert flown.min_m > 0.9 * KEPT_M
    assert not flown.gave_way[0]


@pytest.mark.parametrize("turn_rps", [pytest.param(0.0, marks=pytest.mark.slow), 0.05])
def test_who_isn_t_commanded_is_kept_away_from(turn_rps: float) -> None:
    rows: list[list[float]] = [[0, 0, 100, 22, 0, 0], [300 - 440 * turn_rps, -300, 100, 22, PI / 2, turn_rps]]
    flown = encounter(Vehicles(rows, commanded=[True, False]), 18)
    assert flown.min_m > 0.9 * KEPT_M
    assert not flown.gave_way[1]


@pytest.mark.parametrize(
    ("turn_rps", "east_m", "heading"), [pytest.param(-0.03, -40.0, 0.0, marks=pytest.mark.slow), (-0.05, -30.0, 0.1)]
)
def test_a_leader_in_its_bend_can_fly_on_as_it_reckoned(turn_rps: float, east_m: float, heading: float) -> None:
    """One without commands flies straight on inside the bend. States are exact: the prediction must be, too."""
    rows: list[list[float]] = [[0, 0, 100, 22, 0, turn_rps], [0, east_m, 100, 21.5, heading, 0]]
    flown = encounter(Vehicles(rows, commanded=[True, False]), 16)
    assert flown.gave_way[0]
    assert flown.min_m > KEPT_M


def test_no_vehicle_is_sent_below_the_floor() -> None:
    vehicles = Vehicles([[0, 0, 100, 22, 0, 0], [600, 0, 99, 22, PI, 0]])
    assert np.min([setpoints[2] for setpoints in encounter(vehicles, 15).setpoints]) < 95
    vehicles.floor_m = 95
    flown = encounter(vehicles, 15)
    assert np.min([setpoints[2] for setpoints in flown.setpoints]) >= 99
    assert flown.min_m > 0.9 * KEPT_M


@pytest.mark.parametrize("fence_m", [(0.0, 105.0), (95.0, 200.0), (98.0, 102.0)])
def test_one_that_manoeuvres_stays_within_the_heights_of_the_fence(fence_m: tuple[float, float]) -> None:
    """Up and down are equally far, so it descends under the first limit; within the last it turns."""
    flown = encounter(Vehicles(ENCOUNTERS["head-on"], fence_m=fence_m), 18)
    heights_m = np.array([setpoints[2] for setpoints in flown.setpoints])
    assert fence_m[0] <= heights_m.min()
    assert heights_m.max() <= fence_m[1]
    assert flown.gave_way[1]
    assert flown.min_m > 0.9 * KEPT_M


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_random_encounters_never_break_the_limit(seed: int) -> None:
    assert encounter(random_encounter(seed), 30).min_m > LIMIT_M


def random_encounter(seed: int) -> Vehicles:
    """Return 2 to 4 vehicles that meet within 8 m of a point after 8 to 20 s, some of them in turns."""
    random = np.random.default_rng(seed)
    meet_s, rows = random.uniform(8, 20), list[list[float]]()
    for direction in random.uniform(-PI, PI) + np.arange(random.integers(2, 5)) * random.uniform(1.0, 2.0):
        speed, (north, east, up) = random.uniform(17, 27), random.uniform(-8, 8, 3)
        turn = 0.0 if random.random() < 0.6 else random.uniform(-0.04, 0.04)
        way = meet_s * speed * np.array((math.cos(direction), math.sin(direction)))
        rows.append([north - way[0], east - way[1], 100 + up / 2, speed, direction, turn])
    delay_s, jitter_s, loss = (float(random.choice(values)) for values in ((0, 0.1, 0.3), (0, 0.03), (0, 0.1)))
    return Vehicles(rows, delay_s=delay_s, jitter_s=jitter_s, loss=loss, seed=seed)


places = st.floats(-400, 400)
rows = st.lists(
    st.tuples(places, places, st.floats(80, 120), st.floats(16, 28), st.floats(-PI, PI), st.just(0.0)).map(list),
    min_size=2,
    max_size=5,
)


@settings(max_examples=60, deadline=None)
@given(rows)
def test_what_is_commanded_stays_in_the_envelope_and_one_that_passes_is_commanded_the_same_bits(
    rows: list[list[float]],
) -> None:
    vehicles = Vehicles(rows)
    law = wanted(vehicles, 0.0)
    decided = resolve(picture(vehicles, vehicles.state, law), np.zeros(len(rows)))
    setpoints, yielding = decided.setpoints, decided.side != 0
    assert np.array_equal(setpoints.table[:, ~yielding], law.table[:, ~yielding])
    assert np.isfinite(setpoints.table).all()
    assert ((setpoints.speed_mps >= 16) & (setpoints.speed_mps <= 28)).all()
    assert (np.abs(setpoints.height_m - vehicles.state.height_m) <= 12 + 1e-9).all()
    assert all(yielding[conflict.vehicle] for conflict in decided.conflicts)


@settings(max_examples=60, deadline=None)
@given(st.integers(2, 40), st.floats(12.5, 100), st.floats(-PI, PI), st.integers(0, 2**32 - 1))
def test_a_formation_is_left_alone(count: int, spacing_m: float, heading: float, seed: int) -> None:
    """Slots from the least spacing at which 10 m are kept, and speeds that differ by typical corrections."""
    random = np.random.default_rng(seed)
    rows = [
        [spacing_m * (i // 6), spacing_m * (i % 6), 100.0, 22 + random.uniform(-0.3, 0.3), heading, 0.0]
        for i in range(count)
    ]
    vehicles = Vehicles(rows)
    law = wanted(vehicles, 0.0)
    decided = resolve(picture(vehicles, vehicles.state, law), np.zeros(count))
    assert decided.setpoints.table.tobytes() == law.table.tobytes()
    assert not decided.side.any()


@pytest.mark.parametrize(
    ("rising_mps", "commanded_m", "manoeuvres"),
    [(1.0, 106.1, False), (-1.0, 114.1, False), (-1.0, 110.1, True), (1.0, 98.1, True)],
)
def test_the_air_that_carries_a_vehicle_is_part_of_its_way(
    rising_mps: float, commanded_m: float, *, manoeuvres: bool
) -> None:
    """One flies 10.1 m above another, where 10 m are kept, in air that rises or sinks.

    Its lags add up to 4 s: commanded 4 m below its height in air that rises at 1 m/s, it keeps that height.
    """
    vehicles = Vehicles([[0, 0, 100, 22, 0, 0], [0, 0, 110.1, 22, 0, 0]])
    state = vehicles.state
    state.updraught_mps[1] = rising_mps
    commands = Setpoints(state.airspeed_mps, state.heading_rad, np.array([100.0, commanded_m]))
    decided = resolve(picture(vehicles, state, commands), np.zeros(2))
    assert bool(decided.side[1]) == manoeuvres
    if manoeuvres:
        pass_m = 100.0 + KEPT_M + MARGIN_M
        assert decided.setpoints.height_m[1] == pytest.approx(pass_m - 4.0 * rising_mps)
