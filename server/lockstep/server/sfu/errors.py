"""Errors of a relay.

RelayError
├── RelayUnreachable   no connection, or it ended
├── RelaySilent        it did not answer in time
└── RelayRefused       it refused a request
"""

__all__ = ["RelayError", "RelayRefused", "RelaySilent", "RelayUnreachable"]


class RelayError(Exception):
    """Base of all relay errors.

    Attributes:
        name: stable identifier for logs and metrics
        detail: for a person; never holds a secret
    """

    name = "relay"

    def __init__(self, detail: str) -> None:
        super().__init__(detail)
        self.detail = detail

    def __str__(self) -> str:
        return f"{self.name}: {self.detail}"


class RelayUnreachable(RelayError):
    name = "unreachable"


class RelaySilent(RelayError):
    name = "silent"


class RelayRefused(RelayError):
    """The relay refused a request. `code` is Janus' error code; 0 without one."""

    name = "refused"

    def __init__(self, detail: str, code: int = 0) -> None:
        super().__init__(f"{detail} ({code})" if code else detail)
        self.code = code
