"""Conversion between tables of many vehicles, on which tests compute, and the station's lists of vehicles."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from librt.vecs import vec
from mypy_extensions import i64

from flight_model.arrays import Array
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.slot import Vector3
from flight_model.vehicle_arrays import AutopilotModels, FlightStates, Setpoints
from gcs_formation.control.law_interface import CycleInput, Law, LawOutput
from gcs_formation.estimation.setpoint_history import SetpointHistory

Instants = npt.NDArray[np.int64]
Made = TypeVar("Made")


def states(table: FlightStates) -> list[FlightState]:
    return [FlightState(*values) for values in table.table.T.tolist()]


def models(table: AutopilotModels) -> list[AutopilotModel]:
    return [AutopilotModel(*values) for values in table.table.T.tolist()]


def setpoints(table: Setpoints) -> list[Vector3]:
    return [(speed_mps, heading_rad, height_m) for speed_mps, heading_rad, height_m in table.table.T.tolist()]


def send(history: SetpointHistory, acts: Instants, table: Setpoints) -> None:
    """Add a tick's setpoints to a history."""
    history.begin_tick(vec[i64](acts.tolist()))
    history.record(setpoints(table))


def predict(
    history: SetpointHistory, state: FlightStates, since: Instants, until: Instants, model: AutopilotModels
) -> FlightStates:
    """Return the states of vehicles 0, 1, ... at `until`, from those at `since`."""
    moved = states(state)
    for vehicle, each in enumerate(zip(moved, since.tolist(), until.tolist(), models(model), strict=True)):
        one, begin, end, its = each
        history.carry(one, begin, end, vehicle, its)
    return FlightStates.from_each(moved)


def changed(made: Made, **values: Any) -> Made:
    """Return a plain object with some values changed, like `dataclasses.replace` for dataclasses."""
    names = inspect.signature(type(made)).parameters
    return type(made)(**{name: getattr(made, name) for name in names} | values)


@dataclass(frozen=True)
class Decision:
    """A law's decision, with a row for each vehicle."""

    indices: list[int]
    setpoints: Setpoints
    error_m: Array
    mixed: Array
    gains: Array

    @classmethod
    def of(cls, decided: list[LawOutput]) -> Decision:
        rows = [np.array([getattr(each, name) for each in decided]) for name in ("error_m", "mixed", "gains")]
        return cls([each.index for each in decided], Setpoints.from_each(each.setpoint for each in decided), *rows)


class TableLaw:
    """A law whose decisions are tables."""

    def __init__(self, law: Law) -> None:
        self._law = law

    def decide(self, cycle_input: CycleInput, dt_s: float) -> Decision:
        return Decision.of(self._law.decide(cycle_input, dt_s))
