"""Delay margin of the consensus protocol: golden values, the rightmost root, and theorems."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formation_scenario.consensus_graph import graph_adjacency
from gcs_formation.stability import consensus_delay_margin
from gcs_formation.stability.consensus_loops import as_adjacency, ground_consensus_loops, laplacian
from gcs_formation.stability.pid_margins import delay_margin
from tests.gcs_formation.stability.rightmost_root import consensus_rightmost_root, rightmost_root

DIRECTED_RING = np.roll(np.eye(5), 1, axis=1)


@pytest.mark.parametrize(
    ("adjacency", "damping", "margin_s"),
    [
        (graph_adjacency("path", 4), 0.0, 0.3653558077),
        (graph_adjacency("path", 4), 0.5, 0.4082973558),
        (graph_adjacency("star", 10), 0.5, 0.1515650101),
        (graph_adjacency("complete", 10), 0.5, 0.1515650101),
        (graph_adjacency("star", 50), 2.0, 0.0318348921),
        (DIRECTED_RING, 0.5, 0.25405195821),
        (DIRECTED_RING, 0.0, 0.01337510802),
    ],
)
def test_golden_margins(adjacency, damping, margin_s):
    assert consensus_delay_margin(adjacency, 1.0, 1.0, damping) == pytest.approx(margin_s, abs=1e-10)


@pytest.mark.parametrize(("onboard", "delayed", "margin_s"), [(2.0, 0.0, 0.614), (0.0, 2.0, 0.267)])
def test_damping_on_board_buys_more_than_damping_through_the_link(onboard, delayed, margin_s):
    path = graph_adjacency("path", 4)
    loops = ground_consensus_loops(path, 1.0, 1.0, onboard, delayed)
    assert min(delay_margin(loop.open_loop()) for loop in loops) == pytest.approx(margin_s, abs=5e-4)


@pytest.mark.parametrize("adjacency", [graph_adjacency("path", 4), DIRECTED_RING])
@pytest.mark.parametrize(("k1", "k2", "damping"), [(1.0, 1.0, 0.0), (1.0, 1.0, 0.5), (0.4, 0.9, 0.3)])
def test_rightmost_root_is_on_the_axis_at_the_margin_and_crosses_there(adjacency, k1, k2, damping):
    margin = consensus_delay_margin(adjacency, k1, k2, damping)
    root = [
        consensus_rightmost_root(adjacency, k1, k2, damping, delays=share * margin).real for share in (0.98, 1.0, 1.02)
    ]
    assert root[0] < -1e-5
    assert abs(root[1]) < 1e-10
    assert root[2] > 1e-5


def test_paper_formula_is_the_undamped_case():
    eigenvalue = 2.0 + np.sqrt(2.0)  # largest of the path of 4
    squared = (eigenvalue**2 + np.sqrt(eigenvalue**4 + 4.0 * eigenvalue**2)) / 2.0
    margin = consensus_delay_margin(graph_adjacency("path", 4), 1.0, 1.0)
    assert margin == pytest.approx(np.arctan(np.sqrt(squared)) / np.sqrt(squared), rel=1e-12)


@given(st.floats(0.05, 3.0), st.floats(0.05, 3.0), st.sampled_from(["star", "path", "ring", "complete"]))
def test_undamped_margin_is_below_k2_over_k1_on_every_graph(k1, k2, name):
    assert 0.0 < consensus_delay_margin(graph_adjacency(name, 6), k1, k2) < k2 / k1


def test_lower_bound_by_the_largest_eigenvalue_modulus_is_no_bound_on_a_directed_graph():
    """A directed ring of 12 with little damping is unstable without delay; the undirected one is not."""
    ring = np.roll(np.eye(12), 1, axis=1)
    assert consensus_delay_margin(ring, 1.0, 1.0) < 0.0
    assert consensus_rightmost_root(ring, 1.0, 1.0).real > 0.0
    assert consensus_delay_margin(graph_adjacency("ring", 12), 1.0, 1.0) > 0.0


@given(st.integers(0, 10_000), st.floats(0.0, 1.0), st.floats(0.3, 1.5))
@settings(max_examples=60, deadline=None)
def test_margin_has_the_sign_of_stability_without_delay(seed, k3, k2):
    adjacency = np.random.default_rng(seed).random((4, 4)) ** 4
    margin = consensus_delay_margin(adjacency, 1.0, k2, k3)
    assert (margin > 0.0) == (consensus_rightmost_root(adjacency, 1.0, k2, k3).real < 0.0)


def test_leader_follower_chain_is_as_robust_as_its_weakest_link():
    """Its Laplacian is one Jordan block: each follower's own equation decides, in any order of rows."""
    order = np.random.default_rng(3).permutation(12)
    chain = np.eye(12, k=-1)[np.ix_(order, order)]
    assert consensus_delay_margin(chain, 1.0, 1.0, 0.5) == pytest.approx(
        consensus_delay_margin([[0, 0], [1, 0]], 1.0, 1.0, 0.5), rel=1e-12
    )


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("directed", [False, True])
def test_margin_with_damping_of_each_vehicle_is_where_the_rightmost_root_crosses(seed, directed):
    random = np.random.default_rng(seed)
    adjacency = random.random((4, 4)) * (random.random((4, 4)) < 0.7) + np.roll(np.eye(4), 1, axis=1)
    if not directed:
        adjacency = adjacency + adjacency.T
    h = random.random(4) * (random.random(4) < 0.8)
    margin = consensus_delay_margin(adjacency, 0.5, 1.0, 2.0, h)
    assert margin > 0.0
    at = [consensus_rightmost_root(adjacency, 0.5, 1.0, 2.0, h, s * margin, 16).real for s in (0.5, 0.98, 1, 1.02)]
    assert max(at[:2]) < 0.0
    assert abs(at[2]) < 1e-8
    assert at[3] > 0.0


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_least_damping_of_all_bounds_the_margin_of_an_undirected_graph(seed):
    random = np.random.default_rng(seed)
    weights = random.random((5, 5))
    adjacency, h = weights + weights.T, random.random(5)
    margin = consensus_delay_margin(adjacency, 1.0, 1.0, 1.0, h)
    assert margin >= consensus_delay_margin(adjacency, 1.0, 1.0, 1.0, h.min()) * (1.0 - 1e-9)


def test_equal_weights_are_the_limit_of_unequal_ones():
    path = graph_adjacency("path", 4)
    unequal = consensus_delay_margin(path, 1.0, 1.0, 0.5, [1.0, 1.0, 1.0, 1.0 + 1e-9])
    assert unequal == pytest.approx(0.4082973558, abs=1e-8)


def test_unequal_damping_keeps_the_sign_of_instability():
    ring = np.roll(np.eye(12), 1, axis=1)
    h = np.linspace(0.0, 0.1, 12)
    assert consensus_rightmost_root(ring, 1.0, 1.0, 1.0, h).real > 0.0
    assert consensus_delay_margin(ring, 1.0, 1.0, 1.0, h) < 0.0


@pytest.mark.parametrize("seed", range(3))
def test_any_symmetric_delays_below_the_uniform_margin_are_safe_on_an_undirected_graph(seed):
    random = np.random.default_rng(seed)
    path = graph_adjacency("path", 4)
    delays = np.triu(random.random((4, 4))) * consensus_delay_margin(path, 1.0, 1.0, 0.5)
    assert consensus_rightmost_root(path, 1.0, 1.0, 0.5, delays=delays + delays.T, nodes=16).real < 0.0


def test_equal_delays_of_all_links_are_one_delay():
    uniform = consensus_rightmost_root(DIRECTED_RING, 1.0, 1.0, 0.5, delays=0.2)
    by_link = consensus_rightmost_root(DIRECTED_RING, 1.0, 1.0, 0.5, delays=np.full((5, 5), 0.2))
    assert by_link == pytest.approx(uniform, abs=1e-12)


def test_rightmost_root_of_the_scalar_delay_equation():
    """Root of x' = -x(t - pi/2) at i, of x' = -x(t - 1/e) double at -e."""
    minus_one = -np.eye(1)
    assert rightmost_root({0.0: 0 * minus_one, np.pi / 2: minus_one}) == pytest.approx(1j, abs=1e-12)
    assert rightmost_root({0.0: 0 * minus_one, 1 / math.e: minus_one}) == pytest.approx(-math.e, abs=1e-5)


def test_single_vehicle_has_an_infinite_margin():
    assert consensus_delay_margin([[0.0]], 1.0, 1.0) == np.inf


def test_no_velocity_gain_and_no_damping_leave_no_margin():
    path = graph_adjacency("path", 4)
    assert consensus_delay_margin(path, 1.0, 0.0) == 0.0
    assert consensus_delay_margin(path, 0.0, 1.0) == 0.0


@pytest.mark.parametrize(
    ("adjacency", "gains", "message"),
    [
        (np.zeros((3, 3)), {}, "no spanning tree"),
        ([[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1], [0, 0, 1, 0]], {}, "rows 0, 2"),
        ([[0, 1, 1], [0, 0, 0], [0, 0, 0]], {}, "no spanning tree"),
        (np.ones((2, 3)), {}, "square"),
        (np.ones(4), {}, "square"),
        ([[0, -1], [1, 0]], {}, "not negative"),
        ([[0, np.nan], [1, 0]], {}, "finite"),
        ([[0, 1], [1, 0]], {"k1": -1.0}, "k1 = -1"),
        ([[0, 1], [1, 0]], {"k2": np.nan}, "k2 = nan"),
        ([[0, 1], [1, 0]], {"k3": -0.5}, "k3 = -0.5"),
        ([[0, 1], [1, 0]], {"h": [1.0, 1.0, 1.0]}, "one for each of 2"),
        ([[0, 1], [1, 0]], {"h": [1.0, -1.0]}, "h must be"),
    ],
)
def test_what_is_no_graph_or_gain_is_refused(adjacency, gains, message):
    with pytest.raises(ValueError, match=message):
        consensus_delay_margin(adjacency, **({"k1": 1.0, "k2": 1.0} | gains))


@pytest.mark.parametrize(
    ("name", "spectrum"),
    [
        ("star", [0, 1, 1, 1, 5]),
        ("path", 2 - 2 * np.cos(np.pi * np.arange(5) / 5)),
        ("ring", 2 - 2 * np.cos(2 * np.pi * np.arange(5) / 5)),
        ("complete", [0, 5, 5, 5, 5]),
    ],
)
def test_named_graphs_have_their_known_spectra(name, spectrum):
    found = np.linalg.eigvalsh(laplacian(graph_adjacency(name, 5)))
    assert found == pytest.approx(np.sort(spectrum), abs=1e-12)


def test_graphs_by_name_and_by_weights():
    assert graph_adjacency("ring", 2).tolist() == [[0, 1], [1, 0]]
    assert as_adjacency([[0, 2], [0, 0]]).tolist() == [[0, 2], [0, 0]]
