"""SETUP_SIGNING, as ArduPilot takes it: from any sender whose frames are taken, but only while it is disarmed."""

from __future__ import annotations

from typing import Final

from airlink.messages.system import SetupSigning
from airlink.signing.key import SigningKey
from sim_vehicles.autopilot.autopilot import INFO, Autopilot

ARMED: Final = "ERROR: Won't setup signing when armed"


def set_up_signing(vehicle: Autopilot, message: SetupSigning) -> None:
    """Sign from now on, with the key of a message; a key and a timestamp of zeros: sign no more.

    Source: ArduPilot, `GCS_MAVLINK::handle_setup_signing` and `load_signing_key`. Nothing acknowledges it.
    """
    if vehicle.pilot.condition.armed:
        vehicle.say(INFO, ARMED)
        return
    key = SigningKey(bytes(message.secret_key))
    none = not any(message.secret_key) and message.initial_timestamp == 0
    vehicle.link.set_key(None if none else key, message.initial_timestamp)
