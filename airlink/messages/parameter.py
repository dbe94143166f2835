"""Messages of the parameter protocol, and of MAVLink FTP, over which parameters are read as a file.

Source: MAVLink guide, "Parameter Protocol" and "File Transfer Protocol (FTP)".
"""

from typing import NamedTuple


class ParamRequestRead(NamedTuple):
    """PARAM_REQUEST_READ (20): one parameter, by name or, where index isn't -1, by index."""

    target_system: int
    target_component: int
    param_id: str
    param_index: int = -1


class ParamRequestList(NamedTuple):
    """PARAM_REQUEST_LIST (21): all parameters."""

    target_system: int
    target_component: int


class ParamValue(NamedTuple):
    """PARAM_VALUE (22): a parameter's value, as a float whatever its type."""

    param_id: str
    param_value: float
    param_type: int
    param_count: int
    param_index: int


class ParamSet(NamedTuple):
    """PARAM_SET (23): change a parameter."""

    target_system: int
    target_component: int
    param_id: str
    param_value: float
    param_type: int


class FileTransferProtocol(NamedTuple):
    """FILE_TRANSFER_PROTOCOL (110): one packet of MAVLink FTP, as bytes."""

    target_network: int
    target_system: int
    target_component: int
    payload: tuple[int, ...]


ParameterMessage = ParamRequestRead | ParamRequestList | ParamValue | ParamSet | FileTransferProtocol
