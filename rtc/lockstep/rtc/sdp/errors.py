"""Errors in session descriptions."""

__all__ = ["SdpError"]


class SdpError(ValueError):
    """A description that cannot be used. The only error of this package.

    `section` is the mid of the faulty media section, or "#0" by its place when it has none; None when the whole
    description is faulty. `reason` is for the author of the description.
    """

    def __init__(self, reason: str, section: str | None = None) -> None:
        super().__init__(reason, section)
        self.reason = reason
        self.section = section

    def __str__(self) -> str:
        return self.reason if self.section is None else f"section {self.section}: {self.reason}"
