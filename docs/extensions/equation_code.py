"""The place in the code of each numbered equation of the theory; a test checks both ends.

The paper's are found by their labels in the source (`paper_labels`); ours are listed here.
"""

from __future__ import annotations

import importlib
from typing import Any

from paper_labels import labels

_E, _L, _R = "pteron.equations", "pteron.legs", "pteron.reduction"


def _documented(file: str, name: str) -> str | None:
    """Return the dotted name of the nearest public function or class around a label, if any."""
    module = "pteron." + file.removesuffix(".py").replace("/", ".")
    parts = name.split(".")
    while parts:
        thing: Any = importlib.import_module(module)
        for part in parts:
            thing = getattr(thing, part, None)
        if callable(thing) and not any(part.startswith("_") for part in parts):
            return ".".join((module, *parts))
        parts.pop()
    return None


def _of_the_paper() -> dict[str, tuple[str, ...]]:
    """Return the places of equations 1 to 16."""
    places: dict[str, dict[str, None]] = {str(number): {} for number in range(1, 17)}
    for label in labels():
        place = _documented(label.file, label.name)
        if label.number.startswith("Eq. ") and place:
            places[label.number[5:-1]][place] = None
    return {number: tuple(found) for number, found in places.items()}


CODE: dict[str, tuple[str, ...]] = {
    **_of_the_paper(),
    # Ours: kinematics.
    "K1": (f"{_L}.circles.squared_reach",),
    "K2": (f"{_L}.prrr.PRRREquations",),
    "K3": ("pteron.platforms.turning.Turning.motion",),
    "K4": (f"{_L}.prrr.PRRREquations", f"{_E}.kinematics.link_turning"),
    "K5": (f"{_L}.prrr.PRRREquations", f"{_E}.kinematics.link_turning"),
    # Virtual work, and the Lagrangian form.
    "V1": ("pteron.bodies.motion.needed_wrench", "pteron.bodies.motion.wrench_matrix"),
    "V2": (
        *(f"{_E}.lagrangian.mass_matrix", f"{_E}.lagrangian.coriolis_matrix"),
        f"{_E}.lagrangian.forward_dynamics",
    ),
    # Base parameters.
    "B1": ("pteron.base_parameters", "pteron.base_regressor"),
    "B2": (f"{_R}.transfers.transfers", f"{_L}.prrr.PRRR.transfers"),
    "B3": (f"{_R}.transfers.transfers",),
    "B4": ("pteron.bodies.inertia.SpatialInertia.shares_of_point",),
    # The family of legs.
    "F1": (f"{_L}.slide.SlideEquations.state",),
    "F2": (f"{_L}.crank.CrankEquations.state",),
    "F3": (f"{_L}.slide.SlideEquations.state", f"{_L}.crank.CrankEquations.state"),
    "F4": ("pteron.closures.closure.Closure.forces", "pteron.closures.closure.plain_rows"),
    "F5": (f"{_L}.slide.SlideEquations.needs", f"{_L}.crank.CrankEquations.needs"),
    "F6": (f"{_E}.virtual_work.needed_forces",),
    "F7": ("pteron.platforms.turning.Turning.motion", "pteron.platforms.sliding.Sliding.motion"),
    # Platforms that tilt.
    "O1": ("pteron.platforms.tilting.rotation",),
    "O2": ("pteron.platforms.tilting.Tilting.motion",),
    "O3": (f"{_L}.ups.UPSEquations.motion",),
    "O4": (f"{_L}.ups.UPSEquations.needs",),
    "O5": ("pteron.bodies.spatial.needed_twist_wrench",),
    "O6": ("pteron.platforms.tripod.Tripod.motion",),
    # Five freedoms and spherical legs.
    "W1": ("pteron.platforms.tilting.FiveFreedoms.motion", "pteron.legs.jets.platform_vector"),
    "W2": (f"{_L}.prur.PRUREquations.motion",),
    "W3": (
        *(f"{_L}.universal_link.UniversalLinkEquations.link_across",),
        f"{_L}.prur.AcrossEquations.links",
    ),
    "W4": (f"{_L}.prur.AlongEquations.links",),
    "W5": (f"{_L}.universal_link.UniversalLinkEquations.force",),
    "W5a": (f"{_L}.universal_link.UniversalLinkEquations.held_closure",),
    "W6": (f"{_L}.srrr.SRRREquations.locus",),
    "W7": (f"{_L}.srrr.SRRREquations.motion",),
    # Direct position.
    "P1": ("pteron.closures.constant_rows.ConstantRows.poses",),
    "P2": (f"{_E}.closing.closure_rows",),
    "P3": (f"{_E}.closing.closure_rows", "pteron.kinematics.assembly.every_pose"),
    "P4": (f"{_E}.closing.newton_step", f"{_E}.closing.direct_step"),
    "P5": (f"{_E}.pose_paths.advance_path", "pteron.kinematics.tilting_assembly.tilting_poses"),
    # Singularities.
    "T1": ("pteron.closures.closure.Closure.measure",),
    "T2": ("pteron.closures.constant_rows.ConstantRows", "pteron.kinematics.singular_orientations"),
    "T3": (f"{_E}.constraints.constraint_rows", f"{_E}.constraints.constraint_measure"),
    # Clearances.
    "C1": (f"{_E}.clearance.squared_distance",),
    "R1": (f"{_E}.virtual_work.generalized_forces",),
    "R2": ("pteron.closures.closure.Closure.forces",),
    "R3": (f"{_E}.virtual_work.share_forces",),
    "C2": (f"{_E}.clearance.squared_distance",),
    # Indices, reactions, stiffness, errors.
    "G1": (f"{_E}.indices.homogeneous", f"{_E}.singular_values.singular_values"),
    "G2": (f"{_E}.indices.point_jacobian",),
    "G3": ("pteron.indices.conditioning.global_conditioning",),
    "G4": (f"{_E}.indices.pressure_angle", f"{_E}.indices.output_pressure_angle"),
    "G5": (f"{_E}.reactions.equilibrium", "pteron.indices.joint_reactions.reactions"),
    "G6": ("pteron.indices.compliance.stiffness",),
    "G7": (
        *("pteron.indices.sensitivities.geometric_sensitivities",),
        "pteron.indices.pose_errors.pose_error",
    ),
    # Drives, control, identification.
    "D1": (f"{_E}.drives.drive_forces", f"{_E}.drives.friction"),
    "D2": (f"{_E}.drives.drive_accelerations",),
    "D3": (f"{_E}.laws.adaptive", f"{_E}.mixed.mixed_forces"),
    "I1": ("pteron.identification.observations_of",),
    "I2": ("pteron.identification.weighted_least_squares",),
}
