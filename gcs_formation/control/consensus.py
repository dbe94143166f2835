"""The consensus law: protocol (3) on the scenario's graph, sent as setpoints of speed and heading.

u_p = sum_q a_pq [k1 (x_q - x_p + r_pq) + k2 (v_q - v_p)] + k3 (v_s - v_p), both states at one stamp (errata items 3,
6, 9). The setpoints are v_s + tau_v u_x for the speed and psi_s + tau_psi u_y / v for the heading. The autopilot's own
lag (7) acts as damping of 1/tau_v along and 1/tau_psi across the heading, without delay; only the part of k3 beyond
that is computed here, from the delayed state.

In a turn, r_pq and v_s belong to slots that turn with the path. In place of the differences of states of (3), the law
uses differences of deviations from the slots' own motion, which is the same on a straight path. Each vehicle holds the
height of the path and of its slot by itself: that loop is closed on board, so no link delay is in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from airlink.clock import NANOSECONDS
from flight_model.arrays import Array
from formation_scenario.formation import Frame
from formation_scenario.slot_motion import SlotMotion
from gcs_formation.control import envelope
from gcs_formation.control.feed_forward import Axes, LeaderMotion, Turning, feed_forward
from gcs_formation.control.mixer import Target, formation_error, rotate_to, slot_target
from gcs_formation.control.situation import Decision, Lead, Situation, none_of
from gcs_formation.estimation.estimator import LEAST_AIRSPEED_MPS
from gcs_formation.estimation.flight_state import AutopilotModels, FlightStates, Indices, Setpoints


@dataclass(frozen=True)
class ConsensusParameters:
    """Constants of protocol (3)."""

    k1: float
    k2: float
    k3: float
    weights: Array
    """(C, C): entry (p, q) > 0 when p hears q; a virtual leader hears nobody and is heard by nobody."""
    members: Indices
    """(M,) columns that take part: all that fly."""
    frame: Frame


@dataclass(frozen=True)
class _Reference:
    """The motion that v_s is taken from, a column for each vehicle at its own instant."""

    leader: LeaderMotion
    heading_rad: Array
    """Along which the slots lie: the path's, without what the leader does to get back onto it."""


@dataclass(frozen=True)
class _Deviation:
    """Of vehicles from their slots' motion, in m and m/s north and east; and that motion."""

    position_m: Array
    velocity_mps: Array
    target: Target


class ConsensusLaw:
    """The protocol of all vehicles, the leader among them. It remembers nothing between ticks."""

    commands_leader = True

    def __init__(self, parameters: ConsensusParameters, model: AutopilotModels) -> None:
        """Take the graph and the (C,) autopilots."""
        self._parameters = parameters
        self._model = model
        self._everyone = np.arange(model.tau_v_s.size, dtype=np.intp)
        self._lead_by(0)

    def _lead_by(self, leader: int) -> None:
        """Swap a new leader and the leader at the start in the graph."""
        self._leader, places = leader, self._everyone.copy()
        places[[0, leader]] = places[[leader, 0]]
        weights = self._parameters.weights[np.ix_(places, places)]
        receivers, senders = np.nonzero(weights)
        self._receivers: Indices = receivers
        self._senders: Indices = senders
        self._edge_weights = weights[receivers, senders]

    def decide(self, situation: Situation, dt_s: float) -> Decision:  # noqa: ARG002 - no memory, no rates
        """Return the setpoints of all vehicles; those that aren't active are left out of the sums."""
        if situation.lead.leader != self._leader:
            self._lead_by(situation.lead.leader)
        everyone, model = self._everyone, self._model
        slots = situation.slots
        reference = self._reference(situation)
        state = situation.states.of(everyone, everyone)
        own = self._deviation(state, reference, slots)
        # One for all: weights of its own for each vehicle would make another graph.
        share = float(situation.bandwidth[self._parameters.members].min())
        u_north, u_east = self._protocol(situation, reference, slots, own)
        u_x, u_y = rotate_to(own.target.heading_rad, share * u_north, share * u_east)
        beyond_x, beyond_y = share * self._damping_beyond(own)
        leader = reference.leader
        axes = Axes(leader.state.heading_rad, leader.turning)
        forward = feed_forward(own.target, leader, axes, slots, model)
        wanted = Setpoints(
            forward[:, 0] + model.tau_v_s * (u_x + beyond_x),
            forward[:, 1] + model.tau_psi_s * (u_y + beyond_y) / np.maximum(own.target.speed_mps, LEAST_AIRSPEED_MPS),
            forward[:, 2],
        )
        limited = envelope.limit(wanted, own.target.heading_rad, state, model)
        members, count = self._parameters.members, self._parameters.members.size
        error_m = self._formation_error(situation, state, slots)
        return Decision(
            members, state.take(members), limited.take(members), error_m[members], none_of(count, 3), none_of(count, 9)
        )

    def _protocol(
        self, situation: Situation, reference: _Reference, slots: SlotMotion, own: _Deviation
    ) -> tuple[Array, Array]:
        """Return the sum of (3) over the neighbours, north and east in m/s^2."""
        p, q, k = self._receivers, self._senders, self._parameters
        heard = self._deviation(situation.states.of(q, p), _at(reference, p), slots.take(q))
        apart_m = heard.position_m - own.position_m[:, p]
        apart_mps = heard.velocity_mps - own.velocity_mps[:, p]
        weights = self._edge_weights * (situation.active[p] & situation.active[q])
        north, east = weights * (k.k1 * apart_m + k.k2 * apart_mps)
        return self._sum(north), self._sum(east)

    def _sum(self, of_edges: Array) -> Array:
        """Return each vehicle's sum over the edges on which it hears somebody."""
        total = np.zeros(self._everyone.size)
        np.add.at(total, self._receivers, of_edges)
        return total

    def _damping_beyond(self, own: _Deviation) -> Array:
        """Return (k3 - 1/tau) (v_s - v_p) along and across, (2, C): damping beyond the autopilot's lag."""
        moving = np.stack(rotate_to(own.target.heading_rad, *own.velocity_mps))
        return (1.0 / np.stack((self._model.tau_v_s, self._model.tau_psi_s)) - self._parameters.k3) * moving

    def _reference(self, situation: Situation) -> _Reference:
        """Return what the guidance asks for, carried along the path to each vehicle's instant."""
        lead, everyone = situation.lead, self._everyone
        later_s = (situation.states.instants(everyone) - lead.at) / NANOSECONDS
        swung = (lead.path.turn_rps + lead.path.bend_rps2 * later_s / 2) * later_s
        turn_rps = lead.path.turn_rps + lead.path.bend_rps2 * later_s
        leader = LeaderMotion(
            self._led(situation, lead, swung, later_s),
            Turning(turn_rps, np.full(later_s.shape, lead.path.bend_rps2)),
            np.zeros_like(later_s),
            np.zeros_like(later_s),
        )
        return _Reference(leader, lead.path.heading_rad + swung)

    def _led(self, situation: Situation, lead: Lead, swung: Array, later_s: Array) -> FlightStates:
        """Return the state of a leader without lag behind the guidance: its setpoints less the lead over its lags."""
        leading, model = np.full_like(self._everyone, lead.leader), self._model
        lag_s = float(model.tau_ha_s[lead.leader] + model.tau_hb_s[lead.leader])
        flown = situation.states.of(leading, self._everyone)
        told = lead.told.setpoints.take(leading)
        return FlightStates(
            north_m=flown.north_m,
            east_m=flown.east_m,
            height_m=told.height_m + lead.path.climb_mps * (later_s - lag_s),
            climb_mps=np.full(later_s.shape, lead.path.climb_mps),
            airspeed_mps=told.speed_mps,
            heading_rad=told.heading_rad - model.tau_psi_s[lead.leader] * lead.path.turn_rps + swung,
            wind_north_mps=flown.wind_north_mps,
            wind_east_mps=flown.wind_east_mps,
        )

    def _deviation(self, state: FlightStates, reference: _Reference, slots: SlotMotion) -> _Deviation:
        leader, frame = reference.leader, self._parameters.frame
        turn_rps = leader.turning.rate_rps
        if frame == "follower_heading":  # what moves aside turns its own axes, at its acceleration by its speed
            turn_rps = turn_rps + slots.acceleration_mps2[:, 1] / leader.state.airspeed_mps
        target = slot_target(leader.state, state, turn_rps, slots, frame)
        aside = target.heading_rad - leader.state.heading_rad if frame == "follower_heading" else 0.0
        slot_north, slot_east = _to_north(reference.heading_rad + aside, *slots.position_m[:, :2].T)
        speed, wanted = state.airspeed_mps, target.speed_mps
        return _Deviation(
            np.stack((state.north_m - slot_north, state.east_m - slot_east)),
            np.stack(
                (
                    speed * np.cos(state.heading_rad) - wanted * np.cos(target.heading_rad),
                    speed * np.sin(state.heading_rad) - wanted * np.sin(target.heading_rad),
                )
            ),
            target,
        )

    def _formation_error(self, situation: Situation, state: FlightStates, slots: SlotMotion) -> Array:
        leading = np.full_like(self._everyone, situation.lead.leader)
        leader = situation.states.of(leading, self._everyone)
        error_m = formation_error(leader, state, slots.position_m, self._parameters.frame)
        error_m[situation.lead.leader] = np.nan
        return error_m


def _at(reference: _Reference, which: Indices) -> _Reference:
    leader = reference.leader
    turning = Turning(leader.turning.rate_rps[which], leader.turning.acceleration_rps2[which])
    changes = (leader.acceleration_mps2, leader.climb_change_mps2)
    motion = LeaderMotion(leader.state.take(which), turning, *(each[which] for each in changes))
    return _Reference(motion, reference.heading_rad[which])


def _to_north(heading_rad: Array, forward: Array, right: Array) -> tuple[Array, Array]:
    """Return the north and east components of a vector given along and across `heading_rad`."""
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    return forward * cos - right * sin, forward * sin + right * cos
