"""One tick of the formation law: all vehicles in formation, and their setpoints flown by model (7)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import Instant
from flight_model.vehicle_arrays import AutopilotModels, FlightStates, Setpoints
from formation_scenario.fields import Frame
from formation_scenario.slot_motion import SlotMotion
from gcs_formation.control.follower_loops import LawParameters
from gcs_formation.control.fuzzy_pid import ChannelConstants, FuzzyGainScheduler, PidGains
from gcs_formation.control.law_interface import CycleInput, Lead
from gcs_formation.control.laws import FormationLaw
from gcs_formation.control.setpoint import AS_DECIDED, Mixer
from gcs_formation.estimation.projection import MeasuredStates
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.guidance.leader_commands import LeaderCommand
from gcs_formation.guidance.tracking import RouteHeading
from tests.gcs_formation import tables
from tests.gcs_formation.tables import Decision, TableLaw

Array = npt.NDArray[np.float64]

DT_S = 0.1
AT_ONCE_S = 1e-6
"""A tick so short that rates are instantaneous."""
SPEED_MPS = 22.0
SLOTS_M = np.array([[0.0, 0.0, 0.0], [-30.0, 20.0, 4.0], [-50.0, -25.0, -6.0]])
COUNT = len(SLOTS_M)
LEADER, FOLLOWERS = 0, slice(1, None)
# A value of its own for each column: tau_v, tau_psi, tau_ha, tau_hb, least and most speed, acceleration, turn rate,
# climb.
MODEL = AutopilotModels(
    *np.array(
        (
            (4.0, 3.0, 5.0),
            (1.5, 2.0, 1.2),
            (1.0, 0.8, 1.3),
            (3.0, 2.5, 3.5),
            (5.0, 5.0, 5.0),
            (60.0, 60.0, 60.0),
            (1.5, 1.2, 1.8),
            (0.25, 0.2, 0.3),
            (30.0, 30.0, 30.0),
        )
    )
)
NONE = np.zeros(3)
MIXER = Mixer(k_v=0.1, k_x=1.0, k_psi=0.3, k_y=0.05, k_z=0.7)


HELD_S = DT_S / -np.expm1(-DT_S / MODEL.air_taus_s)
"""Mean lags of speed and heading behind a setpoint that is held for a tick."""


def law(
    kp: Array = NONE,
    ki: Array = NONE,
    kd: Array = NONE,
    frame: Frame = "leader_heading",
    scheduler: FuzzyGainScheduler | None = None,
    scales: tuple[float, float] = (1.0, 1.0),
) -> TableLaw:
    """A law with unfiltered derivatives; `scales` of errors and rates apply to every channel."""
    return TableLaw(FormationLaw(parameters(kp, ki, kd, frame, scheduler, scales), tables.models(MODEL)))


def parameters(
    kp: Array = NONE,
    ki: Array = NONE,
    kd: Array = NONE,
    frame: Frame = "leader_heading",
    scheduler: FuzzyGainScheduler | None = None,
    scales: tuple[float, float] = (1.0, 1.0),
) -> LawParameters:
    """Return the constants of that law."""
    each = zip(kp.tolist(), ki.tolist(), kd.tolist(), strict=True)
    speed, heading, height = (ChannelConstants(PidGains(p, i, d, 1e-9), *scales, 2.0) for p, i, d in each)
    return LawParameters(MIXER, frame, speed, heading, height, scheduler, 2.0)


def state(rows: Array) -> FlightStates:
    return FlightStates(*np.array(rows, dtype=float))


def in_formation(heading_rad: float = 0.0) -> FlightStates:
    """Return states of vehicles in their slots, level, at the formation's speed."""
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    (forward, right, up), still = SLOTS_M.T, np.zeros(COUNT)
    north, east = forward * cos - right * sin, forward * sin + right * cos
    speed, heading = np.full(COUNT, SPEED_MPS), np.full(COUNT, heading_rad)
    return state(np.array((north, east, 100.0 + up, still, speed, heading, still, still)))


def cycle_input(
    states: FlightStates, commanded: Setpoints | None = None, turn_rps: float = 0.0, slots: SlotMotion | None = None
) -> CycleInput:
    """Return a situation in which all have the setpoints `told`; by default those that they fly already."""
    as_flown = Setpoints(states.airspeed_mps, states.heading_rad, states.height_m)
    commanded = as_flown if commanded is None else commanded
    speed_mps, heading_rad, height_m = commanded.table[:, LEADER].tolist()
    to_leader = LeaderCommand(speed_mps, heading_rad, height_m, turn_rps)
    lead = Lead(
        LEADER,
        Instant(0),
        [to_leader] * COUNT,
        RouteHeading(to_leader.heading_rad, turn_rps, 0.0, 0.0, SPEED_MPS),
    )
    history = SetpointHistory(10.0)
    tables.send(history, np.full(COUNT, -1), commanded)
    return CycleInput(
        states=MeasuredStates(tables.states(states), vec[i64]([0] * COUNT), [True] * COUNT, vec[i64]([0] * COUNT)),
        lead=lead,
        slots=(slots or SlotMotion.at_rest(SLOTS_M)).each,
        history=history,
        wind_variance=[0.0] * COUNT,
        active=[True] * COUNT,
        bandwidth=[[1.0] * 3] * COUNT,
        replaced=[AS_DECIDED] * COUNT,
    )


def flown(states: FlightStates, commanded: Setpoints, over_s: float, leader_turns_rps: float = 0.0) -> FlightStates:
    """Fly model (7) without limits, by 400 steps of the midpoint rule, while the leader's heading setpoint turns."""
    table, step_s = states.table.copy(), over_s / 400

    def rates(now: Array, at_s: float) -> Array:
        aim = commanded.table.copy()
        aim[1, LEADER] += leader_turns_rps * at_s
        speed, heading, (slow, fast) = now[4], now[5], MODEL.table[2:4]
        climbing = (aim[2] - now[2] - (slow + fast) * (now[3] - now[8])) / (slow * fast)
        north, east = speed * np.cos(heading) + now[6], speed * np.sin(heading) + now[7]
        turning = (aim[1] - heading) / MODEL.tau_psi_s
        return np.array((north, east, now[3], climbing, (aim[0] - speed) / MODEL.tau_v_s, turning, *np.zeros_like(aim)))

    for k in range(400):
        middle = table + step_s / 2 * rates(table, k * step_s)
        table = table + step_s * rates(middle, (k + 0.5) * step_s)
    return FlightStates(*table)


def sent(decision: Decision) -> Array:
    """Return setpoints (F, 3)."""
    return decision.setpoints.table.T


def with_rows(states: FlightStates, rows: slice | int, values: Array, columns: slice = FOLLOWERS) -> FlightStates:
    table = states.table.copy()
    table[rows, columns] = values
    return FlightStates(*table)


def carried(wind_mps: tuple[float, float]) -> FlightStates:
    """Return states in formation northwards; a wind carries the followers, but not their leader, north and east."""
    return with_rows(in_formation(), slice(6, 8), np.array(wind_mps)[:, None])
