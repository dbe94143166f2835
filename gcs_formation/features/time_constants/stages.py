# Compiled by mypyc: it runs every tick.

"""Its stages: how far time constants are off their models is said in the findings."""

from __future__ import annotations

from formation_scenario.slot_assignment import models_by_index
from gcs_formation.core.cycle import EACH_SECOND, IN_COMMAND, Cycle, Stage
from gcs_formation.estimation.sample import heading_shown
from gcs_formation.features.time_constants.estimator import TimeConstantEstimator
from gcs_formation.features.time_constants.keys import TimeConstantKeys


class MotionSeen(Stage):
    """Takes the motion of the newest samples, with headings as the filters show them, which have taken them."""

    name = "motion_seen"
    when = IN_COMMAND
    after = ("estimates",)

    def __init__(self, estimator: TimeConstantEstimator) -> None:
        """Give samples to `estimator`, which all three stages share."""
        self._estimator = estimator

    def run(self, cycle: Cycle) -> None:
        """Give it each new sample: as measured, with the heading as filtered."""
        filters = cycle.controller.estimator.filters
        for index, sample in enumerate(cycle.samples):
            if sample is not None:
                state, heading_rad = filters[index].state, sample.heading_rad
                if sample.by_course and state is not None:
                    heading_rad = heading_shown(state, sample.north_mps, sample.east_mps)
                motion = sample.airspeed_mps, heading_rad, sample.height_m, sample.climb_mps
                self._estimator.add_sample(index, sample.stamp, motion)


class TimeConstants(Stage):
    """Fits time constants to the motion seen of vehicles that are commanded now, before the law predicts by them."""

    name = "time_constants"
    when = IN_COMMAND
    after = ("tick",)

    def __init__(self, estimator: TimeConstantEstimator) -> None:
        """Update `estimator`, which all three stages share."""
        self._estimator = estimator

    def run(self, cycle: Cycle) -> None:
        """Go on with the fit."""
        active, links = cycle.tick.active, cycle.links
        self._estimator.update([active[index] and not links[index].disobeying for index in range(len(active))])


class TimeConstantsOff(Stage):
    """Says how far time constants are off the models in use, before delay margins are judged."""

    name = "time_constants_off"
    when = EACH_SECOND
    after = ("own_parts",)

    def __init__(self, estimator: TimeConstantEstimator) -> None:
        """Ask `estimator`, which all three stages share."""
        self._estimator = estimator

    def run(self, cycle: Cycle) -> None:
        """Put relative errors, (3, C), into the findings."""
        cycle.findings.time_constants_off = self._estimator.mismatch


def time_constant_estimator(cycle: Cycle) -> TimeConstantEstimator:
    """Return the estimator, which updates the controller's models unless the scenario fixes them."""
    scenario, controller = cycle.scenario, cycle.controller
    rates_hz = scenario.telemetry.rate_hz, scenario.law.rate_hz
    estimated = [model.airframe is None and not model.hovers for model in models_by_index(scenario)]
    in_use = TimeConstantKeys.of(scenario).lag_estimation
    return TimeConstantEstimator(controller.models, controller.history, *rates_hz, in_use=in_use, estimated=estimated)
