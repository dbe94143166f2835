"""Keys of the links: what is done to the datagrams of each direction, and when."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from formation_scenario.fields import Fraction, Keys, NonNegative, Timed

Distribution = Literal["normal", "uniform", "pareto"]
Milliseconds = Annotated[NonNegative, Field(le=600_000.0)]


class Impairment(Keys):
    """What happens to each datagram of one direction of one link."""

    delay_ms: Milliseconds = Field(default=0.0, description="mean delay before truncation at 0, ms")
    jitter_ms: Milliseconds = Field(default=0.0, description="standard deviation of the delay, ms")
    distribution: Distribution = Field(default="normal", description="of the jitter: normal | uniform | pareto")
    loss: Fraction = Field(default=0.0, description="probability that a datagram is lost")
    duplicate: Fraction = Field(default=0.0, description="probability that a datagram arrives twice")
    rate_kbps: NonNegative = Field(default=0.0, description="data rate, kbit/s; 0: unlimited")


class ImpairmentPatch(Keys):
    """The keys of an impairment that change; the others stay as they were."""

    delay_ms: Milliseconds | None = None
    jitter_ms: Milliseconds | None = None
    distribution: Distribution | None = None
    loss: Fraction | None = None
    duplicate: Fraction | None = None
    rate_kbps: NonNegative | None = None


class DefaultLink(Impairment):
    """Both directions of every link, and what differs in one of them."""

    uplink: ImpairmentPatch | None = Field(default=None, description="ground station to vehicle")
    downlink: ImpairmentPatch | None = Field(default=None, description="vehicle to ground station")


class LinkChange(ImpairmentPatch, Timed):
    """A change of some vehicles' links: its own keys for both directions, then those of each direction."""

    uplink: ImpairmentPatch | None = Field(default=None, description="ground station to vehicle")
    downlink: ImpairmentPatch | None = Field(default=None, description="vehicle to ground station")


class Links(Keys):
    """The links between the ground station and every vehicle."""

    default: DefaultLink = DefaultLink()
    uplink: ImpairmentPatch | None = Field(default=None, description="ground station to vehicle, all vehicles")
    downlink: ImpairmentPatch | None = Field(default=None, description="vehicle to ground station, all vehicles")
    changes: tuple[LinkChange, ...] = Field(default=(), description="changes in flight")


class LinkStep(NamedTuple):
    """Both directions of one vehicle's link from `at_s` on; the first step holds before t = 0 too."""

    at_s: float
    uplink: Impairment
    downlink: Impairment


def link_steps(links: Links, changes: Iterable[LinkChange]) -> tuple[LinkStep, ...]:
    """Return a link's states in time order: the default, then each of `changes` applied to the one before."""
    default = links.default
    base = Impairment(**{key: getattr(default, key) for key in Impairment.model_fields})
    uplink = _patched(base, default.uplink, links.uplink)
    downlink = _patched(base, default.downlink, links.downlink)
    steps = [LinkStep(0.0, uplink, downlink)]
    for change in sorted(changes, key=lambda change: change.at_s):
        uplink = _patched(steps[-1].uplink, change, change.uplink)
        downlink = _patched(steps[-1].downlink, change, change.downlink)
        steps.append(LinkStep(change.at_s, uplink, downlink))
    return tuple(steps)


def _patched(impairment: Impairment, *patches: ImpairmentPatch | None) -> Impairment:
    keys = Impairment.model_fields
    given = [{key: getattr(patch, key) for key in keys} for patch in patches if patch is not None]
    update = {key: value for values in given for key, value in values.items() if value is not None}
    return impairment.model_copy(update=update)
