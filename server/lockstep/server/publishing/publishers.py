"""The present publishers of cameras: at most one for each camera, and one camera for each link."""

import asyncio
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

import structlog
from prometheus_client import CollectorRegistry, Counter, Gauge

from lockstep.server.audit.audit_trail import AuditTrail
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import AlreadyPublishing, CameraTaken, NotFound, ShuttingDown, TooManyRequests
from lockstep.server.media.published.published_camera import PublishedCamera
from lockstep.server.publishing.publisher import PacketOutcome, Publisher
from lockstep.server.telemetry.faults import Faults

__all__ = ["Publishers"]

log = structlog.get_logger(__name__)

MOST_CLOSING = 4  # ended publications whose connections and processes still end
WORDS = {
    "deleted": "its publisher has left",
    "link ended": "its publisher's link has ended",
    "silent": "no pictures arrived any more",
    "late": "its pictures arrived too late",
    "never connected": "its publisher never connected",
    "too much": "its publisher sent too much",
    "replaced": "its publisher restarts",
}
LinkEnded = Callable[[str, float], Awaitable[None]]  # id of the link, and the time of its expiry


class Publishers:
    """Await `run`; when it is cancelled, it ends all publications."""

    def __init__(
        self,
        cameras: Sequence[PublishedCamera],
        link_ended: LinkEnded,
        audit: AuditTrail,
        faults: Faults,
        registry: CollectorRegistry,
    ) -> None:
        """`link_ended` returns when that link is no longer valid."""
        self._cameras = {camera.spec.name: camera for camera in cameras}
        self._link_ended = link_ended
        self._audit = audit
        self._faults = faults
        self._tasks: asyncio.TaskGroup | None = None  # of the publishers, while `run` runs
        self._here: dict[Publisher, asyncio.Task[None]] = {}
        self._reserved: dict[PublishedCamera, str] = {}  # links that negotiate for a camera
        self._counted: dict[Publisher, dict[PacketOutcome, int]] = {}  # counts that the metrics have
        self._closing = False
        self._publishers = Gauge("lockstep_whip_publishers", "Connected publishers", registry=registry)
        self._ended = Counter("lockstep_whip_ended", "Publications that ended", ["why"], registry=registry)
        self._unused = Counter(
            "lockstep_whip_unused", "Packets and pictures that were unusable", ["reason"], registry=registry
        )
        self._path = Gauge(
            "lockstep_whip_path_seconds",
            "Shortest round trip to the publisher; its pictures count as older by this time",
            ["source"],
            registry=registry,
        )

    def __iter__(self) -> Iterator[Publisher]:
        return iter(list(self._here))

    @property
    def enabled(self) -> bool:
        return bool(self._cameras)

    @contextmanager
    def place(self, identity: Identity, wanted: str) -> Iterator[PublishedCamera]:
        """Keep a camera that this link may publish while it negotiates.

        If the same link publishes already, that has to have stalled; it ends, and its camera is published anew.

        Args:
            wanted: the name of a camera; "" is that of the link, or the first that nobody publishes

        Raises:
            NotFound: no such camera.
            CameraTaken: somebody else publishes it.
            AlreadyPublishing: this link publishes already.
            TooManyRequests: publications end faster than they can be closed.
            ShuttingDown: the console is shutting down.
        """
        if self._closing:
            raise ShuttingDown("the console is shutting down")
        if wanted and wanted not in self._cameras:
            raise NotFound(f"there is no camera of that name; choose one of {', '.join(self._cameras)}")
        link = identity.token_id
        if len(self._here) >= MOST_CLOSING + len(self._cameras):
            raise TooManyRequests("publications that have ended are still being closed")
        before = next((each for each in self._here if each.identity.token_id == link and not each.ended), None)
        if link in self._reserved.values() or (before is not None and not before.stalled):
            raise AlreadyPublishing("this link publishes a camera already; DELETE its session first")
        camera = self._free_camera(wanted, before)
        if before is not None:
            self.end(before, "replaced")
        self._reserved[camera] = link
        try:
            yield camera
        finally:
            del self._reserved[camera]

    def _free_camera(self, wanted: str, before: Publisher | None) -> PublishedCamera:
        """Return a free camera. `before`: the publisher whose camera is about to be free."""
        taken = {each.camera for each in self._here if each is not before and not each.ended} | self._reserved.keys()
        own = "" if before is None else before.camera.spec.name
        names = [wanted] if wanted else sorted(self._cameras, key=lambda name: name != own)
        free = next((self._cameras[name] for name in names if self._cameras[name] not in taken), None)
        if free is None:
            raise CameraTaken("this camera is published already" if wanted else "all cameras are published already")
        return free

    def admit(self, publisher: Publisher) -> None:
        """Make it the publisher of its camera. Raises ShuttingDown."""
        if self._tasks is None or self._closing:
            raise ShuttingDown("the console is shutting down")
        self._here[publisher] = self._tasks.create_task(self._run(publisher), name=f"publisher {publisher.id}")
        self._publishers.inc()
        publisher.camera.begin(publisher)
        self._audit.record("publication", publisher.actor, "begun", publisher.camera.spec.name)
        log.info("publisher joined", peer=publisher.id, name=publisher.name, source=publisher.camera.spec.name)

    def by_resource(self, resource: str) -> Publisher:
        """Return the publisher of a WHIP session. Raises NotFound if there is no such session."""
        for publisher in self._here:
            if publisher.resource == resource and not publisher.ended:
                return publisher
        raise NotFound("no such WHIP session")

    def end(self, publisher: Publisher, why: str) -> None:
        """End a publisher: its camera is free at once; its connection and process are closed soon."""
        publisher.end(why)
        self._released(publisher)

    def collect(self) -> None:
        """Update the metrics from counts that are kept elsewhere."""
        for publisher in self._here:
            self._count(publisher)
            self._path.labels(publisher.camera.spec.name).set(publisher.path_seconds or 0.0)

    async def run(self) -> None:
        """Run until cancelled."""
        async with asyncio.TaskGroup() as self._tasks:
            try:
                await asyncio.Event().wait()
            finally:
                self._closing = True
                for publisher in self._here:
                    publisher.end("shutdown")
                if self._here:
                    await asyncio.wait(self._here.values())

    def _released(self, publisher: Publisher) -> None:
        """Free its camera."""
        reason = publisher.ended.replace(" ", "_")
        publisher.camera.end(publisher, reason, WORDS.get(publisher.ended, "the connection to its publisher is lost"))

    async def _run(self, publisher: Publisher) -> None:
        """Run a publisher. Raises nothing: a fault with one publisher must not end anything else."""
        identity = publisher.identity
        try:
            try:
                await publisher.run(lambda: self._link_ended(identity.token_id, identity.expires))
            finally:
                self._left(publisher)
        except Exception as error:
            self._faults.caught("publisher", error, peer=publisher.id)
            with suppress(Exception):
                publisher.close()

    def _left(self, publisher: Publisher) -> None:
        del self._here[publisher]
        self._released(publisher)
        self._publishers.dec()
        self._ended.labels(publisher.ended).inc()
        self._count(publisher)
        del self._counted[publisher]
        self._audit.record("publication", publisher.actor, f"ended: {publisher.ended}", publisher.camera.spec.name)
        log.info("publisher left", peer=publisher.id, name=publisher.name, why=publisher.ended)

    def _count(self, publisher: Publisher) -> None:
        counts, before = publisher.counts(), self._counted.get(publisher, {})
        self._counted[publisher] = counts
        for reason, number in counts.items():
            self._unused.labels(reason).inc(number - before.get(reason, 0))
