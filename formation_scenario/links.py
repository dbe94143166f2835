"""Keys of the links: impairments of each direction, their changes in flight, and recorded delays."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Any, Final, NamedTuple

from pydantic import AfterValidator, Field, WithJsonSchema
from pydantic_core import PydanticCustomError

from formation_scenario.channels import Channel
from formation_scenario.fields import (
    MAX_NUMBER,
    OF_AN_EXTENSION,
    WHOLE,
    Allowed,
    AtMost,
    Flag,
    Fraction,
    Keys,
    Later,
    NonNegative,
    OwnKeys,
    Text,
    Timed,
    Vector,
    Word,
    key,
)
from formation_scenario.impairment_types import MIN_KBPS, Burst, Distribution, Milliseconds
from formation_scenario.signing import Signing
from formation_scenario.traces.keys import Trace

MAX_CHANGES: Final = 5000
"""Of links in a flight."""


def _passable(rate_kbps: float) -> float:
    if 0.0 < rate_kbps < MIN_KBPS:
        raise PydanticCustomError("data_rate", "nothing would ever arrive")
    return rate_kbps


DataRate = Annotated[
    NonNegative,
    AfterValidator(_passable),
    WithJsonSchema({"anyOf": [{"const": 0.0}, {"type": "number", "minimum": MIN_KBPS, "maximum": MAX_NUMBER}]}),
    Allowed(f"0, or a number >= {MIN_KBPS:g}"),
]


class Impairment(Keys):
    """Impairments of one direction of one link."""

    delay_ms: Milliseconds = key(0.0, "mean delay before truncation at 0, ms", 300)
    jitter_ms: Milliseconds = key(0.0, "standard deviation of the delay, ms", 20)
    distribution: Distribution = key("normal", "distribution of the jitter", "pareto")
    loss: Fraction = key(0.0, "probability that a datagram is lost", 0.02)
    duplicate: Fraction = key(0.0, "probability that a datagram arrives twice", 0.01)
    rate_kbps: DataRate = key(0.0, "data rate, kbit/s; 0: unlimited", 57.6)
    queue_ms: Milliseconds = key(1000.0, "longest wait for the data rate, ms; what would wait longer is lost", 500)
    mean_burst: Burst | None = key(
        None, "mean number of datagrams lost in a row; without it each is lost on its own", 5
    )
    reorder: Flag = key(
        False, "whether datagrams may overtake each other; if not, each waits for the one before it", True
    )
    outage: Flag = key(False, "whether everything is lost")
    trace_file: Text | None = key(
        None,
        "short form of trace: {file: …}: a number of ms a line is of one way, a second after the one before it",
        "lte.txt",
    )
    trace: Trace | None = key(
        None,
        "recorded delays that are added to delay_ms in place of jitter, played by time and repeated; gaps are losses",
        {"file": "ping.csv", "column": "rtt_ms", "kind": "rtt", "time": "t_s"},
    )
    process: Word = key(
        None,
        "delay and loss process of an extension, which adds to the other keys; none: no longer one",
        "none",
    )
    parameters: OwnKeys = key(None, f"beside process: {OF_AN_EXTENSION}", {})

    @property
    def recording(self) -> Trace | None:
        """The recorded delays, in their short form or not."""
        return Trace(file=self.trace_file) if self.trace is None and self.trace_file is not None else self.trace

    def __hash__(self) -> int:
        """Hash what usually differs; an extension's own keys are a mapping, which has no hash."""
        return hash(
            (self.delay_ms, self.jitter_ms, self.loss, self.rate_kbps, self.outage, self.trace_file, self.process)
        )


def _patch(name: str) -> Any:  # noqa: ANN401 - as pydantic types the defaults of fields
    """Return the field of a key that may change: described as in `Impairment`, None if it stays as it was."""
    field = Impairment.model_fields[name]
    return key(None, field.description or "", *(field.examples or ()), derived="as it was")


class ImpairmentPatch(Keys):
    """The keys of an impairment that change; the others stay as they were."""

    delay_ms: Milliseconds | None = _patch("delay_ms")
    jitter_ms: Milliseconds | None = _patch("jitter_ms")
    distribution: Distribution | None = _patch("distribution")
    loss: Fraction | None = _patch("loss")
    duplicate: Fraction | None = _patch("duplicate")
    rate_kbps: DataRate | None = _patch("rate_kbps")
    queue_ms: Milliseconds | None = _patch("queue_ms")
    mean_burst: Burst | None = _patch("mean_burst")
    reorder: Flag | None = _patch("reorder")
    outage: Flag | None = _patch("outage")
    trace_file: Text | None = _patch("trace_file")
    trace: Trace | None = _patch("trace")
    process: Word = _patch("process")
    parameters: OwnKeys = _patch("parameters")


LinkNumber = Annotated[int, Field(strict=True, ge=1, le=4), WHOLE, Allowed("a whole number from 1 to 4")]
WHICH_LINK: Final[Any] = key(
    None, "which of the vehicles' links, where they have several: 1 is the first of `endpoint`", 2, derived="all"
)


class DefaultLink(Impairment):
    """Both directions of every link, and the differences of each direction."""

    uplink: Later[ImpairmentPatch] | None = key(None, "differences of the way from the ground station to the vehicle")
    downlink: Later[ImpairmentPatch] | None = key(None, "differences of the way from the vehicle to the ground station")
    signing: Later[Signing] | None = key(
        None, "signed frames, at both ends; without it nothing proves who sent a frame"
    )


class LinkChange(ImpairmentPatch, Timed):
    """A change of some vehicles' links: keys for both directions, then those for each direction."""

    link: LinkNumber | None = WHICH_LINK
    uplink: Later[ImpairmentPatch] | None = key(None, "differences of the way from the ground station to the vehicle")
    downlink: Later[ImpairmentPatch] | None = key(None, "differences of the way from the vehicle to the ground station")


NO_PROCESS = "none"
"""The word for no delay and loss process."""


class Links(Keys):
    """The links between the ground station and every vehicle."""

    default: DefaultLink = DefaultLink()
    uplink: Later[ImpairmentPatch] | None = key(None, "the same as default.uplink, over which it takes precedence")
    downlink: Later[ImpairmentPatch] | None = key(None, "the same as default.downlink, over which it takes precedence")
    station_m: Vector | None = key(
        None,
        "where the ground station's antenna is, for processes of extensions: north and east of the origin, and height "
        "above it, m",
        [-200, 0, 3],
        derived="the origin",
    )
    channels: AtMost[Later[Channel]] = key(
        (),
        "radios that several vehicles share, whose datagrams pass them before their own links",
        [{"vehicles": "all", "rate_kbps": 57.6, "duplex": "half", "turnaround_ms": 5}],
    )
    changes: Annotated[tuple[Later[LinkChange], ...], Field(max_length=MAX_CHANGES)] = key(
        (),
        "changes in flight",
        [
            {"at_s": 40, "vehicles": [2], "delay_ms": 300},
            {"at_s": 60, "uplink": {"outage": True}},
            {"at_s": 63, "uplink": {"outage": False}, "loss": 0.05},
        ],
    )


class LinkStep(NamedTuple):
    """Both directions of one vehicle's link from `at_s` on; the first step also holds before t = 0."""

    at_s: float
    uplink: Impairment
    downlink: Impairment


def min_mean_burst(loss: float) -> float:
    """Return the shortest mean burst possible with `loss` (0 to 1): a single arrival between any two bursts."""
    return max(1.0, loss / (1.0 - loss)) if loss < 1.0 else math.inf


def link_steps(links: Links, changes: Iterable[LinkChange]) -> tuple[LinkStep, ...]:
    """Return a link's states in time order: the default, then each of `changes` applied to the one before.

    Changes at the same time make one step; those at 0 s are part of the first.
    """
    default = links.default
    base = Impairment.model_construct(**{key: getattr(default, key) for key in Impairment.model_fields})
    uplink = _patched(base, default.uplink, links.uplink)
    downlink = _patched(base, default.downlink, links.downlink)
    steps = [LinkStep(0.0, uplink, downlink)]
    for change in sorted(changes, key=lambda change: change.at_s):
        uplink = _patched(steps[-1].uplink, change, change.uplink)
        downlink = _patched(steps[-1].downlink, change, change.downlink)
        if change.at_s == steps[-1].at_s:
            steps.pop()
        steps.append(LinkStep(change.at_s, uplink, downlink))
    return tuple(steps)


def through_air(steps: tuple[LinkStep, ...], channel: Channel) -> tuple[LinkStep, ...]:
    """Return a link's states with the delay, jitter and loss of a channel's air added, in both directions."""
    air = channel.air

    def together(impairment: Impairment) -> Impairment:
        return impairment.model_copy(
            update={
                "delay_ms": impairment.delay_ms + air.delay_ms,
                "jitter_ms": math.hypot(impairment.jitter_ms, air.jitter_ms),
                "loss": 1.0 - (1.0 - impairment.loss) * (1.0 - air.loss),
                "mean_burst": impairment.mean_burst or air.mean_burst,
            }
        )

    if not any(air[:3]):
        return steps
    return tuple(LinkStep(step.at_s, together(step.uplink), together(step.downlink)) for step in steps)


def _patched(impairment: Impairment, *patches: ImpairmentPatch | None) -> Impairment:
    for patch in patches:
        impairment = impairment if patch is None else patched(impairment, patch)
    return impairment


def patched(impairment: Impairment, patch: ImpairmentPatch) -> Impairment:
    """Return an impairment with what a patch gives; a record of delays replaces another in its other form."""
    given = {name: getattr(patch, name) for name in Impairment.model_fields}
    update = {name: value for name, value in given.items() if value is not None}
    for name, other in (("trace", "trace_file"), ("trace_file", "trace")):
        if name in update:
            update.setdefault(other, None)
    return impairment.model_copy(update=update)
