"""PX4's simulator in its own process (SITL with SIH), fixed wing and multirotor.

Sources: PX4 user guide, "Simulation-In-Hardware (SIH)"; ROMFS/px4fmu_common/init.d-posix (rcS, px4-rc.mavlink: ports
and variables), src/modules/logger/logged_topics.cpp (ground truth), its pull requests 26467 and 27376 (wind, which its
simulator has had since 2026). Everybody faces north.
"""

from __future__ import annotations

import math
import socket
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from airlink.random_streams import random_stream
from formation_scenario import Scenario, Vehicle
from gcs_formation.app.sitl.missions import give_mission, mission_of
from gcs_formation.app.sitl.px4_hil import FIRST_PORT as HIL_PORT
from gcs_formation.app.sitl.px4_hil import IMU_HZ, HilExchange
from gcs_formation.app.sitl.simulator import Craft, Launch, Simulator, TrueMotion, endurance_s, newest
from gcs_formation.app.sitl.ulog_truth import WIND, read_truth
from sim_vehicles.airframe.rigid_body.fixed_wing import trim_of
from sim_vehicles.airframe.rigid_body.quadrotor import ARM_M

GCS_PORT, STATION_PORT = 18570, 14550
"""Instance n, which is system n + 1, sends from the first plus n to the second."""
FIRST_STEPPED: Final = 40
"""Instance from which stepped ones are numbered, away from simulators that are started by hand, from 0."""
COMPANION_PORT = 14580
"""Plus n: of its link to a companion computer."""
AIRFRAMES: Final = {False: ("10041", "sihsim_airplane"), True: ("10040", "sihsim_quadx")}
THRUST_N: Final = 10.0
"""With its default thrust of 6 N the simulator's aircraft hardly exceeds 14 m/s."""
TRIM_TO_SPARE_MPS: Final = 2.0
ESTIMATOR: Final = {"EKF2_ACC_NOISE": 1.0, "EKF2_GYR_NOISE": 0.1}
"""Of one whose sensors its own simulator makes: the most that they allow. Armed, its accelerometers have noise of 0.5,
1.7 and 1.4 m/s², its gyros of 0.14, 0.07 and 0.03 rad/s (Sih::reconstruct_sensors_signals); the defaults are for 0.35
and 0.015. With those, velocities are 0.3 m/s off for seconds, which turns a leader's course by 0.05 rad, and the slots
behind it by metres."""


def _rotor(number: int, forward_m: float, right_m: float, turning: float) -> dict[str, float]:
    name = f"CA_ROTOR{number}"
    return {f"{name}_PX": forward_m, f"{name}_PY": right_m, f"{name}_KM": turning}


FED: Final = {
    "SENS_EN_GPSSIM": 0,
    "SENS_EN_BAROSIM": 0,
    "SENS_EN_MAGSIM": 0,
    "SENS_EN_ARSPDSIM": 0,
    "IMU_INTEG_RATE": IMU_HZ,
}
"""Of one whose sensors measure our body's motion."""
STEPPED: Final[Mapping[bool, Mapping[str, float]]] = {
    False: FED
    | {
        "PWM_MAIN_FUNC1": 201,
        "PWM_MAIN_FUNC2": 202,
        "PWM_MAIN_FUNC3": 101,
        "PWM_MAIN_FUNC4": 203,
        "FW_YR_P": 0.05,
        "FW_YR_I": 0.1,
        "FW_YR_FF": 0.3,
    },
    True: FED
    | _rotor(0, 0.0, ARM_M, 0.05)
    | _rotor(1, 0.0, -ARM_M, 0.05)
    | _rotor(2, ARM_M, 0.0, -0.05)
    | _rotor(3, -ARM_M, 0.0, -0.05)
    | {"MC_ROLLRATE_P": 0.05, "MC_ROLLRATE_I": 0.1, "MC_ROLLRATE_D": 0.001}
    | {"MC_PITCHRATE_P": 0.05, "MC_PITCHRATE_I": 0.1, "MC_PITCHRATE_D": 0.001},
}
"""Outputs and gains that suit our bodies, by whether it hovers: in the order of ArduPilot's outputs. A fixed wing's
further ones follow from its trim."""
ROLL_P, ROLL_I, PITCH_P, PITCH_I = 0.4, 1.1, 1.5, 2.4
"""Gains of its rates, in units of the gain that holds a rate against its damping: of feedback, and for each second."""
MOST_CLIMB_MPS, MOST_SINK_MPS = 15.0, 5.0
"""That parameters allow."""


class Px4Simulator(Simulator):
    """`px4`, with its directory `etc` beside the one that it is in."""

    name = "px4"
    allowed_endpoints = f"one udpin:HOST:{STATION_PORT}, or udpout:127.0.0.1:PORT with PORT {GCS_PORT - 1} + id"

    def of_scenario(self, vehicle: Vehicle, scenario: Scenario) -> dict[str, float]:
        """Return its failsafe, its battery, the wind, and a fixed wing's speeds."""
        model = vehicle.model
        found: dict[str, float] = {"NAV_DLL_ACT": 2, "SIM_BAT_DRAIN": endurance_s(scenario)}
        if model.hovers and any(scenario.wind.velocity_mps):
            found |= dict(zip(WIND, (-each for each in scenario.wind.velocity_mps[:2]), strict=True))
        if not model.hovers:
            found |= {
                "SIH_T_MAX": THRUST_N,
                "SIH_F_T_MAX": THRUST_N,  # from version 1.18
                "FW_AIRSPD_TRIM": scenario.path.begin_mps,
                "FW_AIRSPD_MAX": math.ceil(model.speed_max_mps + TRIM_TO_SPARE_MPS),
                "FW_AIRSPD_MIN": math.floor(model.speed_min_mps),
            }
        return found

    def cannot(self, vehicle: Vehicle, scenario: Scenario, program: Path, *, stepped: bool) -> list[str]:
        """Return what it can't do: the air of earlier versions is still, and wind rolls fixed wings off the field."""
        found, wind = super().cannot(vehicle, scenario, program, stepped=stepped), scenario.wind.velocity_mps
        if any(wind) and not stepped and not (vehicle.model.hovers and WIND[0].encode() in program.read_bytes()):
            found.append(f"wind of {math.hypot(*wind):.3g} m/s")
        return found

    def found_wrong(self, program: Path) -> str:
        """Return that its start-up scripts aren't there, if so."""
        etc = _etc(program)
        return "" if etc.is_dir() else f"no directory {etc}, which PX4's build puts there"

    def reaches(self, craft: Craft) -> bool:
        """Return whether the endpoint is where it sends to, or its own port."""
        port = craft.station.address.port
        return port == (STATION_PORT if craft.station.kind == "udpin" else GCS_PORT - 1 + craft.system) and (
            craft.station.kind in {"udpin", "udpout"}
        )

    def ports(self, craft: Craft) -> tuple[tuple[socket.SocketKind, int], ...]:
        """Return the port of its link to ground stations, and that at which it asks for its sensors."""
        if not craft.stepped:
            return ((socket.SOCK_DGRAM, GCS_PORT + _instance(craft)),)
        return (socket.SOCK_DGRAM, GCS_PORT + _instance(craft)), (socket.SOCK_STREAM, HIL_PORT + _instance(craft))

    def exchange(self, craft: Craft, seed: int) -> HilExchange:
        """Return its interface for simulators of motion."""
        random = random_stream(seed, "HIL sensors", craft.system)
        return HilExchange(_instance(craft), craft.home, hovers=craft.hovers, random=random)

    def serial_port(self, craft: Craft) -> int:
        """Return the port of its link to ground stations, which it sends to another unless it is sent to first."""
        return GCS_PORT + _instance(craft)

    def launch(self, program: Path, craft: Craft) -> Launch:
        """Return the command, whose settings are environment variables."""
        airframe, model = AIRFRAMES[craft.hovers]
        home = craft.home
        suits = _stepped(craft) if craft.stepped else ESTIMATOR
        variables = {
            "PX4_SYS_AUTOSTART": airframe,
            "PX4_SIM_MODEL": model,
            **({"PX4_SIMULATOR": "mavlink", "PX4_PARAM_MAV_SYS_ID": f"{craft.system}"} if craft.stepped else {}),
            "PX4_SIM_SPEED_FACTOR": f"{craft.speedup:g}",
            "PX4_HOME_LAT": f"{home.lat_deg:.9f}",
            "PX4_HOME_LON": f"{home.lon_deg:.9f}",
            "PX4_HOME_ALT": f"{home.alt_m:.3f}",
            **{f"PX4_PARAM_{name}": f"{value:.9g}" for name, value in {**suits, **craft.parameters}.items()},
        }
        return Launch([str(program), "-i", str(_instance(craft)), "-d", str(_etc(program))], variables)

    def prepare(self, craft: Craft, clock_s: Callable[[], float]) -> None:
        """Give the vehicle the landing of its mission, by the link that its companion computer would have."""
        if craft.landing:
            give_mission(COMPANION_PORT + _instance(craft), mission_of(craft.system, craft.landing), clock_s)

    def true_motion(self, directory: Path) -> TrueMotion | None:
        """Return the topics of ground truth."""
        log = newest(directory, "*.ulg")
        columns = {} if log is None else read_truth(log)
        return TrueMotion.of(columns) if columns else None


def _stepped(craft: Craft) -> Mapping[str, float]:
    """Return the parameters that suit our body."""
    if craft.hovers:
        return STEPPED[True]
    trim = trim_of(craft.parameters["FW_AIRSPD_TRIM"])
    return {
        **STEPPED[False],
        "FW_THR_TRIM": trim.throttle,
        "FW_T_CLMB_MAX": min(trim.climb_mps, MOST_CLIMB_MPS),
        "FW_T_SINK_MIN": min(trim.sink_mps, MOST_SINK_MPS),
        "FW_RR_FF": 1.0 / trim.roll_rps,
        "FW_RR_P": ROLL_P / trim.roll_rps,
        "FW_RR_I": ROLL_I / trim.roll_rps,
        "FW_PR_FF": 1.0 / trim.pitch_rps,
        "FW_PR_P": PITCH_P / trim.pitch_rps,
        "FW_PR_I": PITCH_I / trim.pitch_rps,
    }


def _instance(craft: Craft) -> int:
    """Return the number by which it has its ports; its system - 1 where its station must find those."""
    return FIRST_STEPPED + craft.number if craft.stepped else craft.system - 1


def _etc(program: Path) -> Path:
    return program.parents[1] / "etc"


SIMULATOR: Final = Px4Simulator()
