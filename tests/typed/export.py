"""Code for a controller, and a compiled function."""

from pathlib import Path
from tempfile import TemporaryDirectory

import pteron
from pteron.export import export_mjcf

with TemporaryDirectory() as folder:
    files: list[Path] = pteron.export_c("delta", ["inverse_kinematics"], Path(folder) / "c")
    files += export_mjcf("delta", Path(folder) / "mjcf")
    sizes = {path.name: path.stat().st_size for path in files}
print(len(sizes) == len(files), all(sizes.values()))
