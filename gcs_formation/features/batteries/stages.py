# Compiled by mypyc: it runs every tick.

"""The stage that sends vehicles home whose batteries last for the way home alone."""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from flight_model.flight_state import FlightState
from gcs_formation.core.cycle import EACH_SECOND, Cycle, Stage
from gcs_formation.features.batteries.endurance import Endurance
from gcs_formation.features.batteries.keys import BatteryKeys
from gcs_formation.features.batteries.way_home import way_home_s
from gcs_formation.phases import COMMANDED
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle

SURE_S: Final = 4.0
"""How long too little must be left before that counts: a single report may be wrong."""


class BatteryWatch(Stage):
    """Judges the batteries by the way home of each vehicle. Before it is decided who flies in the formation."""

    name = "batteries"
    when = EACH_SECOND
    after = ("strangers",)

    def __init__(self, cycle: Cycle) -> None:
        """Start with nothing measured."""
        scenario = cycle.scenario
        self._keys = BatteryKeys.of(scenario).battery
        self._speed_mps = max(scenario.path.begin_mps, 1.0)
        self._endurance = {each.identity: Endurance(self._keys.endurance_s) for each in cycle.each}
        self._since = dict[VehicleId, Instant]()
        """Since when each has had too little."""
        self._reported = set[VehicleId]()

    def run(self, cycle: Cycle) -> None:
        """Judge each vehicle that flies, until it has been sent home."""
        tick, commands = cycle.last_tick, cycle.flight.phase in COMMANDED
        for vehicle in cycle.each:
            battery = vehicle.telemetry.battery
            climbed = vehicle.airborne and vehicle.member is not Member.STARTING
            self._endurance[vehicle.identity].observe(battery, cycle.now, flies=climbed)
            if tick is None or not commands or vehicle.sent_home or not vehicle.airborne or math.isnan(battery.left):
                continue
            text = self._too_little(vehicle, tick.state[vehicle.index])
            if not text:
                self._since.pop(vehicle.identity, None)
            elif seconds_between(self._since.setdefault(vehicle.identity, cycle.now), cycle.now) >= SURE_S:
                self._send_home(cycle, vehicle, text)

    def _too_little(self, vehicle: Vehicle, state: FlightState) -> str:
        """Return in words that what is left lasts for the way home and the reserve alone; empty if it lasts longer.

        Of a vehicle whose use, position or home isn't known the reserve alone counts.
        """
        battery, reserve = vehicle.telemetry.battery, self._keys.reserve
        full_s = self._endurance[vehicle.identity].full_s(battery)
        home_m, hovers = vehicle.telemetry.home_m, vehicle.autopilot.hovers
        home_s = math.nan if home_m is None else way_home_s(state, home_m, self._speed_mps, hovers=hovers)
        needed = reserve if math.isnan(home_s / full_s) else reserve + home_s / full_s
        if battery.left > needed:
            return ""
        left = f"{battery.left:.0%} of its battery is left"
        if needed == reserve:
            return f"{left}; safety.battery.reserve is {reserve:.0%}"
        if math.isinf(home_s):
            return f"{left}, and the wind is too strong for the way home"
        return f"{left}, of which the way home needs {needed - reserve:.0%}; safety.battery.reserve is {reserve:.0%}"

    def _send_home(self, cycle: Cycle, vehicle: Vehicle, text: str) -> None:
        """Send it home, or only say so, once."""
        if self._keys.in_flight == "home":
            vehicle.sent_home = text
            self._since.pop(vehicle.identity, None)
        if vehicle.identity not in self._reported:
            self._reported.add(vehicle.identity)
            cycle.log_event(cycle.now, "battery", text, vehicle, {"left": vehicle.telemetry.battery.left})
