"""What people call themselves: only what can be printed, of bounded length, and never two the same."""

from collections.abc import Iterable

__all__ = ["MAX_NAME", "clean_name", "printable", "unique_name"]

MAX_NAME = 40  # characters


def printable(text: str) -> str:
    """`text` without control, formatting and direction characters; any white space becomes one space."""
    return " ".join("".join(each if each.isprintable() else " " if each.isspace() else "" for each in text).split())


def clean_name(wanted: str, fallback: str) -> str:
    """`wanted` as others may see it; `fallback` when nothing of it is left."""
    return printable(wanted)[:MAX_NAME].strip() or fallback


def unique_name(wanted: str, taken: Iterable[str]) -> str:
    """`wanted`, with a number behind it while others have the same."""
    others, number, name = {each.casefold() for each in taken}, 1, wanted
    while name.casefold() in others:
        number += 1
        name = f"{wanted} {number}"
    return name
