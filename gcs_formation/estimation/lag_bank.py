"""A vehicle simulated from its setpoints alone, by models (7) of several lags: `lags` compares them with telemetry."""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import NANOSECONDS
from flight_model.autopilot import AutopilotModel, FlightState, climb, respond, within, wrap
from flight_model.slot import Triple

FREE: Final = 0.6
"""Share of a rate limit beyond which nothing is learnt of a lag: what flies at its limit doesn't show it, and the limit
may be lower than believed (an aircraft turns the slower, the faster it flies)."""
Motion = tuple[float, float, float, float]
"""Airspeed, heading, height and climb, m/s, rad, m."""
Tracks = list[list[list[float]]]
"""Of airspeed, heading and height, (K + 1, B): K simulations minus telemetry, and 1; all 0 where there is no sample."""


class Bank:
    """A vehicle's simulations from its setpoints alone: K of its height, the first of them of the rest, too."""

    def __init__(self, believed: AutopilotModel, air: list[list[float]], height: list[list[float]]) -> None:
        """Simulate lags that are the believed ones times e to the power of `height` (K, 2), and of `air`, fewer."""
        self.flying = False
        """Whether the simulations have begun."""
        self._believed = AutopilotModel(*believed.values())
        self._of_air = len(air)
        self._states = [FlightState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0) for _ in height]
        self._models = [AutopilotModel(*believed.values()) for _ in height]
        for node, model in enumerate(self._models):
            model.tau_ha_s *= math.exp(height[node][0])
            model.tau_hb_s *= math.exp(height[node][1])
            if node < self._of_air:
                model.tau_v_s *= math.exp(air[node][0])
                model.tau_psi_s *= math.exp(air[node][0])
        self._off = [0.0, 0.0, 0.0]
        """The largest errors that were simulated last: the mean of all simulations of airspeed, heading, height."""

    def begin(self, learnt: list[bool], seen: Motion) -> None:
        """Begin those simulations, of airspeed, heading and height, anew that aren't `learnt` from what was `seen`."""
        self.flying = not math.isnan(seen[0])
        speed_mps, heading_rad, height_m, climb_mps = seen if self.flying else (0.0, 0.0, 0.0, 0.0)
        for state in self._states:
            if not learnt[0]:
                state.airspeed_mps = speed_mps
            if not learnt[1]:
                state.heading_rad = heading_rad
            if not learnt[2]:
                state.height_m, state.climb_mps = height_m, climb_mps

    def free(self) -> list[bool]:
        """Return whether airspeed, heading and height kept clear of the rate limits in what was simulated last."""
        model, off = self._believed, self._off
        return [
            off[0] < FREE * model.accel_max_mps2 * model.tau_v_s,
            off[1] < FREE * model.turn_rate_max_rps * model.tau_psi_s,
            off[2] < FREE * model.climb_max_mps * (model.tau_ha_s + model.tau_hb_s),
        ]

    def fly(self, stamps: list[int], seen: list[Motion], acts: list[int], told: list[Triple]) -> Tracks:
        """Return the simulations minus telemetry at the stamps after the first; one not newer than the last is none.

        Args:
            stamps: (B + 1), ns, in order; the simulations are at the first.
            seen: (B + 1) what was measured.
            acts: (R) when setpoints act, ns, in order.
            told: (R) these.
        """
        tracks, of_air = self.unseen(len(stamps) - 1), self._of_air
        self._off = [0.0, 0.0, 0.0]
        at, acting, last = stamps[0], 0, len(acts) - 1
        for sample, stamp in enumerate(stamps[1:]):
            if stamp <= at:
                continue
            while at < stamp:
                while acting < last and acts[acting + 1] <= at:
                    acting += 1
                end = stamp if acting == last else min(stamp, acts[acting + 1])
                self._follow(told[acting], (end - at) / NANOSECONDS)
                at = end
            speed_mps, heading_rad, height_m, _ = seen[sample + 1]
            for node, state in enumerate(self._states):
                tracks[2][node][sample] = state.height_m - height_m
                if node < of_air:
                    tracks[0][node][sample] = state.airspeed_mps - speed_mps
                    tracks[1][node][sample] = wrap(state.heading_rad - heading_rad)
            for track in tracks:
                track[-1][sample] = 1.0
        return tracks

    def unseen(self, samples: int) -> Tracks:
        """Return tracks without a sample."""
        sizes = self._of_air + 1, self._of_air + 1, len(self._states) + 1
        return [[[0.0] * samples for _ in range(size)] for size in sizes]

    def _follow(self, told: Triple, time_s: float) -> None:
        """Move all simulations on by a time in which a setpoint acts, and note how far they are off."""
        speed_mps, heading_rad, height_m = told
        speed_mps = within(speed_mps, self._believed.speed_min_mps, self._believed.speed_max_mps)
        off_mps = off_rad = off_m = 0.0
        of_air = self._of_air
        for node, state in enumerate(self._states):
            off_m += abs(height_m - state.height_m)
            if node < of_air:
                off_mps += abs(speed_mps - state.airspeed_mps)
                off_rad += abs(wrap(heading_rad - state.heading_rad))
                respond(state, self._models[node], speed_mps, heading_rad, height_m, time_s)
            else:
                climb(state, self._models[node], height_m, time_s)
        off = self._off
        self._off = [
            max(off[0], off_mps / of_air),
            max(off[1], off_rad / of_air),
            max(off[2], off_m / len(self._states)),
        ]
