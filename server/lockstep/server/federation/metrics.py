"""Metrics of the board. Names: docs/console-api.md."""

from prometheus_client import CollectorRegistry, Counter, Gauge

__all__ = ["BoardMetrics"]


class BoardMetrics:
    def __init__(self, registry: CollectorRegistry) -> None:
        self.up = Gauge("lockstep_board_up", "1 if the shared board answers, else 0", registry=registry)
        self.consoles = Gauge("lockstep_board_consoles", "Other consoles that are alive", registry=registry)
        self.conflicts = Gauge("lockstep_board_conflicts", "Robot names that two consoles claim", registry=registry)
        self.bad_input = Counter(
            "lockstep_board_bad_input", "Entries of the board that were refused", ["reason"], registry=registry
        )
        self.failures = Counter(
            "lockstep_board_failures", "Number of requests to the board that failed", ["reason"], registry=registry
        )
        self.lost = Counter(
            "lockstep_board_lost", "Messages to other consoles that were lost", ["what"], registry=registry
        )
        self.stops = Counter(
            "lockstep_board_stops", "STOPs for robots of other consoles", ["outcome"], registry=registry
        )
