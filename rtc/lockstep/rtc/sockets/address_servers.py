"""Asks STUN and TURN servers for addresses, and keeps the clients of the TURN servers that gave one."""

import asyncio
import secrets
import socket
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence

from lockstep.rtc.addresses import Address, Datagram, Path
from lockstep.rtc.ice.check_list import LocalCandidate
from lockstep.rtc.ice.gathering import reflexive, relayed
from lockstep.rtc.sockets.endpoint_settings import EndpointSettings
from lockstep.rtc.sockets.turn_client import TurnClient, open_turn_client
from lockstep.rtc.turn.servers import IceServer, MappedAddress, ServerUri, server_uris

__all__ = ["AddressServers"]

SLOWEST = 4  # times as long as STUN over UDP: an address by TCP and TLS takes five round trips


class AddressServers:
    """The STUN and TURN servers of one endpoint.

    Attributes:
        told: the candidates that they reported last
        probes: the questions that wait for an answer, by path; `received` takes it
    """

    def __init__(
        self,
        settings: EndpointSettings,
        counts: Counter[str],
        send: Callable[[Sequence[Datagram]], None],
        on_data: Callable[[Iterable[tuple[bytes, Path]]], None],
    ) -> None:
        """`send`: sends from the endpoint's sockets; `on_data`: takes datagrams that came through a TURN server, with
        their paths."""
        self.told: list[LocalCandidate] = []
        self.probes: dict[Path, MappedAddress] = {}
        self._settings = settings
        self._counts = counts
        self._send = send
        self._on_data = on_data
        self._loop = asyncio.get_running_loop()
        self._clients: list[TurnClient] = []
        self._probed = asyncio.Event()  # one of the probes has received something

    async def ask(self, servers: Sequence[IceServer], bases: Iterable[Address]) -> list[Exception]:
        """Ask for the mapped addresses of `bases` and for relayed ones; `told` has the answers.

        Return the errors of servers without an answer, as `Endpoint.ask` does.
        """
        here = tuple(bases)
        uris = sorted(server_uris(servers, self._counts), key=lambda each: each[0].scheme, reverse=True)  # TURN first
        begun = self._loop.time()
        deadline = begun + self._settings.ask_seconds
        try:
            async with asyncio.TaskGroup() as group:
                tasks = [group.create_task(self._ask_server(*each, here)) for each in uris]
                left = set(tasks)
                while left and self._loop.time() < deadline:
                    done, left = await asyncio.wait(
                        left, timeout=deadline - self._loop.time(), return_when=asyncio.FIRST_COMPLETED
                    )
                    if any(isinstance(each.result(), list) for each in done):
                        now = self._loop.time()
                        deadline = min(deadline, now + max(self._settings.ask_margin, SLOWEST * (now - begun)))
                for task in left:
                    task.cancel()
        finally:
            self.probes.clear()
        outcomes = [task.result() for task in tasks if not task.cancelled()]
        self.told = [each for found in outcomes if isinstance(found, list) for each in found]
        return [each for each in outcomes if isinstance(each, Exception)]

    async def _ask_server(
        self, uri: ServerUri, server: IceServer, bases: Sequence[Address]
    ) -> list[LocalCandidate] | Exception:
        """Return what a server answers, or its error, which does not end the questions to others."""
        try:
            return await (self._ask_turn(uri, server) if uri.scheme == "turn" else self._ask_stun(uri, bases))
        except Exception as error:
            return error

    async def _ask_turn(self, uri: ServerUri, server: IceServer) -> list[LocalCandidate]:
        client = await open_turn_client(uri, server, self._on_data)
        self._clients.append(client)
        address = client.relayed
        return [] if address is None else [relayed(address, client.mapped, len(self._clients))]

    async def _ask_stun(self, uri: ServerUri, bases: Sequence[Address]) -> list[LocalCandidate]:
        found = await self._loop.getaddrinfo(uri.host, uri.port, type=socket.SOCK_DGRAM)
        probes: dict[Address, MappedAddress] = {}
        for base in bases:
            family = socket.AF_INET6 if ":" in base[0] else socket.AF_INET
            remote = next((each[4] for each in found if each[0] == family), None)
            if remote is not None:
                path = Path(base, (str(remote[0]), int(remote[1])))
                self.probes[path] = probes[base] = MappedAddress(secrets.token_bytes)
                probes[base].start(self._loop.time())
                self._send_probe(path)
        await self._until_answered(probes)
        return [
            reflexive(probe.mapped, base, place)
            for place, (base, probe) in enumerate(probes.items())
            if probe.mapped is not None and probe.mapped != base
        ]

    async def _until_answered(self, asked: Mapping[Address, MappedAddress]) -> None:
        """Wait until one probe is answered, which is enough: other sockets may have no way to the server."""
        probes = list(asked.values())
        while not any(each.mapped is not None for each in probes) and not all(each.done for each in probes):
            due = min((each for each in (probe.timer() for probe in probes) if each is not None), default=None)
            self._probed.clear()
            try:
                async with asyncio.timeout_at(due):
                    await self._probed.wait()
            except TimeoutError:
                for path, probe in self.probes.items():
                    if probe in probes and (at := probe.timer()) is not None and at <= self._loop.time():
                        probe.handle_timer(self._loop.time())
                        self._send_probe(path)

    def _send_probe(self, path: Path) -> None:
        self._send([Datagram(data, path) for data in self.probes[path].data_to_send()])

    def received(self, data: bytes, path: Path, now: float) -> None:
        """Take a datagram on a path of `probes`."""
        self.probes[path].receive(data, now)
        self._probed.set()

    # Relayed addresses

    def client(self, address: Address) -> TurnClient | None:
        """Return the client of the TURN server that gave this address."""
        return next((each for each in self._clients if each.relayed == address), None)

    def send(self, datagram: Datagram) -> None:
        """Send from a relayed address; a datagram from another one is counted."""
        client = self.client(datagram.local)
        if client is None:
            self._counts["no_socket"] += 1
        else:
            client.send(datagram.data, datagram.remote)

    def give_back_unused(self, in_use: set[Address]) -> None:
        for client in [each for each in self._clients if each.relayed not in in_use]:
            client.close()
            self._clients.remove(client)

    def close(self) -> None:
        """Give all relayed addresses back. Idempotent."""
        for client in self._clients:
            client.close()
        self._clients.clear()
