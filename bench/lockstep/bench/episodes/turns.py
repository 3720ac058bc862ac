"""Compares who drove the rows of an episode with what the drivers themselves noted. No I/O, no clock."""

from collections.abc import Sequence
from typing import Final, Literal, NamedTuple

__all__ = ["Span", "Turn", "differences", "is_intervention"]

Kind = Literal["human", "policy"]
NEVER: Final = float("inf")


class Turn(NamedTuple):
    """One driver's part of an episode, as that driver noted it.

    Attributes:
        first_event: of the first command of its own whose answer it saw
        last_event: of the last one
    """

    driver: str
    kind: Kind
    first_event: int
    last_event: int


class Span(NamedTuple):
    """Rows of a dataset that follow each other and are of one driver, one kind, and interventions or not.

    Attributes:
        first_event: of the command that is the action of the first row, one after the row's own event
        last_event: of that of the last row
    """

    driver: str
    kind: str
    intervention: bool
    first_event: int
    last_event: int


def is_intervention(turns: Sequence[Turn], number: int) -> bool:
    """Return whether this turn is a person's after a policy's."""
    return turns[number].kind == "human" and any(each.kind == "policy" for each in turns[:number])


def differences(spans: Sequence[Span], turns: Sequence[Turn], person: str) -> list[str]:
    """Return in words where the rows are not of those who drove.

    Each turn has to be one span that lies between the events of the turns beside it: what a driver sent without seeing
    its answer may be in the rows too. `person`: began the episode, and may have rested in it before the first turn.
    """
    rows = list(spans)
    if rows and turns and rows[0].driver == person != turns[0].driver and rows[0].last_event < turns[0].first_event:
        del rows[0]
    told = ", ".join(f"{each.driver} ({each.kind}{', intervention' * each.intervention})" for each in rows)
    if [each.driver for each in rows] != [each.driver for each in turns]:
        return [f"driven by {told or 'nobody'}, not by {', '.join(each.driver for each in turns)}"]
    wrong: list[str] = []
    for number, (row, turn) in enumerate(zip(rows, turns, strict=True)):
        where = f"{turn.driver}, events {turn.first_event} to {turn.last_event}"
        after = turns[number - 1].last_event if number else -NEVER
        before = turns[number + 1].first_event if number + 1 < len(turns) else NEVER
        if (row.kind, row.intervention) != (turn.kind, is_intervention(turns, number)):
            wrong.append(f"{where}: kind {row.kind}, {'an' if row.intervention else 'no'} intervention")
        if not (after < row.first_event <= row.last_event < before):
            wrong.append(f"{where}: rows of events {row.first_event} to {row.last_event}")
        if row.last_event < turn.first_event or row.first_event > turn.last_event:
            wrong.append(f"{where}: no row of its own")
    return wrong
