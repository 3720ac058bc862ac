"""Computes the cost of many observers from measured figures.

`python -m lockstep.bench.relay.capacity [COUNT …] [--gigabits 1]`.

Most figures are those that `python -m bench relay` and `python -m bench observers` measure; assumed ones are marked.
docs/scale.md has the conditions. Pure arithmetic: no process runs.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import typer

__all__ = ["MEASURED", "Figures", "Plan", "plan", "render"]

Limit = Literal["network", "processor", "none"]


@dataclass(frozen=True)
class Figures:
    """The figures of one observer and one machine. Shares of a core are in %."""

    bits_per_second: float  # to one observer: cameras, sound, feedback, headers
    packets_per_second: float  # the same
    direct_share: float  # of a core of the console, for one observer that it serves itself
    member_share: float  # of a core of the console, for the line of an observer behind a relay
    relay_microseconds: float  # of a core of a Janus, for one packet to one observer
    hop_milliseconds: float  # added by one Janus
    network_bits: float  # of each machine
    usable: float = 0.7  # of network and processor; the rest is for bursts
    console_share: float = 50.0  # of the console's one core that observers may take; the operator comes first
    relay_cores: int = 1  # of a Janus' machine
    most_members: int = 1000  # LOCKSTEP_MAX_RELAYED; and no more than 300 were tried


MEASURED = Figures(
    bits_per_second=1_750_000,
    packets_per_second=260,
    direct_share=0.42,
    member_share=0.01,  # 299 were seen to cost 2.3 % together
    relay_microseconds=20.0,  # python -m lockstep.bench.relay.packets: 19.8
    hop_milliseconds=1.0,  # assumed: below what could be measured
    network_bits=1e9,
)


@dataclass(frozen=True)
class Plan:
    observers: int
    direct: int  # number that the console could serve itself
    relays: int  # machines; 0: the console alone
    hops: int  # between the console and an observer
    per_relay: int  # observers that one Janus serves
    limit: Limit  # bound of that number
    console_bits: float  # sent by the console
    first_bits: float  # sent by the first Janus to the others
    added_milliseconds: float
    members: int  # number that the console can keep as participants behind relays


def plan(observers: int, figures: Figures) -> Plan:
    """Return the number of relays, and what bounds them."""
    budget = figures.network_bits * figures.usable
    direct = min(int(figures.console_share / figures.direct_share), int(budget / figures.bits_per_second))
    members = min(figures.most_members, int(figures.console_share / figures.member_share))
    by_network = int(budget / figures.bits_per_second)
    packets = figures.relay_cores * figures.usable * 1e6 / figures.relay_microseconds
    by_processor = int(packets / figures.packets_per_second)
    per_relay, limit = min((by_network, "network"), (by_processor, "processor"))
    if observers <= direct:
        sent = observers * figures.bits_per_second
        return Plan(observers, direct, 0, 0, per_relay, "none", sent, 0.0, 0.0, members)
    relays = math.ceil(observers / per_relay)
    if relays > 1:  # the first has to feed the others, and serves fewer observers for it
        relays = math.ceil((observers + relays - 1) / per_relay)
    hops = 1 if relays == 1 else 2
    return Plan(
        observers,
        direct,
        relays,
        hops,
        per_relay,
        "network" if limit == "network" else "processor",
        figures.bits_per_second,
        (relays - 1) * figures.bits_per_second,
        hops * figures.hop_milliseconds,
        members,
    )


def render(plans: Sequence[Plan]) -> str:
    """Return the plans as a table of Markdown."""
    head = "| observers | relays | each serves at most, by | console sends | first relay sends on | delay added | |"
    lines = [head, "|---|---|---|---|---|---|---|"]
    for each in plans:
        note = "the console alone" if each.relays == 0 else ""
        if each.relays and each.observers > each.members:
            note = f"only {each.members} of them can be participants of one console"
        bound = "–" if each.relays == 0 else f"{each.per_relay}, {each.limit}"
        lines.append(
            f"| {each.observers:,} | {each.relays} | {bound} | {each.console_bits / 1e6:.1f} Mbit/s | "
            f"{each.first_bits / 1e6:.1f} Mbit/s | {each.added_milliseconds:.1f} ms | {note} |"
        )
    return "\n".join(lines)


def main(
    counts: Annotated[list[int] | None, typer.Argument(help="Observers; 10, 1,000 and 100,000 unless given.")] = None,
    gigabits: Annotated[float, typer.Option(help="Network of each machine.")] = MEASURED.network_bits / 1e9,
    cores: Annotated[int, typer.Option(help="Cores of each relay.")] = MEASURED.relay_cores,
    megabits: Annotated[float, typer.Option(help="To one observer.")] = MEASURED.bits_per_second / 1e6,
) -> None:
    """The load of so many observers, from measured figures."""
    scale = megabits * 1e6 / MEASURED.bits_per_second
    figures = Figures(
        bits_per_second=megabits * 1e6,
        packets_per_second=MEASURED.packets_per_second * scale,
        direct_share=MEASURED.direct_share * scale,
        member_share=MEASURED.member_share,
        relay_microseconds=MEASURED.relay_microseconds,
        hop_milliseconds=MEASURED.hop_milliseconds,
        network_bits=gigabits * 1e9,
        relay_cores=cores,
    )
    typer.echo(render([plan(count, figures) for count in counts or (10, 1_000, 100_000)]))


if __name__ == "__main__":
    typer.run(main)
