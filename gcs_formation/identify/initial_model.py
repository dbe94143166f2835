"""The model with which the search begins: its limits are kept, and its time constants where nothing is estimated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from flight_model.arrays import Array
from formation_scenario import Scenario
from formation_scenario.vehicle_files import shipped_models
from formation_scenario.vehicles import VehicleModel
from gcs_formation.identify.recording import STEP_S, Recording

SLOWEST_MPS: Final = 1.0
"""No fixed wing's lowest airspeed is below this."""
RATE_S: Final = 0.3
"""Changes within this time tell how fast a quantity changes: shorter ones tell noise."""
BEYOND: Final = 1.6
"""The largest rate relative to its mean over `RATE_S`, of a time constant of 0.3 s. A limit isn't the vehicle's if it
is below this times what was flown, and then counts as that."""
NOT_EXTREME: Final = 99.8
"""Percentile of the rates that counts as the largest, since noise has larger ones."""


def begin_with(accepted: Scenario | None, recordings: Sequence[Recording]) -> VehicleModel:
    """Return the scenario's model of the first vehicle recorded; without one, a shipped one for what the log is of.

    A shipped model's limits aren't this vehicle's. They are widened to what was commanded and flown.
    """
    if accepted is not None:
        system = recordings[0].system
        return next((each.model for each in accepted.vehicles if each.id == system), accepted.vehicles[0].model)
    aircraft = recordings[0].track.aircraft
    model = VehicleModel.model_validate({} if aircraft is None else shipped_models()[aircraft])
    if not model.hovers and aircraft is not None:
        model = model.model_copy(update={"airframe": None})
    return model if aircraft is None else _widened(model, recordings)


def _widened(model: VehicleModel, recordings: Sequence[Recording]) -> VehicleModel:
    limits = {name: getattr(model, name) for name in ("speed_min_mps", "speed_max_mps", "climb_max_mps")}
    for each in recordings:
        if "speed" in each.channels:
            speeds = np.concatenate((each.commanded[0], each.seen[0]))
            limits["speed_min_mps"] = min(limits["speed_min_mps"], max(float(speeds.min()), SLOWEST_MPS))
            limits["speed_max_mps"] = max(limits["speed_max_mps"], float(speeds.max()))
        if "height" in each.channels:
            limits["climb_max_mps"] = max(
                limits["climb_max_mps"], float(np.percentile(np.abs(each.seen[3]), NOT_EXTREME))
            )
    limits["turn_rate_max_rps"] = _faster(model.turn_rate_max_rps, [each.seen[1] for each in recordings])
    limits["accel_max_mps2"] = _faster(model.accel_max_mps2, [each.seen[0] for each in recordings])
    return model.model_copy(update={name: round(value, 3) for name, value in limits.items()})


def _faster(limit: float, flown: Sequence[Array]) -> float:
    """Return a limit of a quantity's rate, or a larger one if these (K,) show that the vehicle's is."""
    points = round(RATE_S / STEP_S)
    changes = np.concatenate([np.abs(each[points:] - each[:-points]) for each in flown])
    return max(limit, BEYOND * float(np.percentile(changes, NOT_EXTREME)) / RATE_S)
