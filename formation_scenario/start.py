"""Keys of a flight's start."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from formation_scenario.fields import (
    Flag,
    Keys,
    NonNegative,
    Offset,
    Positive,
    Seconds,
    key,
)


class Start(Keys):
    """The start of the flight."""

    in_air: Flag = key(False, "emulators only: begin in flight, without take-off")
    offset_m: Offset = key(
        (0.0, 0.0, 0.0),
        "where each follower starts, after a take-off assembles, from its slot: forward, right, up; as far from "
        "others and the ground as `safety` asks, and inside its fence, m",
        [8, 6, 4],
    )
    row_m: Positive | None = key(
        None,
        "emulators only: on the ground they stand in a row, this far apart to the leader's right, "
        "in the scenario's order; by default at their slots, m",
        9,
    )
    run_in_s: Annotated[NonNegative, Field(le=3600.0)] = key(
        ...,
        "how long the leader flies straight to the path's start before t = 0, s",
        45,
        derived="10 in the air, 60 from the ground; with a fence at most, as far as all have room to turn away from it",
    )
    tolerance_m: Positive = key(3.0, "a follower this near its slot counts as assembled, m", 5)
    boot_timeout_s: Seconds = key(
        600.0,
        "longest wait for a vehicle that gets ready (position fix, estimator, heat), s; for one that makes no progress "
        "meanwhile it is 90 s",
        1200,
    )
    timeout_s: Seconds = key(
        300.0,
        "longest wait for take-off and assembly, s; after it the path begins when the leader next passes its start",
        900,
    )
