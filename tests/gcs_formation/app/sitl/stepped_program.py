"""An emulated vehicle that takes ArduPilot's options, and whose clock is stepped as that of `--model JSON` is.

Run as `SCENARIO=FILE python stepped_program.py OPTIONS`; ENDS_AT_S: it crashes then. What it tells is the emulator's
flight; the body that it moves takes off and keeps its wings level.
"""

from __future__ import annotations

import json
import math
import os
import socket
import sys
from dataclasses import replace

from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import LOOPBACK, Address, parse_endpoint
from airlink.engine import Datagram
from formation_scenario import load_scenario
from gcs_formation.app.sitl.ardupilot_json import LAYOUTS, MAGIC, OUTPUTS
from sim_vehicles.config import fleet_config
from sim_vehicles.fleet import Fleet

FIRST = MAGIC.unpack(next(iter(LAYOUTS)))[0]
PITCH_RAD, THROTTLE_US = 0.1, 1600


def outputs_us(attitude: list[float], gyro_rps: list[float]) -> tuple[int, ...]:
    """Return pulses that keep the wings level and the nose a little up."""
    w, x, y, z = attitude
    bank_rad = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch_rad = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - x * z))))
    aileron = -0.8 * bank_rad - 0.2 * gyro_rps[0]
    elevator = PITCH_RAD - pitch_rad - 0.2 * gyro_rps[1]
    return (*(round(1500 + 500 * max(-1.0, min(1.0, each))) for each in (aileron, elevator)), THROTTLE_US, *[1500] * 13)


def main() -> None:
    given = dict(zip(sys.argv[1:], sys.argv[2:], strict=False))
    assert given["--model"] == f"JSON:{LOOPBACK}"
    _, host, port = given["--serial0"].split(":")
    whole = fleet_config(load_scenario(os.environ["SCENARIO"]))
    own = next(each for each in whole.vehicles if each.identity.system == int(given["--sysid"]))
    end = parse_endpoint(f"udpout:{host}:{port}")
    fleet = Fleet(replace(whole, vehicles=(replace(own, endpoint=end),)))
    station, ends_s = Address(host, int(port)), float(os.environ.get("ENDS_AT_S", "inf"))
    serial, steps = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    serial.bind((LOOPBACK, 0))
    serial.setblocking(False)
    frame, pulses = 0, outputs_us([1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    while True:
        steps.sendto(OUTPUTS.pack(FIRST, 1200, frame, *pulses), (LOOPBACK, int(given["--sim-port-out"])))
        sensed = json.loads(steps.recv(1000))
        pulses = outputs_us(sensed["quaternion"], sensed["imu"]["gyro"])
        now = Instant(round(sensed["timestamp"] * NANOSECONDS))
        frame += 1
        if now / NANOSECONDS >= ends_s:
            sys.exit("Segmentation fault")
        while True:
            try:
                fleet.receive([Datagram(0, station, serial.recv(1000))], now)
            except BlockingIOError:
                break
        fleet.handle_timer(now)
        for datagram in fleet.datagrams_to_send():
            serial.sendto(datagram.data, (host, int(port)))


if __name__ == "__main__":
    main()
