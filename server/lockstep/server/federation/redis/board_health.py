"""Whether other consoles are known through the board, and the errors of the board: counted, and logged once."""

import time
from collections.abc import Iterable

import structlog

from lockstep.server.federation.board import Conflict
from lockstep.server.federation.errors import BoardError, BoardInput
from lockstep.server.federation.metrics import BoardMetrics

__all__ = ["BoardHealth"]

log = structlog.get_logger(__name__)


class BoardHealth:
    """The state of the exchange with the other consoles.

    Attributes:
        unknown_since: s since 1970, from when nothing is known of the others; None while they are known
        trouble: the reason for that
    """

    def __init__(self, place: str, metrics: BoardMetrics) -> None:
        """`place`: the board's address, for the log."""
        self._place = place
        self._metrics = metrics
        self._known_at = time.time()  # time of the newest knowledge of the others
        self.unknown_since: float | None = self._known_at
        self.trouble = "not connected yet"
        self._conflicts: tuple[Conflict, ...] = ()  # conflicts that the log has named

    def found(self, living: int, conflicts: tuple[Conflict, ...]) -> None:
        """Note that the states of all other consoles were read. `living`: the number of them that live."""
        if self.unknown_since is not None:
            log.info("other consoles are known", board=self._place)
        self.unknown_since, self._known_at, self.trouble = None, time.time(), ""
        self._metrics.up.set(1)
        self._metrics.consoles.set(living)
        for each in _without(conflicts, self._conflicts):
            log.error("two consoles claim one robot name", error=each.error, robot=each.robot, consoles=each.consoles)
        for each in _without(self._conflicts, conflicts):
            log.info("only one console claims the robot name again", robot=each.robot)
        self._conflicts = conflicts
        self._metrics.conflicts.set(len(conflicts))

    def lost(self, error: BoardError) -> None:
        """Note that the session with the board has ended."""
        if self.unknown_since is None or self.trouble != str(error):
            log.warning("other consoles are unknown", board=self._place, error=error.name, detail=error.detail)
        if self.unknown_since is None:
            self.unknown_since = self._known_at
        self.trouble = str(error)
        self._metrics.up.set(0)

    def once(self, known: str, error: BoardError, what: str) -> str:
        """Count an error that does not end the session; log it when it begins. Return it in words, the next `known`."""
        self.count(error)
        if not known:
            log.warning(what, board=self._place, error=error.name, detail=error.detail)
        return f"{what}: {error}"

    def count(self, error: BoardError) -> None:
        (self._metrics.bad_input if isinstance(error, BoardInput) else self._metrics.failures).labels(error.name).inc()


def _without(some: Iterable[Conflict], known: Iterable[Conflict]) -> list[Conflict]:
    robots = {each.robot for each in known}
    return [each for each in some if each.robot not in robots]
