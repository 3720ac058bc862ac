"""The gate by age that the event gate is compared with: it renders what was captured at most 0.5 s ago, by clocks.

The product has no such gate. A client without a gate renders all that comes and logs how old each medium was; this
rule says which of those renderings a gate by age would have let through. It needs clocks that agree. No I/O.
"""

from collections.abc import Sequence

from lockstep.bench.experiment.judge.measures import beyond
from lockstep.bench.experiment.judge.record import ClientRecord, Gate, Rendered
from lockstep.client.media.media_gate import GateMode

__all__ = ["MAX_AGE", "client_gate", "count_by_age", "passes"]

MAX_AGE = 0.5  # s


def client_gate(gate: Gate) -> GateMode:
    """Return the gate of the client itself."""
    return "off" if gate == "age" else gate


def passes(gate: Gate, entries: Sequence[Rendered]) -> list[Rendered]:
    """Return the renderings that pass the gate, of those that passed the client's own."""
    if gate != "age":
        return list(entries)
    return [each for each in entries if each.age is not None and each.age <= MAX_AGE]


def count_by_age(client: ClientRecord, stream: str, counts: dict[str, int]) -> dict[str, int]:
    """Return the counts of a stream behind its gate; `counts`: the client's own, of which only `received` holds."""
    if client.gate != "age":
        return counts
    rendered = client.since_begin(stream)
    return {
        "received": counts["received"],
        "rendered": len(rendered),
        "discarded": counts["received"] - len(rendered),
        "held": 0,
        "violations": beyond(rendered, client.tolerance),
    }
