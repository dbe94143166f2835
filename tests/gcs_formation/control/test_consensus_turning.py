"""Consensus in motion: who flies exactly as its slot does is sent the slot's own motion, and protocol (3) is silent.

The leader's reference turns at a changing rate and climbs; slots move; each vehicle has a wind of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pytest
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import NANOSECONDS, Instant
from flight_model.autopilot_model import AutopilotModel, rotated
from flight_model.flight_state import FlightState
from flight_model.slot import Slot
from formation_scenario.fields import Frame
from gcs_formation.control.consensus import ConsensusLaw
from gcs_formation.control.law_interface import CycleInput, LawOutput, Lead
from gcs_formation.control.setpoint import AS_DECIDED
from gcs_formation.estimation.projection import MeasuredStates
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.guidance.leader_commands import LeaderCommand
from gcs_formation.guidance.tracking import RouteHeading

Array = npt.NDArray[np.float64]

MODELS = [
    AutopilotModel(4.0, 1.5, 1.0, 3.0, 10.0, 40.0, 1.5, 0.25, 30.0),
    AutopilotModel(3.0, 2.0, 0.8, 2.5, 10.0, 40.0, 1.5, 0.25, 30.0),
    AutopilotModel(5.0, 1.2, 1.3, 3.5, 10.0, 40.0, 1.5, 0.25, 30.0),
]
GRAPH = np.array([[0.0, 1.0, 0.5], [1.0, 0.0, 0.8], [2.0, 0.3, 0.0]])
SPEED_MPS, HEADING_RAD, CLIMB_MPS = 22.0, 0.6, 0.8
STEP_S = 0.003
SLOTS = [
    ([0.0] * 3, [0.0] * 3, [0.0] * 3),
    ([-30.0, 20.0, 4.0], [0.9, -1.1, 0.3], [-0.3, 0.25, 0.1]),
    ([-50.0, -25.0, -6.0], [-0.7, 0.8, -0.2], [0.35, 0.4, -0.1]),
]


def law(
    frame: Frame, gains: tuple[float, float, float] = (0.1, 0.6, 0.3), models: Sequence[AutopilotModel] = MODELS
) -> ConsensusLaw:
    return ConsensusLaw(gains, GRAPH, [0, 1, 2], frame, list(models))


def slot_at(index: int, at_s: float) -> Slot:
    position, velocity, change = map(np.array, SLOTS[index])
    now = position + at_s * (velocity + at_s / 2.0 * change), velocity + at_s * change, change
    return Slot(*(each.tolist() for each in now))


@dataclass(frozen=True)
class Path:
    """A leader's turn: its rate at 0 s and the change of that."""

    turn_rps: float
    bend_rps2: float

    def heading(self, at_s: float) -> float:
        return HEADING_RAD + (self.turn_rps + self.bend_rps2 * at_s / 2.0) * at_s

    def velocity(self, at_s: float) -> Array:
        return SPEED_MPS * np.array((math.cos(self.heading(at_s)), math.sin(self.heading(at_s))))

    def place(self, index: int, at_s: float, frame: Frame) -> Array:
        """Return where a slot is, the leader at the origin at 0 s."""
        begun, middle, ended = (self.velocity(each) for each in (0.0, at_s / 2.0, at_s))
        slot = slot_at(index, at_s)
        axis = 0.0 if frame == "north" else self.heading(at_s)
        return at_s / 6.0 * (begun + 4.0 * middle + ended) + rotated(-axis, slot.forward_m, slot.right_m)

    def lead(self, at_s: float) -> Lead:
        """Return what the guidance commands and knows at a time: setpoints lead by (7) with the leader's lags."""
        turn = self.turn_rps + self.bend_rps2 * at_s
        height_m = 100.0 + CLIMB_MPS * (at_s + 4.0)
        command = LeaderCommand(SPEED_MPS, self.heading(at_s) + 1.5 * turn, height_m, turn)
        path = RouteHeading(self.heading(at_s), turn, self.bend_rps2, CLIMB_MPS, SPEED_MPS)
        return Lead(0, Instant(round(at_s * NANOSECONDS)), [command] * 3, path)


def changes(path: Path, index: int, frame: Frame) -> tuple[Array, Array]:
    """Return a slot's velocity and acceleration at 0 s."""
    before, now, after = (path.place(index, at_s, frame) for at_s in (-STEP_S, 0.0, STEP_S))
    return (after - before) / (2.0 * STEP_S), (after - 2.0 * now + before) / STEP_S**2


def in_slots(path: Path, frame: Frame, drifts: Sequence[tuple[float, float]]) -> list[FlightState]:
    """Return vehicles at 0 s that move over ground exactly as their slots do; the leader meets a wind too."""
    states = list[FlightState]()
    for index, (drift_north, drift_east) in enumerate(drifts):
        (north_mps, east_mps), _ = changes(path, index, frame)
        north_mps, east_mps = north_mps - drift_north, east_mps - drift_east
        north_m, east_m = path.place(index, 0.0, frame)
        speed_mps, heading_rad = math.hypot(north_mps, east_mps), math.atan2(east_mps, north_mps)
        wind = 1.5 + drift_north, -2.0 + drift_east
        states.append(FlightState(north_m, east_m, 100.0, 0.0, speed_mps, heading_rad, *wind, 0.1 * index))
    return states


def cycle(states: list[FlightState], lead: Lead, bandwidth: float = 1.0) -> CycleInput:
    return CycleInput(
        states=MeasuredStates(states, vec[i64]([0] * 3), [True] * 3, vec[i64]([0] * 3)),
        lead=lead,
        slots=[slot_at(index, 0.0) for index in range(3)],
        history=SetpointHistory(10.0),
        wind_variance=[0.0] * 3,
        active=[True] * 3,
        bandwidth=[[1.0] * 3, [1.0, bandwidth, 1.0], [1.0] * 3],
        replaced=[AS_DECIDED] * 3,
    )


PATHS = [Path(0.06, 0.02), Path(-0.08, 0.01)]
NO_DRIFT = ((0.0, 0.0),) * 3


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("frame", ["leader_heading", "north"])
@pytest.mark.parametrize("at_s", [0.0, -0.7, 0.4])
def test_in_their_slots_vehicles_are_sent_their_slots_motion_led_by_their_own_lags(
    frame: Frame, path: Path, at_s: float
) -> None:
    """Whatever the gains, and however much earlier or later the guidance steered than the states are."""
    states = in_slots(path, frame, NO_DRIFT)
    for decided in law(frame).decide(cycle(states, path.lead(at_s)), 0.1):
        model, state = MODELS[decided.index], states[decided.index]
        _, (north_mps2, east_mps2) = changes(path, decided.index, frame)
        along_mps2, across_mps2 = rotated(state.heading_rad, north_mps2, east_mps2)
        slot, taus_s = slot_at(decided.index, 0.0), model.tau_ha_s + model.tau_hb_s
        height_m = 100.0 + slot.up_m + taus_s * (CLIMB_MPS + slot.up_mps - state.updraught_mps)
        height_m += model.tau_ha_s * model.tau_hb_s * slot.up_mps2
        heading_rad = state.heading_rad + model.tau_psi_s * across_mps2 / state.airspeed_mps
        expected = state.airspeed_mps + model.tau_v_s * along_mps2, heading_rad, height_m
        assert decided.setpoint == pytest.approx(expected, abs=2e-4)
        assert decided.index == 0 or decided.error_m[:2] == pytest.approx((0.0, 0.0), abs=1e-5)
        assert math.isnan(decided.error_m[0]) == (decided.index == 0)


@pytest.mark.parametrize("frame", ["leader_heading", "north", "follower_heading"])
@pytest.mark.parametrize("drifts", [((0.0, 0.0), (0.8, -0.6), (-0.5, 0.9)), ((0.0, 0.0), (-0.7, 0.5), (1.0, 0.6))])
def test_on_a_straight_path_each_flies_against_its_own_drift(
    frame: Frame, drifts: Sequence[tuple[float, float]]
) -> None:
    """Its velocity over ground is the slot's; the setpoint is its own motion, which lasts, and errors are 0."""
    still = [Slot(position, [0.0] * 3, [0.0] * 3) for position, _, _ in SLOTS]
    states, straight = list[FlightState](), Path(0.0, 0.0)
    for slot, (drift_north, drift_east) in zip(still, drifts, strict=True):
        north_mps, east_mps = straight.velocity(0.0) - (drift_north, drift_east)
        heading_rad = math.atan2(east_mps, north_mps)
        axis = {"leader_heading": HEADING_RAD, "north": 0.0, "follower_heading": heading_rad}[frame]
        place_m = rotated(-axis, slot.forward_m, slot.right_m)
        wind = 1.5 + drift_north, -2.0 + drift_east
        states.append(FlightState(*place_m, 100.0, 0.0, math.hypot(north_mps, east_mps), heading_rad, *wind))
    here = cycle(states, straight.lead(0.0))
    here.slots = still
    for decided in law(frame).decide(here, 0.1):
        state = states[decided.index]
        assert decided.setpoint[:2] == pytest.approx((state.airspeed_mps, state.heading_rad), abs=1e-9)
        if decided.index > 0:
            assert decided.error_m[:2] == pytest.approx((0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_in_their_own_frames_those_whose_slots_speed_up_sideways_turn_with_them(side: float) -> None:
    """By (8) a follower heads to where its slot goes: asin(y' / v) less asin(x_rc / v) of its turn, at y'' / v.

    Flown so, nothing but the leads is left: of the heading by its lag, of the speed by what its turn changes.
    """
    slots = [Slot(*each) for each in SLOTS]
    slots[1] = Slot([-30.0, 0.0, 0.0], [0.0, side * 1.1, 0.0], [0.0, side * 0.22, 0.0])
    straight, turn_rps = Path(0.0, 0.0), side * 0.22 / 22.0
    off_rad = math.asin((side * 1.1 - 30.0 * turn_rps) / 22.0)
    heading_rad = HEADING_RAD + off_rad
    north_m, east_m = rotated(-heading_rad, -30.0, 0.0)
    follower = FlightState(north_m, east_m, 100.0, 0.0, 22.0 * math.cos(off_rad), heading_rad, 1.5, -2.0)
    states = [in_slots(straight, "follower_heading", NO_DRIFT)[0], follower, follower]
    here = cycle(states, straight.lead(0.0))
    here.slots = slots
    graph = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    decided = ConsensusLaw((0.1, 0.6, 0.3), graph, [0, 1, 2], "follower_heading", MODELS).decide(here, 0.1)[1]
    assert decided.setpoint[1] - heading_rad == pytest.approx(2.0 * side * 0.22 / follower.airspeed_mps, rel=0.01)
    assert decided.setpoint[0] == pytest.approx(follower.airspeed_mps, abs=0.05)


def beyond(share: float, gains: tuple[float, float, float], off: tuple[float, float, float, float]) -> LawOutput:
    """Return what is sent to vehicle 1, which is `off` its slot's place and velocity, all others as their slots."""
    states = in_slots(Path(0.0, 0.0), "leader_heading", NO_DRIFT)
    states[1].north_m += off[0]
    states[1].east_m += off[1]
    along_mps, across_mps = rotated(states[1].heading_rad, off[2], off[3])
    speed_mps = states[1].airspeed_mps + along_mps
    states[1].airspeed_mps = math.hypot(speed_mps, across_mps)
    states[1].heading_rad += math.atan2(across_mps, speed_mps)
    return law("leader_heading", gains).decide(cycle(states, Path(0.0, 0.0).lead(0.0), share), 0.1)[1]


@pytest.mark.parametrize("share", [1.0, 0.5])
@pytest.mark.parametrize(
    "off", [(1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 0.2, 0.0), (0.3, 0.2, -0.1, 0.2)]
)
def test_setpoints_are_the_protocols_acceleration_along_and_across_the_slots_own_heading_by_its_lags(
    share: float, off: tuple[float, float, float, float]
) -> None:
    """u = -(1 + 0.8) (k1 d + k2 w) + (1/tau - k3) w, times the smallest bandwidth of all; tau_v 3 s, tau_psi 2 s."""
    k1, k2, k3 = 0.1, 0.6, 0.3
    found, silent = beyond(share, (k1, k2, k3), off), beyond(share, (k1, k2, k3), (0.0, 0.0, 0.0, 0.0))
    velocity, _ = changes(Path(0.0, 0.0), 1, "leader_heading")
    heading_rad, speed_mps = math.atan2(velocity[1], velocity[0]), math.hypot(*velocity)
    d_x, d_y = rotated(heading_rad, off[0], off[1])
    w_x, w_y = rotated(heading_rad, off[2], off[3])
    u_x = -1.8 * (k1 * d_x + k2 * w_x) + (1.0 / 3.0 - k3) * w_x
    u_y = -1.8 * (k1 * d_y + k2 * w_y) + (1.0 / 2.0 - k3) * w_y
    assert found.setpoint[0] - silent.setpoint[0] == pytest.approx(3.0 * share * u_x, abs=1e-9)
    assert found.setpoint[1] - silent.setpoint[1] == pytest.approx(2.0 * share * u_y / speed_mps, abs=1e-9)
    assert found.setpoint[2] == silent.setpoint[2]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_far_off_its_slot_a_vehicle_is_sent_the_limits_of_its_envelope(side: float) -> None:
    """10 to 40 m/s, and 60 degrees to the side of the slot's own heading."""
    states = in_slots(Path(0.0, 0.0), "leader_heading", NO_DRIFT)
    velocity, _ = changes(Path(0.0, 0.0), 1, "leader_heading")
    heading_rad = math.atan2(velocity[1], velocity[0])
    north_m, east_m = rotated(-heading_rad, side * 500.0, side * 500.0)
    states[1].north_m, states[1].east_m = states[1].north_m + north_m, states[1].east_m + east_m
    found = law("leader_heading").decide(cycle(states, Path(0.0, 0.0).lead(0.0)), 0.1)[1].setpoint
    assert found[0] == (10.0 if side > 0.0 else 40.0)
    assert found[1] == pytest.approx(heading_rad - side * math.pi / 3.0, abs=1e-6)
