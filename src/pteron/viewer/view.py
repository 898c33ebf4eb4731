"""`view` serves a web page on which a machine can be moved; `Viewer` controls it from Python."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from pteron.errors import DataError, shorten
from pteron.kernels import Array
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion import Motion, Simulation, joint_guides, joint_points
from pteron.motion.enlarged_points import greatest_difference
from pteron.plots.calibration import enlargement, expect_alike
from pteron.report.typeset import template
from pteron.shapes import PoseLike
from pteron.viewer.live import Live
from pteron.viewer.server import Server
from pteron.viewer.session import Session
from pteron.viewer.state import ViewerState

STANDARD_CYCLE = "adept"
"""The name of the standard pick-and-place cycle at the command line."""


class Viewer:
    """A machine on a page that is being served, as `view` returns it.

    All tabs show the same machine, and a new tab shows it as it is.

    Attributes
    ----------
    url : str
        The page's address.
    port : int
        Its port.
    beside : tuple of Viewer
        The machines that stand beside it on the page.
    """

    def __init__(self, live: Live, host: str, port: int, beside: Sequence[Live] = ()) -> None:
        self._live = live
        handlers: dict[str, Any] = {"/": live}
        if beside:
            every = (live, *beside)
            names = [page.name for page in every]
            handlers = {"/": lambda: template("beside.html.j2", "viewer").render(names=names)}
            handlers |= {f"/{k}": page for k, page in enumerate(every, start=1)}
        self._server: Server | None = Server(host, port, handlers)
        self.port = self._server.port
        shown = "127.0.0.1" if host in ("0.0.0.0", "::", "") else host
        self.url = f"http://{f'[{shown}]' if ':' in shown else shown}:{self.port}"
        self.beside: tuple[Viewer, ...] = tuple(
            self._served_viewer(page, f"{self.url}/{k}", self.port)
            for k, page in enumerate(beside, start=2)
        )
        for page in (live, *beside):
            page.start()

    @classmethod
    def _served_viewer(cls, live: Live, url: str, port: int) -> Viewer:
        """Return the viewer of a machine whose page another viewer's server serves."""
        viewer = cls.__new__(cls)
        viewer._live, viewer._server, viewer.beside = live, None, ()
        viewer.url, viewer.port = url, port
        return viewer

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def state(self) -> ViewerState:
        """The present state."""
        return self._live.session.state

    @property
    def home(self) -> Array:
        """The pose, (m,), of the button `Home`."""
        return self._live.session.home

    @property
    def faults(self) -> tuple[str, ...]:
        """Tracebacks of unexpected failures in the viewer; the page reports them too."""
        return tuple(self._live.faults)

    def move_to(self, pose: PoseLike) -> None:
        """Move the platform to a pose (m,), m and rad, or to the nearest reachable one."""
        target = np.asarray(pose, dtype=float)
        self._live.queue_action("move_to", lambda: self._live.session.set_pose(target))

    def play(self, motion: Motion | Simulation, title: str = "motion") -> None:
        """Play a motion, or a simulation's motion, repeatedly."""
        path = motion.motion if isinstance(motion, Simulation) else motion
        self._live.queue_action("load", lambda: self._live.session.take(path, title))

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until all actions are done and sent to the page; return whether they are.

        Parameters
        ----------
        timeout : float, optional
            s.
        """
        return self._live.idle.wait(timeout)

    def close(self) -> None:
        """End the page; tabs say that the server is gone."""
        for viewer in (self, *self.beside):
            viewer._live.stop()
        if self._server is not None:
            self._server.stop()
            self._server = None


def view(
    robot: RobotLike,
    *,
    host: str = "127.0.0.1",
    port: int = 8080,
    motion: Motion | Simulation | str | Path | None = None,
    payload: float = 0.0,
    compare: RobotLike | None = None,
    enlarge: float | None = None,
    beside: Sequence[RobotLike] = (),
) -> Viewer:
    """Show a machine in the browser, where it can be moved.

    The page has the machine in space, or in its plane, with sliders for the pose and the joints,
    the choice of working and assembly mode, the drives' forces, the condition number, the distance
    to singularities and limits, slices of the workspace, and motions to play. It is served until
    the viewer is closed; see docs/view.md.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    host : str
        The address to serve it at; by default only this machine can reach it, by its own names. A
        wider one lets in all who can reach it, by any name. Other servers' pages never open it.
    port : int
        Its port, or the next one that is free; 0 is any.
    motion : Motion, Simulation, str or path, optional
        What to play: a motion, what a simulation did, the file of either or of a log, or "adept",
        the standard pick-and-place cycle.
    payload : float
        At the tool's centre point, kg.
    compare : Manipulator, name or path, optional
        A machine with the same kinds of legs, such as the drawing of one that was calibrated: it
        stands there in grey, in the same pose.
    enlarge : float, optional
        How many times its differences are enlarged; by default so that the greatest is well seen.
    beside : sequence of Manipulator, name or path, optional
        Further machines, side by side with the first; each plays the motion as it can.

    Returns
    -------
    Viewer
        Its `url` is the page's address; `close` it, or use it in a ``with`` block.

    Raises
    ------
    ModelError
        If the machine reaches no pose.
    SingularPose
        If the machine is singular at every pose.
    UnreachablePose
        If it cannot do the motion.
    DataError
        If the host, the port, the payload or a file is not as it must be.

    Examples
    --------
    >>> from pteron.viewer import view
    >>> with view("five-bar", port=0) as viewer:
    ...     viewer.move_to([0.0, 0.12])
    ...     viewer.url[:17]
    'http://127.0.0.1:'
    """
    session = _session(robot, payload, motion)
    live = Live(session, _comparison(session, compare, enlarge))
    others = [Live(_session(machine, payload, motion), None) for machine in beside]
    return Viewer(live, host, port, others)


def _session(
    robot: RobotLike, payload: float, motion: Motion | Simulation | str | Path | None
) -> Session:
    """Return the session of a machine with its payload and motion."""
    session = Session(as_manipulator(robot), payload)
    if isinstance(motion, Motion | Simulation):
        session.take(motion.motion if isinstance(motion, Simulation) else motion, "motion")
    elif motion == STANDARD_CYCLE:
        session.load_standard()
    elif motion is not None:
        session.load(str(motion), read_bytes(motion))
    return session


def _comparison(
    session: Session, compare: RobotLike | None, enlarge: float | None
) -> tuple[Manipulator, float] | None:
    """Return the machine to compare with and the factor that enlarges differences; None if none."""
    if compare is None:
        return None
    robot, other = session.state.robot, as_manipulator(compare)
    expect_alike(robot, other)
    if enlarge is None:
        points, other_points = (joint_points(each, session.home) for each in (robot, other))
        paths = (guide.path for guide in joint_guides(robot, session.home))
        size = float(np.ptp(np.vstack([*points.links, *paths]), axis=0).max())
        enlarge = enlargement(greatest_difference(points, other_points), size)
    return other, enlarge


def read_bytes(path: str | Path) -> bytes:
    """Return the bytes of a file."""
    try:
        return Path(path).read_bytes()
    except OSError as error:
        name = shorten(str(path), bare=True)
        raise DataError(f"{name}: cannot be read ({error.strerror or error})") from None
