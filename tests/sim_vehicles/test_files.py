"""The parameters as a file over MAVLink FTP, read by a peer that follows MAVLink's specification."""

import struct

import pytest

TERMINATE, RESET, LIST, OPEN, READ, BURST, ACK, NAK = 1, 2, 3, 4, 5, 15, 128, 129
NO_SESSION, END_OF_FILE, UNKNOWN_COMMAND, NOT_FOUND = 4, 6, 7, 10
FORMS = {1: "<b", 2: "<h", 3: "<i", 4: "<f"}
SESSION = 248
HEADER = struct.Struct("<HBBBBBBI")


def ask(air, opcode, data=b"", size=None, offset=0, seq=7):
    """Send a request; return the answers as (opcode, request, complete, offset, data, sequence)."""
    before = len(air.ground.of("FILE_TRANSFER_PROTOCOL"))
    header = HEADER.pack(seq, SESSION, opcode, len(data) if size is None else size, 0, 0, 0, offset)
    payload = (header + data).ljust(251, b"\0")
    air.ground.send(air.ground.dialect.file_transfer_protocol_encode(0, 1, 1, list(payload)))
    air.run(0.1)
    answers = []
    for message in air.ground.of("FILE_TRANSFER_PROTOCOL")[before:]:
        assert message.target_system == 255
        number, session, answer, size, request, complete, _, at = HEADER.unpack(bytes(message.payload[:12]))
        assert session == SESSION
        answers.append((answer, request, complete, at, bytes(message.payload[12 : 12 + size]), number))
    return answers


def open_file(air, name=b"@PARAM/param.pck?withdefaults=1"):
    ((answer, request, _, _, data, number),) = ask(air, OPEN, name)
    assert (request, number) == (OPEN, 8)
    return answer, data


def unpacked(content):
    """Return the parameters in a param.pck: name -> (type, value)."""
    magic, count, total = struct.unpack_from("<HHH", content)
    assert (magic, count) == (0x671B, total)
    at, last, found = 6, b"", {}
    while at < len(content):
        kind, lengths = content[at], content[at + 1]
        common, own = lengths & 15, (lengths >> 4) + 1
        last = last[:common] + content[at + 2 : at + 2 + own]
        (value,) = struct.unpack_from(FORMS[kind], content, at + 2 + own)
        at += 2 + own + struct.calcsize(FORMS[kind])
        found[last.decode()] = kind, value
    assert len(found) == count
    return found


def test_a_burst_brings_all_parameters_as_the_list_does(flying):
    answer, data = open_file(flying)
    assert answer == ACK
    parts = ask(flying, BURST, size=80)
    content = b"".join(part[4] for part in parts)
    assert len(content) == struct.unpack("<I", data)[0]
    assert [part[3] for part in parts] == list(range(0, len(content), 80))
    assert [part[2] for part in parts] == [*[0] * (len(parts) - 1), 1]
    assert [part[5] for part in parts] == list(range(8, 8 + len(parts)))
    flying.ground.send(flying.ground.dialect.param_request_list_encode(1, 1))
    flying.run(1.0)
    types = {2: 1, 4: 2, 6: 3, 9: 4}
    listed = {each.param_id: (types[each.param_type], each.param_value) for each in flying.ground.of("PARAM_VALUE")}
    assert unpacked(content) == listed


def test_parts_are_read_singly_and_after_the_end_there_is_none(flying):
    length = struct.unpack("<I", open_file(flying)[1])[0]
    ((answer, _, _, at, data, _),) = ask(flying, READ, size=20, offset=length - 5)
    assert (answer, at, len(data)) == (ACK, length - 5, 5)
    for opcode in (READ, BURST):
        ((answer, _, _, _, data, _),) = ask(flying, opcode, size=20, offset=length)
        assert (answer, data) == (NAK, bytes([END_OF_FILE]))
    ((answer, *_),) = ask(flying, TERMINATE)
    assert answer == ACK
    ((answer, _, _, _, data, _),) = ask(flying, READ, size=20)
    assert (answer, data) == (NAK, bytes([NO_SESSION]))


@pytest.mark.parametrize("name", [b"", b"/etc/passwd", b"@SYS/threads.txt", b"\xff\xfe"])
def test_no_other_file_is_found(flying, name):
    assert open_file(flying, name) == (NAK, bytes([NOT_FOUND]))


def test_a_directory_that_is_not_there_is_not_listed(flying):
    ((answer, request, _, _, data, _),) = ask(flying, LIST, b"/")
    assert (answer, request, data) == (NAK, LIST, bytes([NOT_FOUND]))


@pytest.mark.parametrize("opcode", [6, 7, 14, 200, 255])
def test_other_requests_are_refused(flying, opcode):
    ((answer, request, _, _, data, _),) = ask(flying, opcode, b"/")
    assert (answer, request, data) == (NAK, opcode, bytes([UNKNOWN_COMMAND]))
