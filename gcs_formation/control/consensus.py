"""The consensus law: protocol (3) on the scenario's graph, sent as setpoints of speed and heading.

u_p = sum_q a_pq [k1 (x_q - x_p + r_pq) + k2 (v_q - v_p)] + k3 (v_s - v_p), both states at one stamp (errata items 3,
6, 9). The setpoints are v_s + tau_v u_x for the speed and psi_s + tau_psi u_y / v for the heading. The autopilot's own
time constant (7) acts as damping of 1/tau_v along and 1/tau_psi across the heading, without delay; only the part of k3
beyond that is computed here, from the delayed state.

In a turn, the slots turn with the path. The law therefore replaces the differences of states in (3) by differences of
deviations from the slots' own motion; on a straight path both are the same. The height loop is closed on board each
vehicle, so it has no link delay.
"""

from __future__ import annotations

import math

import numpy as np

from airlink.clock import NANOSECONDS
from flight_model.arrays import Array
from flight_model.autopilot_model import AutopilotModel, rotated
from flight_model.flight_state import FlightState
from flight_model.slot import UNKNOWN, Slot, Vector3
from formation_scenario.fields import Frame
from formation_scenario.slot_frame import axis_rad
from gcs_formation.control.follower_loops import LawParameters
from gcs_formation.control.fuzzy_pid import NO_GAINS
from gcs_formation.control.law_interface import CycleInput, Law, LawOutput
from gcs_formation.control.setpoint import Envelope, LeaderMotion, Target, feed_forward, formation_error, slot_target
from gcs_formation.estimation.vehicle_filter import MIN_AIRSPEED_MPS

_Reference = tuple[LeaderMotion, float]
"""The leader's reference motion (v_s) at the instant of one vehicle's state, and the heading of the slots' axes.

That is the heading of the path, without the leader's correction of its cross-track error.
"""


class _Deviation:
    """Deviation of a vehicle from its slot's motion, in m and m/s north and east; and that motion."""

    def __init__(self, state: FlightState, slot_m: tuple[float, float], target: Target) -> None:
        """Take the vehicle's state, its slot's position relative to the origin, and the slot's motion."""
        self.north_m = state.north_m - slot_m[0]
        self.east_m = state.east_m - slot_m[1]
        v, psi, wanted, along = state.airspeed_mps, state.heading_rad, target.speed_mps, target.heading_rad
        self.north_mps = v * math.cos(psi) - wanted * math.cos(along)
        self.east_mps = v * math.sin(psi) - wanted * math.sin(along)
        self.target = target


class ConsensusLaw(Law):
    """The protocol of all vehicles, including the leader. It keeps no state between ticks."""

    def __init__(
        self, gains: Vector3, weights: Array, members: list[int], frame: Frame, models: list[AutopilotModel]
    ) -> None:
        """Take the constants and the graph of protocol (3).

        Args:
            gains: k1 in 1/s², k2 in 1/s and k3 in 1/s.
            weights: (C, C): entry (p, q) > 0 when p receives from q; a virtual leader has no edges.
            members: indices of real vehicles.
            frame: frame in which slots are defined.
            models: (C,) autopilot models.
        """
        self._k1, self._k2, self._k3 = gains
        self._weights, self._members, self._models = weights, members, models
        self._frame: Frame = frame
        self._connect(0, [True] * len(models))

    def _connect(self, leader: int, active: list[bool]) -> None:
        """Set the graph's edges: the leader trades places with index 0, and inactive vehicles are bridged.

        Bridging is Kron reduction: any vehicle that received an inactive one receives that one's sources instead. A
        connected graph stays connected, and on an undirected graph no delay margin is lowered (Doerfler and Bullo,
        "Kron Reduction of Graphs With Applications to Electrical Networks", IEEE Transactions on Circuits and Systems I
        60 (2013)).
        """
        self._leader, self._active, indices = leader, active, np.arange(len(self._models))
        indices[[0, leader]] = indices[[leader, 0]]
        weights = self._weights[np.ix_(indices, indices)]
        for lost in self._members:
            if not active[lost]:
                incoming, outgoing = weights[lost].copy(), weights[:, lost].copy()
                total = float(incoming.sum())
                weights += np.outer(outgoing, incoming / total if total > 0.0 else 0.0 * incoming)
                weights[lost], weights[:, lost] = 0.0, 0.0
                np.fill_diagonal(weights, 0.0)
        receivers, senders = np.nonzero(weights)
        each: list[float] = weights[receivers, senders].tolist()
        self._edges = list(zip(receivers.tolist(), senders.tolist(), each, strict=True))

    def retune(self, parameters: LawParameters) -> None:
        """Do nothing: k1, k2 and k3 don't come from the gain design."""

    def decide(self, cycle_input: CycleInput, dt_s: float) -> list[LawOutput]:  # noqa: ARG002 - no memory, no rates
        """Return the setpoints of all vehicles; inactive ones are left out of the sums."""
        if cycle_input.lead.leader != self._leader or cycle_input.active != self._active:
            self._connect(cycle_input.lead.leader, cycle_input.active)
        states, slots, models = cycle_input.states, cycle_input.slots, self._models
        everyone = range(len(models))
        flown = [states.of(index, index) for index in everyone]
        leaders = [states.of(self._leader, index) for index in everyone]
        references = [_reference(cycle_input, each, leaders[each], models[self._leader]) for each in everyone]
        own = list(map(self._deviation, flown, references, slots))
        sums = self._protocol(cycle_input, references, slots, own)
        # One share for all vehicles: a different one for each would change the graph's weights.
        share = min(min(cycle_input.bandwidth[p]) for p in self._members)
        return [
            LawOutput(
                p,
                flown[p],
                self._setpoint(flown[p], references[p][0], own[p], slots[p], sums[p], share, models[p]),
                self._error(p, leaders[p], flown[p], slots[p]),
                UNKNOWN,
                NO_GAINS,
            )
            for p in self._members
        ]

    def _error(self, index: int, leader: FlightState, state: FlightState, slot: Slot) -> Vector3:
        axis = axis_rad(self._frame, leader.heading_rad, state.heading_rad)
        return UNKNOWN if index == self._leader else formation_error(leader, state, slot, axis)

    def _protocol(
        self, cycle_input: CycleInput, references: list[_Reference], slots: list[Slot], own: list[_Deviation]
    ) -> list[tuple[float, float]]:
        """Return each vehicle's sum over its neighbours in (3), north and east in m/s²."""
        k1, k2 = self._k1, self._k2
        sums = [(0.0, 0.0)] * len(own)
        for p, q, weight in self._edges:
            there, here = self._deviation(cycle_input.states.of(q, p), references[p], slots[q]), own[p]
            north = k1 * (there.north_m - here.north_m) + k2 * (there.north_mps - here.north_mps)
            east = k1 * (there.east_m - here.east_m) + k2 * (there.east_mps - here.east_mps)
            sums[p] = sums[p][0] + weight * north, sums[p][1] + weight * east
        return sums

    def _setpoint(
        self,
        state: FlightState,
        leader: LeaderMotion,
        own: _Deviation,
        slot: Slot,
        neighbours: tuple[float, float],
        share: float,
        model: AutopilotModel,
    ) -> Vector3:
        """Return one vehicle's setpoint: the slot's own motion, plus u of (3) converted by its time constants."""
        axis, turn_rps, bend_rps2 = leader.state.heading_rad, leader.turn_rps, leader.bend_rps2
        slot = self._seen(slot, leader, axis)
        speed_mps, heading_rad, height_m = feed_forward(
            own.target, leader, axis, turn_rps, bend_rps2, slot, model, state.updraught_mps
        )
        u_x, u_y = self._acceleration(own, neighbours, model)
        speed_mps += model.tau_v_s * share * u_x
        heading_rad += model.tau_psi_s * share * u_y / max(own.target.speed_mps, MIN_AIRSPEED_MPS)
        return Envelope(own.target.heading_rad, state, model).limit(speed_mps, heading_rad, height_m)

    def _acceleration(
        self, own: _Deviation, neighbours: tuple[float, float], model: AutopilotModel
    ) -> tuple[float, float]:
        """Return u of (3) along and across the slot's heading, less the damping by the autopilot's time constant."""
        axis, k3 = own.target.heading_rad, self._k3
        u_x, u_y = rotated(axis, *neighbours)
        along_mps, across_mps = rotated(axis, own.north_mps, own.east_mps)
        return u_x + (1.0 / model.tau_v_s - k3) * along_mps, u_y + (1.0 / model.tau_psi_s - k3) * across_mps

    def _seen(self, slot: Slot, leader: LeaderMotion, axis: float) -> Slot:
        """Return a slot in the leader's frame, whose axis is at `axis`."""
        return slot.turned(axis, leader.turn_rps, leader.bend_rps2) if self._frame == "north" else slot

    def _deviation(self, state: FlightState, reference: _Reference, slot: Slot) -> _Deviation:
        (leader, heading_rad), frame = reference, self._frame
        turn_rps, axis, slot = leader.turn_rps, leader.state.heading_rad, self._seen(slot, leader, heading_rad)
        if frame == "follower_heading":  # a slot that accelerates sideways turns the axes, at acceleration / speed
            turn_rps += slot.right_mps2 / leader.state.airspeed_mps
            axis = state.heading_rad
        drift_north_mps = state.wind_north_mps - leader.state.wind_north_mps
        drift_east_mps = state.wind_east_mps - leader.state.wind_east_mps
        drift_x_mps, drift_y_mps = rotated(axis, drift_north_mps, drift_east_mps)
        target = slot_target(leader.state, drift_x_mps, drift_y_mps, turn_rps, slot, frame)
        if frame == "follower_heading":
            heading_rad += target.heading_rad - leader.state.heading_rad
        return _Deviation(state, rotated(-heading_rad, slot.forward_m, slot.right_m), target)


def _reference(cycle_input: CycleInput, index: int, flown: FlightState, model: AutopilotModel) -> _Reference:
    """Return the guidance's reference motion at the instant of one vehicle's state; `model` is the leader's.

    The reference isn't late behind the guidance: it is the leader's setpoints minus the lead for its time constants.
    """
    lead, path = cycle_input.lead, cycle_input.lead.path
    commanded, later_s = lead.commanded[index], (cycle_input.states.instant(index) - lead.at) / NANOSECONDS
    swung_rad = (path.turn_rps + path.bend_rps2 * later_s / 2) * later_s
    tau_s = model.tau_ha_s + model.tau_hb_s
    state = FlightState(
        flown.north_m,
        flown.east_m,
        commanded.height_m + path.climb_mps * (later_s - tau_s),
        path.climb_mps,
        commanded.speed_mps,
        commanded.heading_rad - model.tau_psi_s * path.turn_rps + swung_rad,
        flown.wind_north_mps,
        flown.wind_east_mps,
    )
    turn_rps = path.turn_rps + path.bend_rps2 * later_s
    return LeaderMotion(state, turn_rps, path.bend_rps2, 0.0, 0.0), path.heading_rad + swung_rad
