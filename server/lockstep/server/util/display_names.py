"""Reduces what people write to what can be printed and seen. Names are also bounded in length, and made unique."""

import unicodedata
from collections.abc import Iterator, Sequence
from enum import IntEnum

__all__ = ["MAX_NAME", "clean_name", "escaped", "printable", "unique_names"]

MAX_NAME = 40  # characters
# Names for stops not made by a person (`lockstep.robot_bridge.stop.stop_latch`, `lockstep.robot_bridge.bridge`).
_OURS = frozenset({"at the robot", "robot bridge", "console", "robot"})
MAX_MARKS = 4  # on one character: more are drawn over the lines above and below

# Letters and digits that are drawn like one of a to z in most fonts, by that letter. Small letters and capitals are
# apart: Greek "Ν" is like "N", and "ν" like "v". Styled Latin letters are not here: their normal form is the letter.
_LIKE = {
    "a": "аαɑ",
    "A": "АΑᎪꓮ",
    "B": "ВΒᏴꓐ",
    "c": "сᴄ",
    "C": "СᏟꓚ",
    "d": "ԁᏧ",
    "D": "Ꭰꓓ",
    "e": "еҽ",
    "E": "ЕΕᎬꓰ",
    "F": "Ϝꓝ",
    "g": "ɡց",
    "G": "ԌᏀꓖ",
    "h": "һհᏂ",
    "H": "НΗᎻꓧ",
    "i": "іιıɩ",
    "j": "јϳ",
    "J": "ЈᎫꓙͿ",
    "k": "кκᴋ",
    "K": "КΚᏦꓗ",
    "l": "Iӏ|1ⵏІΙᏆꓲӀ",
    "L": "Ꮮꓡ",
    "M": "МΜᎷꓟϺ",
    "n": "ոп",
    "N": "Νꓠ",
    "o": "оοօσ",
    "O": "0ОΟՕꓳ",
    "p": "рρ",
    "P": "РΡᏢꓑ",
    "q": "ԛզ",
    "r": "гᴦ",
    "R": "ᎡᏒꓣ",
    "s": "ѕꜱ",
    "S": "ЅՏᏚꓢ",
    "t": "т",
    "T": "ТΤᎢꓔ",
    "u": "υսᴜ",
    "U": "ՍᑌꓴԱ",
    "v": "νѵᴠ",
    "V": "ѴᏙꓦ",
    "w": "ԝաᴡ",
    "W": "ԜᎳꓪ",
    "x": "хχ",
    "X": "ХΧꓫ",
    "y": "уүγ",
    "Y": "ΥҮꓬ",
    "z": "ᴢ",
    "Z": "ΖᏃꓜ",
}
_LATIN = str.maketrans({like: letter for letter, likes in _LIKE.items() for like in likes})

# Letters, marks and symbols of Unicode that show nothing: a name with one looks like the name without it.
_BLANK = {0x034F, 0x115F, 0x1160, 0x17B4, 0x17B5, 0x2800, 0x3164, 0xFFA0}
_BLANK |= {*range(0x180B, 0x1810), *range(0xFE00, 0xFE10), *range(0xE0100, 0xE01F0)}


def printable(text: str) -> str:
    """Return `text` in normal form C, without control, formatting, direction and invisible characters.

    Each character keeps few marks; any white space becomes one space.
    """
    return " ".join("".join(_shown(unicodedata.normalize("NFC", text))).split())


def _shown(text: str) -> Iterator[str]:
    marks = 0
    for each in text:
        if not each.isprintable():
            if each.isspace():
                marks = 0
                yield " "
            continue
        marks = marks + 1 if unicodedata.category(each) in ("Mn", "Me") else 0
        if marks <= MAX_MARKS and ord(each) not in _BLANK:
            yield each


def escaped(text: object) -> str:
    """Return `text`, a path for example, as one line that is safe to print: unprintable characters are escaped."""
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in str(text))


def clean_name(wanted: str, fallback: str) -> str:
    """Return `wanted` as others may see it; `fallback` if nothing of it is left, or it is a name of the product."""
    name = printable(wanted)[:MAX_NAME].strip()
    return name if name and _keys(name).isdisjoint(_OURS) else fallback


def unique_names(people: Sequence[tuple[str, str]]) -> list[str]:
    """Return a name for each of `people`, so that no two names are the same or look the same.

    Each is given by the name that is wanted and the one that others see now, "" for a newcomer, in order of arrival.
    Nobody takes a name from its holder, and a number behind a name stays until the name itself is free.
    """
    taken: set[str] = set()
    numbers: dict[str, int] = {}  # last one given for a name; a crowd of one name costs no more than others
    names = [""] * len(people)
    for place in sorted(range(len(people)), key=lambda each: _claim(*people[each])):
        wanted, current = people[place]
        name, keys = wanted, _keys(wanted)
        if not taken.isdisjoint(keys) and _claim(wanted, current) is _Claim.NUMBERED:
            name = current
        while not taken.isdisjoint(_keys(name)):
            number = max(numbers.get(key, 1) for key in keys) + 1
            numbers.update((key, number) for key in keys)
            name = f"{wanted} {number}"
        taken |= _keys(name)
        names[place] = name
    return names


def _key(name: str) -> str:
    """Return a key that is the same for names that differ in case, or in forms of the same characters."""
    return unicodedata.normalize("NFKC", name).casefold()


def _keys(name: str) -> set[str]:
    """Return a name's keys. Names that share one are the same or look so: "Аda" with a Cyrillic letter and "Ada"."""
    return {_key(name), _key(unicodedata.normalize("NFKC", name).translate(_LATIN))}


class _Claim(IntEnum):
    """The order in which people get a name."""

    HAS_IT = 0
    NUMBERED = 1  # has it with a number
    WANTS_IT = 2


def _claim(wanted: str, current: str) -> _Claim:
    if _key(current) == _key(wanted):
        return _Claim.HAS_IT
    name, _, number = current.rpartition(" ")
    return _Claim.NUMBERED if _key(name) == _key(wanted) and number.isdecimal() else _Claim.WANTS_IT
