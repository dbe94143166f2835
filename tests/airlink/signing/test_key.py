"""Key files: who may read them, what they hold, and timestamps beside them."""

import json
import os
import stat

import pytest

from airlink.clock import Instant, after
from airlink.frame import FrameWriter
from airlink.messages.system import Heartbeat
from airlink.signing.authentication import A_MINUTE, EPOCH_US, Verdict
from airlink.signing.kept_timestamps import EVERY_S, KeptTimestamps
from airlink.signing.key import KeyFileError, key_of_passphrase, read_key, write_new_key
from airlink.signing.signature import signed

NOW_US = EPOCH_US + 10**9


@pytest.fixture
def key_file(tmp_path):
    def write(text, mode=0o600):
        file = tmp_path / "link.key"
        file.write_bytes(text if isinstance(text, bytes) else text.encode())
        file.chmod(mode)
        return file

    return write


def test_a_key_is_32_bytes_in_hex_or_a_passphrases_hash(key_file):
    octets = bytes(range(32))
    assert read_key(key_file(octets.hex())).octets == octets
    assert read_key(key_file(f"{octets.hex().upper()}\n")).octets == octets
    assert read_key(key_file("correct horse battery staple\n")) == key_of_passphrase("correct horse battery staple")
    assert read_key(key_file(octets.hex()[:-1])) == key_of_passphrase(octets.hex()[:-1])


def test_a_passphrase_is_hashed_as_mavproxy_does():
    """Its `signing setup` takes the SHA-256 of the text; the figure is what `printf swarm | sha256sum` prints."""
    expected = "44eb92b46360c22af3395633b6e3014a30afa97b02305b385c51d3feebceda9c"
    assert key_of_passphrase("swarm").octets.hex() == expected


@pytest.mark.parametrize(
    ("text", "mode", "found"),
    [
        ("secret", 0o640, "mode 0640, which others may use"),
        ("secret", 0o604, "mode 0604"),
        ("secret", 0o602, "mode 0602"),
        ("", 0o600, "with 0 lines"),
        ("one\ntwo\n", 0o600, "with 2 lines"),
        ("0" * 64, 0o600, "key of zeros"),
        (b"\xff\xfe", 0o600, "isn't text in UTF-8"),
        ("x" * 5000, 0o600, "longer than 4096 bytes"),
    ],
)
def test_what_is_no_key_file_is_refused_without_what_is_in_it(key_file, text, mode, found):
    with pytest.raises(KeyFileError, match=found) as refused:
        read_key(key_file(text, mode))
    assert "secret" not in str(refused.value)


def test_no_file_and_no_regular_one(tmp_path):
    with pytest.raises(KeyFileError, match="No such file"):
        read_key(tmp_path / "none")
    with pytest.raises(KeyFileError, match="Is a directory"):
        read_key(tmp_path)
    os.mkfifo(tmp_path / "pipe", 0o600)
    with pytest.raises(KeyFileError, match="isn't a file"):
        read_key(tmp_path / "pipe")


def test_a_new_key_is_for_its_owner_alone_and_replaces_none(tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    write_new_key(one)
    write_new_key(other)
    assert stat.S_IMODE(one.stat().st_mode) == 0o600
    assert read_key(one) != read_key(other)
    with pytest.raises(KeyFileError, match="File exists"):
        write_new_key(one)


def frame(stamp, key):
    return signed(FrameWriter(2, 1).encode(Heartbeat(6, 8)), key.octets, 0, stamp)


def test_after_a_restart_a_recording_of_the_minute_before_is_old(key_file):
    file = key_file("secret")
    key, kept, now = read_key(file), KeptTimestamps(file), (NOW_US - EPOCH_US) // 10
    before = kept.restored(key, NOW_US)
    assert before.verify(raw := frame(now, key), Instant(0)) is Verdict.AUTHENTIC
    kept.keep(before)
    after_restart = KeptTimestamps(file).restored(key, NOW_US)
    assert after_restart.verify(raw, Instant(0)) is Verdict.REPLAYED
    assert after_restart.timestamp == before.timestamp
    assert stat.S_IMODE(kept.path.stat().st_mode) == 0o600
    assert key.octets.hex() not in kept.path.read_text()


def test_what_two_programs_keep_is_the_newer(key_file):
    file = key_file("secret")
    key, now = read_key(file), (NOW_US - EPOCH_US) // 10
    one, other = (KeptTimestamps(file) for _ in range(2))
    first, second = one.restored(key, NOW_US), other.restored(key, NOW_US)
    assert first.verify(frame(now + A_MINUTE, key), Instant(0)) is Verdict.AUTHENTIC
    assert second.verify(frame(now, key), Instant(0)) is Verdict.AUTHENTIC
    one.keep(first)
    other.keep(second)
    assert KeptTimestamps(file).restored(key, NOW_US).streams == {(2, 1, 0): now + A_MINUTE}


def test_they_are_kept_every_ten_seconds(key_file):
    file = key_file("secret")
    kept, key = KeptTimestamps(file), read_key(file)
    state = kept.restored(key, NOW_US)
    kept.keep_in_time(state, Instant(0))
    state.timestamp = 77
    kept.keep_in_time(state, after(Instant(0), EVERY_S / 2))
    assert json.loads(kept.path.read_text())["timestamp"] == 0
    kept.keep_in_time(state, after(Instant(0), EVERY_S))
    assert json.loads(kept.path.read_text())["timestamp"] == 77


def test_a_place_where_nothing_can_be_kept_is_named(key_file):
    kept = KeptTimestamps(file := key_file("secret"))
    kept.path.mkdir()
    with pytest.raises(KeyFileError, match=r"cannot read .*link.key.timestamps, .* Is a directory"):
        kept.restored(read_key(file), NOW_US)


@pytest.mark.parametrize(
    "text", ["", "{}", "[]", '{"timestamp": -1, "streams": {}}', '{"timestamp": 1, "streams": {"1": 2}}']
)
def test_a_file_that_was_spoilt_is_named(key_file, text):
    kept = KeptTimestamps(file := key_file("secret"))
    kept.path.write_text(text)
    with pytest.raises(KeyFileError, match="without timestamps in it; allowed: as it was written, or no such file"):
        kept.restored(read_key(file), NOW_US)
