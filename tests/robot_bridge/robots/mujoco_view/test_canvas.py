from collections.abc import Iterator

import numpy as np
import pytest

from lockstep.robot_bridge.robots.mujoco_view.graphics import choose_graphics

choose_graphics()

import mujoco  # noqa: E402
from OpenGL import GL  # noqa: E402

from lockstep.robot_bridge.robots.mujoco_view.canvas import Canvas  # noqa: E402

MODEL = """
<mujoco>
  <visual><global offwidth="160" offheight="120"/><quality offsamples="0" shadowsize="0"/></visual>
  <worldbody>
    <light pos="0 0 3"/>
    <camera name="top" pos="0 0 2"/>
    <geom group="1" type="plane" size="2 2 1" rgba="0.2 0.4 0.8 1"/>
    <geom group="1" type="box" size="0.2 0.2 0.2" pos="0.3 0.3 0.2" rgba="0.9 0.1 0.1 1"/>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def canvas() -> Iterator[Canvas]:
    made = Canvas(mujoco.MjModel.from_xml_string(MODEL), 160, 120)
    yield made
    made.close()


def draw(canvas: Canvas, width: int = 160, height: int = 120) -> np.typing.NDArray[np.uint8]:
    pixels = np.zeros((height, width, 4), np.uint8)
    canvas.draw("top", np.zeros(0), pixels)
    return pixels


def test_the_pixels_are_those_that_mujoco_itself_reads(canvas: Canvas) -> None:
    pixels = draw(canvas)
    expected = np.zeros((120, 160, 3), np.uint8)
    mujoco.mjr_readPixels(expected, None, mujoco.MjrRect(0, 0, 160, 120), canvas._context)
    assert (pixels[:, :, :3] == expected).all()
    assert expected.std() > 10


def test_the_nearer_thing_hides_the_farther_and_up_is_up(canvas: Canvas) -> None:
    """The box is up and to the right of the camera's middle; the first row is the lowest."""
    red, _, blue, _ = np.moveaxis(draw(canvas).astype(int), 2, 0)
    assert red[80, 110] > 2 * blue[80, 110]
    assert blue[40, 50] > red[40, 50] + 50
    assert draw(canvas, 80, 60).shape == (60, 80, 4)


def test_the_buffer_holds_no_stencil(canvas: Canvas) -> None:
    """What nobody uses would double the bytes of a depth."""
    assert GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER) == GL.GL_FRAMEBUFFER_COMPLETE
    kind = GL.glGetFramebufferAttachmentParameteriv(
        GL.GL_FRAMEBUFFER, GL.GL_STENCIL_ATTACHMENT, GL.GL_FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE
    )
    assert kind == GL.GL_NONE
