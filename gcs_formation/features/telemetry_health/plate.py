"""Figure of the telemetry that wasn't accepted: which quantity of which vehicle, from when until when."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.figure import Figure

from gcs_formation.features.telemetry_health.series import spells
from gcs_formation.report import RunData, style
from gcs_formation.report.time_axes import finished, span

ROW_CM = 0.55
REST_CM = 3.5
BAR = 0.7
"""Height of a bar, in rows."""
MAX_ROWS = 30
"""So many quantities of vehicles are shown, those first that were doubted first."""


def has_alarms(run: RunData) -> bool:
    """Return whether any quantity wasn't accepted."""
    return bool(spells(run.events))


def telemetry_health(run: RunData) -> Figure:
    """Draw a bar for each time during which a quantity of a vehicle wasn't accepted."""
    found = sorted(spells(run.events).items(), key=lambda each: each[1][0])[:MAX_ROWS]
    figure = style.new_figure(REST_CM + ROW_CM * len(found))
    ((axes,),) = grid = style.axes_grid(figure, 1, 1)
    end_s = float(run.time_s[-1])
    for row, (_, each) in enumerate(found):
        bars = [(from_s - run.zero_s, min(to_s - run.zero_s, end_s) - from_s + run.zero_s) for from_s, to_s in each]
        axes.broken_barh(bars, (row - BAR / 2.0, BAR), color=style.ASKED)
    axes.set_yticks(np.arange(len(found)), [f"{vehicle}: {quantity}" for (vehicle, quantity), _ in found])
    axes.set_ylim(len(found) - 0.5, -0.5)
    span(axes, run.time_s)
    return finished(figure, run, grid, ("vehicle: quantity",))


PLATES: Final = {telemetry_health: has_alarms}
