"""The frames in which slots, and the errors from them, can be defined, and the direction of each one's first axis.

`leader_heading`: forward and right of the leader as it heads; slots swing when it turns. `follower_heading`, the
paper's: forward and right as the follower itself heads. `north`: fixed, forward is north and right is east; slots keep
their direction from the leader whatever it does, as formations of multirotors are defined in shows.
"""

from __future__ import annotations

from typing import TypeVar

from flight_model.arrays import Array
from formation_scenario.fields import Frame

Angle = TypeVar("Angle", float, Array)


def axis_names(frame: Frame) -> tuple[str, str]:
    """Return what the first two axes of a frame are called."""
    return ("north", "east") if frame == "north" else ("forward", "right")


def axis_rad(frame: Frame, leader_rad: Angle, own_rad: Angle) -> Angle:
    """Return the direction of a slot's forward axis, clockwise from north, by the headings of leader and follower."""
    if frame == "north":
        return 0.0 * leader_rad  # unknown where the leader's is: without a leader there is no slot
    return leader_rad if frame == "leader_heading" else own_rad
