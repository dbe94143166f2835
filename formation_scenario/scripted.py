"""What a program did to a flight that it stepped, by control tick: written to run.yaml, so that the flight repeats."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, TypeAlias, cast

from pydantic import BeforeValidator, Discriminator, Field, Tag, WithJsonSchema

from formation_scenario.fields import WHOLE, Allowed, Keys, NonNegative, VehicleSelection, key
from formation_scenario.links import WHICH_LINK, Impairment, ImpairmentPatch, LinkNumber, patched
from formation_scenario.orders import ALLOWED, EXAMPLES, PlannedOrder, known_order
from formation_scenario.surroundings import Disturbance, Fault

TickNumber = Annotated[int, Field(strict=True, ge=0, le=2**31), WHOLE, Allowed("a whole number from 0")]
REPLACED: Final = "replaced by a program"
ACTS = ("order", "link", "fault", "disturbance", "setpoints")


class ScriptedLink(ImpairmentPatch):
    """A change of some vehicles' links: keys for both directions, then those for each direction."""

    vehicles: VehicleSelection = key("all", "whose: all, or a list of ids", [2])
    link: LinkNumber | None = WHICH_LINK
    uplink: ImpairmentPatch | None = key(None, "differences of the way from the ground station to the vehicle")
    downlink: ImpairmentPatch | None = key(None, "differences of the way from the vehicle to the ground station")

    @property
    def changes_nothing(self) -> bool:
        """Whether no key is given."""
        given = self.model_dump(exclude={"vehicles", "link"}, exclude_none=True)
        return all(value == {} for value in given.values())


class ScriptedFault(Fault):
    """A fault; its times are since the tick."""

    at_s: NonNegative = key(0.0, "when it happens, since the tick, s")


class ScriptedOrder(Keys):
    """What a program did at a control tick, one of the five; `gcs_formation.Flight` records it.

    Ticks are rows of the time series, from 1; those of 0 were before the first. Times of faults and disturbances count
    from the tick, so that they may begin before t = 0.
    """

    at_tick: TickNumber = key(..., "after which control tick", 512)
    order: (
        Annotated[str, BeforeValidator(known_order), WithJsonSchema({"type": "string"}), Allowed(ALLOWED, EXAMPLES)]
        | None
    ) = key(None, "an order, as by `gcs-formation tell`", "speed 24", derived="none")
    link: ScriptedLink | None = key(None, "a change of links")
    fault: ScriptedFault | None = key(None, "a fault")
    disturbance: Disturbance | None = key(None, "a velocity that the air adds")
    setpoints: Literal["replaced by a program"] | None = key(
        None, "from here on the program replaced setpoints: only with it the flight is flown again", REPLACED
    )

    @property
    def given(self) -> list[str]:
        """The names of what is given, of which there is one."""
        return [name for name in ACTS if getattr(self, name) is not None]


def _word(value: object) -> str:
    given = isinstance(value, ScriptedOrder) or (
        isinstance(value, Mapping) and "at_tick" in cast("Mapping[str, Any]", value)
    )
    return "at a tick" if given else "at a time"


AnyOrder: TypeAlias = Annotated[
    Annotated[PlannedOrder, Tag("at a time")] | Annotated[ScriptedOrder, Tag("at a tick")], Discriminator(_word)
]


def impaired(link: Impairment, change: ScriptedLink, direction: ImpairmentPatch | None) -> Impairment:
    """Return a direction of a link after a change."""
    changed = patched(link, change)
    return changed if direction is None else patched(changed, direction)
