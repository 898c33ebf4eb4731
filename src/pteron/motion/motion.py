"""`Motion`: a motion of the platform, sampled in time, and interpolation between its samples."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from pteron.arguments import expect_to_fit
from pteron.errors import DataError, shorten
from pteron.html_table import Column, Overview
from pteron.kernels import Array, as_array
from pteron.renamed import former_attribute
from pteron.result import Result


@dataclass(frozen=True, eq=False, repr=False)
class Motion(Result):
    """A motion of the platform, sampled in time.

    Attributes
    ----------
    time : array, shape (T,)
        Times of the samples, s, ascending.
    pose, velocity, acceleration : array, shape (T, m)
        The platform's motion at these times; m, rad and s.

    Raises
    ------
    DataError
        If there is no sample, or the rows of pose, velocity and acceleration are not T.
    """

    ROWS = "time pose:1 velocity:1 acceleration:1"

    time: Array
    pose: Array
    velocity: Array
    acceleration: Array

    def __post_init__(self) -> None:
        for field in fields(Motion):
            name = field.name
            object.__setattr__(self, name, as_array(getattr(self, name), f"motion.{name}", ()))
        if self.time.ndim != 1 or not len(self.time):
            raise DataError(f"motion.time: shape {self.time.shape} given, (T,) expected, T above 0")
        rows = (len(self.time), self.pose.shape[-1] if self.pose.ndim == 2 else "m")
        for field in fields(Motion)[1:]:
            shape = getattr(self, field.name).shape
            if shape != rows:
                raise DataError(
                    f"motion.{field.name}: shape {shape} given, ({rows[0]}, {rows[1]}) expected: a "
                    "row for each time"
                )

    def __repr__(self) -> str:
        """Return the motion's duration and its counts of samples and coordinates in one line."""
        rows = f"{len(self.time)} samples of {self.pose.shape[1]} coordinates"
        return f"<{type(self).__name__}: {self.duration:.6g} s, {rows}>"

    def summary(self) -> str:
        """Return the range, speed and acceleration of each pose coordinate as lines of text."""
        return self._overview().text

    def _overview(self) -> Overview:
        """Return the range, speed and acceleration of each coordinate as a table, for notebooks."""
        columns = [Column("coordinate", "number"), Column("from", "number")]
        columns += [Column(name, "number") for name in ("to", "speed", "acceleration")]
        extremes = (
            *(self.pose.min(axis=0), self.pose.max(axis=0)),
            *(np.abs(self.velocity).max(axis=0), np.abs(self.acceleration).max(axis=0)),
        )
        rows = [(i, *map(float, row)) for i, row in enumerate(zip(*extremes, strict=True), start=1)]
        about = f"{self.duration:.6g} s, {len(self.time)} samples; what it reaches, in m, rad and s"
        return Overview(type(self).__name__, about, columns, rows)

    def expect_ascending(self) -> None:
        """Raise unless the motion has two or more times that ascend.

        Raises
        ------
        DataError
            If there are fewer than two times, or they do not ascend.
        """
        if len(self.time) < 2 or not (np.diff(self.time) > 0.0).all():
            raise DataError("motion.time: two or more times expected that ascend, in seconds")

    @property
    def duration(self) -> float:
        """Time from the first sample to the last, s."""
        return float(self.time[-1] - self.time[0])

    def at(self, time: ArrayLike) -> tuple[Array, Array, Array]:
        """Return pose, velocity and acceleration at any times, (..., m) each.

        Between two samples the pose is the polynomial of the fifth degree that has their poses,
        velocities and accelerations; before the first and after the last the platform rests there.

        Parameters
        ----------
        time : array, shape (...)
            s.

        Returns
        -------
        pose, velocity, acceleration : array, shape (..., m)
            m, rad and s.

        Examples
        --------
        >>> import numpy as np
        >>> from pteron.motion import Motion
        >>> time = np.linspace(0.0, 1.0, 11)
        >>> wave = np.sin(time), np.cos(time), -np.sin(time)
        >>> motion = Motion(time, *(part[:, None] for part in wave))
        >>> float(abs(motion.at(0.55)[0][0] - np.sin(0.55))) < 1e-9
        True
        """
        times = np.asarray(time, dtype=float)
        if len(self.time) == 1:
            zero_rates = np.zeros((*times.shape, self.pose.shape[-1]))
            return zero_rates + self.pose[0], zero_rates, zero_rates.copy()
        return interpolate((self.time, self.pose, self.velocity, self.acceleration), times)

    def repeat(self, count: int) -> Motion:
        """Return the motion repeated `count` times without a pause; it must end where it begins.

        Raises
        ------
        DataError
            If the motion does not end at the pose, and with the velocity, of its beginning.
        """
        number: object = count
        if not isinstance(number, int | np.integer) or count < 1:
            raise DataError(f"count: {shorten(number)} given, a whole number of 1 or more expected")
        ends = [np.abs(part[-1] - part[0]).max() for part in (self.pose, self.velocity)]
        if max(ends) > 1e-9:
            raise DataError(
                f"the motion ends {ends[0]:.3g} m or rad from where it begins, and its velocity "
                f"differs by {ends[1]:.3g}: it cannot be repeated"
            )
        expect_to_fit("count", count, 2.0 * count * 3.0 * self.pose.size)
        starts = self.duration * np.arange(count)
        time = np.add.outer(starts, self.time[:-1] - self.time[0]).ravel()
        parts = (
            np.concatenate([np.tile(part[:-1], (count, 1)), part[-1:]])
            for part in (self.pose, self.velocity, self.acceleration)
        )
        return Motion(np.append(time, count * self.duration), *parts)

    repeated = former_attribute("repeated", "repeat")


def interpolate_columns(time: Array, columns: Array, at: Array) -> Array:
    """Return columns (T, k) over times (T,) interpolated linearly at times (F,): (F, k)."""
    return np.column_stack([np.interp(at, time, column) for column in columns.T])


def pose_text(pose: Array) -> str:
    """Return a pose as text in brackets for messages, five digits for each number."""
    return f"[{', '.join(f'{coordinate:.5g}' for coordinate in pose + 0.0)}]"


def interpolate(
    samples: tuple[Array, Array, Array, Array], times: Array
) -> tuple[Array, Array, Array]:
    """Return pose, velocity and acceleration (..., m) at times, as `Motion.at` describes.

    `samples` are time (T,), T above 1, and pose, velocity and acceleration (T, m) there. Arrays may
    be of any library whose arrays NumPy's functions take.
    """
    time, pose, velocity, acceleration = samples
    clipped = np.clip(times, time[0], time[-1])
    k = np.clip(np.searchsorted(time, clipped, side="right") - 1, 0, len(time) - 2)
    span = (time[k + 1] - time[k])[..., None]
    u = (clipped - time[k])[..., None] / span
    p, v, a = pose[k], span * velocity[k], 0.5 * span**2 * acceleration[k]
    # The remainder at the next sample, for the terms of third to fifth degree.
    dp = pose[k + 1] - p - v - a
    dv = span * velocity[k + 1] - v - 2.0 * a
    da = 0.5 * span**2 * acceleration[k + 1] - a
    c = 10.0 * dp - 4.0 * dv + da
    d = -15.0 * dp + 7.0 * dv - 2.0 * da
    e = 6.0 * dp - 3.0 * dv + da
    poses = p + u * (v + u * (a + u * (c + u * (d + u * e))))
    rates = (v + u * (2.0 * a + u * (3.0 * c + u * (4.0 * d + u * 5.0 * e)))) / span
    rate_changes = (2.0 * a + u * (6.0 * c + u * (12.0 * d + u * 20.0 * e))) / span**2
    moving = (times == clipped)[..., None]
    return poses, np.where(moving, rates, 0.0), np.where(moving, rate_changes, 0.0)
