"""Draw docs/engines.png: exported MJCF as MuJoCo opens it; MUJOCO_GL=egl where no screen is."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib.image
import mujoco
import numpy as np

import pteron
from pteron.export import export_mjcf

MACHINES = ("quadrupteron", "delta", "par4")
WIDTH, HEIGHT = 400, 340


def main() -> None:
    """Draw each machine at its home pose, by the camera of its file."""
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
    matplotlib.image.imsave(Path(__file__).parent / "engines.png", np.hstack(pictures))


if __name__ == "__main__":
    main()
