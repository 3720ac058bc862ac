"""The parameters of an association, each with its reason."""

from dataclasses import dataclass

__all__ = ["SctpSettings"]


@dataclass(frozen=True, slots=True)
class SctpSettings:
    """Times are seconds, sizes bytes unless they say packets.

    The defaults serve small messages whose delay matters: some kilobytes a second that are to arrive within little
    more than a round trip, on paths of up to some seconds. RFC 9260 16 leaves RTO.Min and its companions to the needs
    of the application; its recommended values serve bulk transfer.
    """

    port: int = 5000  # at both ends; the number in a=sctp-port (RFC 8841 5)

    max_packet: int = 1160
    """An SCTP packet. 1,200 bytes of UDP payload pass every path that WebRTC runs over; DTLS takes up to 37 of them
    (record header, nonce, tag), and chunks end at a multiple of four. There is no path MTU discovery."""

    # Retransmission
    initial_timeout: float = 0.5
    """Before the first measured round trip (RFC 9260 recommends 1 s). Only the handshake and the first message pay a
    needless repeat on a slower path."""

    handshake_ceiling: float = 3.0
    """To which the interval between INITs or COOKIE ECHOs grows. They never stop by count: see `Association`."""

    timeout_ceiling: float = 1.5
    """To which the interval between repeats grows (RTO.Max; RFC 9260 recommends 60 s), or twice the path's shortest
    round trip where that is more. A network that was cut and delivers everything at its end is no path of ten
    seconds; with an interval of that order the next loss would stall a session for as long."""

    margin_floor: float = 0.03
    """The least that is waited beyond the smoothed round trip: a scheduler's or a garbage collector's pause at the
    peer is no loss."""

    margin_ceiling: float = 0.045
    """The most that is waited beyond 1.5 smoothed round trips before the first repeat. A repeat that the peer reports
    as needless doubles it (see `RoundTrip`)."""

    peer_acknowledgement_delay: float = 0.2
    """How long a peer may keep back its acknowledgement of a chunk without the I bit (RFC 9260 6.2; Chromium and
    usrsctp take 0.2 s, the limit is 0.5 s)."""

    sample_interval: float = 1.0
    """As often, one newest-wins message has the I bit, so that the round trip stays known while nothing else flows."""

    # Acknowledgement
    acknowledgement_delay: float = 0.15
    """How long the acknowledgement of one packet may wait for a second packet or for data to travel with (RFC 9260 6.2
    allows 0.5 s). 0: each packet is acknowledged at once, so that the peer knows of a loss the soonest."""

    # Congestion (RFC 9260 7), in packets
    initial_window: int = 10
    """RFC 9260 7.2.1 takes 4,404 bytes; this is TCP's of today (RFC 6928) and Chromium's."""

    window_floor: int = 8
    """The reliable messages that may be unacknowledged at any time. RFC 9260 7.2.3 goes down to one packet after a
    timeout, and a session whose state is a few kilobytes would take many round trips for it."""

    newest_wins_floor: int = 24
    """The newest-wins messages that may be unacknowledged at any time, whatever the window: the departure from
    RFC 9260 7.2 that keeps the newest state from waiting behind a loss. Both floors together bound what leaves on a
    congested path to 32 packets (37 kB) in a round trip and a quarter second, less than one frame of video. They do
    not apply to the peer's receive window, which is always kept."""

    max_burst: int = 14
    """Packets of reliable messages that leave at once (Max.Burst, RFC 9260 6.1 D): one message of 16 KiB."""

    # Bounds
    receive_window: int = 256 * 1024
    """Received bytes of messages that are not complete or not in order yet. What exceeds it is dropped, and more than
    twice as much ends the association."""

    max_receive_message: int = 64 * 1024
    """RFC 8841 6: what a peer may send where a=max-message-size says nothing. A larger one ends the association."""

    max_send_message: int = 16 * 1024
    """RFC 8831 6.6: the size that keeps one message from holding up the others for long."""

    max_streams: int = 1024
    """Streams in each direction; there is some state for each that was ever used."""

    max_gaps: int = 1024
    """Runs of received chunks beyond the first missing one. What would make one more is dropped."""

    max_outstanding: int = 4096
    """Chunks that were sent and are not acknowledged. Newest-wins messages wait, and the oldest of them are dropped,
    while there are more."""

    send_queue: int = 256 * 1024
    """Bytes that wait on one stream; more raise `SendQueueFull`."""

    newest_wins_queue: int = 64 * 1024
    """Bytes of newest-wins messages that wait, on all streams together; the oldest are dropped for a newer one."""

    cookie_lifetime: float = 60.0
    """Valid.Cookie.Life (RFC 9260 16)."""

    given_up_after: float = 30.0
    """A chunk that was missing for so long while others kept coming was given up by a peer that does not say so: old
    Firefox sends no FORWARD TSN while other data flow. It is skipped unless an ordered message waits for it; otherwise
    every later packet would count as out of order for the rest of the session. No sender repeats as rarely as that."""

    interleaving: bool = True
    """Offer RFC 8260. Firefox does; Chromium does not by default, and then plain DATA chunks are used."""
