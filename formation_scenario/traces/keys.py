"""Keys of recorded delays."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from formation_scenario.fields import Keys, Number, Text, key

Unit = Literal["ns", "us", "ms", "s"]
Period = Annotated[Number, Field(ge=1e-4, le=86_400.0)]
Begin = Annotated[Number, Field(ge=0.0, le=1e6)]


class Trace(Keys):
    """Recorded delays that are added to delay_ms in place of jitter, played by time and repeated; gaps are losses."""

    file: Text = key(
        ..., "output of ping, a table with named columns, or numbers; relative to the scenario's file", "ping.csv"
    )
    column: Text | None = key(None, "of a table: the column of delays", "rtt_ms", derived="the only one with a unit")
    unit: Unit | None = key(None, "of the delays", "ns", derived="the end of the column's name; ms of numbers alone")
    kind: Literal["rtt", "one_way"] | None = key(
        None,
        "rtt: of both ways together, of which each gets half; one_way: of each",
        "rtt",
        derived="rtt of ping, and of a column with rtt in its name",
    )
    time: Text | None = key(None, "of a table: the column of when each was sent, in s unless its name says", "t_s")
    time_unit: Unit | None = key(None, "of that", "ms", derived="the end of its name, or s")
    period_s: Period | None = key(
        None, "time between two, where no column says, s", 0.2, derived="of ping its own; 1 of numbers alone"
    )
    between: Literal["interpolated", "drawn"] = key(
        "interpolated",
        "delays between two samples: interpolated, as in a queue; drawn from those around, as jitter is",
        "drawn",
    )
    begin_s: Begin = key(0.0, "how far into the record the run begins, s", 60.0)
