from pathlib import Path

import numpy as np
import pytest

from lockstep.robot_bridge.robots.so101.simple_mesh import HEADER, TRIANGLE, read_simple_mesh


def write(path: Path, corners: object) -> Path:
    triangles = np.zeros(len(np.asarray(corners)), TRIANGLE)
    triangles["corners"] = corners
    path.write_bytes(bytes(80) + len(triangles).to_bytes(4, "little") + triangles.tobytes())
    return path


def grid(count: int) -> object:
    """A square of 1 m in 2 x count x count triangles."""
    places = np.arange(count) / count
    triangles = []
    for x in places:
        for y in places:
            a, b, c, d = ((x, y, 0), (x + 1 / count, y, 0), (x + 1 / count, y + 1 / count, 0), (x, y + 1 / count, 0))
            triangles += [(a, b, c), (a, c, d)]
    return np.array(triangles)


def test_triangles_within_a_cell_vanish_and_the_shape_stays(tmp_path: Path) -> None:
    mesh = read_simple_mesh(write(tmp_path / "square.stl", grid(40)), 0.1)
    assert len(mesh.faces) < 400
    assert mesh.vertices.min(axis=0) == pytest.approx([0.04, 0.04, 0.0], abs=0.05)
    assert mesh.vertices.max(axis=0) == pytest.approx([0.96, 0.96, 0.0], abs=0.05)
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    assert (normals[:, 2] > 0).all()  # none is turned over
    assert normals[:, 2].sum() / 2 == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize(
    "content", [b"", bytes(HEADER), b"solid ascii\nfacet", bytes(80) + (9).to_bytes(4, "little") + bytes(50)]
)
def test_what_is_not_binary_stl_is_an_error(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bad.stl"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="binary STL"):
        read_simple_mesh(path, 0.1)


@pytest.mark.parametrize(("corner", "fault"), [(float("nan"), "not finite"), (1e9, "larger")])
def test_a_corner_that_is_nowhere_or_far_away_is_an_error(tmp_path: Path, corner: float, fault: str) -> None:
    path = write(tmp_path / "far.stl", [((0, 0, 0), (1, 0, 0), (corner, 1, 0))])
    with pytest.raises(ValueError, match=fault):
        read_simple_mesh(path, 0.1)
