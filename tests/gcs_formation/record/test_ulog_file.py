"""PX4's logs are read as its documentation ("ULog File Format") lays them out."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from gcs_formation.record.ulog_file import ULogFile, read_ulog_file

HEAD = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 77)
NUMBERS = {
    "int8_t": "<b", "uint8_t": "<B", "int16_t": "<h", "uint16_t": "<H", "int32_t": "<i", "uint32_t": "<I",
    "int64_t": "<q", "uint64_t": "<Q", "float": "<f", "double": "<d", "bool": "<?", "char": "<B",
}  # fmt: skip
"""Types of fields, and how the standard library packs them."""


def message(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body


def flags(incompatible: int = 0, *offsets: int, second: int = 0) -> bytes:
    """Return the message of flag bits, which comes first: 8 bytes each, then up to three offsets of appended data."""
    own = bytes(8) + bytes((incompatible, second)) + bytes(6)
    return message("B", own + struct.pack("<3Q", *[*offsets, 0, 0, 0][:3]))


def described(topic: str, fields: str) -> bytes:
    return message("F", f"{topic}:{fields}".encode())


def subscribed(topic: str, number: int, instance: int = 0) -> bytes:
    return message("A", struct.pack("<BH", instance, number) + topic.encode())


def row(number: int, at_us: int, rest: bytes = b"") -> bytes:
    return message("D", struct.pack("<HQ", number, at_us) + rest)


def parameter(kind: str, name: str, value: bytes) -> bytes:
    return message("P", bytes([len(kind) + 1 + len(name)]) + f"{kind} {name}".encode() + value)


def read(path: Path, *parts: bytes, head: bytes = HEAD) -> ULogFile:
    """Return what is read of a log of these messages, of the topics `air` and `wind`."""
    file = path / "log.ulg"
    file.write_bytes(head + b"".join(parts))
    return read_ulog_file(file, ("air", "wind"))


AIR = (described("air", "uint64_t timestamp;float x;"), subscribed("air", 3))
"""Definition and subscription of a topic with one field."""
X = struct.pack("<f", 0.5)


@pytest.mark.parametrize("kind", NUMBERS)
def test_fields_of_each_type_and_their_arrays_are_read_by_name(kind: str, tmp_path: Path) -> None:
    """Values are little-endian and packed; the time stamp is in microseconds."""
    fields = f"uint64_t timestamp;{kind} first;{kind}[2] pair;uint8_t last;"
    rows = [[1, 0, 1], [0, 1, 1]]
    packed = [b"".join(struct.pack(NUMBERS[kind], each) for each in values) + b"\x07" for values in rows]
    sent = [row(3, 2_500_000 * (1 + at), each) for at, each in enumerate(packed)]
    found = read(tmp_path, described("air", fields), subscribed("air", 3), *sent).topics["air"]
    expected = {
        "timestamp": [2_500_000, 5_000_000],
        "first": [1, 0],
        "pair[0]": [0, 1],
        "pair[1]": [1, 1],
        "last": [7, 7],
        "at_s": [2.5, 5.0],
    }
    assert {name: values.tolist() for name, values in found.items()} == expected
    assert all(values.dtype == np.float64 for values in found.values())


def test_rows_come_in_their_order_with_their_values(tmp_path: Path) -> None:
    x = np.array([0.1, -3e38, np.inf, 0.0, 1e-30], dtype=np.float32)
    sent = [row(3, 10 * at, struct.pack("<f", value)) for at, value in enumerate(x)]
    found = read(tmp_path, *AIR, *sent).topics["air"]
    np.testing.assert_array_equal(found["x"], x)
    np.testing.assert_allclose(found["at_s"], 1e-5 * np.arange(x.size))


def test_only_the_first_instance_of_a_wanted_topic_is_read_and_all_are_named(tmp_path: Path) -> None:
    """Numbers of messages are those that subscriptions give, not those of topics."""
    others = [subscribed("air", 4, instance=1), subscribed("else", 5), subscribed("wind", 300)]
    described_others = [described(name, "uint64_t timestamp;float x;") for name in ("else", "wind")]
    values = [row(number, number, struct.pack("<f", number)) for number in (5, 4, 3, 300, 9)]
    found = read(tmp_path, *described_others, *AIR, *others, *values)
    assert {name: table["x"].tolist() for name, table in found.topics.items()} == {"air": [3.0], "wind": [300.0]}
    assert found.names == {"air", "else", "wind"}


def test_parameters_are_integers_and_floats_and_later_values_replace_earlier_ones(tmp_path: Path) -> None:
    """One of another type, or without its four bytes, is passed over."""
    sent = [
        parameter("float", "GAIN", struct.pack("<f", 0.25)),
        parameter("int32_t", "SYSID", struct.pack("<i", -7)),
        parameter("float", "GAIN", struct.pack("<f", 0.75)),
        parameter("int8_t", "SHORT", b"\x01\x00\x00\x00"),
        parameter("float", "CUT", b"\x00\x00\x80"),
        message("P", b""),
    ]
    assert read(tmp_path, *sent).parameters == {"GAIN": 0.75, "SYSID": -7.0}


def test_padding_at_a_rows_end_is_not_logged(tmp_path: Path) -> None:
    """That between fields is."""
    fields = "uint64_t timestamp;uint8_t[2] _padding0;float x;uint8_t[4] _padding1;"
    found = read(tmp_path, described("air", fields), subscribed("air", 3), row(3, 1, b"\xff\xff" + X)).topics["air"]
    assert found["x"].tolist() == [0.5]
    assert "_padding1[0]" not in found


@pytest.mark.parametrize("fields", ["uint64_t timestamp;other_s nested;", "float x;", "", "uint64_t timestamp;float;"])
def test_of_a_topic_that_nests_another_or_has_no_time_nothing_is_read(fields: str, tmp_path: Path) -> None:
    found = read(tmp_path, described("air", fields), subscribed("air", 3), row(3, 1, X))
    assert (found.topics, found.names) == ({}, {"air"})


def test_rows_that_are_too_short_are_left_out(tmp_path: Path) -> None:
    found = read(tmp_path, *AIR, row(3, 1, X[:3]), row(3, 2, X), row(3, 3, X + b"more"))
    assert found.topics["air"]["timestamp"].tolist() == [2.0, 3.0]
    assert read(tmp_path, *AIR, row(3, 1, X[:3])).topics == {}


@pytest.mark.parametrize("lacking", range(1, 4 + 8 + 2 + 3 + 1))
def test_a_log_that_is_cut_in_its_last_message_has_those_before(lacking: int, tmp_path: Path) -> None:
    whole = b"".join((*AIR, row(3, 1, X), row(3, 2, X)))
    assert read(tmp_path, whole[: len(whole) - lacking]).topics["air"]["timestamp"].tolist() == [1.0]


def test_parts_that_were_appended_are_read_behind_a_cut(tmp_path: Path) -> None:
    """PX4 appends what it knew at a crash; where it begins is said by the offsets."""
    begun = b"".join(AIR) + row(3, 1, X) + row(3, 2, X)[:-2]
    size = len(HEAD) + len(flags())
    second, third = size + len(begun), size + len(begun) + len(row(3, 5, X)[:-1])
    parts = (begun, row(3, 5, X)[:-1], row(3, 6, X))
    ordered = read(tmp_path, flags(1, second, third), *parts)
    assert ordered.topics["air"]["timestamp"].tolist() == [1.0, 6.0], "each cut ends its own part alone"
    beyond = read(tmp_path, flags(1, third, second, 10**6), *parts)
    assert beyond.topics["air"]["timestamp"].tolist() == [1.0, 6.0], "also in another order, and beyond the end"


@pytest.mark.parametrize(("first", "second"), [(2, 0), (3, 0), (0, 1), (0x80, 0)])
def test_a_log_with_flags_that_are_not_known_is_refused(first: int, second: int, tmp_path: Path) -> None:
    """Of incompatible flags none but that of appended data may be ignored."""
    with pytest.raises(ValueError, match="a ULog file of a later format"):
        read(tmp_path, flags(first, second=second), *AIR)
    with pytest.raises(ValueError, match="a ULog file of a later format"):
        read(tmp_path, flags(first, second=second))
    assert read(tmp_path, flags(), *AIR, row(3, 1, X)).topics["air"]["x"].tolist() == [0.5]


@pytest.mark.parametrize("size", [0, 7, 15])
def test_what_has_no_whole_header_is_no_log(size: int, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no ULog file"):
        read(tmp_path, head=HEAD[:size])
    with pytest.raises(ValueError, match="no ULog file"):
        read(tmp_path, *AIR, head=b"x" + HEAD[1:])
    assert read(tmp_path) == ULogFile({}, {}, frozenset())
    assert read(tmp_path, flags()[:-1], head=HEAD).topics == {}


def test_messages_without_the_bytes_that_name_them_are_passed_over(tmp_path: Path) -> None:
    empty = [message("A", struct.pack("<BH", 0, 9)), message("D", struct.pack("<H", 3)), message("X", b"?")]
    found = read(tmp_path, *AIR, *empty, row(3, 1, X))
    assert (found.topics["air"]["x"].tolist(), found.names) == ([0.5], {"air"})
