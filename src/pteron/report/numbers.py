"""A report's numbers, for programs: what `report.json` holds. SI units and radians."""

from __future__ import annotations

from typing import Any

from pteron.report.contents import Report

__all__ = ["numbers"]


def numbers(report: Report) -> dict[str, Any]:
    """Return the numbers of a report as plain lists, numbers and texts."""
    robot, cycle, ranges = report.robot, report.cycle, report.sliders
    orientations = report.orientations
    return {
        "robot": robot.name,
        "motion": robot.platform.motion,
        "coordinates": list(robot.coordinates),
        "elbows": [leg.elbow for leg in robot.legs],
        "gravity": list(robot.gravity),
        "home": {
            "pose": report.home.tolist(),
            "elbow_sines": report.reserve.elbow_sines.tolist(),
            "regularity": float(report.reserve.regularity),
            "slider_clearances": report.reserve.slider_clearances.tolist(),
            "reserve": float(report.reserve.smallest),
            "jacobian": report.jacobian.matrix.tolist(),
            "condition_number": report.jacobian.condition,
            "condition_radius": report.jacobian.radius,
        },
        "singular_orientations": None if orientations is None else orientations.singular.tolist(),
        "reach": {
            "volume": report.volume.volume,
            "standard_error": report.volume.standard_error,
            "samples": report.volume.count,
            "box": report.volume.box.tolist(),
        },
        "cycle": {
            "scale": cycle.scale,
            "duration": cycle.duration,
            "across": cycle.across.tolist(),
            "up": cycle.up.tolist(),
            "turn": cycle.turn,
            "time": cycle.time.tolist(),
            "pose": cycle.pose.tolist(),
            "velocity": cycle.velocity.tolist(),
            "acceleration": cycle.acceleration.tolist(),
            "forces": report.forces.tolist(),
            "peak_forces": report.peak_forces.tolist(),
            "rms_forces": report.rms_forces.tolist(),
            "peak_slider_speeds": report.peak_speeds.tolist(),
            "sliders": {
                "least": ranges.least.tolist(),
                "greatest": ranges.greatest.tolist(),
                "limits": [None if limits is None else list(limits) for limits in ranges.limits],
                "within": ranges.within.tolist(),
            },
        },
        "base_parameters": {
            "rank": report.base.rank,
            "of": len(report.base.columns),
            "names": list(report.base.names),
            "expressions": list(report.base.expressions()),
            "values": report.base.values().tolist(),
        },
        "costs": [
            {
                "form": cost.form,
                "operations": cost.operations,
                "microseconds": cost.microseconds,
                "note": cost.note,
            }
            for cost in report.costs
        ],
    }
