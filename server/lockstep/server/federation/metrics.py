"""Metrics of the board. Names: docs/console-api.md."""

from prometheus_client import CollectorRegistry, Counter, Gauge

__all__ = ["BoardMetrics"]


class BoardMetrics:
    def __init__(self, registry: CollectorRegistry) -> None:
        self.up = Gauge("lockstep_board_up", "1 while the board answers", registry=registry)
        self.consoles = Gauge("lockstep_board_consoles", "Other consoles that live", registry=registry)
        self.conflicts = Gauge("lockstep_board_conflicts", "Robot names that two consoles claim", registry=registry)
        self.bad_input = Counter(
            "lockstep_board_bad_input", "What was read from the board and refused", ["reason"], registry=registry
        )
        self.failures = Counter(
            "lockstep_board_failures", "Times that the board did not do its part", ["reason"], registry=registry
        )
        self.lost = Counter("lockstep_board_lost", "What others were never told", ["what"], registry=registry)
        self.stops = Counter("lockstep_board_stops", "STOPs for other consoles' robots", ["outcome"], registry=registry)
