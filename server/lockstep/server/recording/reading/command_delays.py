"""How long each command took from the console to the robot and back, by the records of a recording. No I/O."""

from lockstep.server.recording.format.records import CommandRecord, FeedbackRecord, OwnRecord

__all__ = ["CommandDelays"]


class CommandDelays:
    """Call `take` with the records of a recording in their order; others than commands and feedbacks say nothing."""

    def __init__(self) -> None:
        self._event = 0  # of the newest command that has no feedback yet; never more than one is on its way
        self._sent = 0  # ns, when the console had it

    def take(self, record: OwnRecord | None, arrived: int) -> float | None:
        """Return the ms from a command to this record, the first feedback of its event; None: it is another record.

        Args:
            arrived: ns since 1970, by the console's clock
        """
        match record:
            case CommandRecord(outcome="forwarded", event=event):
                self._event, self._sent = event, arrived
            case FeedbackRecord(event=event) if event == self._event:
                self._event = 0
                return max(0, arrived - self._sent) / 1e6  # a clock may be set back
        return None
