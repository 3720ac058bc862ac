"""Two DTLS connections without a network between them, and a UDP socket for the ones of other people."""

import time
from collections.abc import Callable, Sequence
from operator import itemgetter

from lockstep.rtc.certificate import Certificate
from lockstep.rtc.dtls import DtlsConnected, DtlsConnection, DtlsEvent, DtlsSettings, DtlsState, dtls_context
from lockstep.rtc.fingerprint import Fingerprint

__all__ = ["DtlsPair"]

Filter = Callable[[int, bytes], Sequence[bytes]]  # number and content of a datagram, to what arrives of it


def everything(number: int, data: bytes) -> Sequence[bytes]:
    return [data]


class DtlsPair:
    def __init__(
        self,
        client: Certificate | None = None,
        server: Certificate | None = None,
        settings: DtlsSettings | None = None,
        expected: Sequence[Fingerprint] | None = None,  # by the client
    ) -> None:
        of_client, of_server = client or Certificate.generate(), server or Certificate.generate()
        wanted = [of_server.fingerprint] if expected is None else expected
        self.client = DtlsConnection(dtls_context(of_client), "client", wanted, settings)
        self.server = DtlsConnection(dtls_context(of_server), "server", [of_client.fingerprint], settings)
        self.client_events: list[DtlsEvent] = []
        self.server_events: list[DtlsEvent] = []
        self.sent: list[bytes] = []

    def start(self) -> None:
        now = time.monotonic()
        self.server.start(now)
        self.client.start(now)

    def exchange(self, arrives: Filter = everything) -> None:
        """Until neither has more to say."""
        while self._exchanged(arrives):
            pass

    def _exchanged(self, arrives: Filter) -> bool:
        now = time.monotonic()
        busy = False
        for source, target in ((self.client, self.server), (self.server, self.client)):
            for data in source.datagrams_to_send():
                busy = True
                self.sent.append(data)
                for each in arrives(len(self.sent) - 1, data):
                    target.receive_datagram(each, now)
        self.client_events += self.client.events()
        self.server_events += self.server.events()
        return busy

    def connect(self) -> None:
        self.start()
        self.exchange()
        assert isinstance(self.client_events[0], DtlsConnected), self.client_events
        assert isinstance(self.server_events[0], DtlsConnected), self.server_events

    def repeat_until_connected(self) -> None:
        """Let their timers pass, by OpenSSL's own clock."""
        self.exchange()
        while not (self.client.state is self.server.state is DtlsState.CONNECTED):
            due = [(each.timer(), each) for each in (self.client, self.server)]
            when, connection = min(((when, each) for when, each in due if when is not None), key=itemgetter(0))
            time.sleep(max(0.0, when - time.monotonic()))
            connection.handle_timer(time.monotonic())
            self.exchange()
