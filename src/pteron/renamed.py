"""Former public names, which work for one release, with a warning that has the line to write.

A name that is renamed gets a line in `RENAMED`. An attribute that is renamed leaves a line in its
class: ``old = former_attribute("old", "new")``.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from importlib import import_module
from typing import Any

_MOVED = {
    "bodies": "PlanarInertia RodInertia Parameter",
    "kinematics": (
        "Architecture JointMotion architecture assembly_mode constraint_measure "
        "is_singular_everywhere joint_accelerations joint_rates joint_screws "
        "link_jacobians link_vectors position_of singular_orientations twist_jacobian "
        "velocity_of working_mode"
    ),
    "legs": "PRR PRRR PSS RPR RRR RSS RUPU Cone Drive Leg Stribeck",
    "manipulator": "Radii parameter_data parameter_units",
    "platforms": "Bar Platform",
    "reduction": "BaseParameters cheapest_parameters",
}
"""Names that stood in `pteron` itself, by the package that has them."""

RENAMED = {
    "pteron": {
        name: f"pteron.{package}.{name}"
        for package, names in _MOVED.items()
        for name in names.split()
    }
    | {"Geared": "pteron.platforms.GearedPart"},
    "pteron.platforms": {"Geared": "pteron.platforms.GearedPart"},
    "pteron.legs.kind": {
        "Quantity": "pteron.legs.kind.LegQuantity",
        "Transfer": "pteron.legs.kind.LegTransfer",
    },
    "pteron.legs.leg": {
        "Plane": "pteron.legs.leg.PlaneLocus",
        "Sphere": "pteron.legs.leg.SphereLocus",
        "Circle": "pteron.legs.leg.CircleLocus",
        "Turned": "pteron.legs.leg.AngleLocus",
    },
    "pteron.design": {
        "Quantity": "pteron.design.DesignQuantity",
        "Summary": "pteron.design.FrontReport",
        "Told": "pteron.design.ReportedDesign",
        "proved": "pteron.design.prove_design",
    },
    "pteron.export.engines": {"Motor": "pteron.export.engines.TreeMotor"},
    "pteron.identification": {
        "weighted": "pteron.identification.weighted_least_squares",
        "reduced": "pteron.identification.independent_columns",
        "stacked": "pteron.identification.stack_observations",
        "preprocessing_of": "pteron.identification.preprocessing_for_log",
        "Fit": "pteron.identification.RegressorFit",
        "Suspicion": "pteron.identification.IsolatedFault",
        "Trial": "pteron.identification.FaultIsolation",
        "playback": "pteron.playback",
    },
    "pteron.identification.excitation": {
        "Layout": "pteron.identification.excitation.MotionLayout",
    },
    "pteron.identification.faults": {
        "Suspicion": "pteron.identification.faults.IsolatedFault",
        "Trial": "pteron.identification.faults.FaultIsolation",
        "trial": "pteron.identification.faults.isolate_faults",
    },
    "pteron.identification.signals": {
        "smoothed": "pteron.identification.signals.lowpass",
        "preprocessing_of": "pteron.identification.signals.preprocessing_for_log",
        "FourierSeries": "pteron.identification.signals.FittedSeries",
    },
    "pteron.kernels": {
        "alike": "pteron.kernels.sharing_programs",
        "bare": "pteron.kernels.geometry_only",
        "bounded": "pteron.kernels.bounded_function",
        "specialised": "pteron.kernels.specialise_program",
    },
    "pteron.motion": {
        "Fit": "pteron.motion.MotorFit",
        "Place": "pteron.motion.CyclePlace",
        "least_reserve": "pteron.motion.least_margin",
        "placed": "pteron.motion.motion_at_place",
        "there_and_back": "pteron.motion.return_path",
        "along": "pteron.motion.polynomial_motion",
        "linearised": "pteron.motion.linearise",
        "Margins": "pteron.motion.LoopMargins",
        "Trial": "pteron.motion.GainTrial",
    },
    "pteron.motion.simulation": {"Law": "pteron.motion.simulation.ControlLaw"},
    "pteron.workspace": {
        "Reserve": "pteron.workspace.PoseMargins",
        "reserve": "pteron.workspace.pose_margins",
        "over_angles": "pteron.workspace.volumes_over_angles",
    },
    "pteron.identification.estimators": {
        "weighted": "pteron.identification.estimators.weighted_least_squares",
        "reduced": "pteron.identification.estimators.independent_columns",
    },
    "pteron.identification.logs": {
        "joined": "pteron.identification.logs.join_logs",
    },
    "pteron.motion.tuning": {
        "linearised": "pteron.motion.tuning.linearise",
        "Margins": "pteron.motion.tuning.LoopMargins",
        "Trial": "pteron.motion.tuning.GainTrial",
    },
    "pteron.plots": {
        "resized": "pteron.plots.resize",
    },
    "pteron.report.identification": {
        "measured": "pteron.report.identification.value_with_uncertainty",
    },
    "pteron.tables": {
        "listed": "pteron.tables.join_names",
        "in_si": "pteron.tables.convert_to_si",
    },
    "pteron.calibration": {
        "Finding": "pteron.calibration.CalibrationFinding",
        "Plane": "pteron.calibration.ReferencePlane",
    },
}
"""Former names by package, and where each of them is now."""

UNTIL = "0.4"
"""The first version without them."""


def former_name(package: str, name: str) -> Any:
    """Return the object that a package had under a former name, with a deprecation warning.

    A `DeprecationWarning` has the line to write instead; any other name is an AttributeError.

    Parameters
    ----------
    package : str
        Its ``__name__``.
    name : str
        The name that is not there.

    Examples
    --------
    >>> import warnings
    >>> from pteron.identification import signals
    >>> with warnings.catch_warnings(record=True) as told:
    ...     warnings.simplefilter("always")
    ...     series = signals.FourierSeries
    >>> print(told[0].message)
    pteron.identification.signals.FourierSeries goes with version 0.4; write
    from pteron.identification.signals import FittedSeries
    """
    present = RENAMED.get(package, {}).get(name)
    if present is None:
        raise AttributeError(f"module {package!r} has no attribute {name!r}")
    module, _, own = present.rpartition(".")
    warnings.warn(
        f"{package}.{name} goes with version {UNTIL}; write from {module} import {own}",
        DeprecationWarning,
        stacklevel=3,
    )
    try:
        return getattr(import_module(module), own)
    except AttributeError:
        return import_module(present)


def warn_former(former: str, present: str, *, depth: int = 3) -> None:
    """Issue a deprecation warning that names what to write instead of a former name."""
    text = f"{former} goes with version {UNTIL}; write {present}"
    warnings.warn(text, DeprecationWarning, stacklevel=depth)


class FormerAttribute(property):
    """A property of a class and its objects: an attribute under its former name."""

    def __get__(self, own: Any, owner: Any = None) -> Any:
        """Return the attribute of an object, or of its class, that was renamed."""
        assert self.fget is not None
        return self.fget(owner if own is None else own)


def former_attribute(former: str, present: str) -> property:
    """Return a property that gives a renamed attribute under its former name, with a warning.

    Parameters
    ----------
    former, present : str
        What the attribute was called, and what it is called now.

    Returns
    -------
    property
        It gives the attribute, with a `DeprecationWarning` that has what to write instead.
    """

    def attribute(own: Any) -> Any:
        """Return the attribute under its present name; warn that it was renamed."""
        owner = own if isinstance(own, type) else type(own)
        warn_former(f"{owner.__name__}.{former}", f".{present}", depth=4)
        return getattr(own, present)

    return FormerAttribute(attribute)


def adopt_former_methods(owner: type, **former: str) -> None:
    """Adopt methods that a user's subclass still defines under former names, with a warning.

    Parameters
    ----------
    owner : type
        The subclass, in its base's ``__init_subclass__``.
    **former : str
        Present names, by former ones.
    """
    for name in vars(owner).keys() & former.keys():
        warnings.warn(
            f"{owner.__name__}.{name} goes with version {UNTIL}; define {former[name]} instead",
            DeprecationWarning,
            stacklevel=3,
        )
        setattr(owner, former[name], vars(owner)[name])


class FormerTable:
    """A method `table` that was a property until version 0.1: it also acts as the former table."""

    def __init__(self, owner: str, frame: Any, table: Callable[[], Any]) -> None:
        self._owner, self._frame, self._table = owner, frame, table

    def __call__(self) -> Any:
        """Return the table, as the present method does."""
        return self._table()

    def _former(self) -> Any:
        """Return the table that the former property gave, with a deprecation warning."""
        warnings.warn(
            f"{self._owner}.table is a method from version {UNTIL} on; write .designs",
            DeprecationWarning,
            stacklevel=3,
        )
        return self._frame

    def __getattr__(self, name: str) -> Any:
        return getattr(self._former(), name)

    def __getitem__(self, key: Any) -> Any:
        return self._former()[key]

    def __len__(self) -> int:
        return len(self._former())
