"""Lead-in and lead-out of a periodic motion: from rest and to rest, on its own path.

The machine goes along the closed curve of the periodic motion from the first sample to the last;
only its speed along the curve changes. Its poses are thus those of the periodic motion, and with
them all limits of the geometry are kept. The rate s' of the phase grows smoothly from 0 to 1 over
some periods. With p(s) the periodic motion, q' = p' s' and q'' = p'' s'^2 + p' s'', whose last term
is small if the lead is long. Forces of rigid bodies are the sum of those at rest times 1 - s'^2,
those of the motion times s'^2, and a part by s''. Both rest and motion keep the limits, and so does
a lead that is long enough.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pteron.errors import ModelError
from pteron.identification.excitation.fourier import FourierMotion
from pteron.identification.excitation.limits import PER_JOINT, Limits
from pteron.identification.excitation.margins import Margins, margins, relative_margins
from pteron.identification.excitation.random_motions import is_clear
from pteron.identification.signals.states import FullMotion
from pteron.kernels import Array, as_array
from pteron.manipulator import Manipulator
from pteron.motion.motion import Motion
from pteron.motion.trajectories.cycle import quintic
from pteron.result import Result

_LENGTHS = (1, 2, 4, 8)
"""Lengths of a lead in periods, tried in turn: after a whole number it ends where it began. One is
enough for every machine of the catalog."""

_PHASES = 48
"""Phases that are tried for the end of the lead-in."""

_COARSE = 40
"""Samples in a period of the highest harmonic at which leads are compared."""

_FINE = 800
"""Samples in a period of the highest harmonic at which the chosen lead is checked."""

_CLEAR = 1e-4
"""Safety margin of a limit at those samples, over its size; the periodic motion keeps twice
that."""

_TRIED = 4
"""Number of phases, the best ones of each length, that are checked."""


class Lead(NamedTuple):
    """The lead-in of a motion from rest.

    Attributes
    ----------
    duration : float
        Duration of the lead-in, and of the lead-out, s; the phase advances by half of it.
    phase : float
        Phase of the periodic motion at the end of the lead-in, s.
    """

    duration: float
    phase: float


@dataclass(frozen=True, eq=False, repr=False)
class LedMotion(Result):
    """Rest, lead-in, some periods, lead-out, rest: a motion that a controller can run.

    If the lead takes whole periods, as from `found_lead`, the motion ends in the pose in which it
    began. Position, velocity, acceleration and jerk are continuous.

    Attributes
    ----------
    motion : FourierMotion
        The periodic motion.
    lead : Lead
        The lead-in and, reversed, the lead-out.
    periods : int
        Number of whole periods between lead-in and lead-out.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> from pteron.identification.excitation import LedMotion, Limits
    >>> from pteron.identification.excitation import found_lead, random_excitation
    >>> motion = random_excitation(pteron.load("tripteron"), harmonics=2, seed=1)
    >>> led = LedMotion(motion, found_lead(motion, Limits()), periods=3)
    >>> led.start, led.end, led.duration
    (5.0, 20.0, 25.0)
    >>> ends = led.at([0.0, led.duration])
    >>> bool(abs(ends.velocity).max() < 1e-12), bool(np.ptp(ends.pose, axis=0).max() < 1e-12)
    (True, True)
    """

    motion: FourierMotion
    lead: Lead
    periods: int = 1

    @property
    def robot(self) -> Manipulator:
        """The machine."""
        return self.motion.robot

    @property
    def start(self) -> float:
        """Time at which the periodic part begins, s."""
        return self.lead.duration

    @property
    def end(self) -> float:
        """Time at which the periodic part ends, s."""
        return self.start + self.periods * self.motion.period

    @property
    def duration(self) -> float:
        """Duration from rest to rest, s."""
        return self.end + self.lead.duration

    def at(self, time: ArrayLike) -> Motion:
        """Return the platform's motion at times (T,), s; it rests before and after."""
        times = as_array(time, "time", ())
        states = self.states(times)
        return Motion(times, states.pose, states.velocity, states.acceleration)

    def states(self, times: Array) -> FullMotion:
        """Return the motion of platform and joints at times (T,), s; it rests before and after."""
        span = self.lead.duration
        (far_in, rate_in, gain_in), (far_out, rate_out, gain_out) = (
            _lead_phase(moments, span) for moments in (times, self.duration - times)
        )
        steady = np.clip(times, self.start, self.end) - self.start
        phase = self.lead.phase + far_in + steady - far_out
        return self.motion.states(phase, rate_in * rate_out, gain_in - gain_out)

    def margins(self, limits: Limits, rate: float = 1000.0) -> Margins:
        """Return its margins to limits, evaluated at ten times `rate` samples a second.

        One of its periods is evaluated, as all are alike.
        """
        once = LedMotion(self.motion, self.lead)
        return margins(once, limits, max(round(10.0 * rate * once.duration), 4000))


def found_lead(motion: FourierMotion, limits: Limits) -> Lead:
    """Return the shortest lead with which a motion keeps its limits from rest to rest.

    It takes as few periods as possible; the phase of its end is chosen for the largest margin of
    speed, acceleration and force.

    Raises
    ------
    ModelError
        If there is none, such as for a motion that does not keep the limits itself.
    """
    fine, coarse = (count * motion.harmonics for count in (_FINE, _COARSE))
    phases = [float(phase) for phase in motion.uniform_times(_PHASES)]
    for length in _LENGTHS:
        leads = [Lead(length * motion.period, phase) for phase in phases]
        step = 2 * length * coarse
        rooms = [_least_margin(LedMotion(motion, lead, 0), limits, step) for lead in leads]
        for best in np.argsort(rooms)[::-1][:_TRIED]:
            led = LedMotion(motion, leads[best], 0)
            if rooms[best] > _CLEAR and is_clear(led, limits, 2 * length * fine, _CLEAR):
                return led.lead
    raise ModelError(
        f"limits: no lead-in of up to {_LENGTHS[-1]} periods takes {motion.robot.name} from rest "
        "to the motion within them; loosen the force's limit, or make the motion smaller"
    )


def _least_margin(led: LedMotion, limits: Limits, samples: int) -> float:
    """Return the least relative margin of a motion to limits of speed, acceleration and force."""
    margins = relative_margins(led, limits, np.linspace(0.0, led.duration, samples))
    return min(float(margins[name].min()) for name in PER_JOINT if name in margins)


def _lead_phase(times: Array, span: float) -> tuple[Array, Array, Array]:
    """Return the phase relative to the lead's end, s, its rate and acceleration, 1/s, (T,) each."""
    u = np.clip(times / span, 0.0, 1.0)
    rate, gain, _ = quintic(u, 0.0, 1.0)
    return span * (u**4 * (2.5 - 3.0 * u + u**2) - 0.5), rate, gain / span
