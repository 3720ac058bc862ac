"""Asks the person at the terminal what a graph does not say."""

import math
from collections.abc import Sequence
from typing import Protocol

import typer

__all__ = ["Ask", "AskAtTerminal", "TakeGuesses"]


class Ask(Protocol):
    """Each method returns the answer, or the default where nobody is asked.

    Attributes:
        answers: whether a person answers; otherwise what is returned is a guess
    """

    answers: bool

    def choose(self, question: str, options: Sequence[str], default: int = 0) -> int: ...

    def number(self, question: str, default: float, low: float, high: float) -> float: ...

    def agree(self, question: str, default: bool) -> bool: ...


class TakeGuesses:
    answers = False

    def choose(self, question: str, options: Sequence[str], default: int = 0) -> int:
        return default

    def number(self, question: str, default: float, low: float, high: float) -> float:
        return default

    def agree(self, question: str, default: bool) -> bool:
        return default


class AskAtTerminal:
    answers = True

    def choose(self, question: str, options: Sequence[str], default: int = 0) -> int:
        typer.echo(question)
        for number, option in enumerate(options, 1):
            typer.echo(f"  {number}  {option}")
        return int(self.number("Number", default + 1, 1, len(options))) - 1

    def number(self, question: str, default: float, low: float, high: float) -> float:
        while True:
            value: float = typer.prompt(question, default=default, type=float)
            if math.isfinite(value) and low <= value <= high:
                return value
            typer.echo(f"It must be from {low:g} to {high:g}.")

    def agree(self, question: str, default: bool) -> bool:
        return typer.confirm(question, default=default)
