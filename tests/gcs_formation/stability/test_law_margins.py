"""Margins of a scenario's law."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from formation_scenario import load_scenario
from formation_scenario.consensus_graph import graph_adjacency
from formation_scenario.model import Scenario
from formation_scenario.vehicle_rules import all_receive_one
from gcs_formation.stability import consensus_delay_margin, consensus_margins, law_margins, scenario_delay_margin
from gcs_formation.stability.consensus_loops import ground_consensus_loops, spanning_components
from gcs_formation.stability.pid_margins import delay_margin

STRAIGHT = {"waypoints_m": [[0, 0, 100], [3000, 0, 100]]}


def scenario(law: dict[str, Any], tau_v_s: float = 2.0, tau_psi_s: float = 2.0, count: int = 4) -> Scenario:
    model = {"tau_v_s": tau_v_s, "tau_psi_s": tau_psi_s}
    return load_scenario({"schema": 1, "vehicles": {"count": count, "model": model}, "law": law, "path": STRAIGHT})


def consensus(k3: float, graph: str = "path") -> dict[str, Any]:
    return {"type": "consensus", "consensus": {"k1": 1.0, "k2": 1.0, "k3": k3, "graph": graph}}


@pytest.mark.parametrize(("graph", "count", "margin_s"), [("path", 4, 0.4082973558), ("star", 10, 0.1515650101)])
def test_a_lag_of_1_over_k3_is_the_undelayed_damping_of_the_theory(graph: str, count: int, margin_s: float) -> None:
    """Golden values of item 7 for k1 = k2 = 1, c = 0.5: both axes have tau = 2 s."""
    margins = consensus_margins(scenario(consensus(0.5, graph), count=count))
    assert margins == pytest.approx((margin_s, margin_s), abs=1e-9)


@pytest.mark.parametrize("law", [consensus(0.5), {"type": "fuzzy_pid"}, {"type": "pid", "gains": "noise"}])
def test_a_dead_time_uses_up_margin(law: dict[str, Any]) -> None:
    vehicles = {"count": 4, "model": {"dead_time_s": 0.3}}
    plain = {"schema": 1, "law": law, "path": STRAIGHT, "formation": {"shape": "line"}}
    late, prompt = (load_scenario({**plain, "vehicles": each}) for each in (vehicles, {"count": 4}))
    assert scenario_delay_margin(late) == pytest.approx(scenario_delay_margin(prompt) - 0.3)
    for of in ("small_signal", "worst"):
        expected = {loop: each - 0.3 for loop, each in getattr(law_margins(prompt), of).items()}
        assert dict(getattr(law_margins(late), of)) == pytest.approx(expected)


def test_a_dead_time_beyond_the_margin_is_unstable_over_any_link() -> None:
    plain = {"schema": 1, "law": {"type": "fuzzy_pid"}, "path": STRAIGHT}
    late = load_scenario({**plain, "vehicles": {"count": 2, "model": {"dead_time_s": 1.2}}})
    assert scenario_delay_margin(late) < 0.0


def test_the_axis_of_the_least_margin_counts() -> None:
    """1/tau_psi = 2/3 across and 1/4 along; what k3 requires beyond that is delayed."""
    flown = scenario(consensus(0.25), tau_v_s=4.0, tau_psi_s=1.5)
    found_along_s, found_across_s = consensus_margins(flown)
    path = graph_adjacency("path", 4)
    assert found_along_s == pytest.approx(consensus_delay_margin(path, 1.0, 1.0, 0.25), abs=1e-9)
    loops = ground_consensus_loops(path, 1.0, 1.0, 2 / 3, 0.25 - 2 / 3)
    across_s = min(delay_margin(loop.open_loop()) for loop in loops)
    assert found_across_s == pytest.approx(across_s, abs=1e-9)
    assert scenario_delay_margin(flown) == min(found_along_s, found_across_s)
    assert dict(law_margins(flown).small_signal) == {"consensus": scenario_delay_margin(flown)}


def test_damping_computed_on_the_ground_buys_far_less() -> None:
    """Path of 4, c = 2: 0.614 s on board; 0.267 s if all of it but a lag of 1000 s is delayed."""
    assert scenario_delay_margin(scenario(consensus(2.0), 0.5, 0.5)) == pytest.approx(0.614, abs=5e-4)
    assert scenario_delay_margin(scenario(consensus(2.0), 1e3, 1e3)) == pytest.approx(0.267, abs=1e-3)


def test_the_common_speed_has_a_margin_too() -> None:
    """One pair, weakly coupled: s + c + d exp(-s tau) with c = 0.5, d = 1.5 is at i w, w = sqrt(2), after 1.351 s."""
    law = {"type": "consensus", "consensus": {"k1": 1e-6, "k2": 1e-3, "k3": 2.0, "graph": "path"}}
    w = np.sqrt(2.0)
    assert scenario_delay_margin(scenario(law, count=2)) == pytest.approx((np.pi - np.arctan(w / 0.5)) / w, rel=1e-2)


def test_unlike_time_constants_count_by_the_worst() -> None:
    plain = {"schema": 1, "law": consensus(0.5), "path": STRAIGHT}
    models = [{"tau_v_s": tau, "tau_psi_s": tau} for tau in (2.0, 4.0)]
    alike = [consensus_margins(scenario(consensus(0.5), tau, tau, 2))[0] for tau in (2.0, 4.0)]
    vehicles = [{"id": 1, "role": "leader", "model": models[0]}, {"id": 2, "model": models[1]}]
    assert consensus_margins(load_scenario(plain | {"vehicles": vehicles}))[0] == min(alike)


def test_margins_of_aircraft_are_around_their_own_response() -> None:
    """An ArduPlane answers a speed setpoint at 1 rad/s with twice its amplitude: damping of equation (7) excites it."""
    plain = {"schema": 1, "vehicles": {"count": 4, "autopilot": "arduplane"}, "path": STRAIGHT}
    given = {"type": "consensus", "consensus": {"k1": 0.1, "k2": 0.6, "k3": 0.25}}
    unstable, designed = (load_scenario(plain | {"law": law}) for law in (given, {"type": "consensus"}))
    assert scenario_delay_margin(unstable) == consensus_margins(unstable)[0] == 0.0
    assert scenario_delay_margin(designed) > 1.0
    lagging = {"vehicles": {"count": 4, "model": {"tau_v_s": 1.0, "tau_psi_s": 3.45}}, "law": given}
    assert scenario_delay_margin(load_scenario(plain | lagging)) > 0.6


def test_a_leader_that_receives_from_none_swings_where_its_own_loop_is_unstable() -> None:
    """Without neighbours only its own speed is fed back: k3 below 1/tau_v of an ArduPlane."""
    star = [[0, 0], [1, 0]]
    law = {"type": "consensus", "consensus": {"k1": 1e-6, "k2": 0.0, "k3": 0.25, "graph": star}}
    vehicles = {"count": 2, "autopilot": "arduplane"}
    flown = load_scenario({"schema": 1, "vehicles": vehicles, "law": law, "path": STRAIGHT})
    assert scenario_delay_margin(flown) == 0.0


def test_the_other_laws_keep_their_three_loops() -> None:
    flown = scenario({"type": "fuzzy_pid"})
    small = law_margins(flown).small_signal
    assert set(small) == {"x", "y", "z"}
    assert scenario_delay_margin(flown) == min(small.values())


@given(arrays.arrays(np.float64, (5, 5), elements=st.sampled_from([0.0, 0.0, 0.0, 1.0])))
def test_a_graph_has_a_spanning_tree_if_all_hear_one_vehicle(weights: np.ndarray) -> None:
    hears = np.linalg.matrix_power(np.eye(5) + weights, 4) > 0.0  # directly or through others
    assert all_receive_one(weights) == hears.all(axis=0).any()
    if all_receive_one(weights):
        assert sum(part.is_closed for part in spanning_components(weights)) == 1
    else:
        with pytest.raises(ValueError, match="spanning tree"):
            spanning_components(weights)
