"""Checksums of MAVLink frames, CRC-16/MCRF4XX: of one frame, or of many overlapping candidates.

Source: MAVLink guide, "Packet Serialization".
"""

from __future__ import annotations

from types import FunctionType
from typing import Final

from fastcrc.crc16 import mcrf4xx
from librt.strings import read_i64_le
from mypy_extensions import i64

WORD: Final = 8
BYTE: Final = 8
"""Bytes of a word, bits of a byte."""
CRC_BITS: Final = 16
CRC_START: Final = 0xFFFF
NO_EXTRA: Final = 2**56 - 1
"""Mask of a word without its last byte."""
ONE: Final = 0x8000
X_16: Final = 0x8408
"""Remainders of x^0, and of x^16 = x^12 + x^5 + 1."""
MAX_COVERED: Final = 9 + 255
"""Most bytes of a frame that its checksum covers: the longest header after the marker, and the longest payload."""


def checksum(data: bytes, end: i64, extra: i64) -> i64:
    """Return the checksum of a frame's bytes from the second to before `end`, and of its message's CRC_EXTRA."""
    if IS_COMPILED:
        return by_words(data, end, extra)
    crc: i64 = mcrf4xx(data[1:end])
    return with_byte(crc, extra)


def by_words(data: bytes, end: i64, extra: i64) -> i64:
    """Return the same, computed eight bytes at a time, which is the quickest where it is compiled.

    It is the remainder of the bits, as a polynomial, by P = x^16 + x^12 + x^5 + 1. The quotient is the product with
    1/P = x^-16 / (1 + a), a = x^-4 + x^-11 + x^-16, which modulo 2 is x^-16 (1 + a)(1 + a^2)(1 + a^4)(1 + a^8). In the
    words read here the highest power is in the lowest bit.
    """
    at: i64 = 1
    if end < WORD:  # so that there is a whole word before `end`
        data, at, end = bytes(WORD) + data, at + WORD, end + WORD
    crc: i64 = CRC_START
    while at + WORD <= end:
        crc = _remainder(read_i64_le(data, at) ^ crc)
        at += WORD
    rest = read_i64_le(data, end - WORD) >> BYTE & NO_EXTRA | extra << BYTE * (WORD - 1)
    gone = BYTE * (WORD - 1 - end + at)  # bits of the word from before `at`
    later: i64 = 0
    if at == end:
        later = crc >> BYTE  # only CRC_EXTRA is left: it combines with the first of the remainder's two bytes alone
    return _remainder((rest >> gone ^ crc) << gone) ^ later


def _remainder(word: i64) -> i64:
    """Return the remainder of a word divided by P."""
    word ^= word << 4 ^ word << 11 ^ word << 16
    word ^= word << 8 ^ word << 22 ^ word << 32
    word ^= word << 16 ^ word << 44
    word ^= word << 32
    crc = word >> 48 & 0xFFFF
    return crc ^ crc >> 5 ^ crc >> 12


IS_COMPILED: Final = not isinstance(_remainder, FunctionType)
"""A frame of 40 bytes takes `by_words` 0.1 µs compiled, where it takes the library 0.3; interpreted, 7 and 0.7."""


class Checksums:
    """Checksums of frame candidates in some bytes, in linear time: the bytes are processed three times at most.

    Frames don't overlap, but a candidate of up to 280 bytes may begin at every byte. Candidates are summed one by one
    until more bytes have been processed than there are. From then on, checksums follow from the remainders of all bytes
    up to each offset: that up to a candidate's end is the candidate's own plus that up to its begin, shifted by its
    length.
    """

    def __init__(self, data: bytes) -> None:
        """Take the bytes; nothing is computed yet."""
        self._data = data
        self._gone_over = 0
        self._up_to = [0]
        """Remainders of the first n bytes, by n; only that of none at first."""

    def of(self, raw: bytes, end: i64, extra: i64, offset: int) -> i64:
        """Return the checksum of `raw`, which begins at `offset` of all bytes, as `checksum` does."""
        if self._gone_over <= len(self._data):
            self._gone_over += end
            return checksum(raw, end, extra)
        if len(self._up_to) == 1:
            self._go_over_all()
        before: i64 = self._up_to[offset + 1]
        crc: i64 = self._up_to[offset + end]
        return with_byte(crc ^ _product(before ^ CRC_START, _SHIFTS[end - 1]), extra)

    def _go_over_all(self) -> None:
        crc: i64 = 0
        for byte in self._data:
            crc = with_byte(crc, byte)
            self._up_to.append(crc)


def with_byte(crc: i64, byte: i64) -> i64:
    """Return the remainder after one more byte. Source: MAVLink's `crc_accumulate`."""
    low = (crc ^ byte) & 0xFF
    low ^= low << 4 & 0xFF
    return crc >> BYTE ^ low << BYTE ^ low << 3 ^ low >> 4


def _product(one: i64, other: i64) -> i64:
    """Return the remainder of the product of two remainders; the lowest bit of each is its highest power."""
    product: i64 = 0
    for _ in range(CRC_BITS):
        product = product >> 1 ^ (product & 1) * X_16
        if one & 1:
            product ^= other
        one >>= 1
    return product


def _shifts() -> list[int]:
    """Return the factors of a remainder for n following bytes, by n: x^8n."""
    powers = [ONE]
    for _ in range(MAX_COVERED):
        powers.append(with_byte(powers[-1], 0))
    return powers


_SHIFTS: Final = _shifts()
