"""SCTP for WebRTC's data channels, without I/O: RFC 9260 with 3758, 6525, 7053 and 8260.

`Association` is what to use; `rtc.channels` has the data channels above it. The way of a message out: association,
send queue, sender, chunks, packet; and in: packet, association, data transfer, receiver, reassembly.
"""

from lockstep.rtc.sctp.association import Association
from lockstep.rtc.sctp.errors import AssociationClosed, MessageTooLarge, SctpParseError, SendQueueFull
from lockstep.rtc.sctp.events import Closed, Established, Event, MessageReceived, OutgoingStreamsReset, StreamsReset
from lockstep.rtc.sctp.lifecycle import State
from lockstep.rtc.sctp.settings import SctpSettings

__all__ = [
    "Association",
    "AssociationClosed",
    "Closed",
    "Established",
    "Event",
    "MessageReceived",
    "MessageTooLarge",
    "OutgoingStreamsReset",
    "SctpParseError",
    "SctpSettings",
    "SendQueueFull",
    "State",
    "StreamsReset",
]
