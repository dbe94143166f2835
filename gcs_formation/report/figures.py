"""All figures of a run: names, captions, the functions that draw them, and how they are written."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure

from gcs_formation.report import RunData
from gcs_formation.report.error_figures import assembled_first, assembly, disturbance, disturbed, errors, has_followers
from gcs_formation.report.loop_figures import gains, has_gains, latency, separation, setpoints, steps
from gcs_formation.report.plan_figures import plan, trajectory
from gcs_formation.report.style import print_style, save


class Plate(NamedTuple):
    """A figure: the function that draws it, its title and its caption."""

    draw: Callable[[RunData], Figure]
    title: str
    caption: str
    has_something: Callable[[RunData], bool] = lambda _: True
    """Whether the run has anything for it to show; it is left out otherwise."""

    @property
    def name(self) -> str:
        """Its file's name without the suffix."""
        return self.draw.__name__


PLATES = (
    Plate(
        disturbance,
        "Disturbance",
        "Velocity that was added to each vehicle's own over the ground, from ground truth (figure 11 of the paper).",
        disturbed,
    ),
    Plate(
        errors,
        "Formation errors",
        "Slot minus vehicle, in the frame that the scenario names (figure 12 of the paper). Where the transient would "
        "hide what follows it, it has axes of its own on the left. After a gust on followers only: what no law can do "
        "better than, and what ours is held to.",
        has_followers,
    ),
    Plate(
        trajectory,
        "Trajectories",
        "Over the ground (figure 13 of the paper). Heights are stretched; grey: the tracks' shadows. With terrain, "
        "below: heights over time, and the ground under the leader.",
    ),
    Plate(
        plan,
        "Plan view",
        "Tracks of all vehicles and the path, north up. A, B, …: the formation at these times, seen with the "
        "leader's heading up; circles are the slots that were commanded then.",
    ),
    Plate(
        assembly,
        "Take-off and assembly",
        "Before the path: tracks over the ground, north up; heights; and how far each follower was from its slot. "
        "At 0 s the leader starts along the path.",
        assembled_first,
    ),
    Plate(
        setpoints,
        "Setpoints and responses",
        "What the ground station asked of each autopilot, and what it did. Of many followers, those with the "
        "largest errors.",
    ),
    Plate(
        steps,
        "Setpoint steps",
        "How far each follower's setpoints moved from one tick to the next. Lines are medians over stretches of time, "
        "bands the range.",
        has_followers,
    ),
    Plate(
        gains,
        "Gains",
        "Of the worst of those that follow longest, as shares of their nominal values, which the legend has.",
        has_gains,
    ),
    Plate(
        separation,
        "Separation and clearance",
        "Least distance of any two vehicles, and heights above the ground below each vehicle, with the safety limits.",
    ),
    Plate(
        latency,
        "Latency",
        "One-way delay of each link: half of the measured round trip, and dotted what was injected. How old the newest "
        "telemetry was when the law used it. Lines are medians over stretches of time, bands the range. Share of its "
        "delay margin that each follower's loops used, at the gains in force. While a vehicle isn't commanded, "
        "nothing is drawn.",
    ),
)


def write_figures(run: RunData, directory: Path) -> Iterator[tuple[Plate, Path]]:
    """Draw every figure that the run has something for into a directory; yield each with its file."""
    directory.mkdir(exist_ok=True)
    for plate in PLATES:
        path = directory / f"{plate.name}.png"
        if not plate.has_something(run):
            path.unlink(missing_ok=True)
            continue
        with print_style():
            save(plate.draw(run), path)
        yield plate, path
