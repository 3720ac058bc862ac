"""Settings of the board that several consoles behind one entry share."""

from pathlib import Path
from urllib.parse import parse_qsl, urlsplit

from pydantic import SecretStr, field_validator
from pydantic_settings import BaseSettings

__all__ = ["MAX_NAME", "BoardSettings", "board_place", "check_address"]

MAX_NAME = 40
QUERY = ("ssl_ca_certs", "ssl_certfile", "ssl_keyfile", "ssl_check_hostname", "ssl_cert_reqs")


class BoardSettings(BaseSettings):
    """Part of `Settings`."""

    board: SecretStr = SecretStr("")  # "rediss://:password@host:6379/0"; "": this console is alone
    board_file: Path | None = None  # file with the address; takes precedence
    console_name: str = ""  # name of this console in other consoles' overviews; "": the machine's name and a number

    @field_validator("board_file", mode="before")
    @classmethod
    def _no_file(cls, value: object) -> object:
        return None if value == "" else value

    @field_validator("console_name")
    @classmethod
    def _check_name(cls, value: str) -> str:
        if len(value) > MAX_NAME or not value.isprintable():
            raise ValueError(f"at most {MAX_NAME} printable characters")
        return value

    @field_validator("board")
    @classmethod
    def _check_board(cls, value: SecretStr) -> SecretStr:
        if value.get_secret_value():
            check_address(value.get_secret_value())
        return value

    @property
    def has_board(self) -> bool:
        return self.board_file is not None or bool(self.board.get_secret_value())

    @property
    def board_url(self) -> str:
        """The address with its password: never show it. "" without a board. OSError: the file cannot be read."""
        if self.board_file is not None:
            return self.board_file.read_text(errors="replace").strip()
        return self.board.get_secret_value()


def board_place(url: str) -> str:
    """Return the board's address for people and logs: without user and password."""
    parts = urlsplit(url)
    return (
        f"{parts.scheme}://{parts.path}"
        if parts.scheme == "unix"
        else f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}"
    )


def check_address(url: str) -> None:
    """Check the board's address. Raises ValueError without the address, which may hold a password."""
    try:
        parts = urlsplit(url)
        good = parts.scheme in ("redis", "rediss") and parts.hostname is not None and parts.port != 0
        good = good or (parts.scheme == "unix" and bool(parts.path))
        query = [key for key, _ in parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query))]
    except ValueError:
        good, query = False, []
    if not good:
        raise ValueError("the board is not redis://[[user]:password@]host[:port][/number], rediss://… or unix:///path")
    if not set(query) <= set(QUERY):
        raise ValueError(f"the query of the board's address may only have {', '.join(QUERY)}")
