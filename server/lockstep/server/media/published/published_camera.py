"""A camera that a client publishes, as a source: it always exists, at times without a publisher."""

from collections.abc import Callable

import structlog

from lockstep.server.media.sources.source_url import SourceSpec
from lockstep.server.media.sources.source_wire import Captured, SourceState

__all__ = ["PublishedCamera"]

log = structlog.get_logger(__name__)


class PublishedCamera:
    """A publisher calls `begin`, then the other methods, then `end`, and passes itself to each.

    Attributes:
        state, detail: its state, and a description in words
        publisher: the current publisher; None: nobody publishes
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
        """Hand the camera over to `publisher`; from now on calls of others are ignored."""
        self.publisher = publisher
        self._enter("connecting", "")

    def captured(self, publisher: object, medium: Captured, name: str) -> None:
        """Take a picture of `publisher`; `name` is the publisher's name for others."""
        if publisher is self.publisher:
            self._enter("live", f"published by {name}")
            self._captured(medium)

    def failed(self, publisher: object, reason: str, detail: str) -> None:
        """Note that nothing can be shown for now."""
        if publisher is self.publisher:
            self._failed(reason)
            self._enter("reconnecting", detail)

    def end(self, publisher: object, reason: str, detail: str) -> None:
        """End the publication of `publisher`. Idempotent."""
        if publisher is self.publisher:
            self.publisher = None
            self._failed(reason)
            self._enter("waiting", detail)

    def _enter(self, state: SourceState, detail: str) -> None:
        if (state, detail) != (self.state, self.detail):
            log.info("published camera", source=self.spec.name, state=state, detail=detail)
            self.state, self.detail = state, detail
            self._changed()
