"""Keys of a run's end."""

from __future__ import annotations

from formation_scenario.fields import (
    Keys,
    NonNegative,
    key,
)
from formation_scenario.orders import End


class Finish(Keys):
    """The end of a run."""

    loiter_s: NonNegative = key(10.0, "how long the vehicles loiter after the run, s", 30)
    then: End = key(
        "loiter",
        "what all do once the path or the time is at its end: circle or hover there, go home, or [land one after "
        "another](formations.md#loiter-rtl-and-land) and disarm; where one can't land none takes off",
        "land",
    )
