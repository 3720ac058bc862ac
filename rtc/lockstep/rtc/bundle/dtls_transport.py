"""DTLS on the path that ICE finds, and the datagrams that come before it can begin."""

from collections import Counter, deque
from collections.abc import Sequence

from OpenSSL import SSL

from lockstep.rtc.dtls import DtlsConnection, DtlsRole, DtlsSettings, DtlsState
from lockstep.rtc.fingerprint import Fingerprint
from lockstep.rtc.ice.agent import Agent

__all__ = ["DtlsTransport"]


class DtlsTransport:
    """`connection` is None until both descriptions are known; it begins with the first path."""

    def __init__(
        self, context: SSL.Context, ice: Agent, settings: DtlsSettings, most_held: int, counts: Counter[str]
    ) -> None:
        """`most_held`: datagrams that are kept until the handshake begins. `counts`: those of the peer."""
        self.connection: DtlsConnection | None = None
        self._context = context
        self._ice = ice
        self._settings = settings
        self._counts = counts
        self._held: deque[bytes] = deque(maxlen=most_held)

    def negotiated(self, role: DtlsRole, fingerprints: Sequence[Fingerprint]) -> None:
        self.connection = DtlsConnection(self._context, role, fingerprints, self._settings)

    @property
    def is_up(self) -> bool:
        return self.connection is not None and self.connection.state is DtlsState.CONNECTED

    def start(self, now: float) -> None:
        """Begin the handshake, if there is a path and it has not begun."""
        dtls = self.connection
        if dtls is not None and dtls.state is DtlsState.NEW and self._ice.path is not None:
            dtls.start(now)
            while self._held:
                dtls.receive_datagram(self._held.popleft(), now)

    def receive(self, data: bytes, now: float) -> None:
        if self.connection is None or self.connection.state is DtlsState.NEW:
            self._held.append(data)  # the peer's answer, or the path that ICE has found, is on its way
            self._counts["dtls_early"] += 1
        else:
            self.connection.receive_first(data, now)
