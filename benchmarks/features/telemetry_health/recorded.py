"""False alarms of the checks of telemetry in recorded flights, for example of real autopilots.

`python -m benchmarks.features.telemetry_health.recorded RUN...` takes directories of runs (`flight.tlog`,
`run.yaml`) and passes what each vehicle reported more than 10 m above its home, armed, through the same checks as in
flight. Nothing is commanded there, and stamps aren't compared with arrivals: simulators don't run at the pace of the
log's clock. It runs uncompiled: the checks get a stand-in for the vehicle, without its links.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final, NamedTuple

from airlink import mavlink as m
from airlink.clock import Instant
from airlink.messages import Message
from airlink.messages.telemetry import Attitude, GlobalPositionInt
from airlink.stream_parser import StreamParser
from flight_model.earth import GeodeticOrigin
from flight_model.slot import UNKNOWN
from formation_scenario import load_scenario
from formation_scenario.vehicles import VehicleModel
from gcs_formation.estimation.sample import Sample
from gcs_formation.features.telemetry_health.vehicle_health import Commanded, VehicleHealth
from gcs_formation.record.tlog import read_tlog
from gcs_formation.vehicle.reported_motion import ReportedMotion
from gcs_formation.vehicle.telemetry import Telemetry
from gcs_formation.vehicle.velocity_setpoint import ground_motion

ALOFT_M: Final = 10.0
GAP_S: Final = 3.0
"""A position so long after the one before isn't counted as flown between, s."""
AUTOPILOT: Final = m.MAV_COMP_ID_AUTOPILOT1
NOISE: Final[Any] = SimpleNamespace(noise=SimpleNamespace(by_quantity=(0.0,) * 6), state=None)
"""Noise isn't declared, and no filter runs: the checks know what the samples themselves show."""


class Replayed(NamedTuple):
    """One vehicle of a flight."""

    flown_s: float
    alarms: list[str]


class Reported:
    """What one vehicle reported, and its health."""

    def __init__(self, model: VehicleModel, origin: GeodeticOrigin, *, leads: bool) -> None:
        """Start with nothing reported."""
        self.seen, self.leads = Telemetry(origin, hovers=model.hovers), leads
        sampler = SimpleNamespace(airspeed_check=None)
        links = {"clock": SimpleNamespace(one_way_s=0.0), "jitter": SimpleNamespace(jitter_s=0.0)}
        vehicle: Any = SimpleNamespace(telemetry=self.seen, sampler=sampler, **links)
        self.health = VehicleHealth(vehicle, model.autopilot())
        self._before_s = math.nan
        self.found = Replayed(0.0, [])

    def take(self, message: Message) -> None:
        """Take a message that arrived."""
        self.seen.store(message)
        motion, attitude = self.seen.motion, self.seen.attitude
        if not isinstance(message, GlobalPositionInt) or motion is None or attitude is None or not self.seen.complete:
            return
        if motion.stamp_s == self._before_s or not self.seen.armed or motion.above_home_m < ALOFT_M:
            return
        elapsed_s, self._before_s = motion.stamp_s - self._before_s, motion.stamp_s
        if 0.0 < elapsed_s < GAP_S:
            self.found = self.found._replace(flown_s=self.found.flown_s + elapsed_s)
        self._examine(motion, attitude)

    def _examine(self, motion: ReportedMotion, attitude: Attitude) -> None:
        now = Instant(round(motion.stamp_s * 1e9))
        heading_rad = attitude.yaw_rad + attitude.yawspeed_radps * (motion.stamp_s - attitude.time_boot_s)
        speed_mps = self.seen.airspeed_mps
        velocity_mps = motion.north_mps, motion.east_mps
        if self.seen.hovers:
            speed_mps, heading_rad = ground_motion(heading_rad, *velocity_mps, leads=self.leads)
        position_m = motion.north_m, motion.east_m, motion.height_m
        sample = Sample(now, *position_m, *velocity_mps, motion.climb_mps, speed_mps, heading_rad)
        commanded = Commanded(math.nan, UNKNOWN, stops=False)
        self.health.examine(sample, NOISE, commanded, now, leads=self.leads)
        for quantity, healthy, text in self.health.changes(now):
            if not healthy:
                self.found.alarms.append(f"{motion.stamp_s:.1f} s: {quantity}: {text}")


def replay(run: Path) -> dict[int, Replayed]:
    """Return the vehicles of a run's flight, by system id."""
    scenario = load_scenario(run / "run.yaml")
    origin = scenario.origin.geodetic
    vehicles = {each.id: Reported(each.model, origin, leads=each.role == "leader") for each in scenario.vehicles}
    parser = StreamParser()
    for _, raw in read_tlog(run / "flight.tlog"):
        for frame in parser.feed(raw):
            reported, message = vehicles.get(frame.system), frame.message
            if reported is not None and frame.component == AUTOPILOT and message is not None:
                reported.take(message)
    return {number: each.found for number, each in vehicles.items() if each.found.flown_s > 0.0}


def main() -> None:
    """Replay, and print the alarms."""
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("runs", nargs="+", type=Path)
    total_s, alarmed, count = 0.0, 0, 0
    for run in options.parse_args().runs:
        for number, each in replay(run).items():
            total_s, alarmed, count = total_s + each.flown_s, alarmed + bool(each.alarms), count + 1
            print(f"{run.name}, vehicle {number}: {each.flown_s:.0f} s, {len(each.alarms)} alarms", flush=True)
            for text in each.alarms:
                print(f"    {text}", flush=True)
    print(f"{alarmed} of {count} vehicles had alarms, in {total_s / 3600.0:.2f} hours of their flight")


if __name__ == "__main__":
    main()
