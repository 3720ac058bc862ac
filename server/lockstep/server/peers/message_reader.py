"""Reads the messages of one peer within its rate, and says when too many were bad. No I/O, no clock."""

from lockstep.protocol.console import ClientMessage
from lockstep.protocol.messages import Stop
from lockstep.server.errors import ChannelError, Flood
from lockstep.server.peers.channels import ChannelName, MessageBudget, parse_message
from lockstep.server.util.rate_limits import RateLimits

__all__ = ["MessageReader"]

FORGIVEN_RATE = 2.0  # Hz, of bad messages


class MessageReader:
    """Parses messages. Call `refuse` for each that is refused.

    Attributes:
        has_given_up: True once more bad messages have come than are forgiven
    """

    def __init__(self, rate: float, max_bad_messages: int) -> None:
        """`rate`: messages a second."""
        self.has_given_up = False
        self._budget = MessageBudget(rate)
        self._patience = RateLimits(FORGIVEN_RATE, max_bad_messages)

    def read(self, channel: ChannelName | None, data: object, now: float) -> ClientMessage:
        """Parse a message as `parse_message` does. A stop beyond the rate is heard, and counts as a bad message.

        Raises:
            ChannelError: the message is bad, or a Flood.
        """
        try:
            message = parse_message(channel, data)
        except ChannelError:
            self._budget.spend(now)
            raise
        try:
            self._budget.spend(now)
        except Flood:
            if not isinstance(message, Stop):
                raise
            self.refuse(now)
        return message

    def refuse(self, now: float) -> None:
        """Count a bad message."""
        if not self._patience.spend("", now):
            self.has_given_up = True
