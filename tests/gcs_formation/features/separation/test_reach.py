"""The bound that saves predictions: it skips no pair that comes too close, and a formation needs no predictions."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight_model.slot import UNKNOWN
from flight_model.vehicle_arrays import FlightStates, Setpoints
from gcs_formation.features.separation.approach import approach, fly, fly_level, may_come_near
from gcs_formation.features.separation.broad_phase import BroadPhase, KeptDistance
from gcs_formation.features.separation.traffic import TrafficPicture, bound, possible_pairs
from tests.gcs_formation import tables
from tests.gcs_formation.features.separation.encounters import KEPT_M, Vehicles, model, picture, wanted

PI = np.pi


def wanted_by_all(made: TrafficPicture) -> Setpoints:
    """Return the setpoints of a scene; vehicles that nobody commands are assumed to continue."""
    state = made.traffic.state
    on = np.array((state.airspeed_mps, state.heading_rad, state.height_m))
    return Setpoints.of(np.where(made.commanded, made.setpoints.table, on))


def random_scene(seed: int, count: int, spread_m: float, unlike: float, *, hovers: bool = False) -> TrafficPicture:
    """Return vehicles near each other; `unlike`: how much speeds, headings, winds and setpoints differ, 0 to 1.

    Multirotors fly velocities over ground, and have no wind.
    """
    random = np.random.default_rng(seed)
    commanded = [True, *(random.random(count - 1) < 0.8).tolist()]
    rows = [
        [*random.uniform(-spread_m, spread_m, 2), 100.0, 22 + 6 * u, PI * v, 0.0 if own else random.uniform(-0.1, 0.1)]
        for own, u, v in zip(commanded, *(unlike * random.uniform(-1, 1, (2, count))), strict=True)
    ]
    vehicles = Vehicles(rows, commanded=commanded, delay_s=random.uniform(0, 0.3))
    law = wanted(vehicles, 0.0)
    setpoints = Setpoints(
        np.clip(law.speed_mps + 6 * unlike * random.uniform(-1, 1, count), 16, 28),
        law.heading_rad + PI * unlike * random.uniform(-1, 1, count),
        law.height_m,
    )
    wind_mps = 0.0 if hovers else 2.0
    winds = FlightStates(*vehicles.state.table[:6], *(wind_mps * unlike * random.uniform(-1, 1, (2, count))))
    made = picture(vehicles, winds, setpoints)
    slots_m, each_m = random.uniform(-15, 15, (3, count)), random.uniform(0, 2 * KEPT_M, (count, count))
    slots_m[:, random.random(count) < 0.2] = np.nan
    kept = KeptDistance(KEPT_M, np.minimum(each_m, each_m.T) if random.random() < 0.5 else None)
    made = replace(made, slots_m=slots_m, kept=kept)
    traffic = replace(made.traffic, lead_s=random.uniform(0, 0.3, count), hovers=hovers)
    return replace(made, traffic=replace(traffic, accel_mps2=2 * unlike * random.uniform(-1, 1, (2, count))))


@settings(max_examples=200, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(2, 12),
    st.floats(5, 300),
    st.sampled_from((0.0, 0.003, 0.01, 0.1, 0.5, 1.0)),
    st.booleans(),
)
def test_no_pair_is_left_out_that_comes_too_near(
    seed: int, count: int, spread_m: float, unlike: float, hovers: bool
) -> None:
    made = random_scene(seed, count, spread_m, unlike, hovers=hovers)
    one, other = np.triu_indices(count, 1)
    options = fly(made.traffic, made.as_commanded(), made.times_s, made.trails_m)
    near = approach(options[:, :, one], options[:, :, other], made.minimum(one, other), made.times_s)
    ours = made.commanded[one] | made.commanded[other]
    pairs = list(zip(one[ours].tolist(), other[ours].tolist(), strict=True))
    bad = {pair for pair, lack in zip(pairs, near.deficit_m_s[ours].tolist(), strict=True) if lack > 1e-9}
    possible = set(zip(*(side.tolist() for side in possible_pairs(made)), strict=True))
    assert bad <= possible <= set(pairs)
    assert np.allclose(fly_level(made.traffic, made.as_commanded(), made.times_s), options[:2], rtol=0, atol=1e-9)


@settings(max_examples=200, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(2, 12),
    st.floats(5, 3000),
    st.sampled_from((0.0, 0.003, 0.01, 0.1, 0.5)),
    st.booleans(),
)
def test_the_broad_phase_check_on_plain_numbers_finds_a_pair_where_there_is_one(
    seed: int, count: int, spread_m: float, unlike: float, hovers: bool
) -> None:
    made = random_scene(seed, count, spread_m, unlike, hovers=hovers)
    made = replace(made, commanded=np.ones(count, dtype=bool), setpoints=wanted_by_all(made))
    models, (_, first_s, *_, horizon_s) = tables.models(made.traffic.model), made.times_s.tolist()
    look = BroadPhase(models, first_s, horizon_s, hovers=hovers)
    states, setpoints = tables.states(made.traffic.state), tables.setpoints(made.setpoints)
    early_s, timing_s = made.traffic.lead_s.tolist(), made.timing_s.tolist()
    accel = np.hypot(*made.traffic.accel_mps2).tolist()
    slots_m = [(forward, right, up) for forward, right, up in made.slots_m.T.tolist()]
    for _ in range(2):  # the second time in the order found
        look.begin_test(states[0], setpoints[0][0], setpoints[0][1])
        for place, (state, commands) in enumerate(zip(states, setpoints, strict=True)):
            look.see(
                place, state, slots_m[place], commands[0], commands[1], early_s[place], timing_s[place], accel[place]
            )
        assert look.all_separated(made.kept) == (possible_pairs(made)[0].size == 0)


@pytest.mark.parametrize("along", [0, 1])
@pytest.mark.parametrize(("apart_m", "separated"), [(9.9, False), (10.1, True)])
def test_two_that_are_near_are_found_whatever_the_order_of_all_is_and_was_before(
    along: int, apart_m: float, separated: bool
) -> None:
    """Two abreast, and three far from them and from each other, on a line northwards or eastwards."""
    places_m = -3000.0, 0.0, apart_m, 1500.0, 4000.0
    look = BroadPhase(tables.models(model(len(places_m))), 0.3, 12.0, hovers=False)
    for order in permutations(places_m):
        place_m = np.zeros((2, len(order)))
        place_m[along] = order
        vehicles = Vehicles([[north_m, east_m, 100, 22, 0, 0] for north_m, east_m in place_m.T.tolist()])
        states = tables.states(vehicles.state)
        look.begin_test(states[0], 22.0, 0.0)
        for index, state in enumerate(states):
            look.see(index, state, UNKNOWN, 22.0, 0.0, 0.0, 0.0, 0.0)
        assert look.all_separated(KeptDistance(KEPT_M)) == separated


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(10, 300), st.floats(0, 1))
def test_no_neighbour_is_left_out_that_any_way_comes_too_near(seed: int, spread_m: float, unlike: float) -> None:
    made = random_scene(seed, 12, spread_m, unlike)
    options = fly_level(made.traffic, made.as_commanded(), made.times_s)
    others = np.arange(3, 12)
    minimum = made.minimum(np.full(others.size, 0), others)
    near = may_come_near(options[:, :, :3], options[:, :, others], minimum, made.times_s)
    for own in range(3):
        come = approach(
            np.repeat(options[:, :, [own]], others.size, axis=2), options[:, :, others], minimum, made.times_s
        )
        assert near[come.deficit_m_s > 1e-9].all()


def test_a_formation_in_its_slots_needs_no_ways() -> None:
    rows: list[list[float]] = [
        [30.0 * (i // 6), 30.0 * (i % 6), 100, 22 + 0.5 * (i % 3), 0.02 * (i % 2), 0] for i in range(100)
    ]
    vehicles = Vehicles(rows)
    one, _ = possible_pairs(picture(vehicles, vehicles.state, wanted(vehicles, 0.0)))
    assert one.size == 0


def test_among_many_the_search_for_pairs_that_are_near_finds_all_that_a_look_at_each_does() -> None:
    """Forty vehicles with large timing errors, which count for both vehicles of a pair."""
    made = replace(random_scene(7, 40, 3000.0, 1.0), timing_s=np.full(40, 20.0))
    reach = bound(made)
    one, other = np.triu_indices(40, 1)
    minimum = made.minimum(one, other)
    distance_m = np.hypot(*(reach.position_m[:, other] - reach.position_m[:, one]))
    needed_m = minimum.distance_m + minimum.timing_s * (reach.fast_mps[one] + reach.fast_mps[other])
    near = (distance_m < needed_m + reach.far_m[one] + reach.far_m[other]) & (
        made.commanded[one] | made.commanded[other]
    )
    np.testing.assert_array_equal(possible_pairs(made), (one[near], other[near]))
    assert 0 < near.sum() < one.size


def test_along_multirotors_is_as_the_leader_is_commanded_whatever_velocity_a_manoeuvre_or_braking_has_left_it() -> None:
    vehicles = Vehicles([[0, 0, 100, 25, 1, 0], [-12, 0, 100, 25, 1, 0]])
    made = picture(vehicles, vehicles.state, wanted(vehicles, 0.0))
    commands = Setpoints(np.full(2, 17.0), np.full(2, 2.0), np.full(2, 100.0))
    hovers = replace(made, setpoints=commands, traffic=replace(made.traffic, hovers=True))
    assert [each.tolist() for each in hovers.along] == [[17.0, 17.0], [2.0, 2.0]]
    assert hovers.lasting(0) == (17.0, 2.0)
    assert [each.tolist() for each in made.along] == [[25.0, 25.0], [1.0, 1.0]]
