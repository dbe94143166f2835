"""Repair: the nearest scenario that flies.

`search.repair` proposes changes, one means after another in the order that `repair.order` sets, and judges each by the
same functions as `check`. It begins with the points of the path, which it moves as little as possible; what it may
change beside them are settings. A change stays only if it makes fewer or smaller violations.
"""

from formation_scenario.repair.draft import Change
from formation_scenario.repair.search import Repair, repair, repair_refused

__all__ = ["Change", "Repair", "repair", "repair_refused"]
