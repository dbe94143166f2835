"""ArduPilot's simulator (SITL): what its vehicles have in common.

Sources: ArduPilot documentation, "SITL Simulator" and "Using SITL"; libraries/AP_HAL_SITL/SITL_cmdline.cpp (options and
ports), libraries/SITL/SIM_Aircraft.cpp (SIM2) and SITL.cpp (SIM).
"""

from __future__ import annotations

import math
import socket
from abc import abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar, Final

import numpy as np

from airlink import mavlink as m
from airlink.clock import MICROSECONDS, VIRTUAL_EPOCH_US
from airlink.endpoint import LOOPBACK
from flight_model.arrays import Array
from formation_scenario import Scenario, Vehicle
from gcs_formation.app.sitl.ardupilot_json import JsonExchange
from gcs_formation.app.sitl.simulator import Craft, Launch, Simulator, TrueMotion, newest

FIRST_INSTANCE: Final = 40
"""Away from simulators that are started by hand, from 0."""
RC_PORT, PORT_STEP = 5501, 10
CALIBRATED: Final = {
    f"INS_ACC{which}{what}_{axis}": value
    for which in ("", 2)
    for what, value in (("OFFS", 0.001), ("SCAL", 1.001))
    for axis in "XYZ"
}
"""The simulator's accelerometers count as calibrated only if their offsets aren't 0."""
DEFAULTS = "set.parm"
SIM_FIELDS: Final = ("Lat", "Lng", "Alt", "Yaw")
SIM2_FIELDS: Final = ("VN", "VE", "VD", "As")
NUMBERS_OF_ALL: Final = 2
"""Fewest samples between which a motion is known."""


class ArduPilotSimulator(Simulator):
    """A vehicle of ArduPilot's simulator, which sends to the port at which the station listens."""

    allowed_endpoints = "one udpin:HOST:PORT"
    step_s: ClassVar[float] = 0.0025
    """Of a clock that is stepped, s."""
    model: ClassVar[str]
    """As `--model` names it."""
    own: ClassVar[Mapping[str, float]]
    """Parameters without which the model doesn't arm, or doesn't fly."""

    def of_scenario(self, vehicle: Vehicle, scenario: Scenario) -> dict[str, float]:
        """Return the family's, and the wind: SIM_WIND_DIR is where it comes from."""
        north_mps, east_mps, _ = scenario.wind.velocity_mps
        found = {**self._of_scenario(vehicle, scenario), "MAV_GCS_SYSID": float(scenario.station.system)}
        if speed_mps := math.hypot(north_mps, east_mps):
            found["SIM_WIND_SPD"] = speed_mps
            found["SIM_WIND_DIR"] = math.degrees(math.atan2(-east_mps, -north_mps)) % 360.0
        return found

    @abstractmethod
    def _of_scenario(self, vehicle: Vehicle, scenario: Scenario) -> dict[str, float]: ...

    def exchange(self, craft: Craft, seed: int) -> JsonExchange:  # noqa: ARG002 - its noise is its own
        """Return its interface for simulators of motion."""
        return JsonExchange(craft.home, self.step_s)

    def cannot(self, vehicle: Vehicle, scenario: Scenario, program: Path, *, stepped: bool) -> list[str]:
        """Return what the scenario says and it can't do: it has no second link by which to be given a mission."""
        landing = ["landing (AUTOLAND is used)"] if vehicle.landing else []
        return [*super().cannot(vehicle, scenario, program, stepped=stepped), *landing]

    def reaches(self, craft: Craft) -> bool:
        """Return whether the station listens: the simulator then sends there."""
        return craft.station.kind == "udpin"

    def ports(self, craft: Craft) -> tuple[tuple[socket.SocketKind, int], ...]:
        """Return the port of its transmitter's input."""
        return ((socket.SOCK_DGRAM, RC_PORT + PORT_STEP * (FIRST_INSTANCE + craft.number)),)

    def launch(self, program: Path, craft: Craft) -> Launch:
        """Return the command; parameters that its version doesn't know are ignored."""
        to, home = craft.station.opposite().address, craft.home
        location = f"{home.lat_deg:.9f},{home.lon_deg:.9f},{home.alt_m:.3f},{home.heading_deg:.3f}"
        model = f"JSON:{LOOPBACK}" if craft.stepped else self.model
        command = [str(program), "--model", model, "--speedup", f"{craft.speedup:g}", "--home", location]
        command += [f"-I{FIRST_INSTANCE + craft.number}", "--sysid", str(craft.system), "--defaults", DEFAULTS]
        command += ["--serial0", f"udpclient:{to.host}:{to.port}", "--serial1", "none:0", "--serial2", "none:0"]
        if craft.stepped:  # the time of day is that of the virtual clock too, so that flights are repeatable
            command += ["--sim-port-out", str(craft.steps_port), "--start-time", str(VIRTUAL_EPOCH_US // MICROSECONDS)]
        lines = (f"{name} {value:.9g}\n" for name, value in {**self.own, **craft.parameters}.items())
        return Launch(command, files={DEFAULTS: "".join(lines)})

    def true_motion(self, directory: Path) -> TrueMotion | None:
        """Return SIM's positions and headings, with SIM2's velocities and airspeeds at the same times."""
        log = newest(directory, "*.BIN")
        if log is None:
            return None
        rows: dict[str, list[tuple[float, ...]]] = {"SIM": [], "SIM2": []}
        for kind, fields in m.dataflash_messages(str(log), tuple(rows)):
            wanted = SIM_FIELDS if kind == "SIM" else SIM2_FIELDS
            if all(name in fields for name in wanted):
                rows[kind].append((fields["TimeUS"] * 1e-6, *(float(fields[name]) for name in wanted)))
        if min(map(len, rows.values())) < NUMBERS_OF_ALL:
            return None
        return _motion(np.array(rows["SIM"]), np.array(rows["SIM2"]))


def _motion(positions: Array, moving: Array) -> TrueMotion:
    """Return the motion of SIM's rows (N, 5) and SIM2's (K, 5), each with its time first."""
    boot_s, lat_deg, lon_deg, alt_m, yaw_deg = positions.T
    north_mps, east_mps, down_mps, airspeed_mps = (
        np.interp(boot_s, moving[:, 0], moving[:, column]) for column in range(1, 5)
    )
    return TrueMotion.of(
        {
            "boot_s": boot_s,
            "lat_rad": np.radians(lat_deg),
            "lon_rad": np.radians(lon_deg),
            "alt_m": alt_m,
            "north_mps": north_mps,
            "east_mps": east_mps,
            "climb_mps": -down_mps,
            "heading_rad": np.radians(yaw_deg),
            "airspeed_mps": airspeed_mps,
        }
    )
