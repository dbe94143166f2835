"""The paper's figures beside this run's, where they can be compared, and errors after gusts beside their bounds."""

from __future__ import annotations

from html import escape

import numpy as np

from formation_scenario.disturbances import StepDisturbance
from gcs_formation.report.gusts import gusts
from gcs_formation.report.run_data import RunData
from gcs_formation.report.tables import AXES, badge, number, table

STEP_MPS = 0.6
"""What the paper adds north and east to every vehicle from 500 s on (figure 11)."""
REPORTED_M = {"x": 0.22, "y": 0.5}
"""The largest errors that the paper reads from figure 12, the transient at the beginning left out."""

BOUND = (
    "Nothing can act before the round trip T has passed; then a vehicle accelerates by a at most. So whatever the law, "
    "the largest error is at least |D| T + D²/(2 a) along a slot axis; ours is held to 1.5 times that and 0.05 m. T is "
    "as measured before the gust, with sampling and hold by their means: an error may stay a little below the least "
    "possible where the gust comes just before a sample. D is the change of the follower's disturbance beyond its "
    "leader's. Shown is the follower nearest to its bound."
)


def beside_the_paper(run: RunData) -> str:
    """Return the paper's figures beside the run's as HTML, nothing where they can't be compared."""
    step = _step(run)
    if step is None:
        return ""
    found = _largest_m(run, step.at_s)
    rows = [
        [f"largest |error| {axis} from the step on, m", number(REPORTED_M.get(axis), 2), number(found[axis])]
        for axis in AXES
    ]
    rows += [
        [f"least {what} of the whole run, m", "no collision", number(run.summary["safety"][f"min_{what}_m"], 1)]
        for what in ("separation", "clearance")
    ]
    heads = ["Worst follower", "paper", "this run"]
    return f'{table(heads, rows)}<p class="note">{escape(_conditions(run, step))}</p>'


def after_gusts(run: RunData) -> str:
    """Return the errors after gusts on followers only beside their bounds as HTML, nothing where there was no gust."""
    rows = [
        [
            f"{gust.at_s:g} s, {error.axis}",
            str(error.vehicle),
            *(number(value) for value in error[2:]),
            badge(error.found_m <= error.allowed_m, "held" if error.found_m <= error.allowed_m else "broken"),
        ]
        for gust in gusts(run)
        for error in gust.errors
    ]
    if not rows:
        return ""
    heads = ["Gust on followers only", "Vehicle", "T, s", "least possible, m", "held to, m", "largest |error|, m", ""]
    return f'{table(heads, rows, (0, 1, 6))}<p class="note">{escape(BOUND)}</p>'


def _step(run: RunData) -> StepDisturbance | None:
    """Return the paper's disturbance in this run, None where there is none or the run ends within 60 s of it."""
    if not run.begun or not run.followers:
        return None
    alike = (
        each
        for each in run.scenario.disturbances
        if isinstance(each, StepDisturbance) and np.allclose(np.abs(each.velocity_mps), (STEP_MPS, STEP_MPS, 0.0))
    )
    return next((each for each in alike if each.at_s + 60.0 <= float(run.time_s[-1])), None)


def _largest_m(run: RunData, from_s: float) -> dict[str, float | None]:
    window = run.flown.window(from_s, float(run.time_s[-1]))
    errors = np.abs(np.concatenate([run.flown.error(vehicle)[window] for vehicle in run.followers]))
    most = np.fmax.reduce(errors)
    return {axis: float(most[i]) if np.isfinite(most[i]) else None for i, axis in enumerate(AXES)}


def _conditions(run: RunData, step: StepDisturbance) -> str:
    """Return who is disturbed, the frame of the errors and the delay of the links, in this run and in the paper."""
    everybody = step.vehicles == "all" or run.leader in step.vehicles
    whom = "every vehicle" if everybody else "followers only, a relative disturbance"
    delays_ms = [link["injected_delay_ms"] for link in run.summary["links"].values()]
    known_ms = [delay_ms for delay_ms in delays_ms if delay_ms is not None]
    links = f"links take {max(known_ms):.0f} ms each way, or less" if known_ms else "nothing is injected into links"
    frame = run.scenario.formation.frame.replace("_heading", "'s")
    return (
        f"This run: the step acts on {whom}, from {step.at_s:g} s on; slots in the {frame} frame; {links}. "
        "The paper says that it acts on every vehicle; it gives "
        "neither the links' delay nor path, speed, slots or gains, and whether figure 12 shows formation errors or "
        "errors of an estimate can't be told from its text."
    )
