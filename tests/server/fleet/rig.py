"""A real fleet's console on real bridges with planar robots."""

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from tempfile import TemporaryDirectory
from typing import Any

import httpx
from aiortc import RTCPeerConnection

from lockstep.protocol.console import Role, Seat, SeatRequest
from lockstep.server.fleet.fleet import Fleet
from lockstep.server.fleet.fleet_app import create_fleet_app
from lockstep.server.fleet.robots import robot_settings
from lockstep.server.http.transport.serve import bind, running
from lockstep.server.http.transport.uvicorn_http_limits import bounded_by
from lockstep.server.settings import Settings
from lockstep.server.state.dependencies import Dependencies
from lockstep.server.state.persistent_state import ConsoleState, open_state
from tests.server.rig import PATIENCE, Rig, TestPeer, running_bridge

__all__ = ["FleetRig", "drive_once", "running_fleet", "running_fleet_rig"]


@dataclass
class FleetRig:
    """A running console with several robots."""

    url: str
    fleet: Fleet
    state: ConsoleState
    http: httpx.AsyncClient

    def token(self, role: Role, *robots: str) -> dict[str, str]:
        return {"Authorization": f"Bearer {self.state.access.issue(role, role, robots)}"}

    def session(self, name: str) -> Dependencies:
        found = self.fleet.sessions[name].dependencies
        assert found is not None
        return found

    async def tiles(self, *robots: str) -> dict[str, dict[str, Any]]:
        """What the overview of an observer's link for these robots shows, by name."""
        answer = await self.http.get("/api/fleet", headers=self.token("observer", *robots))
        assert answer.status_code == 200, answer.text
        return {tile["name"]: tile for tile in answer.json()["robots"]}

    async def all_reached(self) -> None:
        async with asyncio.timeout(PATIENCE):
            for name in self.fleet.sessions:
                await self.session(name).console.robot.reached.wait()

    async def join(self, name: str, peer: TestPeer, headers: dict[str, str], query: str = "") -> None:
        """Connect it to that robot, with open data channels."""
        here = self.session(name)
        async with httpx.AsyncClient(base_url=self.url, trust_env=False, timeout=PATIENCE) as http:
            rig = Rig(self.url, self.fleet.sessions[name].app, here.access, http)
            await peer.join(rig, headers, ("control", "session", "stop"), f"/robots/{name}/whep{query}")

    @asynccontextmanager
    async def peer(self, name: str, role: Role, *, view: str = "") -> AsyncIterator[TestPeer]:
        """A peer of that robot."""
        peer = TestPeer()
        try:
            await self.join(name, peer, self.token(role), f"?view={view}" if view else "")
            yield peer
        finally:
            await peer.close()

    async def offer(self, name: str, headers: dict[str, str], query: str = "") -> httpx.Response:
        """What the console answers to an offer of data channels."""
        pc = RTCPeerConnection()
        try:
            pc.createDataChannel("session")
            await pc.setLocalDescription(await pc.createOffer())
            return await self.http.post(
                f"/robots/{name}/whep{query}",
                content=pc.localDescription.sdp,
                headers={**headers, "Content-Type": "application/sdp"},
            )
        finally:
            await pc.close()


@asynccontextmanager
async def running_fleet(ports: Mapping[str, int], **settings: Any) -> AsyncIterator[FleetRig]:
    """A console for the bridges at these ports, by the robots' names."""
    with TemporaryDirectory() as directory:
        robots = tuple(f"{name}=tcp://127.0.0.1:{port}" for name, port in ports.items())
        given: dict[str, Any] = {"robots": robots, "port": 0, "scene": False, "state_dir": directory}
        wanted = Settings(**(given | settings))
        state = open_state(wanted)
        app = create_fleet_app(wanted, robot_settings(wanted), state)
        listener = bind(wanted.host, wanted.port)
        url = f"http://127.0.0.1:{listener.getsockname()[1]}"
        try:
            async with (
                running(app, listener, http=bounded_by(wanted, app)),
                httpx.AsyncClient(base_url=url, trust_env=False, timeout=PATIENCE) as http,
            ):
                yield FleetRig(url, app.state.fleet, state, http)
        finally:
            listener.close()


@asynccontextmanager
async def running_fleet_rig(*names: str, **settings: Any) -> AsyncIterator[FleetRig]:
    """Bridges and console, connected."""
    async with AsyncExitStack() as stack:
        ports = {name: (await stack.enter_async_context(running_bridge())).address[1] for name in names}
        rig = await stack.enter_async_context(running_fleet(ports, **settings))
        await rig.all_reached()
        yield rig


async def drive_once(peer: TestPeer) -> int:
    """Take the seat, and one event that moves nothing; its number."""
    peer.send("session", SeatRequest())
    await peer.until(lambda each: isinstance(each, Seat) and each.holder != "")
    now = await peer.feedback()
    return (await peer.drive([0.0] * len(now.axes))).event
