"""Publishes whether stops can be kept on the console's disk."""

from lockstep.server.session_events import SessionEvents, StopsDiskChanged
from lockstep.server.stop.stop_keeper import StopKeeper

__all__ = ["StopsDisk"]


class StopsDisk:
    """Run `run` as a task."""

    def __init__(self, keeper: StopKeeper, events: SessionEvents) -> None:
        self._keeper = keeper
        self._events = events
        self._trouble = keeper.trouble  # as it was published last

    async def run(self) -> None:
        """Publish every change until cancelled."""
        while True:
            self._trouble = await self._keeper.trouble_other_than(self._trouble)
            self._events.publish(StopsDiskChanged(self._trouble))
