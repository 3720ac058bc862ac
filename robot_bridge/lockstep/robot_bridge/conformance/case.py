"""A case: the rule that the protocol sets, its section in the documentation, and the function that tries it."""

from collections.abc import Awaitable, Callable
from enum import StrEnum
from typing import NamedTuple

from lockstep.robot_bridge.conformance.subject import Subject

__all__ = ["Case", "Outcome", "Result"]


class Case(NamedTuple):
    name: str  # "repeat"
    asks: str  # "a repeat of the last command executes nothing …"
    section: str  # heading of docs/robot-link.md, "What happens to a command"
    play: Callable[[Subject], Awaitable[None]]  # raises Violation or NotApplicable


class Outcome(StrEnum):
    OK = "ok"
    FAILED = "failed"
    NOT_APPLICABLE = "not applicable"
    NOT_TRIED = "not tried"  # the check ended before it


class Result(NamedTuple):
    case: Case
    outcome: Outcome
    detail: str = ""  # the violation, or why the case does not apply
