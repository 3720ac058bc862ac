"""Sets up and reads MuJoCo's picture buffer directly by OpenGL, at a lower cost than MuJoCo's own calls.

Call these in the thread of the context, while it is current.
"""

from typing import Any

import mujoco  # first: it decides how OpenGL is reached
import numpy as np
import numpy.typing as npt
from OpenGL import GL

__all__ = ["drop_stencil", "read_rgba"]


def drop_stencil(context: Any, width: int, height: int) -> None:
    """Give the off-screen buffer, of that size and without multisampling, a depth buffer without a stencil.

    Only reflections need the stencil. With it a depth takes twice the bytes, which on a CPU is a tenth of a picture. If
    OpenGL does not accept that, the buffer stays as it was.
    """
    if context.offSamples or GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER) != GL.GL_FRAMEBUFFER_COMPLETE:
        return
    _attach(context, GL.GL_DEPTH_COMPONENT32F, width, height, stencil=False)
    if GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER) != GL.GL_FRAMEBUFFER_COMPLETE:
        _attach(context, GL.GL_DEPTH32F_STENCIL8, width, height, stencil=True)


def _attach(context: Any, kind: int, width: int, height: int, *, stencil: bool) -> None:
    buffer = context.offDepthStencil
    GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
    GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, kind, width, height)
    for place, attached in ((GL.GL_STENCIL_ATTACHMENT, buffer if stencil else 0), (GL.GL_DEPTH_ATTACHMENT, buffer)):
        GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, place, GL.GL_RENDERBUFFER, attached)


def read_rgba(pixels: npt.NDArray[np.uint8], viewport: mujoco.MjrRect) -> None:
    """Fill `pixels` (height, width, 4) with the rows of the picture just drawn, the lowest first.

    The framebuffer stores four bytes a pixel; the three that `mjr_readPixels` gives are packed one by one.
    """
    GL.glReadPixels(0, 0, viewport.width, viewport.height, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE, pixels)
