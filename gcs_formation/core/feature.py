"""Features: folders of `gcs_formation/features`, each with all that one thing needs, and found by being there.

No other module names one or imports it, and a feature imports no other: what they say to one another is in the cycle's
findings. So a folder can be deleted, and the station flies without what it brought; or one can be added, with nothing
else edited. Where a feature's stages stand in the control cycle follows from the stages that they name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, TypeVar

from flight_model.arrays import Array
from formation_scenario.feature_folders import PACKAGE, feature_names
from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.errors import RunAbortedError
from gcs_formation.mission.beginning import Beginning
from gcs_formation.mission.ending import Endings
from gcs_formation.mission.gate import BeforeTakeOff
from gcs_formation.mission.past_flight import PastFlight

NOT_RESUMED = "found no feature that resumes a flight; allowed: fly it from its start"
T = TypeVar("T")
Derived = Callable[[Array], Mapping[str, Array]]
"""Returns further columns of a time series, (T, V) for V vehicles at T times, s; flags are of type bool."""
Derives = Callable[[Sequence[Mapping[str, Any]], Sequence[str]], Derived]
"""Makes it of a run's events, and of the names of its V vehicles."""


@dataclass(frozen=True)
class Feature:
    """What a feature brings; its folder's name is its name.

    What only a report needs is beside it: `plate.py` with `PLATES`, as in `report/page.py`, and `captions.yaml`.
    """

    does: str
    """What it does, in a few words, for those who ask which features there are."""
    stages: Callable[[Cycle], Sequence[Stage]]
    """Makes its stages for a flight."""
    events: Mapping[str, str] = field(default_factory=dict)
    """The kinds of events that it records, and what each says."""
    figures: Mapping[str, str] = field(default_factory=dict)
    """The figures of summary.json that are null, or computed in another way, without it, and what each is."""
    before_take_off: BeforeTakeOff | None = None
    """Says what is wrong with a vehicle before the first command."""
    resumes: Callable[[Cycle, PastFlight], Beginning] | None = None
    """Makes the beginning of a flight that is resumed; of one feature at most."""
    ends: Callable[[Cycle], Endings] | None = None
    """Makes what begins the endings of a flight; of one feature at most."""
    columns: Derives | None = None
    """Derives further columns of the time series, when its file is written."""


def features() -> dict[str, Feature]:
    """Return the features that are there, by name: of each, the module `feature` has its `FEATURE`."""
    return {name: import_module(f"{PACKAGE}.{name}.feature").FEATURE for name in feature_names()}


def resumed_beginning(cycle: Cycle, past: PastFlight) -> Beginning:
    """Return how a past flight is resumed.

    Raises:
        RunAbortedError: no feature resumes flights, or two do.
    """
    resumes = only_one({name: each.resumes for name, each in features().items()}, "resumes flights")
    if resumes is None:
        raise RunAbortedError(NOT_RESUMED)
    return resumes(cycle, past)


def take_endings(cycle: Cycle) -> None:
    """Let a flight be ended by the feature that ends flights, if there is one.

    Raises:
        RunAbortedError: two features do.
    """
    ends = only_one({name: each.ends for name, each in features().items()}, "ends flights")
    if ends is not None:
        cycle.phase_machine.endings = ends(cycle)


def only_one(brought: Mapping[str, T | None], does: str) -> T | None:
    """Return what one feature brings, by name; None if none does.

    Raises:
        RunAbortedError: several do, none of which may silently take the others' place.
    """
    found = {name: each for name, each in brought.items() if each is not None}
    if len(found) > 1:
        raise RunAbortedError(f"found features {', '.join(found)}, each of which {does}; allowed: one of them")
    return next(iter(found.values()), None)


def derived(
    blocks: Iterator[dict[str, Array]], events: Sequence[Mapping[str, Any]], vehicles: Sequence[str]
) -> Iterator[dict[str, Array]]:
    """Yield a time series' blocks, each column (T, V), with those that features derive of a run's events."""
    each = [feature.columns(events, vehicles) for feature in features().values() if feature.columns]
    for block in blocks:
        time_s = block["t_s"][:, 0]
        yield block | {name: column for derive in each for name, column in derive(time_s).items()}
