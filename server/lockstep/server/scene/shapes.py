"""The shapes of a robot's description in viser. Runs in the scene's own thread."""

import numpy as np
import trimesh
import viser

from lockstep.protocol.description import Geom

__all__ = ["add_geom"]


def add_geom(server: viser.ViserServer, path: str, geom: Geom) -> None:
    scene, (first, second, _) = server.scene, geom.size
    red, green, blue, alpha = geom.rgba
    color = (round(red * 255), round(green * 255), round(blue * 255))
    opacity = None if alpha >= 1 else alpha
    at, wxyz = geom.position, geom.orientation
    if geom.shape == "mesh":
        vertices = np.array(geom.vertices, dtype=np.float32).reshape(-1, 3)
        faces = np.array(geom.triangles, dtype=np.uint32).reshape(-1, 3)
        scene.add_mesh_simple(
            path, vertices, faces, color=color, opacity=opacity, flat_shading=True, position=at, wxyz=wxyz
        )
    elif geom.shape == "box":
        dimensions = (2 * geom.size[0], 2 * geom.size[1], 2 * geom.size[2])
        scene.add_box(path, color=color, dimensions=dimensions, opacity=opacity, position=at, wxyz=wxyz)
    elif geom.shape == "sphere":
        scene.add_icosphere(path, radius=first, color=color, opacity=opacity, position=at, wxyz=wxyz)
    else:
        make = trimesh.creation.cylinder if geom.shape == "cylinder" else trimesh.creation.capsule
        mesh = make(radius=first, height=2 * second)
        # viser's cylinder does not stand on z as the description's does, and viser has no capsule: both go as centred
        # meshes.
        vertices = np.asarray(mesh.vertices - mesh.bounds.mean(axis=0), dtype=np.float32)
        scene.add_mesh_simple(
            path, vertices, np.asarray(mesh.faces), color=color, opacity=opacity, position=at, wxyz=wxyz
        )
