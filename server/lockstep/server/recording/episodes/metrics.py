"""Counts the ends of episodes (docs/deploy.md)."""

from lockstep.server.recording.writing.episode_written import EpisodeEnded
from lockstep.server.session_events import SessionEvents
from lockstep.server.telemetry.metrics import Metrics

__all__ = ["count_episodes"]


def count_episodes(events: SessionEvents, metrics: Metrics) -> None:
    """Count each episode of these events when it has ended, by its end."""
    events.subscribe(EpisodeEnded, lambda event: metrics.episodes.labels(event.end).inc())
