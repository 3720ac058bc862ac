"""`lockstep check`: checks that a bridge in any language does what docs/robot-link.md asks.

The cases are in `cases/`; each opens its own links by a `Subject` and reports by a `Violation`. The same
cases run in the tests, against the bridge of this package and others.
"""

from lockstep.robot_bridge.conformance.case import Case, Outcome, Result
from lockstep.robot_bridge.conformance.run import CASES, play, play_all
from lockstep.robot_bridge.conformance.subject import Subject

__all__ = ["CASES", "Case", "Outcome", "Result", "Subject", "play", "play_all"]
