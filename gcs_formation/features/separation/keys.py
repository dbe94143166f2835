"""Keys of the separation rule."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field

from formation_scenario.brought_keys import BroughtKeys
from formation_scenario.fields import Flag, Keys, Number, Positive, key
from formation_scenario.kept_distance import BUFFER_M, SEPARATION_M, KeepsDistance
from formation_scenario.plain_defaults import filled, usable
from formation_scenario.source import Key, Plain


class Avoidance(Keys, KeepsDistance):
    """The separation rule."""

    enabled: Flag = key(True, "whether setpoints keep clear of it")
    distance_m: Positive = key(..., "distance that it keeps, m", 15, derived="safety.separation_m + 5")
    horizon_s: Annotated[Number, Field(ge=4.0, le=60.0)] = key(12.0, "how far it looks ahead, s", 20)

    @property
    def kept_m(self) -> float:
        """The distance that it keeps, m."""
        return self.distance_m


class SeparationKeys(BroughtKeys, group="safety", after=("separation_m",)):
    """What keeps the limit on separation."""

    avoidance: Avoidance = key(..., "", derived="its keys'")

    @classmethod
    def with_defaults(cls, group: dict[Key, Plain]) -> dict[Key, Plain]:
        """Return the group with the distance that follows from the least allowed one."""
        kept: dict[Key, Plain] = {"distance_m": usable(group.get("separation_m"), SEPARATION_M) + BUFFER_M}
        return group | {"avoidance": filled(group.get("avoidance"), kept)}


KEYS: Final = (SeparationKeys,)
