"""A vehicle's membership in the formation; how it changes is in `gcs_formation/fleet/membership_table.py`."""

from __future__ import annotations

from enum import Enum
from typing import Final


class Member(Enum):
    """A vehicle's membership in the formation."""

    STARTING = "starting"
    FLYING = "flying in formation"
    PARTED = "parted by its pilot"
    NO_LINK = "not heard: told nothing until it is"
    HOLDING = "told to loiter"
    RETURNING = "told to come back"
    HOMEWARD = "sent home"


CIRCLING: Final = (Member.HOLDING, Member.RETURNING)
"""Memberships in which a vehicle may be loitering as commanded."""
