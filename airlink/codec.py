"""Typed messages to and from MAVLink payloads. Units change here and nowhere else.

How a field is scaled follows from the unit that the dialect declares for it, so a message needs no code
of its own. Source: MAVLink guide, "Serialization".
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from operator import itemgetter
from typing import Any, Final, TypeVar, cast, get_args

from airlink.mavlink import Layout, layout
from airlink.messages import Message

SI_SUFFIX_AND_SCALE: dict[str, tuple[str, float]] = {
    "ms": ("s", 1e-3),
    "m": ("m", 1.0),
    "mm": ("m", 1e-3),
    "m/s": ("mps", 1.0),
    "cm/s": ("mps", 1e-2),
    "m/s/s": ("mps2", 1.0),
    "rad": ("rad", 1.0),
    "rad/s": ("radps", 1.0),
    "deg": ("rad", math.pi / 180),
    "cdeg": ("rad", math.pi / 180e2),
    "degE7": ("rad", math.pi / 180e7),
    "mV": ("v", 1e-3),
    "cA": ("a", 1e-2),
}
"""Declared unit -> the suffix of our field's name, and what one unit is in SI."""

_RANGES = {
    "int8_t": (-(2**7), 2**7 - 1),
    "uint8_t": (0, 2**8 - 1),
    "uint8_t_mavlink_version": (0, 2**8 - 1),
    "int16_t": (-(2**15), 2**15 - 1),
    "uint16_t": (0, 2**16 - 1),
    "int32_t": (-(2**31), 2**31 - 1),
    "uint32_t": (0, 2**32 - 1),
    "int64_t": (-(2**63), 2**63 - 1),
    "uint64_t": (0, 2**64 - 1),
}
_UNKNOWN_UINT16 = 2**16 - 1
_ZEROS: Final = [bytes(count) for count in range(256)]
HALF: Final = 0.5
_FLOAT32_MAX: float = struct.unpack("<f", b"\xff\xff\x7f\x7f")[0]

T = TypeVar("T")
Convert = Callable[[Any], Any]
Scatter = Callable[[Sequence[Any]], Sequence[Any]]


def wire_name(message_class: type[Any]) -> str:
    """Return MAVLink's name of a message class: GlobalPositionInt -> GLOBAL_POSITION_INT."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", message_class.__name__).upper()


class PayloadCodec:
    """Payload bytes to a typed message and back, for one message."""

    def __init__(self, message_class: type[Any]) -> None:
        """Work out from the dialect's layout how each field of `message_class` is converted."""
        self.layout = layout(wire_name(message_class))
        self.message_id = self.layout.message_id
        self.id_bytes = self.message_id.to_bytes(3, "little")
        self.extra = bytes([self.layout.crc_extra])
        """What its checksum covers besides the frame."""
        self._make: Callable[[Any], Message] = partial(tuple.__new__, message_class)
        count = len(message_class._fields)
        self._pick = _pick(self.layout, count)
        self._scales = _only_some(_plain_scale(self.layout, place) for place in range(count))
        self._decoders = _only_some(_decoder(self.layout, place) for place in range(count))
        self._as_sent = not self._scales and not self._decoders
        self._fits = tuple(_fit(self.layout, place) for place in range(count))
        self._units_in_si = _units_in_si(self.layout, count)
        self._unpack = self.layout.packer.unpack
        self._pack = self.layout.packer.pack
        self._length = self.layout.packer.size
        self._scatter = _scatter(self.layout, count)

    def decode(self, payload: bytes) -> Message:
        """Return the message; missing bytes count as zeros, surplus ones (newer extensions) are left out."""
        missing = self._length - len(payload)
        if missing > 0:
            payload = payload + _ZEROS[missing]
        elif missing < 0:
            payload = payload[: self._length]
        picked = self._pick(self._unpack(payload))
        if self._as_sent:
            return self._make(picked)
        values = list(picked)
        for place, scale in self._scales:
            values[place] *= scale
        for place, convert in self._decoders:
            values[place] = convert(values[place])
        return self._make(values)

    def encode(self, message: tuple[Any, ...]) -> bytes:
        """Return the whole payload, extension fields included and not yet truncated.

        A value outside its field's range is sent as the nearest that fits, NaN in an integer as unknown.
        """
        pack = self._pack
        if self._units_in_si is not None:
            try:
                if not self._units_in_si:
                    return pack(*self._scatter(message))
                row = list(message)
                for place, units in self._units_in_si:
                    row[place] = _nearest(row[place] * units)
                return pack(*self._scatter(row))
            except (struct.error, ValueError, OverflowError):
                pass  # a value is NaN or doesn't fit
        return pack(*self._scatter([fit(v) for fit, v in zip(self._fits, message, strict=True)]))


def _starts(source: Layout) -> dict[int, int]:
    """Return where each field, numbered in the XML's order, begins among the unpacked values."""
    starts: dict[int, int] = {}
    position = 0
    for place in _packed_order(source):
        starts[place] = position
        position += _values(source, place)
    return starts


def _packed_order(source: Layout) -> list[int]:
    return sorted(range(len(source.fields)), key=source.wire_order.__getitem__)


def _values(source: Layout, place: int) -> int:
    """Return how many of the unpacked values a field has; a text is one."""
    return 1 if source.types[place] == "char" else max(source.array_lengths[place], 1)


def _scale(source: Layout, place: int) -> float | None:
    """Return what one unit of a field is in SI, None for a field that stays as it is."""
    entry = SI_SUFFIX_AND_SCALE.get(source.units[place])
    return entry[1] if entry else None


def _plain_scale(source: Layout, place: int) -> float | None:
    """Return the scale of a field that is decoded by that alone, None for any other."""
    scale = _scale(source, place)
    if scale is None or source.array_lengths[place] or source.types[place] in {"char", "uint16_t"}:
        return None
    return None if scale == 1.0 and _is_float(source, place) else scale


def _is_float(source: Layout, place: int) -> bool:
    return source.types[place] in {"float", "double"}


def _pick(source: Layout, count: int) -> Callable[[Sequence[Any]], Sequence[Any]]:
    """Return what picks the first fields, in the XML's order, out of the unpacked values."""
    starts = _starts(source)
    lengths = [0 if kind == "char" else length for kind, length in zip(source.types, source.array_lengths, strict=True)]
    if not any(lengths) and [starts[i] for i in range(len(source.fields))] == list(range(count)):
        return tuple
    places = [slice(starts[i], starts[i] + lengths[i]) if lengths[i] else starts[i] for i in range(count)]
    return itemgetter(*places) if count > 1 else lambda values: [values[places[0]]]


def _decoder(source: Layout, place: int) -> Convert | None:
    """Return what makes an unpacked value one of ours, None where that is nothing, or no more than a scale."""
    scale = _scale(source, place)
    if source.types[place] == "char":
        return lambda text: text.split(b"\0", 1)[0].decode("utf-8", "replace")
    if scale is None or (scale == 1.0 and _is_float(source, place)):
        return None

    if _plain_scale(source, place) is not None:
        return None

    def decode(value: float) -> float:
        unknown = source.types[place] == "uint16_t" and value == _UNKNOWN_UINT16
        return math.nan if unknown else value * scale

    return (lambda values: tuple(map(decode, values))) if source.array_lengths[place] else decode


def _only_some(each: Iterable[T | None]) -> list[tuple[int, T]]:
    """Return those that aren't None, with their places."""
    return [(place, one) for place, one in enumerate(each) if one is not None]


def _units_in_si(source: Layout, count: int) -> list[tuple[int, float]] | None:
    """Return how many units of a field the SI unit has, with the places of the fields that aren't sent as they are.

    None altogether when a field asks for more than a product, rounded: a text, an array, a scaled float.
    """
    scales = [_scale(source, place) for place in range(count)]
    for place, scale in enumerate(scales):
        if source.types[place] == "char" or source.array_lengths[place]:
            return None
        if _is_float(source, place):
            if scale not in {None, 1.0}:
                return None
            scales[place] = None
    return _only_some(1 / scale if scale else None for scale in scales)


def _fit(source: Layout, place: int) -> Convert:
    """Return what makes any value of a field one that can be packed."""
    kind, array = source.types[place], source.array_lengths[place]
    scale = _scale(source, place)
    if kind == "char":
        return lambda text: text.encode("utf-8", "replace")[:array]
    one = _fit_one(source, place, scale)
    return (lambda values: [one(value) for value in (*values, *[0] * array)[:array]]) if array else one


def _fit_one(source: Layout, place: int, scale: float | None) -> Convert:
    """Return what makes any value, or any one of an array, one that can be packed."""
    if _is_float(source, place):
        return _nearest_float32 if scale in {None, 1.0} else lambda value: _nearest_float32(value / scale)
    low, high = _RANGES[source.types[place]]
    if scale is None:
        return lambda value: value if low <= value <= high else int(min(max(value, low), high))
    unknown = high if high == _UNKNOWN_UINT16 else 0
    return lambda value: unknown if math.isnan(value) else round(min(max(value / scale, low), high))


def _nearest(value: float) -> int:
    """Return what `round` does: compiled, that itself would be a call of Python's own.

    Raises:
        ValueError: it is NaN.
        OverflowError: it is infinite.
    """
    low = math.floor(value)
    above = value - low
    if above < HALF or (above == HALF and low % 2 == 0):
        return low
    return low + 1


def _nearest_float32(value: float) -> float:
    if -_FLOAT32_MAX <= value <= _FLOAT32_MAX or not math.isfinite(value):
        return value
    return math.copysign(_FLOAT32_MAX, value)


def _scatter(source: Layout, count: int) -> Scatter:
    """Return what puts a message's values into the order in which they are packed, zeros for the left-out."""
    packed = _packed_order(source)
    blanks = [_blank(source, place) for place in range(count, len(packed))]
    if any(_values(source, place) > 1 for place in packed):
        arrays = [place for place in packed if _values(source, place) > 1]
        return lambda row: _flat([*row, *blanks], packed, arrays)
    reorder = cast("Scatter", tuple) if packed == sorted(packed) else itemgetter(*packed)
    return (lambda row: reorder((*row, *blanks))) if blanks else reorder


def _blank(source: Layout, place: int) -> Any:
    if source.types[place] == "char":
        return b""
    values = _values(source, place)
    return [0] * values if values > 1 else 0


def _flat(row: list[Any], packed: list[int], arrays: list[int]) -> list[Any]:
    flat: list[Any] = []
    for place in packed:
        flat.extend(row[place] if place in arrays else (row[place],))
    return flat


CODECS: Final[dict[type[Any], PayloadCodec]] = {kind: PayloadCodec(kind) for kind in get_args(Message)}
CODEC_OF_ID: Final[dict[int, PayloadCodec]] = {codec.layout.message_id: codec for codec in CODECS.values()}
