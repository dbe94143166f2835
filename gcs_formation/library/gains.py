"""Gains of the PID laws (13)-(14): those of a design by loop shaping, or one's own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from flight_model.frequency_response import FREQUENCIES, Responses, airframe_responses, tau_responses
from flight_model.gain_design import DelayAndNoise, design
from formation_scenario.gains import SENSORS, WEIGHTS
from formation_scenario.vehicles import VehicleModel
from gcs_formation.control.fuzzy_pid import PidGains
from gcs_formation.control.setpoint import Mixer


@dataclass(frozen=True)
class LawGains:
    """The mixer and each channel's gains."""

    mixer: Mixer
    speed: PidGains
    heading: PidGains
    height: PidGains
    disturbance_observer_radps: float = 0.0
    """Bandwidth of the wind observer that goes with them."""
    anti_windup_s: float = 5.0

    def scenario_keys(self) -> dict[str, float]:
        """Return them as a scenario's keys, for `run(overrides=…)` or a study's `set`."""
        keys = {f"law.mixer.{name}": value for name, value in vars(self.mixer).items()}
        for channel in ("speed", "heading", "height"):
            gains: PidGains = getattr(self, channel)
            keys |= {f"law.{channel}.{name}": getattr(gains, name) for name in ("kp", "ki", "kd")}
        keys["law.derivative_filter_s"] = self.speed.filter_s
        keys["law.disturbance_observer_radps"] = self.disturbance_observer_radps
        return keys | {"law.anti_windup_s": self.anti_windup_s}


def design_gains(  # noqa: PLR0913 - what a design is for, by name
    model: VehicleModel,
    *,
    speed_mps: float = 22.0,
    delay_s: float = 0.0,
    law_rate_hz: float = 10.0,
    telemetry_rate_hz: float = 10.0,
    position_sigma_m: float = SENSORS[0],
    airspeed_sigma_mps: float = SENSORS[1],
    heading_sigma_rad: float = SENSORS[2],
    mixer: Mapping[str, float] = WEIGHTS,
) -> LawGains:
    """Return the fastest gains that keep the bounds of sensitivity, delay margin and noise: `law.gains: auto`.

    Source: S. Skogestad and I. Postlethwaite, "Multivariable Feedback Control", 2nd ed., 2.4 and 2.6.

    Args:
        model: the vehicle, with its airframe if it has one.
        speed_mps: along the path.
        delay_s: of the link, each way.
        law_rate_hz: of the control loop.
        telemetry_rate_hz: of the vehicle's state messages.
        position_sigma_m: standard deviation of the telemetry's noise, likewise of airspeed and heading.
        airspeed_sigma_mps: m/s.
        heading_sigma_rad: rad.
        mixer: k_v, k_x, k_psi, k_y and k_z of (13), which the design takes as given.

    Raises:
        ValueError: a delay below 0, or a rate or a speed that isn't positive.
    """
    for name, value in (
        ("speed_mps", speed_mps),
        ("law_rate_hz", law_rate_hz),
        ("telemetry_rate_hz", telemetry_rate_hz),
    ):
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{name}: found {value!r}; allowed: a number > 0")
    if not (math.isfinite(delay_s) and delay_s >= 0.0):
        raise ValueError(f"delay_s: found {delay_s!r}; allowed: a number >= 0")
    loop_s = 2.0 * delay_s + 0.5 / law_rate_hz + 0.5 / telemetry_rate_hz + model.dead_time_s
    noise = DelayAndNoise(1.0 / law_rate_hz, loop_s, position_sigma_m, airspeed_sigma_mps, heading_sigma_rad)
    found, (filter_s, observer_radps, anti_windup_s) = design([responses(model, speed_mps)], speed_mps, mixer, noise)
    speed, heading, height = (PidGains(each.kp, each.ki, each.kd, filter_s) for each in found.values())
    return LawGains(Mixer(**mixer), speed, heading, height, observer_radps, anti_windup_s)


def responses(model: VehicleModel, speed_mps: float) -> Responses:
    """Return a vehicle's frequency responses: of its airframe if it has one, else of equation (7)."""
    if model.airframe is None:
        return tau_responses(model.tau_v_s, model.tau_psi_s, (model.tau_ha_s, model.tau_hb_s))
    return airframe_responses(FREQUENCIES, model.airframe.parameters(), speed_mps)
