"""The robot's bodies and cameras as entities of Rerun: a body's path leads over its parents, as its pose does."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import rerun as rr

from lockstep.protocol.description import Body, Camera, Geom, RobotDescription
from lockstep.server.scene.kinematics import Pose, joined, scene_paths

__all__ = ["BodyPaths", "log_bodies", "log_cameras"]

CAMERAS = "camera"  # and the camera's name, where its place is not known
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


class BodyPaths:
    """The entity of each body and camera of a description."""

    def __init__(self, description: RobotDescription) -> None:
        self.bodies = {name: entity(*path.strip("/").split("/")) for name, path in scene_paths(description).items()}
        places = {camera.name: camera.calibration for camera in description.cameras}
        self._carriers = {name: found.body for name, found in places.items() if found is not None}

    def camera(self, name: str) -> str:
        """Return the entity of a camera: on the body that carries it, so that its picture has a place."""
        carrier = self._carriers.get(name)
        if carrier is None or (carrier and carrier not in self.bodies):
            return entity(CAMERAS, name)
        return f"{self.bodies.get(carrier, '')}{entity(CAMERAS, name)}"


def entity(*parts: str) -> str:
    """Return an entity's path; `parts` may have any characters."""
    path: str = rr.new_entity_path(list(parts))
    return path


def log_bodies(stream: rr.RecordingStream, description: RobotDescription, paths: BodyPaths) -> None:
    """Log, as static, the shapes of all bodies, and where those without joints are."""
    for body in description.bodies:
        path = paths.bodies.get(body.name)
        if path is None:
            continue
        if not body.joints:
            stream.log(path, _transform(body.position, body.orientation), static=True)
        for kind in ("box", "sphere", "cylinder", "capsule"):
            geoms = [geom for geom in body.geoms if geom.shape == kind]
            if geoms:
                stream.log(f"{path}/{kind}", _shapes(kind, geoms), static=True)
        meshes = [geom for geom in body.geoms if geom.shape == "mesh"]
        for number, mesh in enumerate(meshes):
            stream.log(f"{path}/mesh/{number}", _transform(mesh.position, mesh.orientation), _mesh(mesh), static=True)


def log_cameras(stream: rr.RecordingStream, cameras: Iterable[Camera], paths: BodyPaths) -> None:
    """Log, as static, where cameras are and what they see."""
    for camera in cameras:
        found = camera.calibration
        if found is None:
            continue
        path = paths.camera(camera.name)
        stream.log(path, _transform(found.position, found.orientation), static=True)
        stream.log(
            path,
            rr.Pinhole(
                focal_length=(found.fx, found.fy),
                principal_point=(found.cx, found.cy),
                width=camera.width,
                height=camera.height,
                camera_xyz=rr.ViewCoordinates.RDF,
            ),
            static=True,
        )


def _transform(position: Iterable[float], orientation: Iterable[float]) -> rr.Transform3D:
    return rr.Transform3D(translation=tuple(position), quaternion=rr.Quaternion(xyzw=_xyzw(orientation)))


def _xyzw(orientation: Iterable[float]) -> tuple[float, ...]:
    w, x, y, z = orientation
    return (x, y, z, w)


def _mesh(geom: Geom) -> Any:
    return rr.Mesh3D(
        vertex_positions=np.array(geom.vertices, np.float32).reshape(-1, 3),
        triangle_indices=np.array(geom.triangles, np.uint32).reshape(-1, 3),
        albedo_factor=tuple(round(255 * min(max(value, 0.0), 1.0)) for value in geom.rgba),
    )


def _shapes(kind: str, geoms: list[Geom]) -> Any:
    common: dict[str, Any] = {
        "quaternions": [_xyzw(geom.orientation) for geom in geoms],
        "colors": [tuple(round(255 * min(max(value, 0.0), 1.0)) for value in geom.rgba) for geom in geoms],
        "fill_mode": "solid",
    }
    centers = [geom.position for geom in geoms]
    radii = [geom.size[0] for geom in geoms]
    match kind:
        case "box":
            return rr.Boxes3D(half_sizes=[geom.size for geom in geoms], centers=centers, **common)
        case "sphere":
            return rr.Ellipsoids3D(half_sizes=[(radius,) * 3 for radius in radii], centers=centers, **common)
        case "cylinder":
            lengths = [2 * geom.size[1] for geom in geoms]
            return rr.Cylinders3D(lengths=lengths, radii=radii, centers=centers, **common)
    # Rerun's capsule begins at its own place and goes along z, a description's has it in the middle.
    ends = [
        joined(Pose(geom.position, geom.orientation), Pose((0.0, 0.0, -geom.size[1]), UPRIGHT)).position
        for geom in geoms
    ]
    lengths = [2 * geom.size[1] for geom in geoms]
    return rr.Capsules3D(lengths=lengths, radii=radii, translations=ends, **common)


def moving(description: RobotDescription) -> list[Body]:
    """Return the bodies whose pose depends on joints."""
    return [body for body in description.bodies if body.joints]
