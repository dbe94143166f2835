"""The main loop of an emulated autopilot: its rate, and the instant of what is never due."""

from __future__ import annotations

from airlink.clock import Instant

LOOP_HZ = 50
"""Rate of ArduPlane's main loop, on which it flies, reads and sends."""
LOOP_S = 1.0 / LOOP_HZ
NEVER = Instant(2**63)
"""Later than any instant of a run."""
