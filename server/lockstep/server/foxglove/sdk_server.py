"""The Foxglove SDK's WebSocket server with the topics of one robot. The SDK is an optional extra of the console."""

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

import foxglove
from foxglove import Channel, Context, Schema

from lockstep.server.recording.format.topics import Topic

__all__ = ["SdkServer"]

NAME = "Lockstep"
SDK_THREADS = "tokio"  # begin of their names, which the console's own threads have not
NICE = 10
BACKLOG = 256  # messages kept for each client, about 1 s; then the SDK drops the oldest


class SdkServer:
    """The server. `advertise` and `log` are called from one thread. It takes nothing from clients: no capability is on.

    Nothing of a client calls into Python, so the SDK has no listener: whoever subscribed and unsubscribed without end
    would keep the interpreter from the operator's commands.

    Attributes:
        port: that it listens on
    """

    def __init__(self, host: str, port: int) -> None:
        """Start to listen.

        Raises:
            RuntimeError: the address cannot be listened on.
        """
        self._context = Context()
        self._channels: dict[str, tuple[Topic, Channel]] = {}
        self._server = foxglove.start_server(
            name=NAME,
            host=host,
            port=port,
            capabilities=[],
            context=self._context,
            message_backlog_size=BACKLOG,
        )
        self.port = self._server.port

    def advertise(self, topics: Iterable[Topic]) -> None:
        """Offer exactly these topics. Channels of topics that stay are kept, with their subscriptions."""
        wanted = {topic.name: topic for topic in topics}
        for name, (topic, channel) in list(self._channels.items()):
            if wanted.get(name) != topic:
                channel.close()
                del self._channels[name]
        for name, topic in wanted.items():
            if name not in self._channels:
                schema = Schema(name=topic.schema, encoding=topic.schema_encoding, data=topic.schema_data)
                channel = Channel(name, schema=schema, message_encoding=topic.encoding, context=self._context)
                self._channels[name] = (topic, channel)

    def log(self, topic: str, data: bytes, arrived: int) -> None:
        """Send a message to whoever subscribed to `topic`; waits for nobody. `arrived`: ns since 1970."""
        found = self._channels.get(topic)
        if found is not None:
            found[1].log(data, log_time=arrived)

    def subscribed(self) -> frozenset[str]:
        """Return the topics that somebody is subscribed to. May be called from any thread."""
        return frozenset(name for name, (_, channel) in list(self._channels.items()) if channel.has_sinks())

    def yield_to_the_operator(self) -> None:
        """Lower the priority of the SDK's own threads, where the system has one for each: a viewer that floods the
        server takes the time that others leave.

        Call it again while somebody subscribes: a thread is known by its name, which it gets only when it first runs.
        """
        for task in Path("/proc/self/task").glob("*"):
            with suppress(OSError, AttributeError):  # it has just ended; or the system has no such priorities
                if (task / "comm").read_text().startswith(SDK_THREADS):
                    os.setpriority(os.PRIO_PROCESS, int(task.name), NICE)

    def stop(self) -> None:
        """Close the connections and the socket. Blocks for a moment; idempotent."""
        self._server.stop()
        for _, channel in self._channels.values():
            channel.close()
        self._channels.clear()
