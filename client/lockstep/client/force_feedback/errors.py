"""The error of force feedback."""

__all__ = ["ForceFeedbackError"]


class ForceFeedbackError(Exception):
    """A device cannot push, or does no longer. The text says why."""
