"""The parts that report pages are made of, as HTML text: one file that needs nothing else. No I/O but the style."""

import base64
import html
from collections.abc import Iterable, Sequence
from importlib.resources import files

__all__ = ["Cell", "number", "page", "picture", "section", "share", "table", "text"]

PAGE_STYLE = files("lockstep.server.recording.report") / "report.css"
Cell = str | int | float | None


def text(value: object) -> str:
    """Return text that stands for itself: what a file says can be anything."""
    return html.escape("".join(each if each.isprintable() else " " for each in str(value)), quote=True)


def number(value: float | None, digits: int = 1, unit: str = "") -> str:
    """Return a number in words; a dash when it is not known."""
    if value is None:
        return "–"
    return f"{value:,.{digits}f}".replace(",", "\u202f") + (f" {unit}" if unit else "")


def share(part: float, whole: float) -> str:
    return "–" if not whole else f"{100 * part / whole:.0f} %"


def table(head: Sequence[str], rows: Iterable[Sequence[Cell]], words: str = "", left: int = 1) -> str:
    """Return a table. Cells are escaped, the first one is a heading. `left`: columns that are aligned to the left."""
    lines = []
    for row in rows:
        first, *rest = ["–" if each is None or each == "" else text(each) for each in row]
        cells = "".join(
            f"<td class='left'>{each}</td>" if at < left - 1 else f"<td>{each}</td>" for at, each in enumerate(rest)
        )
        lines.append(f"<tr><th scope='row' class='left'>{first}</th>{cells}</tr>")
    heads = "".join(
        f"<th scope='col' class='left'>{text(each)}</th>" if at < left else f"<th scope='col'>{text(each)}</th>"
        for at, each in enumerate(head)
    )
    body = "".join(lines) or f"<tr><td colspan='{len(head)}' class='left quiet'>none</td></tr>"
    quiet = f"<p class='quiet'>{text(words)}</p>" if words else ""
    whole = f"<table class='plain'><thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>"
    return f"{quiet}<div class='wide' tabindex='0'>{whole}</div>"  # what scrolls can be reached with the keyboard


def section(name: str, title: str, *parts: str) -> str:
    """Return a section of finished parts."""
    return f"<section id='{text(name)}'><h2>{text(title)}</h2>{''.join(parts)}</section>"


def picture(jpeg: bytes, words: str) -> str:
    """Return a picture, inside of the page."""
    data = base64.b64encode(jpeg).decode()
    return f"<img src='data:image/jpeg;base64,{data}' alt='{text(words)}' loading='lazy'>"


def page(title: str, lead: str, sections: Iterable[str]) -> str:
    """Return the whole page; `lead` and `title` are escaped."""
    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>",
        "<meta name='viewport' content='width=device-width, initial-scale=1'>",
        "<meta name='color-scheme' content='light dark'>",
        # Nothing in it is loaded from elsewhere, and nothing in it runs, whoever made the recording.
        "<meta http-equiv='Content-Security-Policy' "
        "content=\"default-src 'none'; style-src 'unsafe-inline'; img-src data:\">",
        f"<title>Lockstep: {text(title)}</title><style>{PAGE_STYLE.read_text()}</style></head><body>",
        f"<header><h1>{text(title)}</h1><p class='lead'>{text(lead)}</p></header><main>",
        *sections,
        "</main></body></html>",
    ]
    return "".join(parts)
