"""WHEP signalling and the console's few HTTP calls, over httpx."""

import ssl
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self
from urllib.parse import urljoin, urlsplit

import httpx
import msgspec

from lockstep.client.console_url import ConsoleLink
from lockstep.client.errors import ConnectFailed, SignallingRefused
from lockstep.client.transport.sfu_media import RelayTicket
from lockstep.protocol.maps import OccupancyMap
from lockstep.protocol.messages import StopTaken
from lockstep.rtc.turn.servers import IceServer

__all__ = ["Answer", "Whep"]

TIMEOUT = 10.0  # s for one request


class Answer(NamedTuple):
    sdp: str
    resource: str  # URL that ends the session


class _IceServer(msgspec.Struct):
    urls: list[str]
    username: str | None = None
    credential: str | None = None


class _IceServers(msgspec.Struct):
    ice_servers: list[_IceServer]


class _WatchTicket(msgspec.Struct):
    ticket: str


class _StopAnswer(msgspec.Struct):
    number: int
    kept: bool


class _RelayAnswer(msgspec.Struct):
    relay: RelayTicket | None


class _Problem(msgspec.Struct):
    error: str = ""
    detail: str = ""


_ice_servers = msgspec.json.Decoder(_IceServers)
_watch_ticket = msgspec.json.Decoder(_WatchTicket)
_stop_answer = msgspec.json.Decoder(_StopAnswer)
_relay_answer = msgspec.json.Decoder(_RelayAnswer)


class _NewestMap(msgspec.Struct):
    map: OccupancyMap


_problem = msgspec.json.Decoder(_Problem)
_newest_map = msgspec.json.Decoder(_NewestMap)


class Whep:
    """The HTTP side of one connection."""

    def __init__(self, link: ConsoleLink, tls_ca: Path | None = None) -> None:
        """`tls_ca`: a PEM file to trust instead of the system's certificates, as a console's self-signed one."""
        self._base = link.base
        self._client = httpx.AsyncClient(
            headers={"Authorization": f"Bearer {link.token}"},
            timeout=TIMEOUT,
            trust_env=not link.loopback,  # a proxy cannot reach this machine's loopback
            # Without TLS, spares the loading of certificates.
            verify=ssl.create_default_context(cafile=tls_ca) if link.secure and tls_ca is not None else link.secure,
        )

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self.aclose()

    async def aclose(self) -> None:
        await self._client.aclose()

    async def ice_servers(self) -> list[IceServer]:
        """Return STUN and TURN servers with credentials that are good now; raises like `offer`."""
        response = await self._request("GET", self._base + "/api/ice")
        try:
            found = _ice_servers.decode(response.content).ice_servers
        except msgspec.DecodeError as error:
            raise SignallingRefused(response.status_code, "", "the answer is not a list of ICE servers") from error
        return [IceServer(each.urls, each.username, each.credential) for each in found]

    async def relay(self, peer: str = "") -> RelayTicket | None:
        """Return the relay for this observer; None: the console itself. The answer has the relay's key only for a
        connected `peer`. Raises like `offer`."""
        response = await self._request("GET", f"{self._base}/api/relay{f'?peer={peer}' if peer else ''}")
        try:
            return _relay_answer.decode(response.content).relay
        except msgspec.DecodeError as error:
            raise SignallingRefused(response.status_code, "", "the answer does not name a relay") from error

    async def watch(self, relay: str) -> str:
        """Return a ticket for the WebSocket of an observer that has its media from `relay`. Raises like `offer`."""
        response = await self._request("POST", f"{self._base}/api/watch?relay={relay}")
        try:
            return _watch_ticket.decode(response.content).ticket
        except msgspec.DecodeError as error:
            raise SignallingRefused(response.status_code, "", "the answer is not a ticket") from error

    async def decline(self, ticket: str) -> None:
        """Give a ticket back; raises like `offer`."""
        await self._request("DELETE", f"{self._base}/watch/{ticket}")

    async def offer(self, sdp: str, *, trailer: bool, relay: str = "") -> Answer:
        """Send an offer and return the answer. `relay`: the relay that media come from.

        Raises:
            SignallingRefused: the console answered with an error.
            ConnectFailed: it did not answer.
        """
        query = f"?relay={relay}" if relay else "?stamp=trailer" if trailer else ""
        url = self._base + "/whep" + query
        response = await self._request("POST", url, content=sdp.encode(), headers={"Content-Type": "application/sdp"})
        location = response.headers.get("Location", "")
        resource = urljoin(url, location)
        if response.status_code != 201 or not location or urlsplit(resource).netloc != urlsplit(url).netloc:
            raise SignallingRefused(response.status_code, "", "not a WHEP answer: is this link a Lockstep console's?")
        return Answer(response.text, resource)

    async def restart_ice(self, resource: str, fragment: str) -> str:
        """Send new ICE credentials and candidates (RFC 9725 4.3.3); return the console's. Raises like `offer`."""
        headers = {"Content-Type": "application/trickle-ice-sdpfrag", "If-Match": "*"}
        response = await self._request("PATCH", resource, content=fragment.encode(), headers=headers)
        return response.text

    async def end(self, resource: str) -> None:
        """End the session; raises like `offer`."""
        await self._request("DELETE", resource)

    async def stop(self, reason: str, press: str) -> StopTaken:
        """Latch the stop by HTTP; raises like `offer`, also when the robot has not confirmed it."""
        answer = await self._request("POST", self._base + "/api/stop", json={"reason": reason, "press": press})
        try:
            said = _stop_answer.decode(answer.content)
            return StopTaken(press=press, number=said.number, kept=said.kept)
        except msgspec.DecodeError as error:
            raise SignallingRefused(answer.status_code, "", "the answer does not confirm a stop") from error

    async def map(self) -> OccupancyMap | None:
        """Return the robot's newest map; None: it has sent none. Raises like `offer`."""
        try:
            answer = await self._request("GET", self._base + "/api/map")
        except SignallingRefused as refused:
            if refused.status == 404:
                return None
            raise
        try:
            return _newest_map.decode(answer.content).map
        except msgspec.DecodeError as error:
            raise SignallingRefused(answer.status_code, "", "the answer is not a map") from error

    async def _request(self, method: str, url: str, **arguments: object) -> httpx.Response:
        try:
            response = await self._client.request(method, url, **arguments)  # type: ignore[arg-type]
        except httpx.HTTPError as error:
            detail = f"no answer from {self._base} ({error or type(error).__name__}); is the console running there?"
            raise ConnectFailed(detail) from error
        if response.status_code >= 400:
            raise _refusal(response)
        return response


def _refusal(response: httpx.Response) -> SignallingRefused:
    try:
        problem = _problem.decode(response.content)
    except msgspec.DecodeError:
        problem = _Problem(detail=response.text[:200])
    return SignallingRefused(response.status_code, problem.error, problem.detail)
