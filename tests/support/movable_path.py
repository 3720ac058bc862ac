"""A path between a browser and a console that a test can cut, while HTTP and every later path go on."""

import asyncio
import re
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager

from playwright.async_api import Page, Route

from lockstep.emulator.impairment.deliveries import Deliveries
from lockstep.emulator.impairment.outages import Outages
from lockstep.emulator.impairment.profile import load_profile
from lockstep.emulator.transport.client_paths import ClientPaths
from lockstep.emulator.transport.udp_forwarder import LOOPBACK, UdpForwarder
from lockstep.rtc.interfaces import own_addresses

__all__ = ["MovablePath", "movable_path"]

FOR_GOOD = 3600.0  # s
OFFERS = re.compile(r"/whep(\?|$)")


class MovablePath:
    """The first connection of the page goes through it. What an ICE restart finds does not."""

    def __init__(self, relay: UdpForwarder, outages: Outages) -> None:
        self.restarts: list[int] = []  # HTTP status of each ICE restart so far
        self.refuses_restarts = False
        self._relay = relay
        self._outages = outages
        self._offered = False
        self._may_restart = asyncio.Event()
        self._may_restart.set()

    def cut(self) -> None:
        """From now on nothing passes."""
        self._outages.demand(time.monotonic(), FOR_GOOD)

    @contextmanager
    def restarts_wait(self) -> Iterator[None]:
        """No ICE restart reaches the console inside the block: one that the page asks for waits for its end."""
        self._may_restart.clear()
        try:
            yield
        finally:
            self._may_restart.set()

    async def connect(self, route: Route) -> None:
        """Stands between the page and `POST /whep`."""
        if self._offered:
            await route.continue_()
            return
        self._offered = True
        response = await route.fetch(post_data=self._relay.offer(route.request.post_data or ""))
        await route.fulfill(response=response, body=self._relay.answer(await response.text()))

    async def patch(self, route: Route) -> None:
        """Stands between the page and its WHEP resource."""
        if route.request.method != "PATCH" or route.request.headers.get("if-match") != "*":
            await route.continue_()
        elif self.refuses_restarts:
            self.restarts.append(422)
            await route.fulfill(status=422, json={"error": "ice_restart_unsupported", "detail": ""})
        else:
            await self._may_restart.wait()
            response = await route.fetch()
            self.restarts.append(response.status)
            await route.fulfill(response=response)


@asynccontextmanager
async def movable_path(page: Page) -> AsyncIterator[MovablePath]:
    """Put `page` behind such a path; before the page is opened."""
    profile, outages, deliveries = load_profile("perfect"), Outages(), Deliveries()
    own = await asyncio.to_thread(own_addresses)
    hosts = [each for each in own if ":" not in each and each != LOOPBACK]
    relay = UdpForwarder(ClientPaths(profile, "1", outages), deliveries, [*hosts, LOOPBACK])
    path = MovablePath(relay, outages)
    try:
        await page.route(OFFERS, path.connect)
        await page.route("**/whep/*", path.patch)
        yield path
        await page.unroute_all(behavior="ignoreErrors")
    finally:
        relay.close()
        deliveries.close()
