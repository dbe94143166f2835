"""What a radio is: its rates, how its ends share the air, its buffers, and what the air does to datagrams.

Sources of the defaults: SiK's firmware (github.com/ArduPilot/SiK, `Firmware/radio/serial.c`: RX_BUFF_MAX;
`parameters.c`: MAX_WINDOW).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, Literal

from airlink.endpoint import ComponentId
from airlink.impairment import UNIMPAIRED, Impairment

Arbitration = Literal["tdm", "first_come"]

RADIO: Final = ComponentId(51, 68)
"""MAVLink ids of a radio itself: '3' and 'D', as SiK and mLRS have them."""
BUFFER_BYTES: Final = 1850
"""Of a SiK radio, for what comes from its serial port."""
WINDOW_S: Final = 0.131
"""Longest turn of a SiK radio."""
RSSI: Final = 130
"""Signal strength that is reported, in SiK's unit: (rssi / 1.9 - 127) dBm, so -59 dBm."""
NOISE: Final = 40
"""-106 dBm."""


@dataclass(frozen=True)
class RadioSettings:
    """A radio, by which a ground station reaches some vehicles: one end on the ground, and one in each vehicle."""

    uplink_bps: float
    """Bits of datagrams a second while the ground end sends."""
    downlink_bps: float
    """The same of each vehicle's end; in full duplex they share it."""
    half_duplex: bool = True
    """Whether one end sends at a time; if not, the ground end and one of the vehicles' ends do."""
    turnaround_s: float = 0.0
    """Half duplex: least silence between what is sent in one direction and in the other."""
    buffer_bytes: int = BUFFER_BYTES
    """Bytes that wait at each end before they are sent; a datagram that doesn't fit is dropped whole."""
    arbitration: Arbitration = "tdm"
    """Who sends next: the ends in turns, each for up to `window_s`, or the end whose datagram came first."""
    window_s: float = WINDOW_S
    air: Impairment = field(default=UNIMPAIRED)
    """Further delay, jitter and loss of what was sent; of both directions alike."""
    reports: bool = True
    """Whether both ends send RADIO_STATUS to what is connected to them."""

    def airtime_s(self, size_bytes: int, *, up: bool) -> float:
        """Return how long it takes to send a datagram, s."""
        return 8.0 * size_bytes / (self.uplink_bps if up else self.downlink_bps)
