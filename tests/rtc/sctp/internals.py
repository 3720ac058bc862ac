"""The figures of an association that its interface does not show, for tests of bounds and of what is left over."""

from lockstep.rtc.sctp import Association

__all__ = ["Internals"]


class Internals:
    """The present figures of `association`. Sizes are bytes of payload."""

    def __init__(self, association: Association) -> None:
        self._packets = association._packets
        self._transfer = association._transfer

    @property
    def tag(self) -> int:
        """The verification tag of packets to this end."""
        return self._packets.tag

    @property
    def control_chunks(self) -> int:
        """The control chunks that wait to be sent."""
        return len(self._packets.control)

    # The sending half

    @property
    def next_tsn(self) -> int:
        return self._transfer.sender.fragmentation.next_tsn

    @property
    def is_idle(self) -> bool:
        """True if nothing waits and all is acknowledged."""
        return self._transfer.sender.idle

    @property
    def outstanding(self) -> int:
        """The chunks that wait to be sent or acknowledged."""
        return len(self._transfer.sender.outstanding.chunks)

    @property
    def congestion_window(self) -> int:
        return self._transfer.sender.window.congestion.size

    @property
    def flight(self) -> int:
        return self._transfer.sender.window.flight

    @property
    def newest_flight(self) -> int:
        """The part of newest-wins messages, which has a window of its own."""
        return self._transfer.sender.window.newest_flight

    @property
    def dropped(self) -> int:
        """The messages that made room for newer ones."""
        return self._transfer.sender.queue.dropped

    # The receiving half

    @property
    def cumulative(self) -> int:
        """The TSN up to which everything has arrived."""
        return self._transfer.receiver.received.cumulative

    @property
    def runs(self) -> int:
        """The runs of TSNs that are remembered because of holes before them."""
        return len(self._transfer.receiver.received._runs)

    @property
    def held(self) -> int:
        """The size of what waits for the rest of its message, or for its turn."""
        return self._transfer.receiver.reassembly.held

    @property
    def fragments(self) -> int:
        return sum(len(run.payloads) for run in self._transfer.receiver.reassembly._starts.values())

    # Stream resets

    @property
    def peer_reset_number(self) -> int:
        """The number of the peer's next request."""
        return self._transfer.resets._peer_number

    @property
    def asks_for_reset(self) -> bool:
        """True while a request of this end has no answer."""
        return self._transfer.resets._request is not None
