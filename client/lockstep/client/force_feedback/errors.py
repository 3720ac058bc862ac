"""The error of force feedback."""

__all__ = ["ForceFeedbackError"]


class ForceFeedbackError(Exception):
    """A device cannot push, or no longer pushes. The text says why."""
