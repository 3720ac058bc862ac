"""The box around a mesh that a URDF names, and what is not read."""

import os
import struct
from pathlib import Path

import pytest

from lockstep.robot_bridge.robots.ros2.discovery.meshes import mesh_box, mesh_file
from lockstep.robot_bridge.robots.ros2.discovery.urdf import Box

CORNERS = ((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 4.0, -6.0))
BOX = Box((1.0, 2.0, -3.0), (1.0, 2.0, 3.0))


def binary(corners: tuple[tuple[float, ...], ...] = CORNERS, head: bytes = b"solid by some program") -> bytes:
    numbers = [0.0] * 3 + [value for corner in corners for value in corner]
    return head.ljust(80) + struct.pack("<I", 1) + struct.pack("<12fH", *numbers, 0)


def text() -> bytes:
    corners = "".join(f"  vertex {x} {y} {z}\n" for x, y, z in CORNERS)
    return f"solid x\nfacet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\nendsolid x\n".encode()


@pytest.mark.parametrize("data", [binary(), text()])
def test_a_mesh_in_a_file_has_a_box(data: bytes, tmp_path: Path) -> None:
    file = tmp_path / "link.STL"
    file.write_bytes(data)
    assert mesh_box(f"file://{file}") == BOX


def test_a_mesh_of_a_package_is_looked_for_where_packages_are(tmp_path: Path) -> None:
    file = tmp_path / "second" / "share" / "tug" / "meshes" / "link.stl"
    file.parent.mkdir(parents=True)
    file.write_bytes(binary())
    places = {"AMENT_PREFIX_PATH": f"{tmp_path / 'first'}:{tmp_path / 'second'}"}
    assert mesh_file("package://tug/meshes/link.stl", places) == file
    assert mesh_file("package://tug/meshes/other.stl", places) is None
    assert mesh_file("package://tug/meshes/link.stl", {}) is None


@pytest.mark.parametrize(
    "data", [b"", b"no mesh", binary()[:-1], binary(((float("nan"),) * 3,) * 3), b"solid\nvertex a b c\n"]
)
def test_what_is_no_mesh_has_no_box(data: bytes, tmp_path: Path) -> None:
    file = tmp_path / "link.stl"
    file.write_bytes(data)
    assert mesh_box(f"file://{file}") is None


def test_only_regular_files_of_meshes_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "secret").write_bytes(binary())
    (tmp_path / "link.stl").write_bytes(binary())
    for uri in (
        f"file://{tmp_path}/pipe.stl",
        f"file://{tmp_path}/secret",
        f"file://{tmp_path}/x/../link.stl",
        f"http://localhost{tmp_path}/link.stl",
        "",
    ):
        assert mesh_box(uri) is None
