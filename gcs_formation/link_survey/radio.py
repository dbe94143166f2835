"""What a telemetry radio says of its link in RADIO_STATUS (MAVLink common, 109)."""

from __future__ import annotations

from statistics import median
from typing import Any, Final

from airlink.frame import HEADER_V1, HEADER_V2, Frame

LENGTH: Final = 9
"""Of its payload: rxerrors and fixed of 16 bits; rssi, remrssi, txbuf, noise and remnoise of 8."""
OFFSETS: Final = {"rssi": 4, "remote_rssi": 5, "txbuf_percent": 6, "noise": 7, "remote_noise": 8}


class RadioReports:
    """The reports of the radio at one endpoint."""

    def __init__(self) -> None:
        """Start without any."""
        self._values = {name: list[int]() for name in OFFSETS}
        self._errors, self._fixed = list[int](), list[int]()

    def receive(self, frame: Frame) -> None:
        """Take a report; bytes that are cut off at the end are 0."""
        begin = HEADER_V2 if frame.version == 2 else HEADER_V1
        payload = frame.raw[begin : begin + frame.raw[1]][:LENGTH].ljust(LENGTH, b"\0")
        self._errors.append(int.from_bytes(payload[0:2], "little"))
        self._fixed.append(int.from_bytes(payload[2:4], "little"))
        for name, offset in OFFSETS.items():
            self._values[name].append(payload[offset])

    def figures(self) -> dict[str, Any] | None:
        """Return the median and the worst of each, and how many packets couldn't be received or were corrected."""
        if not self._errors:
            return None
        worst = {name: max if "noise" in name else min for name in OFFSETS}
        found: dict[str, Any] = {
            name: {"p50": median(values), "worst": worst[name](values)} for name, values in self._values.items()
        }
        return found | {
            "reports": len(self._errors),
            "errors": (self._errors[-1] - self._errors[0]) % 2**16,
            "corrected": (self._fixed[-1] - self._fixed[0]) % 2**16,
        }
