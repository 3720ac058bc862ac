"""Errors of the emulator.

EmulatorError
├── ProfileError            a profile cannot be used; says where and what to write instead
├── BadDescription          an SDP that no forwarder can stand in
└── NamespacesUnavailable   this machine or user cannot have network namespaces or TUN devices
"""

__all__ = ["BadDescription", "EmulatorError", "NamespacesUnavailable", "ProfileError"]


class EmulatorError(Exception):
    """Base of the emulator's errors."""


class ProfileError(EmulatorError):
    def __init__(self, source: str, where: str, problem: str) -> None:
        super().__init__(source, where, problem)
        self.source = source  # "lte-drive", or the path of the file
        self.where = where  # "control.loss_percent"; empty for the whole file
        self.problem = problem

    def __str__(self) -> str:
        return ": ".join(part for part in (f"profile {self.source}", self.where, self.problem) if part)


class BadDescription(EmulatorError):
    pass


class NamespacesUnavailable(EmulatorError):
    pass
