"""The control cycle: all that the station does at a tick, in its order.

Read it from top to bottom: each stage's docstring says what it needs and why it stands where it does, and its `when`
in which cycles it runs. Stages of features come between these, each behind the stages that it names in `after`: which
of two features' stages comes first is said there, in their `stages.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from airlink.clock import Instant
from gcs_formation.core.commanding import (
    Assembled,
    Delays,
    Law,
    Leader,
    OwnFilters,
    OwnMonitors,
    SetpointsTaken,
    Tick,
    Wanted,
)
from gcs_formation.core.connecting import Begin, Commands, Links, Restarts, Start
from gcs_formation.core.cycle import Stage
from gcs_formation.core.each_second import Heartbeats, OwnParts, Strangers
from gcs_formation.core.estimating import Estimates, Members, Samples
from gcs_formation.core.parts import LogLink, Parts
from gcs_formation.core.recording import Events, LookOn, Record
from gcs_formation.core.sending import End, Phases, Setpoints, StandIns


def core_stages(
    parts: Parts, until_s: float | None, strangers: Callable[[Instant], None], log_link: LogLink
) -> list[Stage]:
    """Return the stages of every flight, in their order.

    Args:
        parts: what they work with.
        until_s: mission time at which to end early.
        strangers: watches those whose frames aren't taken.
        log_link: records the state of a vehicle's link.
    """
    cycle, dispatch, recorder = parts.cycle, parts.dispatch, parts.recorder
    return [
        # Once a second: what changes slowly, then the heartbeats.
        OwnParts(),
        Strangers(strangers),
        Heartbeats(parts.heartbeats, dispatch),
        # Who is there, and ready.
        Links(log_link, parts.several_links),
        Restarts(cycle),
        Start(parts.gate, parts.starting),
        Begin(parts.gate),
        Commands(),
        # What vehicles do, and who of them flies in the formation.
        Samples(),
        Estimates(),
        Members(),
        # Before the law: what is wanted, and by which delays.
        Wanted(parts.orders),
        Delays(dispatch),
        Tick(),
        Leader(),
        # The law.
        Law(),
        # Setpoint filters.
        OwnFilters(),
        # Monitors after them.
        SetpointsTaken(),
        OwnMonitors(),
        Assembled(),
        # What comes of it.
        Setpoints(dispatch),
        Record(recorder),
        Events(recorder),
        Phases(parts.heartbeats, math.inf if until_s is None else until_s),
        # Without a formation to command.
        LookOn(parts.orders, dispatch, recorder),
        # In all cycles.
        StandIns(dispatch),
        End(),
    ]


def ordered(core: list[Stage], brought: list[Stage]) -> list[Stage]:
    """Return the core's stages with those of features, each behind all stages that it names, as early as it can be.

    Names of stages that aren't there are passed over: a feature may be left out. Of several that could come next, the
    first by name does.

    Raises:
        ValueError: one is behind no stage of the core, or some wait for each other; a name is there twice.
    """
    names = [each.name for each in core]
    waiting = sorted(brought, key=lambda each: each.name)
    known = {*names, *(each.name for each in waiting)}
    if len(known) < len(names) + len(waiting):
        raise ValueError(f"found stages of one name among {', '.join([*names, *(each.name for each in waiting)])}")
    for each in waiting:
        if not set(each.after) & set(names):
            raise ValueError(f"found stage {each.name} after {', '.join(each.after)}; allowed: {', '.join(names)}")
    found = list[Stage]()
    for stage in core:
        found.append(stage)
        while follows := next((each for each in waiting if _may_follow(each, found, known)), None):
            found.append(follows)
            waiting.remove(follows)
    if waiting:
        raise ValueError(f"found stages that wait for each other: {', '.join(each.name for each in waiting)}")
    return found


def _may_follow(stage: Stage, found: list[Stage], known: set[str]) -> bool:
    """Return whether all that a stage names have been placed, but for those that aren't there."""
    return set(stage.after) & known <= {each.name for each in found}
