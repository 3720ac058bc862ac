"""Manages all attached sources: stamps their media from the event clock and hands them to the media hub."""

import asyncio
import time
from collections.abc import Callable, Sequence
from typing import Protocol

from prometheus_client import CollectorRegistry, Counter, Gauge

from lockstep.protocol.console import Sources, SourceStatus
from lockstep.protocol.messages import Media
from lockstep.server.media.published.camera_spec import SCHEME
from lockstep.server.media.published.published_camera import PublishedCamera
from lockstep.server.media.sources.attached_source import AttachedSource
from lockstep.server.media.sources.source_url import SourceSpec
from lockstep.server.media.sources.source_wire import Captured

__all__ = ["EventReferences", "LocalMedia", "SourceManager"]


class EventReferences(Protocol):
    """The part of the event clock that is needed here."""

    def reference_at(self, time: float) -> int | None: ...


class LocalMedia(Protocol):
    """The part of the media hub that is needed here."""

    def stream_of(self, source: str) -> str: ...
    def feed_local(self, media: Media, now: float) -> None: ...


class SourceManager:
    """Await `run`. A medium without a known event, because it is too old or no robot was reached, is dropped."""

    def __init__(
        self,
        specs: Sequence[SourceSpec],
        clock: EventReferences,
        media: LocalMedia,
        registry: CollectorRegistry,
        tell: Callable[[Sources], None],
    ) -> None:
        self._clock = clock
        self._media = media
        self._tell = tell
        self._broken: set[str] = set()  # sources whose pictures build on a dropped one
        self._failures = Counter(
            "lockstep_media_source_failures", "Failures of attached sources", ["source", "reason"], registry=registry
        )
        self._live = Gauge("lockstep_media_source_live", "1 if the source works, else 0", ["source"], registry=registry)
        self._captured = Counter(
            "lockstep_media_source_captured",
            "Pictures and sound segments of attached sources",
            ["source"],
            registry=registry,
        )
        self._unstamped = Counter(
            "lockstep_media_source_unstamped",
            "Pictures and sound segments whose event is unknown",
            ["source"],
            registry=registry,
        )
        self._age = Gauge(
            "lockstep_media_source_age_seconds",
            "Time from capture to arrival of the newest picture or sound segment",
            ["source"],
            registry=registry,
        )
        for spec in specs:
            self._live.labels(spec.name).set(0)
        self.published = [PublishedCamera(spec, *self._told_of(spec)) for spec in specs if spec.scheme == SCHEME]
        self._read = [AttachedSource(spec, *self._told_of(spec)) for spec in specs if spec.scheme != SCHEME]

    @property
    def sources(self) -> Sequence[AttachedSource | PublishedCamera]:
        return [*self._read, *self.published]

    def _told_of(
        self, spec: SourceSpec
    ) -> tuple[Callable[[Captured], None], Callable[[], None], Callable[[str], None]]:
        """Return a source's callbacks for a captured medium, a changed state, and a failure."""
        return (
            lambda medium: self._deliver(spec, medium),
            self._changed,
            lambda reason: self._failures.labels(spec.name, reason).inc(),
        )

    async def run(self) -> None:
        """Run all sources until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            for source in self._read:
                tasks.create_task(source.run(), name=f"source {source.spec.name}")

    def state(self) -> Sources:
        """Return the state of all sources, for people."""
        return Sources(
            sources=[
                SourceStatus(
                    stream=self._media.stream_of(source.spec.name),
                    label=source.spec.label,
                    state=source.state,
                    detail=source.detail if source.state != "live" or source in self.published else "",
                )
                for source in self.sources
            ]
        )

    def _changed(self) -> None:
        for source in self.sources:
            self._live.labels(source.spec.name).set(source.state == "live")
        self._tell(self.state())

    def _deliver(self, spec: SourceSpec, medium: Captured) -> None:
        now = time.monotonic()
        self._captured.labels(spec.name).inc()
        self._age.labels(spec.name).set(now - medium.time)
        stamp = self._clock.reference_at(medium.time)
        if stamp is None:
            self._broken.add(spec.name)
            self._unstamped.labels(spec.name).inc()
            return
        if medium.keyframe:
            self._broken.discard(spec.name)
        elif spec.name in self._broken:
            return
        self._media.feed_local(
            Media(
                stream=self._media.stream_of(spec.name),
                codec=medium.codec,
                stamp=stamp,
                time=medium.time,
                payload=medium.payload,
                width=medium.width,
                height=medium.height,
                sample_rate=medium.sample_rate,
                channels=medium.channels,
                keyframe=medium.keyframe,
            ),
            now,
        )
