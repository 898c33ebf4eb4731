"""Random Fourier motions, each as large as the limits allow: starts of the search for good ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pteron.arguments import expect, expect_to_fit
from pteron.errors import ModelError
from pteron.identification.excitation.fourier import FourierMotion, Space
from pteron.identification.excitation.limits import Limits
from pteron.identification.excitation.margins import check_rest, relative_margins
from pteron.identification.excitation.movement import Movement
from pteron.identification.signals.states import home
from pteron.kernels import Array
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.shapes import Seed

_FINE = 800
"""Samples in a period of the highest harmonic at which the limits are checked."""

_CLEAR = 2e-4
"""Safety margin of every limit at those samples, over its size: more than a margin can dip
between two of them."""

_COARSE = 50
"""Samples in a period of the highest harmonic while the scale is sought."""

_COARSE_CLEAR = 2e-3
"""Safety margin at the coarse samples, over a limit's size, so that the finer check seldom
fails."""

_SPREAD = 0.2
"""Distance of random centers from home, over the size of the working space."""

_SCALES = (1.0, 0.998, 0.99, 0.97, 0.9, 0.75, 0.5)
"""Scales to which a motion that violates a limit is shrunk, until it does not."""

_RESOLUTION = 0.1
"""Share of the shrinkage to which the scale is then refined."""

_HALVINGS = 12
"""Most times that a random center is moved halfway home because it does not keep the limits at
rest."""

_BISECTIONS = 14
"""Bisections for the largest scale."""

_DOUBLINGS = 12
"""Most doublings of the scale until a limit is violated."""


def random_excitation(
    robot: RobotLike,
    *,
    space: Space = "platform",
    harmonics: int = 5,
    period: float = 5.0,
    limits: Limits | None = None,
    seed: Seed | np.random.Generator = 0,
) -> FourierMotion:
    """Return a random Fourier motion about the home pose, as large as the limits allow.

    Its coefficients are normal, of equal variance in all harmonics; its center is drawn near the
    home pose. The scale about the center is found by bisection.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    space : {"platform", "joints"}
        Whose coordinates the series are of.
    harmonics : int
        How many, 1 or more.
    period : float
        The time after which the motion repeats, s.
    limits : Limits, optional
        What the motion keeps at every instant; by default `Limits.of` the machine.
    seed : int or numpy Generator
        Where the randomness comes from.

    Raises
    ------
    ModelError
        If the machine does not even keep the limits at rest; the message names the limit.
    DataError
        If a number is not what it should be.
    SingularPose
        If the machine is singular at every pose.

    Examples
    --------
    >>> import pteron
    >>> from pteron.identification.excitation import random_excitation
    >>> motion = random_excitation(pteron.load("tripteron"), harmonics=3, seed=7)
    >>> motion.coefficients.shape
    (7, 3)
    """
    robot = as_manipulator(robot)
    limits = limits or Limits.of(robot)
    expect(harmonics >= 1, "harmonics", harmonics, "1 or more")
    # Sines and cosines of all harmonics at the samples of a look.
    expect_to_fit("harmonics", harmonics, 2.0 * _FINE * harmonics * harmonics)
    rng = np.random.default_rng(seed)
    middle = np.array(home(robot))
    check_rest(robot, middle, limits)
    size = sizes(robot, "platform")
    n = robot.freedom
    offset = _SPREAD * size * rng.uniform(-1.0, 1.0, n)
    shape = rng.normal(size=(2 * harmonics, n)) * sizes(robot, space)

    def rest_motion(pose: Array) -> FourierMotion:
        """Return the motion at rest at a pose (m,): a Fourier motion without amplitudes."""
        center = (
            pose if space == "platform" else evaluate_unchecked(robot, "joint_coordinates", pose)
        )
        return FourierMotion(robot, space, period, center, *np.zeros((2, harmonics, n)))

    for _ in range(_HALVINGS):
        resting = rest_motion(middle + offset)
        if is_clear(resting, limits, 2, _COARSE_CLEAR) and (
            motion := _largest(resting, shape, limits)
        ):
            return motion
        offset = 0.5 * offset
    motion = _largest(rest_motion(middle), shape, limits)
    if motion is None:
        raise ModelError(
            f"limits: no motion of {robot.name} about its home pose keeps them all; loosen those "
            "that it barely keeps at rest"
        )
    return motion


def sizes(robot: Manipulator, space: Space) -> Array:
    """Return the size (n,) of motions in each coordinate, m and rad, before they are scaled."""
    metres = 0.25 * float(np.mean([leg.size for leg in robot.legs]))
    if space == "joints":
        return np.array([metres / leg.lever for leg in robot.legs])
    return np.where(robot.platform.angular, 1.0, metres)


def is_clear(motion: Movement, limits: Limits, samples: int, clear: float = _CLEAR) -> bool:
    """Return whether a motion keeps all limits by a relative margin at so many samples."""
    margins = relative_margins(motion, limits, np.linspace(0.0, motion.duration, samples))
    return all(float(margin.min()) >= clear for margin in margins.values())


def shrink_into_limits(motion: FourierMotion, limits: Limits) -> FourierMotion | None:
    """Return the motion shrunk about its center as little as it takes to keep the limits.

    None where no scale keeps them: the center itself is then out of a leg's reach.
    """

    def keeps_limits(scale: float) -> bool:
        """Return whether the motion, scaled about its center, keeps the limits at fine samples."""
        return is_clear(_scale(motion, scale), limits, _FINE * motion.harmonics)

    high = 1.0
    for low in _SCALES:
        if keeps_limits(low):
            break
        high = low
    else:
        return None
    while high - low > _RESOLUTION * (1.0 - low):
        low, high = _halve(keeps_limits, low, high)
    return _scale(motion, low)


def _largest(center_motion: FourierMotion, shape: Array, limits: Limits) -> FourierMotion | None:
    """Return the largest motion of a shape about a center within limits; None without room."""

    def resize(scale: float) -> FourierMotion:
        """Return the motion about its center with coefficients `scale` times the shape."""
        return center_motion.with_coefficients(np.vstack([center_motion.center, scale * shape]))

    def keeps_limits(scale: float) -> bool:
        """Return whether the shape at a scale keeps the limits by a margin at coarse samples."""
        return is_clear(resize(scale), limits, _COARSE * center_motion.harmonics, _COARSE_CLEAR)

    low, high = 0.0, 1.0
    for _ in range(_DOUBLINGS):
        if not keeps_limits(high):
            break
        high *= 2.0
    for _ in range(_BISECTIONS):
        low, high = _halve(keeps_limits, low, high)
    return shrink_into_limits(resize(low), limits) if low else None


def _halve(keeps_limits: Callable[[float], bool], low: float, high: float) -> tuple[float, float]:
    """Return the half of a bisection interval that contains the largest feasible scale."""
    middle = 0.5 * (low + high)
    return (middle, high) if keeps_limits(middle) else (low, middle)


def _scale(motion: FourierMotion, scale: float) -> FourierMotion:
    """Return a motion with its amplitudes about the mean scaled."""
    coefficients = motion.coefficients
    coefficients[1:] *= scale
    return motion.with_coefficients(coefficients)
