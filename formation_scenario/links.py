"""Keys of the links: impairments of each direction, their changes in flight, and recorded delays."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Final, Literal, NamedTuple

from pydantic import AfterValidator, Field, WithJsonSchema
from pydantic_core import PydanticCustomError

from formation_scenario.bounded_read import read_bounded
from formation_scenario.fields import (
    MAX_NUMBER,
    OF_AN_EXTENSION,
    Allowed,
    FileError,
    Flag,
    Fraction,
    Keys,
    NonNegative,
    Number,
    OwnKeys,
    Text,
    Timed,
    Vector,
    Word,
    key,
)
from formation_scenario.signing import Signing

MOST_CHANGES: Final = 5000
"""Of links in a flight."""
MOST_MS = 600_000.0
ALLOWED = f"a file with a number of milliseconds from 0 to {MOST_MS:.0f} on each line, # before comments"
_NUMBER = re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")
LEAST_KBPS = 1e-3
"""One bit a second, at which the longest UDP datagram takes six days."""


def _passable(rate_kbps: float) -> float:
    if 0.0 < rate_kbps < LEAST_KBPS:
        raise PydanticCustomError("data_rate", "nothing would ever arrive")
    return rate_kbps


Distribution = Literal["normal", "uniform", "pareto"]
Burst = Annotated[Number, Field(ge=1.0, le=1e6)]
Milliseconds = Annotated[NonNegative, Field(le=MOST_MS)]
DataRate = Annotated[
    NonNegative,
    AfterValidator(_passable),
    WithJsonSchema({"anyOf": [{"const": 0.0}, {"type": "number", "minimum": LEAST_KBPS, "maximum": MAX_NUMBER}]}),
    Allowed(f"0, or a number >= {LEAST_KBPS:g}"),
]


MOST_TRACE_BYTES = 16_000_000


class RecordedDelays(NamedTuple):
    """The delays in a file, and their mean."""

    delays_ms: tuple[float, ...]
    mean_ms: float


def read_trace(path: Path) -> RecordedDelays:
    """Return the delays in a file, in its order; empty lines and text after # are ignored.

    Raises:
        FileError: the file can't be read, has no number, or a line that isn't a number from 0 to `MOST_MS`.
    """
    try:
        text = read_bounded(path, MOST_TRACE_BYTES).decode("utf-8")
    except OSError as error:
        raise FileError(f"found {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise FileError(f"found {path}, which isn't text in UTF-8") from error
    lines = ((number, line.partition("#")[0].strip()) for number, line in enumerate(text.splitlines(), start=1))
    delays_ms = tuple(_delay_ms(entry, f"{path}:{number}") for number, entry in lines if entry)
    if not delays_ms:
        raise FileError(f"found {path} without a number in it")
    return RecordedDelays(delays_ms, math.fsum(delays_ms) / len(delays_ms))


def _delay_ms(entry: str, place: str) -> float:
    if not _NUMBER.match(entry) or not 0.0 <= float(entry) <= MOST_MS:
        raise FileError(f"found '{entry[:40]}' at {place}")
    return float(entry)


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
        "file of recorded delays (ms, one a line) that are added to delay_ms in place of jitter, in their order, "
        "then from the beginning again; relative to the scenario's file",
        "lte.txt",
    )
    process: Word = key(
        None,
        "delay and loss process of an extension, which adds to the other keys; none: no longer one",
        "none",
    )
    parameters: OwnKeys = key(None, f"beside process: {OF_AN_EXTENSION}", {})

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
    process: Word = _patch("process")
    parameters: OwnKeys = _patch("parameters")


class DefaultLink(Impairment):
    """Both directions of every link, and the differences of each direction."""

    uplink: ImpairmentPatch | None = key(None, "differences of the way from the ground station to the vehicle")
    downlink: ImpairmentPatch | None = key(None, "differences of the way from the vehicle to the ground station")
    signing: Signing | None = key(None, "signed frames, at both ends; without it nothing proves who sent a frame")


class LinkChange(ImpairmentPatch, Timed):
    """A change of some vehicles' links: keys for both directions, then those for each direction."""

    uplink: ImpairmentPatch | None = key(None, "differences of the way from the ground station to the vehicle")
    downlink: ImpairmentPatch | None = key(None, "differences of the way from the vehicle to the ground station")


NO_PROCESS = "none"
"""The word for no delay and loss process."""


class Links(Keys):
    """The links between the ground station and every vehicle."""

    default: DefaultLink = DefaultLink()
    uplink: ImpairmentPatch | None = key(None, "the same as default.uplink, over which it takes precedence")
    downlink: ImpairmentPatch | None = key(None, "the same as default.downlink, over which it takes precedence")
    station_m: Vector | None = key(
        None,
        "where the ground station's antenna is, for processes of extensions: north and east of the origin, and height "
        "above it, m",
        [-200, 0, 3],
        derived="the origin",
    )
    changes: Annotated[tuple[LinkChange, ...], Field(max_length=MOST_CHANGES)] = key(
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


def least_mean_burst(loss: float) -> float:
    """Return the shortest mean burst possible with `loss` (0 to 1): a single arrival between any two bursts."""
    return max(1.0, loss / (1.0 - loss)) if loss < 1.0 else math.inf


def link_steps(links: Links, changes: Iterable[LinkChange]) -> tuple[LinkStep, ...]:
    """Return a link's states in time order: the default, then each of `changes` applied to the one before.

    Changes at the same time make one step; those at 0 s are part of the first.
    """
    default = links.default
    base = Impairment(**{key: getattr(default, key) for key in Impairment.model_fields})
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


def _patched(impairment: Impairment, *patches: ImpairmentPatch | None) -> Impairment:
    keys = Impairment.model_fields
    given = [{key: getattr(patch, key) for key in keys} for patch in patches if patch is not None]
    update = {key: value for values in given for key, value in values.items() if value is not None}
    return impairment.model_copy(update=update)
