"""What the commands' help ends with."""

from __future__ import annotations

EXAMPLES = """\b
Examples:
  sim-vehicles configs/quickstart.yaml        the vehicles of a scenario, at its endpoints
  sim-vehicles --count 4 --base-port 14551    vehicle i has system id i and sends to port 14550 + i
  sim-vehicles --count 20 --one-port          all of them to port 14550
  sim-vehicles sins configs/sins.yaml         inertial navigation: alignment, then flight
  sim-vehicles fly --help                     every option
"""
