"""Writes settings as YAML with a comment beside each value. No I/O.

Names come from other machines: a name that is more than a plain word is written in quotes, with every other character
than ASCII escaped, and a comment has no character that could end its line.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

__all__ = ["CHECK", "Section", "Value", "comment", "plain", "render"]

CHECK = "CHECK:"  # begins the comment of every guess
MAX_COMMENT = 200
NOTE_COLUMN = 44

_PLAIN = re.compile(r"^[/A-Za-z_][A-Za-z0-9_/.\-]*$")
_WORDS = {"true", "false", "yes", "no", "on", "off", "null", "y", "n"}  # what YAML 1.1 takes for something else

Plain = bool | int | float | str | Sequence["Plain"] | Mapping[str, "Plain"]


@dataclass(frozen=True)
class Value:
    value: Plain
    note: str = ""
    guess: bool = False
    off: bool = False  # stands in the file as a comment, for a person to switch on


@dataclass
class Section:
    """A map of settings, in order; comments stand above it. `items` are a list instead.

    A list whose items are all off is off itself.
    """

    head: list[str] = field(default_factory=list)
    values: dict[str, "Value | Section"] = field(default_factory=dict)
    items: list[Value] = field(default_factory=list)


def comment(text: str) -> str:
    """Return a comment of one line."""
    clean = "".join(character if character.isprintable() else "?" for character in text)
    return f"# {clean[:MAX_COMMENT]}"


def render(section: Section) -> str:
    return "\n".join(_lines(section, 0)) + "\n"


def _lines(section: Section, depth: int) -> Iterator[str]:
    indent = "  " * depth
    for key, value in section.values.items():
        if isinstance(value, Value):
            yield _noted(f"{_off(value)}{indent}{key}: {plain(value.value)}", value)
            continue
        if depth == 0:
            yield ""
        yield from (indent + comment(line) for line in value.head)
        is_off = bool(value.items) and not value.values and all(item.off for item in value.items)
        yield f"{'# ' if is_off else ''}{indent}{key}:"
        yield from _lines(value, depth + 1)
    for item in section.items:
        yield _noted(f"{_off(item)}{indent}- {plain(item.value)}", item)


def _off(value: Value) -> str:
    return "# " if value.off else ""


def _noted(line: str, value: Value) -> str:
    if not value.note:
        return line
    return f"{line:<{NOTE_COLUMN}} {comment(f'{CHECK} {value.note}' if value.guess else value.note)}"


def plain(value: Plain) -> str:
    """Return a value in YAML's flow style."""
    if isinstance(value, str):
        is_word = _PLAIN.match(value) is not None and value.lower() not in _WORDS
        return value if is_word else _quoted(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        rounded = round(value, 6)
        return str(int(rounded)) if rounded == int(rounded) else repr(rounded)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{plain(key)}: {plain(each)}" for key, each in value.items()) + "}"
    return "[" + ", ".join(map(plain, value)) + "]"


def _quoted(text: str) -> str:
    """Return text in double quotes, in ASCII (YAML 1.1, 5.6; JSON's pairs of surrogates are no YAML)."""
    return '"' + "".join(map(_escaped, text)) + '"'


def _escaped(character: str) -> str:
    code = ord(character)
    if 0x20 <= code < 0x7F and character not in '"\\':
        return character
    return f"\\x{code:02x}" if code <= 0xFF else f"\\u{code:04x}" if code <= 0xFFFF else f"\\U{code:08x}"
