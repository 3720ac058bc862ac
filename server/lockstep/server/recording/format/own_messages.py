"""Lockstep's own messages in Protocol Buffers, for what Foxglove has no schema: the wrench, and axes by name.

Their types are made here, from the fields below, so that no compiler is needed. Fields are only ever added: each file
carries the schema that it was written with.
"""

from typing import Any, Final

from foxglove_schemas_protobuf import Vector3_pb2
from google.protobuf import descriptor_pool, message_factory, timestamp_pb2
from google.protobuf.descriptor_pb2 import DescriptorProto, FieldDescriptorProto, FileDescriptorProto
from google.protobuf.message import Message

__all__ = ["AxisCommands", "AxisStates", "WrenchStamped"]

PACKAGE: Final = "lockstep"
FILE: Final = "lockstep/Measured.proto"
TIMESTAMP: Final = ".google.protobuf.Timestamp"
VECTOR: Final = ".foxglove.Vector3"
SCALARS: Final = {
    "string": FieldDescriptorProto.TYPE_STRING,
    "double": FieldDescriptorProto.TYPE_DOUBLE,
    "uint32": FieldDescriptorProto.TYPE_UINT32,
}

Fields = tuple[tuple[str, str], ...]  # name and type; their numbers count from 1. "?" marks a value that may be absent
STAMPED: Final[Fields] = (("timestamp", TIMESTAMP), ("epoch", "string"), ("event", "uint32"))
MESSAGES: Final[dict[str, Fields]] = {
    # Named as geometry_msgs/WrenchStamped: N and N m, in the frame of the sensor's body.
    "WrenchStamped": (*STAMPED, ("frame_id", "string"), ("force", VECTOR), ("torque", VECTOR)),
    # In the axis' unit. Absent: a command for a goal axis to stay, or no value is known.
    "AxisCommand": (("name", "string"), ("value", "double?"), ("unit", "string")),
    # A command that the console forwarded; `event` is the one that it is to become.
    "AxisCommands": (
        *STAMPED,
        ("axes", ".lockstep.AxisCommand*"),
        ("driver", "string"),
        ("speed", "double"),  # of the goal axes' largest speed that is used at most
    ),
    # `goal`: where a goal axis was commanded to be.
    "AxisState": (("name", "string"), ("measured", "double?"), ("goal", "double?"), ("unit", "string")),
    "AxisStates": (*STAMPED, ("axes", ".lockstep.AxisState*")),
}


def _message(name: str, fields: Fields) -> DescriptorProto:
    found = DescriptorProto(name=name)
    for number, (field, kind) in enumerate(fields, start=1):
        label = FieldDescriptorProto.LABEL_REPEATED if kind.endswith("*") else FieldDescriptorProto.LABEL_OPTIONAL
        made = found.field.add(name=field, number=number, label=label)
        base = kind.rstrip("?*")
        if base in SCALARS:
            made.type = SCALARS[base]
        else:
            made.type, made.type_name = FieldDescriptorProto.TYPE_MESSAGE, base
        if kind.endswith("?"):  # proto3 keeps presence in a oneof of its own
            made.proto3_optional, made.oneof_index = True, len(found.oneof_decl)
            found.oneof_decl.add(name=f"_{field}")
    return found


def _types() -> dict[str, Any]:
    file = FileDescriptorProto(name=FILE, package=PACKAGE, syntax="proto3")
    file.dependency.extend((timestamp_pb2.DESCRIPTOR.name, Vector3_pb2.DESCRIPTOR.name))
    file.message_type.extend(_message(name, fields) for name, fields in MESSAGES.items())
    pool = descriptor_pool.Default()  # the one that knows Foxglove's messages
    pool.AddSerializedFile(file.SerializeToString())
    found = {name: pool.FindMessageTypeByName(f"{PACKAGE}.{name}") for name in MESSAGES}
    return {name: message_factory.GetMessageClass(each) for name, each in found.items()}


_made: Final = _types()
WrenchStamped: Final[type[Message]] = _made["WrenchStamped"]
AxisCommands: Final[type[Message]] = _made["AxisCommands"]
AxisStates: Final[type[Message]] = _made["AxisStates"]
