"""The key of online time-constant estimation."""

from __future__ import annotations

from typing import Final

from formation_scenario.brought_keys import BroughtKeys
from formation_scenario.fields import Flag, key


class TimeConstantKeys(BroughtKeys, group="law", after=("predictor",)):
    """Whether the law's models are those that vehicles are seen to follow."""

    lag_estimation: Flag = key(
        True, "estimate each vehicle's time constants in flight, from half to twice those of its model"
    )


KEYS: Final = (TimeConstantKeys,)
