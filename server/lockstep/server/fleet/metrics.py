"""The metrics of all robots in one text: the metrics of each session, with the robot's name in the label `robot`."""

from collections.abc import Iterable, Iterator

from prometheus_client import CollectorRegistry, Counter, Gauge, ProcessCollector
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector
from prometheus_client.samples import Sample

from lockstep.server.state.dependencies import Dependencies
from lockstep.server.telemetry.exposition import Exposition
from lockstep.server.telemetry.faults import Faults
from lockstep.server.telemetry.metrics import certificate_end, describe_process

__all__ = ["FleetMetrics"]


class FleetMetrics:
    """Counts what concerns no robot, and collects the metrics of the robots' sessions."""

    def __init__(self) -> None:
        self._sessions: dict[str, Dependencies] = {}
        self._own = CollectorRegistry()
        self.bad_input = Counter(
            "lockstep_bad_input", "Refused input, by place and reason", ["where", "reason"], registry=self._own
        )
        self.internal_errors = Counter(
            "lockstep_internal_errors", "Faults of the console itself", ["where"], registry=self._own
        )
        self.faults = Faults(self.internal_errors)
        self.registry = CollectorRegistry()
        self.exposition = Exposition(self.registry)
        ProcessCollector(registry=self.registry)
        describe_process(self.registry)
        self.certificate_end = certificate_end(self.registry)
        self.robots = Gauge("lockstep_fleet_robots", "Robots of this console", registry=self.registry)
        self.session_failures = Counter(
            "lockstep_fleet_session_failures",
            "Number of times that a fault ended a robot's session",
            ["robot"],
            registry=self.registry,
        )
        self.stops = Counter("lockstep_fleet_stops", "Stops of all robots together", registry=self.registry)
        self.registry.register(_Together(self._own, self._sessions))

    def watch(self, robot: str, session: Dependencies) -> None:
        self._sessions[robot] = session

    def forget(self, robot: str) -> None:
        self._sessions.pop(robot, None)

    def collect(self) -> None:
        """Update the metrics of all robots with counts that are kept elsewhere."""
        for session in self._sessions.values():
            session.collect()


class _Together(Collector):
    def __init__(self, own: CollectorRegistry, sessions: dict[str, Dependencies]) -> None:
        self._own = own
        self._sessions = sessions

    def collect(self) -> Iterator[Metric]:
        """Yield one family for each name, however many robots there are: the format allows a name only once."""
        together: dict[str, Metric] = {}
        _add(together, self._own.collect(), "")
        for robot, session in self._sessions.items():
            _add(together, session.metrics.registry.collect(), robot)
        yield from together.values()


def _add(together: dict[str, Metric], families: Iterable[Metric], robot: str) -> None:
    for family in families:
        known = together.setdefault(family.name, Metric(family.name, family.documentation, family.type, family.unit))
        for sample in family.samples:
            labels = {**sample.labels, "robot": robot} if robot else sample.labels
            known.samples.append(Sample(sample.name, labels, sample.value, sample.timestamp, sample.exemplar))
