"""Counts the ends of episodes (docs/deploy.md)."""

from lockstep.server.recording.writing.episode_written import EpisodeWritten
from lockstep.server.session_events import SessionEvents
from lockstep.server.telemetry.metrics import Metrics

__all__ = ["count_episodes"]

ENDS = ("kept", "discarded", "cut")


def count_episodes(events: SessionEvents, metrics: Metrics) -> None:
    """Count each episode of these events when it ends, by its end."""

    def count(event: EpisodeWritten) -> None:
        if event.record.kind in ENDS:
            metrics.episodes.labels(event.record.kind).inc()

    events.subscribe(EpisodeWritten, count)
