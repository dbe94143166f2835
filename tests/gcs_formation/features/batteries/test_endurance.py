"""How long a battery lasts, by what is known."""

import math

import pytest

from airlink.clock import Instant, after
from airlink.messages.telemetry import BatteryStatus, SysStatus
from gcs_formation.features.batteries.endurance import Endurance, planned_full_s
from gcs_formation.vehicle.reported_battery import ReportedBattery

FULL_S = 1200.0


def reported(percent: int, volts: float = 12.0, lasts_s: int = 0, consumed_mah: int = -1) -> ReportedBattery:
    battery = ReportedBattery()
    battery.take(SysStatus(0, 0, 0, 0, volts, -0.01, percent))
    battery.take(BatteryStatus(0, 0, 0, 0, (volts,), -0.01, consumed_mah, -1, percent, lasts_s))
    return battery


def drained(endurance: Endurance, from_share: float, seconds: int, full_s: float = FULL_S, flies: bool = True) -> None:
    """Report whole percents, rounded down, once a second."""
    for second in range(seconds + 1):
        percent = math.floor(100.0 * (from_share - second / full_s))
        endurance.observe(reported(percent), after(Instant(0), float(second)), flies=flies)


def test_use_is_measured_between_changes_of_the_percentage() -> None:
    endurance = Endurance(None)
    drained(endurance, 0.995, 59)
    assert math.isnan(endurance.full_s(reported(90)))  # less than 5 % has been used between changes
    endurance = Endurance(None)
    drained(endurance, 0.995, 300)
    assert endurance.full_s(reported(70)) == pytest.approx(FULL_S, rel=0.01)


def test_what_is_measured_comes_before_what_is_stated_and_that_before_the_autopilots_estimate() -> None:
    endurance = Endurance(900.0)
    assert endurance.full_s(reported(80, lasts_s=400)) == 900.0
    drained(endurance, 0.9, 300)
    assert endurance.full_s(reported(60, lasts_s=400)) == pytest.approx(FULL_S, rel=0.01)
    assert planned_full_s(reported(80, lasts_s=400), math.nan) == pytest.approx(500.0)
    assert math.isnan(planned_full_s(reported(80), math.nan))


def test_on_the_ground_and_with_another_battery_the_measurement_begins_again() -> None:
    endurance = Endurance(None)
    drained(endurance, 0.9, 300, flies=False)
    assert math.isnan(endurance.measured_s)
    drained(endurance, 0.9, 300)
    endurance.observe(reported(95), Instant(0), flies=True)
    assert math.isnan(endurance.measured_s)


@pytest.mark.parametrize("unknown", [reported(-1), reported(0, volts=0.0), reported(120)])
def test_what_is_not_told_is_unknown(unknown: ReportedBattery) -> None:
    """An autopilot without a battery monitor reports -1, or 0 % with 0 V."""
    assert math.isnan(unknown.left)
    assert math.isnan(unknown.current_a)
    assert math.isnan(unknown.consumed_mah)


def test_values_told_are_taken_of_the_first_battery() -> None:
    battery = reported(42, consumed_mah=1300)
    battery.take(BatteryStatus(1, 0, 0, 0, (9.0,), 3.0, 10, -1, 3))
    assert (battery.left, battery.voltage_v, battery.consumed_mah) == (pytest.approx(0.42), 12.0, 1300.0)
