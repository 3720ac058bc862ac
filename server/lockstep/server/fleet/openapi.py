"""The OpenAPI document of a fleet: its own operations, and those of each robot below /robots/{robot}."""

from typing import Any

from lockstep.server.errors import BadParameter, LinkOtherRobot, NotAllowed, NotFound, RobotFailed
from lockstep.server.fleet.audit_routes import MAX_RECORDS, FleetAudit
from lockstep.server.fleet.fleet_routes import FleetHealth, FleetInfo, FleetReadiness, FleetStop
from lockstep.server.http.robot_paths import ROBOTS
from lockstep.server.routes.openapi import OPERATIONS, WITH_JSON, Operation, Parameter, openapi_document
from lockstep.server.routes.stop_body import StopRequest
from lockstep.server.util.robot_names import NAME_PATTERN

__all__ = ["FLEET_OPERATIONS", "fleet_openapi"]

ROBOT = Parameter("robot", "path", {"type": "string", "pattern": f"^{NAME_PATTERN}$"}, required=True)
STOP = "/api/stop"  # is taken, and kept, also while the robot's session has failed
LIMIT = Parameter("limit", "query", {"type": "integer", "minimum": 1, "maximum": MAX_RECORDS})

FLEET_OPERATIONS: tuple[Operation, ...] = (
    Operation("get", "/api/fleet", "All robots that the link admits to.", 200, FleetInfo),
    Operation(
        *("post", "/api/fleet/stop", "Stop all robots, latched. Every role may do this.", 200, FleetStop),
        errors=(LinkOtherRobot, *WITH_JSON),
        body=StopRequest,
    ),
    Operation(
        *("get", "/api/fleet/audit", "The newest records of all robots' audits. Supervisors.", 200, FleetAudit),
        errors=(NotAllowed, BadParameter),
        parameters=(LIMIT,),
    ),
    Operation("get", "/healthz", "Whether the console runs, and reaches its robots.", 200, FleetHealth, token=False),
    Operation("get", "/readyz", "Whether the console serves.", 200, FleetReadiness, token=False),
    Operation("get", "/metrics", "Prometheus; the label robot names one.", 200, "text/plain", token=False),
)


def fleet_openapi() -> dict[str, Any]:
    """Return the OpenAPI 3.1 document, in JSON's types alone."""
    of_robots = [
        each._replace(
            path=f"{ROBOTS}/{{robot}}{each.path}",
            errors=(*each.errors, NotFound, *(() if each.path == STOP else (RobotFailed,))),
            parameters=(ROBOT, *each.parameters),
        )
        for each in OPERATIONS
    ]
    return openapi_document((*FLEET_OPERATIONS, *of_robots))
