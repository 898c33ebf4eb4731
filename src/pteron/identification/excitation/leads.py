"""Lead-in and lead-out: an exciting motion starts from rest, and comes to rest, on its own path.

The machine goes along the closed curve of the periodic motion from the first sample to the last;
only its speed along the curve changes. Its poses are thus those of the periodic motion, and with
them all limits of the geometry are kept. The phase s starts smoothly, s' = 0 ... 1 over some
periods: then q' = p' s' and q'' = p'' s'^2 + p' s'', of which the last part is small if the lead is
long. Forces of rigid bodies are those at rest times 1 - s'^2, those of the motion times s'^2, and
what s'' adds: since the motion keeps its limits at rest too, long enough leads keep them as well.
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

_LENGTHS = (1, 2, 4, 8)
"""Periods that a lead takes, tried in turn: a whole number ends where it began. One has sufficed
for every machine of the catalog."""

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
"""Phases of a length that are checked, the best ones."""


class Lead(NamedTuple):
    """The lead-in of a motion from rest.

    Attributes
    ----------
    duration : float
        Of the lead-in and of the lead-out, s; half of it passes in phase.
    phase : float
        Of the periodic motion where the lead-in ends, s.
    """

    duration: float
    phase: float


@dataclass(frozen=True, eq=False)
class LedMotion:
    """Rest, lead-in, some periods, lead-out, rest: what a machine can be told to do.

    Where the lead takes whole periods, as those of `found_lead` do, it rests in the end in the pose
    in which it began. Position, velocity, acceleration and jerk are continuous.

    Attributes
    ----------
    motion : FourierMotion
        The periodic motion.
    lead : Lead
        How it sets off and comes to rest.
    periods : int
        How many whole periods lie between lead-in and lead-out.

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
        """When the periodic part begins, s."""
        return self.lead.duration

    @property
    def end(self) -> float:
        """When it ends, s."""
        return self.start + self.periods * self.motion.period

    @property
    def duration(self) -> float:
        """Duration from rest to rest, s."""
        return self.end + self.lead.duration

    def at(self, time: ArrayLike) -> Motion:
        """Return the platform's motion at times (T,), s; it rests before and after."""
        times = as_array(time, "time", ())
        found = self.states(times)
        return Motion(times, found.pose, found.velocity, found.acceleration)

    def states(self, times: Array) -> FullMotion:
        """Return the motion of platform and joints at times (T,), s; it rests before and after."""
        span = self.lead.duration
        (far_in, rate_in, gain_in), (far_out, rate_out, gain_out) = (
            _set_off(one, span) for one in (times, self.duration - times)
        )
        steady = np.clip(times, self.start, self.end) - self.start
        phase = self.lead.phase + far_in + steady - far_out
        return self.motion.states(phase, rate_in * rate_out, gain_in - gain_out)

    def margins(self, limits: Limits, rate: float = 1000.0) -> Margins:
        """Return its margins, at ten times as many samples a second.

        One of its periods is looked at, as they are all alike.
        """
        once = LedMotion(self.motion, self.lead)
        return margins(once, limits, max(round(10.0 * rate * once.duration), 4000))


def found_lead(motion: FourierMotion, limits: Limits) -> Lead:
    """Return the shortest lead with which a motion keeps its limits from rest to rest.

    It takes as few periods as may be; where in the period it ends is chosen for the largest margin
    of speed, acceleration and force.

    Raises
    ------
    ModelError
        If there is none, as of a motion that does not keep the limits itself.
    """
    fine, coarse = (count * motion.harmonics for count in (_FINE, _COARSE))
    phases = [float(phase) for phase in motion.uniform_times(_PHASES)]
    for length in _LENGTHS:
        leads = [Lead(length * motion.period, phase) for phase in phases]
        rooms = [_room(LedMotion(motion, lead, 0), limits, 2 * length * coarse) for lead in leads]
        for best in np.argsort(rooms)[::-1][:_TRIED]:
            led = LedMotion(motion, leads[best], 0)
            if rooms[best] > _CLEAR and is_clear(led, limits, 2 * length * fine, _CLEAR):
                return led.lead
    raise ModelError(
        f"limits: no lead-in of up to {_LENGTHS[-1]} periods takes {motion.robot.name} from rest "
        "to the motion within them; loosen the force's limit, or make the motion smaller"
    )


def _room(led: LedMotion, limits: Limits, samples: int) -> float:
    """Return the least relative margin of a movement to what depends on how fast it goes."""
    found = relative_margins(led, limits, np.linspace(0.0, led.duration, samples))
    return min(float(found[name].min()) for name in PER_JOINT if name in found)


def _set_off(times: Array, span: float) -> tuple[Array, Array, Array]:
    """Return how far the phase is from where the lead ends, s, its rate and its gain, (T,) each."""
    u = np.clip(times / span, 0.0, 1.0)
    rate, gain, _ = quintic(u, 0.0, 1.0)
    return span * (u**4 * (2.5 - 3.0 * u + u**2) - 0.5), rate, gain / span
