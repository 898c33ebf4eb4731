"""What pages are about, in words that readers search for; they stand in the index too.

The search compares a query with these entries as a whole, so that each is a word or a phrase as a
reader types it.
"""

from __future__ import annotations

from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

TOPICS: dict[str, tuple[str, ...]] = {
    "calibration-logs": ("measurements", "laser tracker", "dial gauge", "log of measurements"),
    "catalog": (
        *("catalog", "list of machines", "stewart", "five-bar", "delta robot", "tripteron"),
        *("hexapods", "wrist", "par4"),
    ),
    "compared": ("comparison", "alternatives", "other software"),
    "controllers": ("controller", "control law", "PD control", "computed torque", "gains"),
    "engines": ("MuJoCo", "Pinocchio", "URDF", "SDF", "MJCF", "Gazebo", "Drake"),
    "evidence": ("accuracy", "speed", "benchmark"),
    "from-log-to-controller": ("feed-forward", "log to controller"),
    "gymnasium": ("gymnasium", "reinforcement learning"),
    "identification": (
        *("identify", "identification", "log", "friction", "ROS", "rosbag", "TwinCAT"),
        "parameter estimation",
    ),
    "kernels": ("compile", "CasADi", "Numba", "JAX", "GPU", "CUDA"),
    "limits": ("limitations", "what it cannot do"),
    "other-tools": ("Klipper", "LinuxCNC", "FMI", "FMU", "Simulink"),
    "play": ("play a motion", "animation"),
    "plots": ("figures", "plot", "film", "video", "matplotlib"),
    "robot-file": ("robot file", "TOML", "file format", "own machine"),
    "simulation": ("simulation", "simulate", "encoder", "sensors"),
    "sizing": ("torque", "motor", "motor sizing", "motor torque", "sizing", "gear ratio"),
    "trajectories": ("trajectory", "pick and place", "cycle", "path", "time-optimal motion"),
    "verdicts": ("check", "verdict", "warnings", "thresholds"),
    "view": ("view", "viewer", "3-D view", "browser"),
    "changelog": ("new features", "versions"),
    "licence": ("licence", "license", "BSD"),
    "how-to/calibrate-a-printer": (
        *("calibrate", "calibration", "delta calibration", "printer", "bed level", "G33"),
        *("Marlin", "heights"),
    ),
    "how-to/clearances": ("collision", "clearance", "collision of links"),
    "how-to/design": ("design", "optimisation", "dimensions", "optimal design"),
    "how-to/extend": ("extend", "own index", "plug-in"),
    "how-to/from-a-task-to-a-machine": ("choose", "choose a machine", "selection", "task"),
    "how-to/maps": ("map", "maps of the workspace", "dexterity"),
    "how-to/own-leg": ("own leg", "new leg", "new mechanism"),
    "how-to/payloads-and-tools": ("payload", "tool", "gripper"),
    "how-to/platforms-that-tilt": (
        *("hexapod", "motion simulator", "motion cueing", "telescope", "tripod", "tilt"),
        *("quaternion", "Euler angles"),
    ),
    "how-to/prove-a-workspace": ("workspace", "reach", "proof", "certified workspace"),
    "how-to/singularities": ("singularity", "singularities", "singular pose"),
    "how-to/simulate-then-identify": ("simulated log",),
    "reference/index": ("units of arguments", "API", "functions"),
    "start/coming-from": ("MATLAB", "Simscape", "migration"),
    "start/first-result": ("tutorial", "quick start", "getting started", "first result"),
    "start/install": ("install", "installation", "pip", "extras", "requirements"),
    "start/tour": ("tour", "overview"),
    "theory/base-parameters": ("base parameters", "base inertial parameters"),
    "theory/conventions": ("units", "symbols", "signs", "notation"),
    "theory/direct-position": ("forward kinematics", "assembly mode"),
    "theory/dynamics": ("dynamics", "virtual work"),
    "theory/indices": ("stiffness", "condition number", "manipulability", "backlash"),
    "theory/redundancy": ("redundancy", "redundant actuation"),
}
"""Topics of each page; each topic has one page."""


class TopicsOfPages(SphinxTransform):
    """Put the topics of a page into the index."""

    default_priority = 400

    def apply(self, **kwargs: Any) -> None:
        """Add a node with the entries, which lead to the page's heading."""
        section = next(self.document.findall(nodes.section), None)
        if section is not None:
            entries = [
                ("single", topic, section["ids"][0], "main", None)
                for topic in TOPICS.get(self.env.docname, ())
            ]
            section.insert(1, addnodes.index(entries=entries))


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx."""
    app.add_transform(TopicsOfPages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
