import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation_scenario.formation import CUSTOM, SHAPE_NAMES
from formation_scenario.slot_assignment import slot_schedule, slot_table, slots

SHAPES = tuple(name for name in SHAPE_NAMES if name != CUSTOM)
shapes = st.sampled_from(sorted(SHAPES))
counts = st.integers(1, 60)


def nearest(table: np.ndarray) -> float:
    positions = np.vstack((np.zeros(3), table))
    distances = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    return float(np.min(distances + np.diag(np.full(len(positions), np.inf))))


@given(shapes, counts, st.floats(0.5, 1000))
def test_no_two_vehicles_are_nearer_than_the_spacing(shape, count, spacing):
    table = slots(shape, count, spacing)
    assert table.shape == (count, 3)
    assert nearest(table) >= spacing * (1 - 1e-9)


@given(shapes.filter(lambda shape: shape not in {"circle", "plus"}), counts)
def test_no_slot_is_ahead_of_the_leader(shape, count):
    assert slots(shape, count, 30.0)[:, 0].max() <= 0.0


@given(shapes.filter(lambda shape: shape != "circle"), counts)
def test_another_follower_moves_no_slot(shape, count):
    np.testing.assert_array_equal(slots(shape, count + 1, 30.0)[:count], slots(shape, count, 30.0))


@given(shapes, counts, st.floats(1, 100))
def test_slots_scale_with_the_spacing_and_are_level(shape, count, spacing):
    table = slots(shape, count, spacing)
    np.testing.assert_allclose(table, spacing * slots(shape, count, 1.0))
    assert not table[:, 2].any()


@given(st.sampled_from(["diamond", "triangle", "square"]), counts)
def test_filled_shapes_are_compact(shape, count):
    extent = np.ptp(slots(shape, count, 1.0)[:, :2], axis=0)
    assert extent.max() <= 2.0 * np.sqrt(2.0 * (count + 1))


@pytest.mark.parametrize("shape", sorted(SHAPES))
@pytest.mark.parametrize("count", [0, 250])
def test_none_and_a_full_network_have_slots(shape, count):
    table = slots(shape, count, 30.0)
    assert table.shape == (count, 3)
    assert nearest(table) >= 30.0 * (1 - 1e-9)


def test_diamond_of_four():
    np.testing.assert_array_equal(slots("diamond", 3, 30.0), [[-30, -30, 0], [-30, 30, 0], [-60, 0, 0]])


@pytest.mark.parametrize("side", [2, 3, 4, 7])
def test_full_diamonds_are_symmetric_fore_and_aft(side):
    positions = np.vstack((np.zeros(3), slots("diamond", side * side - 1, 1.0)))
    length = 2 * (side - 1)
    rows = [int(np.sum(positions[:, 0] == -row)) for row in range(length + 1)]
    assert rows == [min(row, length - row) + 1 for row in range(length + 1)]


@pytest.mark.parametrize("side", [3, 5, 7])
def test_full_odd_squares_have_the_leader_in_the_middle_of_the_front_row(side):
    positions = {tuple(position) for position in np.vstack((np.zeros(3), slots("square", side * side - 1, 1.0)))}
    half = side // 2
    assert positions == {(-row, column, 0) for row in range(side) for column in range(-half, half + 1)}


def test_golden_slots_of_the_small_formations():
    np.testing.assert_array_equal(slots("follower", 2, 20.0), [[-20, 0, 0], [-40, 0, 0]])
    np.testing.assert_array_equal(slots("line", 3, 20.0), [[0, -20, 0], [0, 20, 0], [0, -40, 0]])
    np.testing.assert_array_equal(slots("echelon", 2, 20.0), [[-20, 20, 0], [-40, 40, 0]])
    np.testing.assert_array_equal(slots("arrow", 3, 20.0), [[-20, -20, 0], [-20, 20, 0], [-40, -40, 0]])
    np.testing.assert_array_equal(slots("plus", 4, 20.0), [[-20, 0, 0], [0, -20, 0], [0, 20, 0], [20, 0, 0]])
    np.testing.assert_allclose(slots("triangle", 2, 20.0), [[-17.320508, -10, 0], [-17.320508, 10, 0]])


@given(st.integers(2, 60))
def test_a_circle_is_a_regular_polygon_around_the_leader(count):
    table = slots("circle", count, 30.0)
    radii = np.hypot(table[:, 0], table[:, 1])
    np.testing.assert_allclose(radii, radii[0])
    np.testing.assert_allclose(table.mean(axis=0), 0.0, atol=1e-9)


def test_custom_slots_are_in_the_order_of_the_followers(load):
    scenario = load(
        "formation={shape: custom, slots_m: {4: [-4, 0, 9], 2: [-20, 0, 0], '1:3': [-30, 0, 1]}}",
    )
    np.testing.assert_array_equal(slot_table(scenario), [[-20, 0, 0], [-30, 0, 1], [-4, 0, 9]])


def test_the_schedule_has_each_change_with_its_own_spacing_and_slots(load):
    own = "{2: [-10, 0, 0], 3: [-20, 0, 0], 4: [-30, 0, 0]}"
    steps = slot_schedule(
        load(
            f"formation.changes=[{{at_s: 90, shape: custom, slots_m: {own}}},"
            " {at_s: 60, shape: follower, spacing_m: 50}, {at_s: 70, shape: line}]"
        )
    )
    assert [(step.at_s, step.shape) for step in steps] == [
        (0.0, "diamond"),
        (60.0, "follower"),
        (70.0, "line"),
        (90.0, "custom"),
    ]
    assert steps[1].positions_m[1:, 0].tolist() == [-50.0, -100.0, -150.0]
    assert steps[2].positions_m[1:, 1].tolist() == [-30.0, 30.0, -60.0]
    assert steps[3].positions_m[1:, 0].tolist() == [-10.0, -20.0, -30.0]
