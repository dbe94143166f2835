"""Steps of setpoints of real autopilots, against the figures in the emulators' tests and docs/real-autopilots.md."""

from __future__ import annotations

import os

import pytest

from tests.processes import free_port
from tests.real import steps
from tests.real.simulators import ARDUCOPTER, ARDUPLANE

pytestmark = pytest.mark.slow
SPEEDUP = 2.0
COPTER_S = {
    "speed 0 to 5, on": (1.58, 2.34),
    "speed 0 to 5, back": (1.62, 2.29),
    "speed 5 to 6, on": (0.75, 1.62),
    "speed 5 to 6, back": (0.86, 2.0),
    "0.5 sideways, on": (0.61, 0.95),
    "0.5 sideways, back": (0.64, 1.05),
    "climb 0 to 1, on": (0.79, 1.04),
    "climb 0 to 1, back": (0.79, 1.03),
    "climb 0 to -1, on": (0.8, 1.04),
    "climb 0 to -1, back": (0.79, 1.04),
    "climb 0 to 0.3, on": (0.41, 0.6),
    "climb 0 to 0.3, back": (0.42, 0.61),
    "yaw by 90, on": (1.26, 1.65),
    "yaw by 90, back": (1.27, 1.66),
    "yaw by 20, on": (0.6, 0.79),
    "yaw by 20, back": (0.6, 0.78),
}
PLANE_S = {
    "speed 22 to 26, on": (4.24, 6.91),
    "speed 22 to 26, back": (6.38, 8.0),
    "height by 10, on": (4.24, 7.89),
    "height by 10, back": (4.23, 8.0),
    "height by 30, on": (6.86, 10.48),
    "height by 30, back": (6.77, 10.36),
    "heading by 20, on": (3.68, 7.45),
    "heading by 20, back": (3.66, 7.37),
    "heading by 90, on": (3.88, 7.47),
    "heading by 90, back": (3.87, 7.49),
}


@pytest.mark.parametrize(
    ("kind", "family", "measured_s"), [(ARDUCOPTER, steps.COPTER, COPTER_S), (ARDUPLANE, steps.PLANE, PLANE_S)]
)
def test_steps_take_as_long_as_was_measured(tmp_path, kind, family, measured_s):
    if not os.environ.get(kind.variable):
        pytest.skip(f"{kind.variable} isn't set to the path of a SITL binary")
    port = free_port()
    with kind.simulated(1, port, tmp_path / "vehicle", SPEEDUP):
        found = steps.times_s(port, family)
    for name, times_s in measured_s.items():
        assert found[name] == pytest.approx(times_s, rel=0.15), name
