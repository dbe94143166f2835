"""The lags of equation (7) as each vehicle flies them, learnt from its telemetry and what it was sent.

Output-error identification (Ljung, "System Identification", 2nd ed., 4.2 and 10.2): each vehicle is simulated from its
setpoints alone by several models at once, whose lags span `RATIO_MAX`. Between them the simulated motion is
interpolated by a polynomial in the logarithm of the lag's ratio to the believed one. The ratio found is the one that
comes nearest to the telemetry by least squares, held by a normal prior about the believed lag. No measurement enters
the simulation, so white noise in the telemetry doesn't bias it; a constant difference (a sensor's bias) isn't fitted.
"""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import NANOSECONDS
from flight_model.autopilot import AutopilotModel, finite
from flight_model.slot import Triple
from gcs_formation.estimation.lag_bank import Bank, Motion, Tracks
from gcs_formation.estimation.lag_fit import BATCH_S, Channel, Nodes
from gcs_formation.estimation.setpoint_history import Flown, SetpointHistory

RESOLUTION: Final = (0.02, 0.002, 0.05)
"""Residuals of airspeed (m/s), heading (rad) and height (m) count as no smaller: telemetry's digits, and the instant at
which a setpoint acts, aren't known better."""
GAP_S: Final = 3.0
"""A longer gap in the telemetry starts the simulation anew."""


class VehicleLags:
    """A vehicle's batch of samples, and its simulations."""

    def __init__(self, model: AutopilotModel, air: Nodes, height: Nodes, samples: int) -> None:
        """Start with the lags that `model` has; so many `samples` are a batch."""
        self.lagging = True
        """Whether it flies by (7); of others, whose model only comes near them, no lags are learnt."""
        self.model = model
        self.stamps: list[int] = []
        """Of the samples, ns; the first ended the batch before."""
        self._lags_s = model.tau_v_s, model.tau_psi_s, model.tau_ha_s, model.tau_hb_s
        self._bank = Bank(model, air.at, height.at)
        self.batch = [Tracks(len(nodes.at), samples) for nodes in (air, air, height)]
        """Of airspeed, heading and height."""
        self._motion: Motion = (math.nan, math.nan, math.nan, math.nan)
        self._stamp = 0
        self._seen: list[Motion] = []
        self._learning = True
        self._learnt = [False, False, False]

    def hear(self, stamp: int, motion: Motion) -> None:
        """Take its motion as measured at `stamp`."""
        self._stamp, self._motion = max(stamp, self._stamp), motion

    def note(self, *, learning: bool) -> None:
        """Add the newest sample; `learning`: it flies as it was commanded."""
        self._learning = self._learning and learning and not math.isnan(self._motion[0])
        self.stamps.append(self._stamp)
        self._seen.append(self._motion)

    def learns(self, setpoints: list[Triple]) -> bool:
        """Return whether a batch with these `setpoints` shows its lags."""
        if not (self._learning and self.lagging and self._bank.flying):
            return False
        if (self.stamps[-1] - self.stamps[0]) / NANOSECONDS > GAP_S + BATCH_S:
            return False
        return all(finite(speed_mps + heading_rad + height_m) for speed_mps, heading_rad, height_m in setpoints)

    def fly(self, flown: Flown) -> None:
        """Put the simulations minus telemetry into the batch."""
        self._bank.fly(self.stamps, self._seen, flown, self.batch)
        self._learnt = self._bank.free()
        for channel, free in enumerate(self._learnt):
            if not free:
                self.batch[channel].clear()

    def begin(self) -> None:
        """Begin a batch with the newest sample; the simulations that didn't teach begin anew from it."""
        self._bank.begin(self._learnt, self._seen[-1])
        self.stamps, self._seen = self.stamps[-1:], self._seen[-1:]
        self._learning, self._learnt = True, [False, False, False]
        for tracks in self.batch:
            tracks.clear()

    def use(self, log_ratios: list[float]) -> None:
        """Give its model lags by their ratios to the believed ones: of airspeed and heading, and both of height."""
        speed, heading, slow, fast = log_ratios
        model, (speed_s, heading_s, slow_s, fast_s) = self.model, self._lags_s
        model.tau_v_s, model.tau_psi_s = speed_s * math.exp(speed), heading_s * math.exp(heading)
        model.tau_ha_s, model.tau_hb_s = slow_s * math.exp(slow), fast_s * math.exp(fast)


class LagEstimator:
    """Keeps the lags of the models of all vehicles, (C,), as they fly; they are changed in place.

    Everyone who predicts or steers by those models reads them anew each tick.
    """

    def __init__(
        self,
        models: list[AutopilotModel],
        history: SetpointHistory,
        telemetry_hz: float,
        law_hz: float,
        *,
        in_use: bool,
    ) -> None:
        """Start with the lags that `models` have; `history` holds what was commanded.

        Not `in_use`, the models stay as they are, and only their misfit is watched.
        """
        air, height, self._ticks = Nodes(5, 1), Nodes(4, 2), max(2, round(BATCH_S * law_hz))
        self.vehicles = [VehicleLags(model, air, height, self._ticks) for model in models]
        each = zip((air, air, height), RESOLUTION, strict=True)
        self.channels = [Channel(nodes, len(models), finest, telemetry_hz, in_use=in_use) for nodes, finest in each]
        """Airspeed, heading, height."""
        self._in_use = in_use
        self._history = history
        self._noted = 0

    @property
    def misfit(self) -> list[list[float]]:
        """(3, C) by what share the lags of airspeed, heading and height seem to differ from those in use."""
        return [channel.misfit for channel in self.channels]

    def log_ratios(self, column: int) -> list[float]:
        """Return those of a vehicle's lags of airspeed, heading and height (two) to the believed ones."""
        return [each for channel in self.channels for each in channel.log_ratio[column]]

    def hear(self, column: int, stamp: int, motion: Motion) -> None:
        """Take a vehicle's airspeed, heading, height and climb as measured at `stamp`, m/s, rad, m."""
        self.vehicles[column].hear(stamp, motion)

    def learn(self, learning: list[bool]) -> None:
        """Take the newest samples at a tick; `learning` (C,): vehicles that fly as they were commanded.

        Once in `BATCH_S` the models' lags are fitted.
        """
        for column, flies in enumerate(learning):
            self.vehicles[column].note(learning=flies)
        self._noted += 1
        if self._noted <= self._ticks:
            return
        begins = [each.stamps[0] for each in self.vehicles]
        self._fit(self._history.between(begins, [each.stamps[-1] for each in self.vehicles]))
        for each in self.vehicles:
            each.begin()
        self._noted = 1

    def _fit(self, flown: list[Flown]) -> None:
        """Fit the lags to a batch, in which each vehicle was `flown` so."""
        learns = [each.learns(flown[column].setpoints) for column, each in enumerate(self.vehicles)]
        if not any(learns):
            return
        for column, each in enumerate(self.vehicles):
            if learns[column]:
                each.fly(flown[column])
        for place, channel in enumerate(self.channels):
            channel.learn([each.batch[place] for each in self.vehicles])
        if self._in_use:
            for column, each in enumerate(self.vehicles):
                each.use(self.log_ratios(column))
