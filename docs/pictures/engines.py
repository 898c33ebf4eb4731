"""Draw engines.png: exported MJCF as MuJoCo opens it.

It needs OpenGL, without a screen EGL; where there is none the picture is left as it is.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib.image
import numpy as np

import pteron
from pteron.export import export_mjcf

if sys.platform == "linux" and "DISPLAY" not in os.environ:
    os.environ.setdefault("MUJOCO_GL", "egl")  # read as MuJoCo is imported

MACHINES = ("quadrupteron", "delta", "par4")
WIDTH, HEIGHT = 400, 340


def draw(docs: Path) -> None:
    """Draw each machine at its home pose, by the camera of its file."""
    try:
        import mujoco
    except (ImportError, AttributeError) as error:  # the second where there is no library
        print(f"engines.png is left as it is: no OpenGL here ({error})")
        return
    pictures = []
    for name in MACHINES:
        with TemporaryDirectory() as folder:
            (path,) = export_mjcf(pteron.load(name), folder)
            model: Any = mujoco.MjModel.from_xml_path(str(path))
        data: Any = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        with mujoco.Renderer(model, 2 * HEIGHT, 2 * WIDTH) as renderer:
            renderer.update_scene(data, "view")
            fine = renderer.render().astype(float)
        halved = fine.reshape(HEIGHT, 2, WIDTH, 2, 3).mean(axis=(1, 3))
        pictures.append(halved.round().astype(np.uint8))
    matplotlib.image.imsave(docs / "engines.png", np.hstack(pictures))
