"""What the ground station calculates, for programs and notebooks: no scenario, no file, no flight is needed.

Equation (7) and the projection through setpoints in flight; gain design; delay margins of the laws' loops, with and
without prediction; the fuzzy scheduler; delays from time-stamped requests. All of it is what flights use, not a copy.
SI units and radians; north, east, and heights upwards; headings clockwise from north. `VehicleModel()` has the default
aircraft's time constants and limits, and takes others by name.
"""

from flight_model.flight_state import FlightState
from formation_scenario.vehicles import VehicleModel
from gcs_formation.control.fuzzy_pid import FuzzyGainScheduler, GainRange, PidGains
from gcs_formation.control.setpoint import Mixer
from gcs_formation.library.delay_estimation import Delays, delays
from gcs_formation.library.gains import LawGains, design_gains
from gcs_formation.library.margins import delay_margins, mismatch_margins
from gcs_formation.library.motion import Motion, fly, project
from gcs_formation.stability.consensus_loops import consensus_delay_margin
from gcs_formation.stability.mismatch import MismatchMargin
from gcs_formation.stability.pid_margins import loop_delay_s

__all__ = [
    "Delays",
    "FlightState",
    "FuzzyGainScheduler",
    "GainRange",
    "LawGains",
    "MismatchMargin",
    "Mixer",
    "Motion",
    "PidGains",
    "VehicleModel",
    "consensus_delay_margin",
    "delay_margins",
    "delays",
    "design_gains",
    "fly",
    "loop_delay_s",
    "mismatch_margins",
    "project",
]
