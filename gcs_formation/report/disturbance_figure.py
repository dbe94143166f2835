"""The disturbance velocity of each vehicle over time: wind and whatever else displaces it."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from gcs_formation.record.timeseries import DISTURBANCE
from gcs_formation.report.lines import everyone
from gcs_formation.report.marks import marks
from gcs_formation.report.run_data import RunData
from gcs_formation.report.style import axes_grid, column_of, legend_below, new_figure
from gcs_formation.report.time_axes import at_least, draw_marks, span, time_label

LABELS = ("north, m/s", "east, m/s", "down, m/s")
LEAST_MPS = 0.1
"""What the axes reach to at least, upwards and downwards."""


def disturbed(run: RunData) -> bool:
    """Whether any vehicle is known to have been disturbed; only ground truth knows."""
    own = run.flown.vehicles.values()
    return run.flown.truth and any(np.nan_to_num(each[name]).any() for each in own for name in DISTURBANCE)


def disturbance(run: RunData) -> Figure:
    """Draw the true disturbance of every vehicle; the down component where there is any."""
    group = everyone(run)
    values = [[run.flown.vehicles[vehicle][name] for vehicle in group.vehicles] for name in DISTURBANCE]
    shown = 3 if np.nan_to_num(np.array(values[2])).any() else 2
    figure = new_figure(3.2 + 2.8 * shown)
    rows = column_of(axes_grid(figure, shown, 1, sharex=True), 0)
    for axes, label, series in zip(rows, LABELS, values, strict=False):
        group.draw(axes, run.time_s, series)
        at_least(axes, -LEAST_MPS, LEAST_MPS)
        axes.set_ylabel(label)
    span(rows[0], float(run.time_s[0]), float(run.time_s[-1]))
    draw_marks([rows], marks(run))
    rows[-1].set_xlabel(time_label(run))
    figure.align_ylabels(rows)
    legend_below(figure)
    return figure
