"""Agents on real UDP sockets: the smallest shell there is."""

import asyncio
from collections.abc import Callable
from types import TracebackType
from typing import Self

from lockstep.rtc.ice.agent import Agent
from lockstep.rtc.ice.events import Event
from lockstep.rtc.sockets.udp_socket import UdpSocket

__all__ = ["AgentOnSocket"]


class AgentOnSocket:
    """Enter it where a loop runs. What is no STUN is in `data`; `until` waits for what agent and events show."""

    def __init__(self, agent: Agent, udp_socket: UdpSocket) -> None:
        self.agent = agent
        self.events: list[Event] = []
        self.data: list[bytes] = []
        self._socket = udp_socket
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._changed = asyncio.Event()

    async def __aenter__(self) -> Self:
        self._loop.add_reader(self._socket.fileno(), self._receive)
        self.drain()
        return self

    async def __aexit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self._loop.remove_reader(self._socket.fileno())
        if self._timer is not None:
            self._timer.cancel()
        self.agent.close()
        self._socket.close()

    @property
    def now(self) -> float:
        return self._loop.time()

    async def until(self, condition: Callable[[], bool], seconds: float = 20.0) -> None:
        async with asyncio.timeout(seconds):
            while not condition():
                self._changed.clear()
                await self._changed.wait()

    def drain(self) -> None:
        """After each call of the agent."""
        self._socket.queue(self.agent.datagrams_to_send())
        self._socket.flush()
        self.events += self.agent.events()
        if self._timer is not None:
            self._timer.cancel()
        due = self.agent.timer()
        self._timer = None if due is None else self._loop.call_at(due, self._handle_timer)
        self._changed.set()

    def _receive(self) -> None:
        for data, path in self._socket.receive():
            if data[0] < 4:
                self.agent.receive_datagram(data, path, self.now)
            elif self.agent.accepts(path):
                self.data.append(data)
        self.drain()

    def _handle_timer(self) -> None:
        self.agent.handle_timer(self.now)
        self.drain()
