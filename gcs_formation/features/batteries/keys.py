"""Keys of the batteries' reserve."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from formation_scenario.brought_keys import BroughtKeys
from formation_scenario.fields import Keys, Number, Positive, key

Reserve = Annotated[Number, Field(ge=0.0, le=0.9)]


class Battery(Keys):
    """What is left in a battery whose vehicle tells it, and what happens when that isn't enough."""

    reserve: Reserve = key(0.2, "share of each battery that is to be left after the flight home", 0.3)
    endurance_s: Positive | None = key(
        None,
        "for how long the vehicle that uses most flies on a full battery in this formation, s; what is measured in "
        "flight comes first",
        1800,
        derived="as each autopilot estimates it, if it does",
    )
    before_take_off: Literal["refuse", "warn"] = key(
        "refuse", "what `fly` does if a battery doesn't last for the planned flight, the way home and the reserve"
    )
    in_flight: Literal["home", "warn"] = key(
        "home", "what happens once what is left lasts for the way home and the reserve alone"
    )


class BatteryKeys(BroughtKeys, group="safety", after=("path_distance_m", "separation_m")):
    """The reserve, beside the other limits."""

    battery: Battery = Battery()


KEYS: Final = (BatteryKeys,)
