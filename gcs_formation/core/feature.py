"""Features: folders of `gcs_formation/features`, each with all that one thing needs, and found by being there.

No other module names one or imports it, and a feature imports no other: what they say to one another is in the cycle's
findings. So a folder can be deleted, and the station flies without what it brought; or one can be added, with nothing
else edited. Where a feature's stages stand in the control cycle follows from the stages that they name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module

from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.core.present import PACKAGE, feature_names


@dataclass(frozen=True)
class Feature:
    """What a feature brings; its folder's name is its name."""

    does: str
    """What it does, in a few words, for whoever asks which features there are."""
    stages: Callable[[Cycle], Sequence[Stage]]
    """Makes its stages for a flight."""
    events: Mapping[str, str] = field(default_factory=dict)
    """The kinds of events that it records, and what each says."""
    figures: Mapping[str, str] = field(default_factory=dict)
    """The figures of summary.json that are null, or computed in another way, without it, and what each is."""


def features() -> dict[str, Feature]:
    """Return the features that are there, by name: of each, the module `feature` has its `FEATURE`."""
    return {name: import_module(f"{PACKAGE}.{name}.feature").FEATURE for name in feature_names()}
