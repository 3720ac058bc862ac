"""What a DTLS connection must withstand: nothing raises, nobody is connected without a certificate that was announced,
and no bytes of a stranger end a connection that is up.

The first byte chooses; datagrams follow, each behind its length.
"""

import functools

from OpenSSL import SSL

from lockstep.rtc.certificate import Certificate
from lockstep.rtc.dtls import DtlsClosed, DtlsConnected, DtlsConnection, DtlsState, dtls_context
from tests.rtc.dtls_pair import DtlsPair

__all__ = ["try_input"]

LENGTH = 2  # bytes, of a datagram's length in an input
NOW = 0.0


@functools.cache
def _context() -> SSL.Context:
    return dtls_context(Certificate.generate())


def handshake(data: bytes, *, server: bool) -> None:
    connection = DtlsConnection(_context(), "server" if server else "client", [])
    connection.start(NOW)
    _feed(connection, data)
    if any(isinstance(event, DtlsConnected) for event in connection.events()):
        raise AssertionError("connected with an unknown certificate")


def connected(data: bytes) -> None:
    pair = DtlsPair()
    pair.connect()
    _feed(pair.server, data)
    if pair.server.state is not DtlsState.CONNECTED or any(isinstance(x, DtlsClosed) for x in pair.server.events()):
        raise AssertionError("a stranger ended a connection")


def _feed(connection: DtlsConnection, data: bytes) -> None:
    while data:
        end = LENGTH + int.from_bytes(data[:LENGTH], "big")
        connection.receive_datagram(data[LENGTH:end], NOW)
        connection.handle_timer(NOW)
        connection.datagrams_to_send()
        connection.timer()
        data = data[end:]


def try_input(data: bytes) -> None:
    """Raises whatever goes wrong."""
    code = data[0] % 3 if data else 0
    if code == 2:
        connected(data[1:])
    else:
        handshake(data[1:], server=code == 0)
