"""Names of firmwares and their flight modes, by heartbeats and by numbers in logs."""

from __future__ import annotations

from typing import Final

from airlink import mavlink as m

PLANE, COPTER, OTHER = "ArduPlane", "ArduCopter", "an autopilot of another kind"
WINGS: Final = frozenset({m.MAV_TYPE_FIXED_WING, *range(m.MAV_TYPE_VTOL_DUOROTOR, m.MAV_TYPE_VTOL_DUOROTOR + 7)})
"""Types of vehicles that ArduPlane tells: fixed wings, and those that take off and land vertically."""
ROTORS: Final = frozenset(
    {
        m.MAV_TYPE_QUADROTOR, m.MAV_TYPE_COAXIAL, m.MAV_TYPE_HELICOPTER, m.MAV_TYPE_HEXAROTOR, m.MAV_TYPE_OCTOROTOR,
        m.MAV_TYPE_TRICOPTER, m.MAV_TYPE_DODECAROTOR, m.MAV_TYPE_DECAROTOR,
    }
)  # fmt: skip
ENUMS: Final = {PLANE: "PLANE_MODE", COPTER: "COPTER_MODE"}


def mode_name(autopilot: int, kind: int, custom_mode: int) -> tuple[str, str]:
    """Return the firmware and its mode's name, by a heartbeat's autopilot, type and custom mode."""
    if autopilot != m.MAV_AUTOPILOT_ARDUPILOTMEGA:
        firmware = m.name_of("MAV_AUTOPILOT", autopilot)
        return firmware, f"mode {custom_mode >> 16 & 0xFF}.{custom_mode >> 24}" if custom_mode > 0xFFFF else str(
            custom_mode
        )
    firmware = PLANE if kind in WINGS else COPTER if kind in ROTORS else OTHER
    return firmware, numbered(firmware, custom_mode)


def numbered(firmware: str, mode: int) -> str:
    """Return the name of an ArduPilot's mode by its number."""
    name = m.name_of(ENUMS[firmware], mode) if firmware in ENUMS else str(mode)
    return f"mode {name}" if name.isdecimal() else name
