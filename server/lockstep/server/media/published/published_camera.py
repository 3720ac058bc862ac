"""A camera that somebody publishes, as the desk of sources sees it: there is always one, and at times nobody's."""

from collections.abc import Callable

import structlog

from lockstep.server.media.sources.source_url import SourceSpec
from lockstep.server.media.sources.source_wire import Captured, SourceState

__all__ = ["PublishedCamera"]

log = structlog.get_logger(__name__)


class PublishedCamera:
    """A publisher calls `begin`, then the others, and `end` at the end, each with what stands for it.

    Attributes:
        state, detail: how it does, in words
        publisher: what stands for the one who publishes now; None: nobody does
    """

    def __init__(
        self,
        spec: SourceSpec,
        captured: Callable[[Captured], None],
        changed: Callable[[], None],
        failed: Callable[[str], None],
    ) -> None:
        """`captured`, `changed` and `failed` are called on the loop; the last with a stable reason."""
        self.spec = spec
        self.state: SourceState = "waiting"
        self.detail = ""
        self.publisher: object | None = None
        self._captured = captured
        self._changed = changed
        self._failed = failed

    def begin(self, publisher: object) -> None:
        """From now on it is theirs; what others say counts no more."""
        self.publisher = publisher
        self._enter("connecting", "")

    def captured(self, publisher: object, medium: Captured, name: str) -> None:
        """A picture of theirs; `name` is what others call them."""
        if publisher is self.publisher:
            self._enter("live", f"published by {name}")
            self._captured(medium)

    def failed(self, publisher: object, reason: str, detail: str) -> None:
        """Nothing can be shown now, and it may be again."""
        if publisher is self.publisher:
            self._failed(reason)
            self._enter("reconnecting", detail)

    def end(self, publisher: object, reason: str, detail: str) -> None:
        """They publish no more. Idempotent."""
        if publisher is self.publisher:
            self.publisher = None
            self._failed(reason)
            self._enter("waiting", detail)

    def _enter(self, state: SourceState, detail: str) -> None:
        if (state, detail) != (self.state, self.detail):
            log.info("published camera", source=self.spec.name, state=state, detail=detail)
            self.state, self.detail = state, detail
            self._changed()
