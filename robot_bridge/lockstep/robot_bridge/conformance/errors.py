"""The reasons for which a case of the conformance check does not end well.

CheckError
├── Violation               the bridge did something else than the protocol asks
├── NotApplicable           this robot has nothing that the case is about
├── NotReady                the robot cannot be checked now; nothing was tried
└── StoppedByOther          somebody stopped the robot during the check, which then ends
"""

__all__ = ["CheckError", "NotApplicable", "NotReady", "StoppedByOther", "Violation", "expect"]


class CheckError(Exception):
    """Base of the check's errors; the text says what was found, for a person."""


class Violation(CheckError):
    pass


class NotApplicable(CheckError):
    pass


class NotReady(CheckError):
    pass


class StoppedByOther(CheckError):
    pass


def expect(condition: bool, found: str) -> None:
    """Require what the protocol asks. `found`: the text of the violation.

    Raises:
        Violation: the condition does not hold.
    """
    if not condition:
        raise Violation(found)
