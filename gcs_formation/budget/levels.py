"""What is given up over a full link, in this order: docs/links.md has the table."""

from __future__ import annotations

from typing import Final, NamedTuple


class Level(NamedTuple):
    """How sparing the station is of one vehicle's link."""

    words: str
    """What has changed from the level before."""
    unread_hz: float
    """Rate of messages that no one here reads, 0: none."""
    telemetry_share: float
    """Share of the rate of positions, attitudes and airspeeds, down to `MIN_HZ`."""
    setpoint_s: float
    """Shortest time between two setpoints of a quantity; those that stop a failsafe come as often as that needs."""
    probe_s: float
    """Shortest time between two TIMESYNC requests."""


MIN_HZ: Final = 2.0
UNREAD_HZ: Final = 0.1
"""Rate of messages that no one here reads: still enough for the log."""
LEVELS: Final = (
    Level("everything is sent as often as it is of use", UNREAD_HZ, 1.0, 0.0, 0.0),
    Level(
        "telemetry comes half as often, and nothing that no one reads; setpoints go 5 times a second at most",
        0.0,
        0.5,
        0.2,
        0.5,
    ),
    Level("telemetry comes a quarter as often", 0.0, 0.25, 0.2, 0.5),
    Level("telemetry comes twice a second, setpoints go 3 times at most", 0.0, 0.0, 0.3, 1.0),
    Level("setpoints go twice a second at most", 0.0, 0.0, 0.5, 1.0),
    Level("setpoints go once a second", 0.0, 0.0, 1.0, 1.0),
)
