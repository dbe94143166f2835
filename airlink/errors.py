"""Errors of the wire. Bytes from the network never raise: they are counted and dropped."""


class AirlinkError(Exception):
    """Root of every error that airlink raises."""


class EndpointError(AirlinkError):
    """A connection string that can't be used as written."""


class PortError(AirlinkError):
    """A local address that can't be opened: taken, forbidden or not of this machine."""


class ImpairmentError(AirlinkError):
    """A setting of an impaired link that isn't allowed."""
