"""Write the JSON Schemas of the console's and the robot link's messages and of recordings to docs/schemas/.

The page's TypeScript types (web/src/protocol/wire.ts) and its table of spans (ways.ts beside it) are made from the
first by `npm run generate` in web/.
With `--check` nothing is written and a difference ends with status 1.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, get_args

import msgspec

from lockstep.protocol.console import ClientMessage, ServerMessage
from lockstep.protocol.messages import LinkMessageOnWire
from lockstep.protocol.traces.trace import COMMAND_WAY, PICTURE_WAY, Span
from lockstep.server.fleet.openapi import fleet_openapi
from lockstep.server.recording.format.records import OWN_RECORDS
from lockstep.server.routes.openapi import openapi_document

SCHEMAS = Path(__file__).resolve().parent.parent / "docs" / "schemas"


def _reachable(union: Any) -> set[str]:
    _, components = msgspec.json.schema_components(get_args(union), ref_template="#/$defs/{name}")
    return set(components)


def _schema(
    title: str,
    unions: dict[str, Any],
    received_only: frozenset[str] = frozenset(),
    ways: Mapping[str, Sequence[Span]] = MappingProxyType({}),
) -> str:
    """One schema whose `$defs` hold every message, and each union by its name.

    `ways`: by name of a struct with spans, its fields in the order of the way, and on whose clock each is measured.

    `received_only` names the structs that only ever arrive at a reader of this schema. Lockstep writes every field
    of those, so all are required.
    """
    members = [message for union in unions.values() for message in get_args(union)]
    _, components = msgspec.json.schema_components(members, ref_template="#/$defs/{name}")
    for name in received_only:
        components[name]["required"] = list(components[name].get("properties", {}))
    for name, way in ways.items():
        components[name]["x-way"] = [span._asdict() for span in way]
    for name, union in unions.items():
        components[name] = {"oneOf": [{"$ref": f"#/$defs/{member.__name__}"} for member in get_args(union)]}
    document = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": title,
        "oneOf": [{"$ref": f"#/$defs/{name}"} for name in unions],
        "$defs": dict(sorted(components.items())),
    }
    return json.dumps(document, indent=2) + "\n"


def _recording_schema() -> str:
    """Lockstep's own records, as properties by the names of MCAP's schemas."""
    _, components = msgspec.json.schema_components(OWN_RECORDS.values(), ref_template="#/$defs/{name}")
    document = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Lockstep recordings",
        "properties": {name: {"$ref": f"#/$defs/{kind.__name__}"} for name, kind in OWN_RECORDS.items()},
        "$defs": dict(sorted(components.items())),
    }
    return json.dumps(document, indent=2) + "\n"


def generated() -> dict[Path, str]:
    """Every generated file with the text it should have."""
    console = {"ClientMessage": ClientMessage, "ServerMessage": ServerMessage}
    ways = {"PictureSpans": PICTURE_WAY, "CommandSpans": COMMAND_WAY}
    received = frozenset(_reachable(ServerMessage) - _reachable(ClientMessage))
    return {
        SCHEMAS / "console.schema.json": _schema("Lockstep console messages", console, received, ways),
        SCHEMAS / "console-openapi.json": json.dumps(openapi_document(), indent=2) + "\n",
        SCHEMAS / "fleet-openapi.json": json.dumps(fleet_openapi(), indent=2) + "\n",
        SCHEMAS / "robot-link.schema.json": _schema("Lockstep robot link messages", {"LinkMessage": LinkMessageOnWire}),
        SCHEMAS / "recording.schema.json": _recording_schema(),
    }


def main(arguments: list[str]) -> int:
    stale = [path for path, text in generated().items() if not path.exists() or path.read_text() != text]
    if "--check" in arguments:
        for path in stale:
            print(f"{path.name} is not what the messages say: run scripts/generate_wire.py", file=sys.stderr)
        return 1 if stale else 0
    for path in stale:
        path.write_text(generated()[path])
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
