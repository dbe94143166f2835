"""A figure of what was told, measured and fitted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from gcs_formation.arrays import Array
from gcs_formation.identify.recording import STEP_S, Recording
from gcs_formation.report.style import CM, DPI, FOLLOWERS, GREY, INK, WIDTH_CM, print_style

HEIGHT_CM = 14.0
LABELS = ("airspeed, m/s", "heading, degrees", "height, m")


def draw(recording: Recording, flown: dict[str, Array], file: Path) -> None:
    """Draw a recording and the models' flights by its setpoints alone, (3, K) each by its name, as a PNG."""
    at_s: Array = STEP_S * np.arange(recording.seen.shape[1], dtype=np.float64)
    scales = (1.0, 180.0 / np.pi, 1.0)
    with print_style():
        figure = Figure(figsize=(WIDTH_CM * CM, HEIGHT_CM * CM), layout="constrained")
        axes = [figure.add_subplot(3, 1, 1)]
        axes += [figure.add_subplot(3, 1, row, sharex=axes[0]) for row in (2, 3)]
        for row, (axis, label, scale) in enumerate(zip(axes, LABELS, scales, strict=True)):
            axis.step(at_s, recording.told[row] * scale, where="post", color=GREY, linewidth=0.6, label="setpoint")
            axis.plot(at_s, recording.seen[row] * scale, color=INK, label="measured")
            for (name, values), colour in zip(flown.items(), FOLLOWERS, strict=False):
                axis.plot(at_s, values[row] * scale, color=colour, label=name)
            axis.set_ylabel(label)
        axes[-1].set_xlabel("time, s")
        axes[0].legend(ncols=2 + len(flown), loc="lower left", bbox_to_anchor=(0.0, 1.0))
        figure.savefig(file, dpi=DPI)
