"""WebRTC without I/O: ICE, DTLS, SRTP, SCTP, data channels, SDP and RTP, and one socket shell for all of them.

Begin at `lockstep.rtc.endpoint.Endpoint`, the shell, or at `lockstep.rtc.peer.Peer`, which puts the cores together.

Every protocol is a core that opens no socket, starts no task and reads no clock. `now` is seconds of one monotonic
clock, and the caller passes in randomness, so that a test repeats exactly. All cores have one shape:

    core.receive_datagram(data, path, now)  # received; bad input is dropped and counted, never raised
    core.handle_timer(now)                  # call when `timer()` is due
    core.datagrams_to_send()                # send these; drained
    core.events()                           # frozen dataclasses; drained
    core.timer()                            # the time at which `handle_timer` is due next; None: never

`DtlsConnection` and `DataChannels` lie inside one path and are given no address. OpenSSL reads its own clock.

After each `receive_datagram`, `handle_timer` or other call, drain the other two and ask for the timer again.
This package imports nothing else of this repository.
"""
