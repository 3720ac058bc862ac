"""Says that a name is not that of a setting, the same way for files and environment variables. No I/O."""

from collections.abc import Iterable
from difflib import get_close_matches

__all__ = ["not_a_setting"]


def not_a_setting(name: str, known: Iterable[str], *, within: str = "", further: str = "") -> str:
    """Return a sentence for a name that is not in `known`, with the one of them that was probably meant.

    Args:
        name: as it was given; for the likeness its case does not matter
        known: the names that there are
        within: stands in front of either name: the table of a file that both are in, as in "media."
        further: what else is to be said of it, behind "is not a setting"
    """
    name = name if name.isprintable() else ascii(name)
    names = {each.lower(): each for each in known}
    near = get_close_matches(name.lower(), names, 1)
    return f"{within}{name} is not a setting{further}{f'; did you mean {within}{names[near[0]]}?' if near else ''}"
