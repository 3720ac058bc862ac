"""Counters and gauges of the console, in a separate registry. Names: docs/console-api.md."""

import platform
from collections import Counter as Totals
from collections.abc import Sequence
from importlib.metadata import version
from typing import get_args

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector

from lockstep.protocol.actions import Status, StatusLevel
from lockstep.server.telemetry.exposition import Exposition
from lockstep.server.telemetry.faults import Faults

__all__ = ["MAX_LIMITS", "Metrics", "certificate_end", "describe_process"]

MAX_STATUS_NAMES = 64  # names of status items whose values are shown, over all bridges since the start
MAX_LIMITS = 300  # names of limits that are counted apart, over all robots


def describe_process(registry: CollectorRegistry) -> None:
    """Add the running versions as a metric, for dashboards and to compare two consoles."""
    labels = {"version": version("lockstep-console"), "python": platform.python_version()}
    Gauge(
        "lockstep_build_info", "Always 1; the labels name the versions that run", list(labels), registry=registry
    ).labels(**labels).set(1)


def certificate_end(registry: CollectorRegistry) -> Gauge:
    """Return the gauge of the certificate's end, which is set where TLS is served."""
    return Gauge(
        "lockstep_tls_certificate_end_seconds",
        "The time at which the certificate expires, in seconds since 1970; 0 without TLS",
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
            "lockstep_bad_input", "Refused input, by place and reason", ["where", "reason"], registry=registry
        )
        self.refusals = Counter("lockstep_refusals", "Refused commands and requests", ["reason"], registry=registry)
        self.commands = Counter("lockstep_commands", "Commands of peers, by outcome", ["outcome"], registry=registry)
        self.rests = Counter("lockstep_rests", "Rests sent to the robot, by reason", ["why"], registry=registry)
        self.stops = Counter("lockstep_stops", "Requests to stop, by the way they came", ["where"], registry=registry)
        self.resets = Counter("lockstep_resets", "Resets sent to the robot", registry=registry)
        self.feedback = Counter("lockstep_feedback", "Feedback messages of the robot", registry=registry)
        self.dropped = Counter("lockstep_dropped", "Messages that a full queue dropped", ["queue"], registry=registry)
        self.peers = Gauge("lockstep_peers", "Connected peers", ["role"], registry=registry)
        self.peers_ended = Counter(
            "lockstep_peers_ended", "Peers that have left, by reason", ["why"], registry=registry
        )
        self.scene_viewers = Gauge("lockstep_scene_viewers", "Viewers of the 3D scene", registry=registry)
        self.robot_link_up = Gauge("lockstep_robot_link_up", "1 if the robot link is up, else 0", registry=registry)
        self.link_losses = Counter(
            "lockstep_robot_link_losses", "Number of times that the robot link went down", registry=registry
        )
        self.event = Gauge("lockstep_event", "The number of the newest event", registry=registry)
        self.speed_share = Gauge(
            "lockstep_speed_share", "Share of the full speed that the speed cap permits, 0 to 1", registry=registry
        )
        self.speed_share.set(1)
        self.limited = Counter(
            "lockstep_limited_feedback",
            "Feedback messages in which a limit or a geofence slowed the robot",
            ["limit"],
            registry=registry,
        )
        self._limits: set[str] = set()  # names that have a counter
        self.actions = Counter(
            "lockstep_actions", "Actions of the robot, by new state and reason", ["state", "reason"], registry=registry
        )
        self.seat_changes = Counter(
            "lockstep_seat_changes",
            "Changes of the seat's holder, by the new one: human, policy, or none when it became free",
            ["kind"],
            registry=registry,
        )
        self.episodes = Counter("lockstep_episodes", "Episodes that ended", ["end"], registry=registry)
        self.status_items = Gauge(
            "lockstep_status_items", "Items of the robot's newest status, by level", ["level"], registry=registry
        )
        self.status_values = Gauge(
            "lockstep_status_value",
            "Numbers of the robot's newest status, by name of the item",
            ["item"],
            registry=registry,
        )
        self._status_names: set[str] = set()  # names that have, or had, a gauge
        self._status_shown: set[str] = set()  # those of the newest status
        self.stopped = Gauge("lockstep_stopped", "1 if the robot is stopped, else 0", registry=registry)
        self.recording_failed = Gauge(
            "lockstep_recording_failed", "1 if a recording is wanted but cannot be written, else 0", registry=registry
        )
        self.free_bytes = Gauge(
            "lockstep_recording_free_bytes", "Free space in the recordings' directory", registry=registry
        )
        self.links_unreadable = Gauge(
            "lockstep_links_unreadable",
            "1 if the console admits no one because it cannot read the list of revoked links, else 0",
            registry=registry,
        )
        self.audit_failing = Gauge(
            "lockstep_audit_failing", "1 if the audit log cannot be written, else 0", registry=registry
        )
        self.audit_lost = Counter("lockstep_audit_lost", "Audit records that are lost", registry=registry)
        self.audit_failures = Counter("lockstep_audit_failures", "Failed writes of the audit log", registry=registry)
        self.internal_errors = Counter(
            "lockstep_internal_errors", "Faults of the console itself", ["where"], registry=registry
        )
        self.faults = Faults(self.internal_errors)
        self.robot_turnaround = Histogram(
            "lockstep_robot_turnaround_seconds",
            "Time from sending a command to the robot to receiving its feedback",
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

    def status_shown(self, status: Status) -> None:
        """Show the numbers of a status, in place of the one before.

        The robot chooses the names: those beyond `MAX_STATUS_NAMES` are left out.
        """
        levels = Totals(item.level for item in status.items)
        for level in get_args(StatusLevel):
            self.status_items.labels(level).set(levels[level])
        numbers = {item.name: item.value for item in status.items if not isinstance(item.value, str)}
        for gone in self._status_shown - numbers.keys():
            self.status_values.remove(gone)
        self._status_shown &= numbers.keys()
        for name, value in numbers.items():
            if name in self._status_names or len(self._status_names) < MAX_STATUS_NAMES:
                self._status_names.add(name)
                self._status_shown.add(name)
                self.status_values.labels(name).set(value)

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
