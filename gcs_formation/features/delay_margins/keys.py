"""The key that says what is done when a loop's delay nears its margin."""

from __future__ import annotations

from typing import Final, Literal

from formation_scenario.brought_keys import BroughtKeys
from formation_scenario.fields import key


class DelayMarginKeys(BroughtKeys, group="law", after=("predictor", "lag_estimation")):
    """What is done near a margin."""

    on_delay: Literal["degrade", "hold", "warn"] = key(
        "warn",
        "when a loop's delay nears its margin: degrade (gains come down until it holds); hold (its vehicle loiters for "
        "up to 20 s, then as degrade); warn",
    )


KEYS: Final = (DelayMarginKeys,)
