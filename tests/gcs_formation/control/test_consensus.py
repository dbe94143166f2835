"""The consensus law against its protocol, and against invariants of any protocol."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import Instant
from flight_model.vehicle_arrays import AutopilotModels, FlightStates
from formation_scenario.consensus_graph import graph_adjacency
from formation_scenario.fields import Frame
from formation_scenario.slot_motion import SlotMotion
from gcs_formation.control.consensus import ConsensusLaw
from gcs_formation.control.law_interface import CycleInput, Lead
from gcs_formation.control.setpoint import AS_DECIDED
from gcs_formation.estimation.projection import MeasuredStates
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.guidance.leader_commands import LeaderCommand
from gcs_formation.guidance.tracking import RouteHeading
from gcs_formation.stability.consensus_loops import laplacian
from tests.gcs_formation import tables
from tests.gcs_formation.tables import Decision, TableLaw

Array = npt.NDArray[np.float64]

SPEED_MPS = 22.0
TAU_V_S, TAU_PSI_S = 4.0, 1.5
K1, K2 = 0.02, 0.05
COUNT = 4
GRAPH = np.array([[0.0, 1.0, 0.0, 0.5], [1.0, 0.0, 0.0, 0.0], [0.0, 2.0, 0.0, 1.0], [0.0, 0.0, 0.3, 0.0]])
SLOTS_M = np.array([[-30.0, 20.0, 0.0], [-30.0, -20.0, 5.0], [-60.0, 0.0, 0.0]])
offsets = st.lists(st.floats(-2.0, 2.0), min_size=4 * COUNT, max_size=4 * COUNT).map(
    lambda values: np.array(values).reshape(4, COUNT)
)
headings = st.floats(-np.pi, np.pi)


def index(value: float) -> Array:
    return np.full(COUNT, value)


MODEL = AutopilotModels(*map(index, (TAU_V_S, TAU_PSI_S, 1.0, 3.0, 1.0, 99.0, 1.5, 0.25, 3.0)))


def law(k3: float = 0.25, graph: Array = GRAPH, frame: Frame = "leader_heading") -> TableLaw:
    return TableLaw(ConsensusLaw((K1, K2, k3), graph, list(range(COUNT)), frame, tables.models(MODEL)))


def places(heading_rad: float) -> tuple[Array, Array]:
    forward, right = np.concatenate((np.zeros((1, 3)), SLOTS_M))[:, :2].T
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    return forward * cos - right * sin, forward * sin + right * cos


def cycle_input(
    heading_rad: float, offset: Array, turn_rps: float = 0.0, active: npt.NDArray[np.bool_] | None = None
) -> CycleInput:
    """Return vehicles on a path with a heading, with offsets (4, N): m north and east, m/s along and to the right."""
    north_m, east_m = places(heading_rad)
    state = FlightStates(
        north_m=north_m + offset[0],
        east_m=east_m + offset[1],
        height_m=index(100.0),
        climb_mps=index(0.0),
        airspeed_mps=np.hypot(SPEED_MPS + offset[2], offset[3]),
        heading_rad=heading_rad + np.arctan2(offset[3], SPEED_MPS + offset[2]),
        wind_north_mps=index(0.0),
        wind_east_mps=index(0.0),
    )
    commanded = LeaderCommand(SPEED_MPS, heading_rad + TAU_PSI_S * turn_rps, 100.0, turn_rps)
    lead = Lead(0, Instant(0), [commanded] * COUNT, RouteHeading(heading_rad, turn_rps, 0.0, 0.0, SPEED_MPS))
    slots = SlotMotion.at_rest(np.concatenate((np.zeros((1, 3)), SLOTS_M)))
    return CycleInput(
        states=MeasuredStates(tables.states(state), vec[i64]([0] * COUNT), [True] * COUNT, vec[i64]([0] * COUNT)),
        lead=lead,
        slots=slots.each,
        history=SetpointHistory(10.0),
        wind_variance=[0.0] * COUNT,
        active=[True] * COUNT if active is None else active.tolist(),
        bandwidth=[[1.0] * 3] * COUNT,
        replaced=[AS_DECIDED] * COUNT,
    )


def accelerations(decision: Decision, heading_rad: float) -> tuple[Array, Array]:
    """Return the accelerations along and across that setpoints ask of the lags, beyond the path's, m/s^2."""
    to_side = np.remainder(decision.setpoints.heading_rad - heading_rad + np.pi, 2 * np.pi) - np.pi
    return (decision.setpoints.speed_mps - SPEED_MPS) / TAU_V_S, to_side * SPEED_MPS / TAU_PSI_S


@given(offsets, headings)
def test_setpoints_are_the_protocol_on_a_straight_path(offset: Array, heading_rad: float) -> None:
    """u = -L (k1 d + k2 w) + (k3 - 1/tau) (v_s - v), d and w the deviations from slots and speed (items 3 and 9)."""
    k3 = 0.4
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    ahead_m, to_side_m = offset[0] * cos + offset[1] * sin, offset[1] * cos - offset[0] * sin
    matrix = laplacian(GRAPH)
    along = -matrix @ (K1 * ahead_m + K2 * offset[2]) - (k3 - 1 / TAU_V_S) * offset[2]
    across = -matrix @ (K1 * to_side_m + K2 * offset[3]) - (k3 - 1 / TAU_PSI_S) * offset[3]
    asked = accelerations(law(k3).decide(cycle_input(heading_rad, offset), 0.1), heading_rad)
    np.testing.assert_allclose(asked, (along, across), atol=1e-9)


@given(offsets)
def test_a_new_leader_takes_the_place_of_the_old_one_in_the_graph(offset: Array) -> None:
    """Each is received by those who received the other, with their weights; the others hear each other as before."""
    swapped = [2, 1, 0, 3]
    matrix, here = laplacian(GRAPH[np.ix_(swapped, swapped)]), cycle_input(0.0, offset)
    flying = law(1 / TAU_V_S)
    for leader, graph in ((2, matrix), (0, laplacian(GRAPH))):
        asked = accelerations(
            flying.decide(tables.changed(here, lead=tables.changed(here.lead, leader=leader)), 0.1), 0.0
        )
        np.testing.assert_allclose(asked[0], -graph @ (K1 * offset[0] + K2 * offset[2]), atol=1e-9)


@given(offsets, headings, st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)))
def test_the_place_of_the_whole_formation_is_no_matter(
    offset: Array, heading_rad: float, moved_m: tuple[float, float]
) -> None:
    moved = offset.copy()
    moved[:2] += np.array(moved_m)[:, None]
    asked = [law().decide(cycle_input(heading_rad, each), 0.1).setpoints.table for each in (offset, moved)]
    np.testing.assert_allclose(asked[0], asked[1], atol=1e-8)


@given(offsets, headings)
def test_an_undirected_graph_does_not_move_the_middle(offset: Array, heading_rad: float) -> None:
    """The protocol's terms cancel in the sum: no vehicle's term is lost or counted twice."""
    offset[2:] = 0.0
    ring = law(graph=graph_adjacency("ring", COUNT))
    for axis in accelerations(ring.decide(cycle_input(heading_rad, offset), 0.1), heading_rad):
        assert axis.sum() == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("frame", ["leader_heading", "follower_heading"])
def test_slots_are_flown_round_a_turn_without_any_term_of_the_protocol(frame: Frame) -> None:
    """Vehicles in slots fixed in the frame get setpoints that keep them there (equilibria of (8), item 24)."""
    turn_rps, heading_rad = 0.05, 0.7
    forward_m, right_m = np.concatenate((np.zeros((1, 3)), SLOTS_M))[:, :2].T
    if frame == "leader_heading":
        lead_angle = np.arctan2(turn_rps * forward_m, SPEED_MPS - turn_rps * right_m)
        speed, axis = np.hypot(SPEED_MPS - turn_rps * right_m, turn_rps * forward_m), index(heading_rad)
    else:
        lead_angle = np.arcsin(turn_rps * forward_m / SPEED_MPS)
        speed, axis = SPEED_MPS * np.cos(lead_angle) - turn_rps * right_m, heading_rad + lead_angle
    moved = np.array([places(each) for each in axis])[np.arange(COUNT), :, np.arange(COUNT)].T - places(heading_rad)
    offset = np.stack((*moved, speed * np.cos(lead_angle) - SPEED_MPS, speed * np.sin(lead_angle)))
    commanded = law(frame=frame).decide(cycle_input(heading_rad, offset, turn_rps), 0.1).setpoints
    np.testing.assert_allclose(commanded.speed_mps, speed)
    np.testing.assert_allclose(commanded.heading_rad, heading_rad + lead_angle + TAU_PSI_S * turn_rps)


@given(offsets, st.sampled_from(([2], [1], [1, 3])))
def test_what_received_from_one_that_is_lost_receives_from_its_sources(offset: Array, lost: list[int]) -> None:
    """The remaining graph is the Schur complement of its Laplacian (Kron reduction)."""
    active = np.ones(COUNT, dtype=bool)
    active[lost] = False
    matrix, rest, gone = laplacian(GRAPH), np.flatnonzero(active), np.flatnonzero(~active)
    inner = np.linalg.inv(matrix[np.ix_(gone, gone)])
    left = matrix[np.ix_(rest, rest)] - matrix[np.ix_(rest, gone)] @ inner @ matrix[np.ix_(gone, rest)]
    bridged = np.zeros((COUNT, COUNT))
    bridged[np.ix_(rest, rest)] = np.diag(np.diag(left)) - left
    given_ = cycle_input(0.3, offset, active=active)
    asked = [each.decide(given_, 0.1).setpoints.table[:, active] for each in (law(), law(graph=bridged))]
    np.testing.assert_allclose(asked[0], asked[1], atol=1e-12)


@pytest.mark.parametrize("lost", [1, 2])
def test_on_a_path_those_behind_one_that_is_lost_stay_tied_to_those_before_it(lost: int) -> None:
    """Without the new edge only speed connected the parts, and a gust left them 10 m off for good."""
    offset, active = np.zeros((4, COUNT)), np.arange(COUNT) != lost
    offset[0, lost + 1 :] = 10.0
    table = law(graph=graph_adjacency("path", COUNT)).decide(cycle_input(0.0, offset, active=active), 0.1).setpoints
    assert table.speed_mps[lost + 1] < SPEED_MPS - 0.1


def test_heights_are_the_path_s_and_the_slots_own() -> None:
    """They contain no state of another vehicle: that loop is closed on board."""
    commanded = law().decide(cycle_input(0.0, np.ones((4, COUNT))), 0.1).setpoints
    np.testing.assert_allclose(commanded.height_m, [100.0, 100.0, 105.0, 100.0])
