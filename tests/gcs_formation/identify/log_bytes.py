"""Writes the bytes of autopilots' logs: DataFlash with its formats and multipliers, and ULog with its definitions."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from pathlib import Path

PACKED = {
    "Q": "Q",
    "f": "f",
    "B": "B",
    "b": "b",
    "c": "h",
    "e": "i",
    "N": "16s",
    "Z": "64s",
    "L": "i",
    "M": "B",
    "H": "H",
}
HUNDREDTHS = "ce"
DATAFLASH = {
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns", ""),
    "FMTU": (63, "QBNN", "TimeUS,FmtType,UnitIds,MultIds", ""),
    "PARM": (64, "QNff", "TimeUS,Name,Value,Default", ""),
    "MSG": (65, "QZ", "TimeUS,Message", ""),
    "MODE": (66, "QMBB", "TimeUS,Mode,ModeNum,Rsn", ""),
    "ARSP": (67, "QBf", "TimeUS,I,Airspeed", "F-0"),
    "TECS": (68, "Qfffffff", "TimeUS,h,dh,hin,hdem,dhdem,spdem,sp", "F0000000"),
    "NTUN": (69, "Qfcce", "TimeUS,Dist,TBrg,NavBrg,TAsp", "F0BBB"),
    "XKF1": (70, "QBcfff", "TimeUS,C,Yaw,VN,VE,VD", "F-B000"),
    "POS": (71, "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt", "FGG00"),
    "GUIP": (72, "QBfffbffffff", "TimeUS,Type,pX,pY,pZ,Terrain,vX,vY,vZ,aX,aY,aZ", "F-BBB-BBBBBB"),
    "PSCN": (73, "Qffffff", "TimeUS,TPN,PN,DVN,TVN,VN,AN", "F000000"),
    "PSCE": (74, "Qffffff", "TimeUS,TPE,PE,DVE,TVE,VE,AE", "F000000"),
    "PSCD": (75, "Qffffff", "TimeUS,TPD,PD,DVD,TVD,VD,AD", "F000000"),
    "ATT": (76, "Qccccc", "TimeUS,DesRoll,Roll,DesPitch,Pitch,Yaw", "FBBBBB"),
}  # fmt: skip
"""Number, types, columns and multipliers of each message, the columns that are read in the order of ArduPilot."""

Row = tuple[str, float, Sequence[float | bytes]]
"""A message's kind, its time, s, and the values of its columns after the time."""


def write_dataflash(file: Path, rows: Iterable[Row], metres: bool = False) -> Path:
    """Write an ArduPilot log; `metres`: GUIP is in metres, as since 4.7."""
    data = bytearray()

    def write(kind: str, *values: object) -> None:
        number, types, _, _ = DATAFLASH[kind]
        scaled = [
            round(value * 100) if kind_of in HUNDREDTHS and isinstance(value, float) else value
            for value, kind_of in zip(values, types, strict=True)
        ]
        data.extend(b"\xa3\x95" + bytes([number]) + struct.pack("<" + "".join(PACKED[each] for each in types), *scaled))

    for name, (number, types, columns, _) in DATAFLASH.items():
        length = 3 + struct.calcsize("<" + "".join(PACKED.get(each, "4s") for each in types))
        header = b"\xa3\x95\x80" + struct.pack("<BB", number, length)
        data.extend(header + struct.pack("<4s16s64s", name.encode(), types.encode(), columns.encode()))
    for name, (number, types, _, multipliers) in DATAFLASH.items():
        if multipliers:
            text = multipliers.replace("B", "0") if name == "GUIP" and metres else multipliers
            write("FMTU", 0, number, b"s" + b"-" * (len(types) - 1), text.encode())
    for kind, at_s, values in rows:
        write(kind, round(at_s * 1e6), *values)
    file.write_bytes(bytes(data))
    return file


def write_ulog(file: Path, topics: dict[str, str], rows: Iterable[Row], system: int = 1, **set_to: float) -> Path:
    """Write a PX4 log with parameters; `topics`: fields of each topic after the timestamp, as uORB has them, padded."""
    sizes = {"float": ("f", 4), "uint8_t": ("B", 1), "double": ("d", 8)}
    data = bytearray(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0))

    def write(kind: str, body: bytes) -> None:
        data.extend(struct.pack("<HB", len(body), ord(kind)) + body)

    write("B", bytes(40))
    packings = dict[str, str]()
    for name, fields in topics.items():
        packing, size = "<Q", 8
        for each in fields.split(";"):
            kind, count = each.split(" ")[0].partition("[")[::2]
            times = int(count.rstrip("]") or 1)
            packing, size = packing + sizes[kind][0] * times, size + sizes[kind][1] * times
        padding = f"uint8_t[{-size % 8}] _padding0;" if size % 8 else ""
        write("F", f"{name}:uint64_t timestamp;{fields};{padding}".encode())
        packings[name] = packing
    key = b"int32_t MAV_SYS_ID"
    write("P", bytes([len(key)]) + key + struct.pack("<i", system))
    for each, value in set_to.items():
        named = b"float " + each.encode()
        write("P", bytes([len(named)]) + named + struct.pack("<f", value))
    for number, name in enumerate(topics):
        write("A", bytes([0]) + struct.pack("<H", number) + name.encode())
    for kind, at_s, values in rows:
        number = list(topics).index(kind)
        write("D", struct.pack("<H", number) + struct.pack(packings[kind], round(at_s * 1e6), *values))
    file.write_bytes(bytes(data))
    return file
