"""Counters and gauges of the console, in a separate registry. Names: docs/console-api.md."""

import platform
from collections import Counter as Totals
from collections.abc import Sequence
from importlib.metadata import version

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector

from lockstep.server.telemetry.exposition import Exposition
from lockstep.server.telemetry.faults import Faults

__all__ = ["MAX_LIMITS", "Metrics", "certificate_end", "describe_process"]

MAX_LIMITS = 300  # names of limits that are counted apart, over all robots


def describe_process(registry: CollectorRegistry) -> None:
    """Add the running versions as a metric, for dashboards and to compare two consoles."""
    labels = {"version": version("lockstep-console"), "python": platform.python_version()}
    Gauge("lockstep_build_info", "1, with what runs as labels", list(labels), registry=registry).labels(**labels).set(1)


def certificate_end(registry: CollectorRegistry) -> Gauge:
    """Return the gauge of the certificate's end, which is set where TLS is served."""
    return Gauge(
        "lockstep_tls_certificate_end_seconds",
        "When the certificate ends, s since 1970; 0 without TLS",
        registry=registry,
    )


class Metrics:
    """All metrics of /metrics but those of the media hub, which shares the registry."""

    def __init__(self, *, process: bool = True) -> None:
        """`process`: include the metrics of the whole process."""
        self.registry = CollectorRegistry()
        self.exposition = Exposition(self.registry)
        self._robot_bad_input: Totals[str] = Totals()
        self._robot_drops: Totals[str] = Totals()
        self._audit = (0, 0)
        registry = self.registry
        if process:
            ProcessCollector(registry=registry)
            describe_process(registry)
            self.certificate_end = certificate_end(registry)
        self.bad_input = Counter(
            "lockstep_bad_input", "Input refused, by where and why", ["where", "reason"], registry=registry
        )
        self.refusals = Counter("lockstep_refusals", "Commands and requests refused", ["reason"], registry=registry)
        self.commands = Counter("lockstep_commands", "Commands from peers, by outcome", ["outcome"], registry=registry)
        self.rests = Counter("lockstep_rests", "Rests forwarded, by why", ["why"], registry=registry)
        self.stops = Counter("lockstep_stops", "Stops asked for, by where", ["where"], registry=registry)
        self.resets = Counter("lockstep_resets", "Resets forwarded", registry=registry)
        self.feedback = Counter("lockstep_feedback", "Feedback from the robot", registry=registry)
        self.dropped = Counter("lockstep_dropped", "Messages dropped by a full queue", ["queue"], registry=registry)
        self.peers = Gauge("lockstep_peers", "Peers connected", ["role"], registry=registry)
        self.peers_ended = Counter("lockstep_peers_ended", "Peers gone, by why", ["why"], registry=registry)
        self.scene_viewers = Gauge("lockstep_scene_viewers", "Viewers of the 3D scene", registry=registry)
        self.link_up = Gauge("lockstep_robot_link_up", "1 while the robot link is up", registry=registry)
        self.link_losses = Counter("lockstep_robot_link_losses", "Times the robot link went down", registry=registry)
        self.event = Gauge("lockstep_event", "Event reference", registry=registry)
        self.speed_share = Gauge("lockstep_speed_share", "Share of full speed that the cap permits", registry=registry)
        self.speed_share.set(1)
        self.limited = Counter(
            "lockstep_limited_feedback",
            "Feedback in which a limit or geofence slowed the robot",
            ["limit"],
            registry=registry,
        )
        self._limits: set[str] = set()  # names that have a counter
        self.stopped = Gauge("lockstep_stopped", "1 while the robot is stopped", registry=registry)
        self.recording_failed = Gauge(
            "lockstep_recording_failed", "1 while a recording is wanted and cannot be written", registry=registry
        )
        self.free_bytes = Gauge(
            "lockstep_recording_free_bytes", "Free space where recordings are written", registry=registry
        )
        self.links_unreadable = Gauge(
            "lockstep_links_unreadable", "1 while nobody gets in: which links are revoked is unknown", registry=registry
        )
        self.audit_failing = Gauge("lockstep_audit_failing", "1 while the log cannot be written", registry=registry)
        self.audit_lost = Counter("lockstep_audit_lost", "Audit records that were never written", registry=registry)
        self.audit_failures = Counter("lockstep_audit_failures", "Failed writes of the audit log", registry=registry)
        self.internal_errors = Counter("lockstep_internal_errors", "Our own faults", ["where"], registry=registry)
        self.faults = Faults(self.internal_errors)
        self.robot_turnaround = Histogram(
            "lockstep_robot_turnaround_seconds",
            "Command forwarded to its feedback received",
            buckets=(0.001, 0.002, 0.004, 0.006, 0.008, 0.012, 0.02, 0.05, 0.1, 0.5, 1.0),
            registry=registry,
        )

    def limits_acted(self, names: Sequence[str]) -> None:
        """Count limits by name. The robot chooses the names: those beyond `MAX_LIMITS` are counted as `other`."""
        for name in names:
            if name not in self._limits and len(self._limits) >= MAX_LIMITS:
                name = "other"
            self._limits.add(name)
            self.limited.labels(name).inc()

    def collect(self, bad_input: Totals[str], drops: Totals[str]) -> None:
        """Update the counters from the totals that the robot links keep."""
        for name, total in bad_input.items():
            self.bad_input.labels("robot", name).inc(total - self._robot_bad_input[name])
        for name, total in drops.items():
            self.dropped.labels(f"robot {name}").inc(total - self._robot_drops[name])
        self._robot_bad_input, self._robot_drops = bad_input.copy(), drops.copy()

    def collect_audit(self, lost: int, failures: int) -> None:
        """Update the counters from the totals of the audit log's writer."""
        self.audit_lost.inc(lost - self._audit[0])
        self.audit_failures.inc(failures - self._audit[1])
        self._audit = (lost, failures)
