"""Words of another node, made fit to be shown. No I/O."""

__all__ = ["words_of"]

MOST = 200  # characters
LOOKED_AT = 4  # times as many characters, since some are left out


def words_of(text: object, most: int = MOST) -> str:
    """Return one line of printable characters, cut to `most`. Of a long text only the beginning is looked at.

    The rest would hold up the control loop: both run in one interpreter.
    """
    line = " ".join(str(text)[: LOOKED_AT * most].split())
    return "".join(filter(str.isprintable, line))[:most]
