# Compiled by mypyc: it runs every tick.

"""Estimates each vehicle's time constants in flight: batches of samples, and the models that they update in place."""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import i64

from flight_model.autopilot_model import AutopilotModel
from gcs_formation.estimation.setpoint_history import SentSetpoints, SetpointHistory
from gcs_formation.features.time_constants.fit import TimeConstantFit
from gcs_formation.features.time_constants.interpolation import Nodes
from gcs_formation.features.time_constants.model_set import ModelSet, ResidualBatch, Samples, Seen
from gcs_formation.features.time_constants.persistence import BATCH_S

RESOLUTION: Final[tuple[float, ...]] = (0.02, 0.002, 0.05)
"""Standard deviations of the residuals of airspeed (m/s), heading (rad) and height (m) before any were seen: telemetry
is rounded, and the instant at which a setpoint acts isn't known exactly. Tuned: m/s, rad, m; half to double; shown by
`pytest tests/gcs_formation/features/time_constants`."""
FINEST: Final[tuple[float, ...]] = (0.001, 1e-4, 0.05)
"""The minimum that they may turn out to have. Heights show vertical motion of the air, too, which looks like time
constants: their small motions teach nothing. Tuned: m/s, rad, m; at most `RESOLUTION`; shown by `pytest
tests/gcs_formation/features/time_constants`."""
GAP_S: Final = 3.0
"""A longer gap in the telemetry restarts the simulations. Tuned: s; 1 to 5; shown by `pytest
tests/gcs_formation/features/time_constants`."""


class VehicleEstimator:
    """A vehicle's batch of samples, its simulations, and the time constants fitted to them."""

    def __init__(
        self,
        model: AutopilotModel,
        air: Nodes,
        height: Nodes,
        samples: int,
        hz: float,
        *,
        estimated: bool,
        in_use: bool,
    ) -> None:
        """Start with the time constants of `model`; `samples`: of a batch; `hz`: rate of the telemetry."""
        self._estimated = estimated
        """Whether it flies by (7); where the model is only an approximation, no time constants are estimated."""
        self.model = model
        self._taus_s = model.tau_v_s, model.tau_psi_s, model.tau_ha_s, model.tau_hb_s
        self._model_set = ModelSet(model, air.at, height.at)
        each = list(zip((air, air, height), RESOLUTION, FINEST, strict=True))
        self.channels = [TimeConstantFit(nodes, first, finest, hz, in_use=in_use) for nodes, first, finest in each]
        """Airspeed, heading, height."""
        self._batch = [ResidualBatch(len(nodes.at), samples) for nodes, _, _ in each]
        self._in_use = in_use
        self._motion: Seen = (math.nan, math.nan, math.nan, math.nan)
        self._stamp: i64 = 0
        self._samples = Samples(samples + 1)
        self._learning = True

    def log_ratios(self) -> list[float]:
        """Return the logarithms of its ratios to the declared time constants: airspeed, heading, both of height."""
        return [each for channel in self.channels for each in channel.log_ratio]

    def add_sample(self, stamp: i64, motion: Seen) -> None:
        """Take its motion as measured at `stamp`."""
        self._stamp, self._motion = max(stamp, self._stamp), motion

    def add_newest(self, *, estimating: bool) -> None:
        """Add the newest sample; `estimating`: the vehicle follows its setpoints."""
        self._learning = self._learning and estimating and not math.isnan(self._motion[0])
        self._samples.add(self._stamp, self._motion)

    def update(self, sent: SentSetpoints) -> None:
        """Fit the time constants to the batch, and begin the next one with the newest sample.

        Simulations whose residuals couldn't be used restart from that sample.
        """
        estimated, changed = [False, False, False], False
        if self._learning and self._estimated and self._model_set.flying and self._samples.span_s <= GAP_S + BATCH_S:
            estimated = self._model_set.fly(self._samples, sent, self._batch)
        for index, tracks in enumerate(self._batch):
            if not estimated[index]:
                tracks.clear()
            changed = self.channels[index].update(tracks) or changed
            tracks.clear()
        if self._in_use and changed:
            self._use()
        self._model_set.initialise(estimated, self._stamp, self._motion)
        self._learning, self._samples.count = True, 0
        self._samples.add(self._stamp, self._motion)

    def _use(self) -> None:
        """Set the model's time constants to the fitted ones."""
        speed, heading, slow, fast = self.log_ratios()
        model, (speed_s, heading_s, slow_s, fast_s) = self.model, self._taus_s
        model.tau_v_s, model.tau_psi_s = speed_s * math.exp(speed), heading_s * math.exp(heading)
        model.tau_ha_s, model.tau_hb_s = slow_s * math.exp(slow), fast_s * math.exp(fast)


class TimeConstantEstimator:
    """Updates the time constants of all vehicles' models, (C,), in place.

    Whatever predicts or steers by those models reads the time constants again each tick.
    """

    def __init__(
        self,
        models: list[AutopilotModel],
        history: SetpointHistory,
        telemetry_hz: float,
        law_hz: float,
        *,
        in_use: bool,
        estimated: list[bool] | None = None,
    ) -> None:
        """Start with the time constants of `models`; `history` holds the setpoints.

        Unless `in_use`, the models stay as they are, and only their mismatch is estimated. `estimated` (C,): vehicles
        that fly by (7), so that their time constants can be estimated; all by default.
        """
        air, height, self._ticks = Nodes(5, 1), Nodes(4, 2), max(2, round(BATCH_S * law_hz))
        size = air, height, self._ticks, telemetry_hz
        self.vehicles = [
            VehicleEstimator(model, *size, estimated=flies, in_use=in_use)
            for model, flies in zip(models, estimated or [True] * len(models), strict=True)
        ]
        self._history = history
        self._added = 0

    @property
    def mismatch(self) -> list[list[float]]:
        """(3, C) estimated relative mismatch of the time constants of airspeed, heading and height in use."""
        return [[each.channels[index].mismatch for each in self.vehicles] for index in range(len(RESOLUTION))]

    def add_sample(self, index: int, stamp: int, motion: Seen) -> None:
        """Take a vehicle's airspeed, heading, height and climb as measured at `stamp`, m/s, rad, m."""
        self.vehicles[index].add_sample(stamp, motion)

    def update(self, estimating: list[bool]) -> None:
        """Take the newest samples at a tick, and fit the time constants every `BATCH_S`.

        `estimating` (C,): vehicles that follow their setpoints.
        """
        for index, flies in enumerate(estimating):
            self.vehicles[index].add_newest(estimating=flies)
        self._added += 1
        if self._added <= self._ticks:
            return
        for index, each in enumerate(self.vehicles):
            each.update(self._history.of(index))
        self._added = 1
