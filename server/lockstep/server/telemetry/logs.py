"""Configures log lines on standard error, as text or JSON: standard output carries only requested output."""

import logging
import sys
from enum import StrEnum

import structlog
from structlog.types import Processor

from lockstep.server.telemetry.log_context import add_session

__all__ = ["LogFormat", "configure_logs"]


class LogFormat(StrEnum):
    TEXT = "text"
    JSON = "json"


def configure_logs(level: int = logging.INFO, form: LogFormat = LogFormat.TEXT) -> None:
    """Configure logging process-wide; call once, from an entry point."""
    rendered = _json_lines() if form is LogFormat.JSON else _text_lines()
    structlog.configure(
        processors=[
            structlog.contextvars.merge_contextvars,
            add_session,
            structlog.processors.add_log_level,
            structlog.processors.format_exc_info,
            *rendered,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(level),
        logger_factory=structlog.WriteLoggerFactory(sys.stderr),
        cache_logger_on_first_use=False,
    )
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_formatter(form, rendered))
    logging.basicConfig(handlers=[handler], level=logging.WARNING)


def _text_lines() -> list[Processor]:
    return [
        structlog.processors.TimeStamper(fmt="%Y-%m-%d %H:%M:%S"),
        structlog.processors.KeyValueRenderer(key_order=["timestamp", "level", "event"]),
    ]


def _json_lines() -> list[Processor]:
    """Return processors for JSON: `event` is the event reference, `message` says what happened."""
    return [
        structlog.processors.TimeStamper(fmt="iso", utc=True),
        structlog.processors.EventRenamer("message"),
        _name_event,
        structlog.processors.JSONRenderer(),
    ]


def _name_event(logger: object, method: str, line: structlog.types.EventDict) -> structlog.types.EventDict:
    if "s" in line:
        line["event"] = line.pop("s")
    return line


def _formatter(form: LogFormat, rendered: list[Processor]) -> logging.Formatter:
    """Return the formatter for the log records of libraries."""
    if form is LogFormat.TEXT:
        return logging.Formatter("%(levelname)s %(name)s: %(message)s")
    return structlog.stdlib.ProcessorFormatter(
        foreign_pre_chain=[
            structlog.stdlib.add_logger_name,
            structlog.stdlib.add_log_level,
            add_session,
            structlog.processors.format_exc_info,
        ],
        processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *rendered],
    )
