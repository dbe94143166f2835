"""With any fields of any message nothing raises, and every state stays within the flight envelope."""

import importlib
import math
import struct

from hypothesis import given, settings
from hypothesis import strategies as st

from airlink.endpoint import Address
from airlink.engine import Datagram
from formation_scenario.vehicles import VehicleModel
from sim_vehicles.autopilot.parameters import MAX_LISTS
from sim_vehicles.link import MAX_PEERS

dialect = importlib.import_module("pymavlink.dialects.v20.ardupilotmega")
FLOATS = st.one_of(
    st.floats(width=32),
    st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -1.0, 1.0, 2.0, 22.0, 3.4e38, -3.4e38, 1e-45, 90.0, 360.0]),
)
COMMANDS = (
    43000, 43001, 43002, 176, 400, 22, 20, 17, 16, 18, 19, 177, 224, 300, 178, 186, 192, 511, 510, 512, 410, 520,
)  # fmt: skip
PARAMETERS = ("AIRSPEED_MIN", "AIRSPEED_MAX", "AIRSPEED_CRUISE", "WP_LOITER_RAD", "TKOFF_ALT", "RTL_ALTITUDE", "NONE")
FAILSAFE = ("FS_GCS_ENABL", "FS_LONG_ACTN", "FS_LONG_TIMEOUT", "MAV_GCS_SYSID", "MAV_SYSID", "ARMING_CHECK")
VALUES = {
    "float": FLOATS,
    "uint8_t": st.integers(0, 2**8 - 1),
    "uint16_t": st.integers(0, 2**16 - 1),
    "uint32_t": st.integers(0, 2**32 - 1),
    "int16_t": st.integers(-(2**15), 2**15 - 1),
    "int32_t": st.integers(-(2**31), 2**31 - 1),
    "int64_t": st.integers(-(2**63), 2**63 - 1),
}
PLAUSIBLE = {
    "target_system": st.sampled_from([0, 1]),
    "command": st.sampled_from(COMMANDS),
    "frame": st.sampled_from([0, 3, 5, 6, 10, 11, 1, 255]),
    "custom_mode": st.integers(0, 17),
    "base_mode": st.sampled_from([1, 0, 255]),
    "param_id": st.sampled_from([name.encode() for name in PARAMETERS + FAILSAFE]),
    "name": st.just(b"MISSION_T"),
    "tc1": st.sampled_from([0, 1, -1]),
    "mission_type": st.sampled_from([0, 0, 0, 1, 255]),
    "seq": st.integers(0, 3),
    "count": st.integers(0, 4),
    "current": st.sampled_from([0, 0, 2, 3]),
}
MESSAGES = (
    "command_int", "command_int", "command_int", "command_long", "command_long", "set_mode", "request_data_stream",
    "timesync", "param_request_list", "param_request_read", "param_set", "param_set", "mission_request_list",
    "mission_count", "mission_clear_all", "heartbeat", "named_value_float", "mission_item_int", "mission_item_int",
    "mission_item", "mission_set_current", "mission_request_int", "mission_request", "mission_write_partial_list",
)  # fmt: skip


@st.composite
def messages(draw):
    kind = getattr(dialect, f"MAVLink_{draw(st.sampled_from(MESSAGES))}_message")
    types = dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))
    values = {
        name: draw(PLAUSIBLE.get(name, VALUES.get(types[name], st.integers(0, 255))))
        for name in kind.fieldnames
        if name != "opaque_id"
    }
    return kind, values


def envelope_holds(air):
    frame = VehicleModel()
    for body in air.fleet.bodies:
        state = body.state
        assert all(map(math.isfinite, state.values()))
        assert 0.0 <= state.airspeed_mps <= frame.speed_max_mps + 1e-9
        assert abs(state.climb_mps) <= frame.climb_max_mps + 1e-9
        assert abs(body.turn_rate_radps) <= frame.turn_rate_max_rps + 1e-9
        assert state.height_m >= 0.0


def telemetry_is_finite(air):
    for _, message in air.ground.received:
        values = [value for value in message.to_dict().values() if isinstance(value, float)]
        assert all(map(math.isfinite, values)), message


@given(data=st.data())
@settings(deadline=None, max_examples=60)
def test_no_message_makes_a_flying_fleet_fall_out_of_its_envelope(data, make_air_for_any_bytes):
    air = make_air_for_any_bytes()
    for _ in range(data.draw(st.integers(1, 12))):
        kind, values = data.draw(messages())
        air.ground.send(kind(**values))
        air.run(data.draw(st.sampled_from([0.02, 0.02, 0.1, 0.5])))
        envelope_holds(air)
    air.run(2.0)
    envelope_holds(air)
    telemetry_is_finite(air)
    assert air.ground.of("HEARTBEAT") or air.fleet.vehicles[0].pilot.condition.value == "crashed"


@given(
    payload=st.binary(max_size=60),
    message_id=st.sampled_from([11, 20, 21, 110, 23, 38, 39, 40, 41, 43, 44, 45, 51, 66, 73, 75, 76, 111, 251]),
)
@settings(deadline=None, max_examples=100)
def test_any_payload_of_a_known_message_is_survived(payload, message_id, make_air_for_any_bytes):
    air = make_air_for_any_bytes()
    body = struct.pack("<BBBBBBHB", len(payload), 0, 0, 0, 255, 190, message_id, 0) + payload
    crc = dialect.x25crc(body)
    crc.accumulate(struct.pack("B", dialect.mavlink_map[message_id].crc_extra))
    air.ground.send_bytes(b"\xfd" + body + struct.pack("<H", crc.crc))
    air.run(0.1)
    envelope_holds(air)


def test_a_crowd_of_strangers_neither_fills_the_memory_nor_disturbs_the_ground_stations_numbering(make_air):
    air = make_air()
    crowd = [air.peer(Address("10.0.0.1", 1024 + number)) for number in range(200)]
    for peer in crowd:
        peer.send(dialect.MAVLink_param_request_list_message(1, 1))
        peer.send_bytes(b"\xfd\x09")
        air.run(0.02)
    air.run(1.0)
    vehicle = air.fleet.vehicles[0]
    assert max(map(len, (vehicle.link._peers, vehicle.link._senders))) <= MAX_PEERS + 1
    assert len(vehicle.parameters._to_list) <= MAX_LISTS * len(vehicle.parameters.entries())
    numbers = [message.get_seq() for _, message in air.ground.received]
    assert numbers == [number % 256 for number in range(len(numbers))]


def test_a_ground_station_that_was_heard_outlasts_addresses_that_send_noise(make_air):
    air = make_air(endpoint="udpin:127.0.0.1:14551")
    air.ground.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    air.run(0.02)
    for number in range(100):
        air.fleet.receive([Datagram(0, Address("10.0.0.1", number), b"\xfd\x09\x00")], air.fleet.next_timer())
    air.ground.received.clear()
    air.run(2.0)
    assert air.ground.of("HEARTBEAT")
