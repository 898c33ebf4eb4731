"""`view` serves a web page on which a machine can be moved; `Viewer` controls it from Python."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Self

import numpy as np

from pteron.errors import DataError, PteronError, shown
from pteron.kernels import Array
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion import Motion, Simulation, joint_guides, joint_points
from pteron.motion.enlarged_points import greatest_difference
from pteron.plots.calibration import enlargement, expect_alike
from pteron.shapes import PoseLike
from pteron.viewer.handle import Handle
from pteron.viewer.panel import Panel
from pteron.viewer.readings import Readings, readings
from pteron.viewer.scene import Scene
from pteron.viewer.server import serve, stop
from pteron.viewer.session import Session
from pteron.viewer.slices import choices, slice_map, slice_meshes
from pteron.viewer.solids import machine_size
from pteron.viewer.state import ViewerState, stopped

_FRAME = 1.0 / 30.0
"""Time between two pictures of a motion, s."""

_PANEL = 0.1
"""Time between two readings of a motion, s: nobody reads faster, and browsers are busy."""

_SETTLED = 0.25
"""Time without an action after which results that take longer are shown, s."""

STANDARD_CYCLE = "adept"
"""The name of the standard pick-and-place cycle at the command line."""


class Viewer:
    """A machine on a page that is being served; `view` makes it.

    All tabs show the same machine, and a new tab shows it as it is.

    Attributes
    ----------
    url : str
        The page's address.
    """

    def __init__(
        self,
        session: Session,
        host: str,
        port: int,
        compared: tuple[Manipulator, float] | None = None,
    ) -> None:
        self._session, self._compared = session, compared
        self._server = serve(host, port, session.state.robot.name)
        shown = "127.0.0.1" if host in ("0.0.0.0", "::", "") else host
        address = f"[{shown}]" if ":" in shown else shown
        self.url = f"http://{address}:{self._server.get_port()}"
        self._actions: dict[str, Callable[[], object]] = {}
        self._wake = threading.Condition()
        self._closed = False
        self._idle = threading.Event()
        self._faults: list[str] = []
        gui, scene = self._server.gui, self._server.scene
        gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        scene.configure_environment_map(None)
        scene.configure_default_lights(cast_shadow=False)
        scene.add_light_ambient("/light", intensity=0.7)
        gui.main_panel.dock_right()
        self._panel = Panel(self._server, session, self.do)
        self._looks: tuple[object, ...] = ()
        self._sliced: tuple[object, ...] = ()
        self._scaled: tuple[object, ...] = ()
        self._set_up()
        self._show(settled=True)
        self._thread = threading.Thread(target=self._run, name="pteron viewer", daemon=True)
        self._thread.start()

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
    def port(self) -> int:
        """The port of the page."""
        return int(self._server.get_port())

    @property
    def state(self) -> ViewerState:
        """The state that is shown."""
        return self._session.state

    @property
    def faults(self) -> tuple[str, ...]:
        """Tracebacks of unexpected failures in the viewer; the page reports them too."""
        return tuple(self._faults)

    def move_to(self, pose: PoseLike) -> None:
        """Move the platform to a pose (m,), m and rad, or as near to it as it goes."""
        target = np.asarray(pose, dtype=float)
        self.do("move_to", lambda: self._session.set_pose(target))

    def play(self, motion: Motion | Simulation, title: str = "motion") -> None:
        """Play a motion, or what a simulation did, again and again."""
        found = motion.motion if isinstance(motion, Simulation) else motion
        self.do("load", lambda: self._session.take(found, title))

    def do(self, name: str, act: Callable[[], object]) -> None:
        """Do something with the session soon; of actions with one name only the last is done."""
        with self._wake:
            self._actions.pop(name, None)
            self._actions[name] = act
            self._idle.clear()
            self._wake.notify()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until all that was asked for is done and sent to the page; say whether it is.

        Parameters
        ----------
        timeout : float, optional
            s.
        """
        return self._idle.wait(timeout)

    def close(self) -> None:
        """End the page; tabs say that the connection is lost."""
        with self._wake:
            if self._closed:
                return
            self._closed = True
            self._wake.notify()
        self._thread.join()
        stop(self._server)

    # The thread that owns the session.

    def _run(self) -> None:
        session = self._session
        last = shown = changed = monotonic()
        settled = True
        while True:
            with self._wake:
                if not self._actions:
                    self._idle.set()
                if not self._actions and not self._closed:
                    self._wake.wait(self._until(last, changed, settled))
                if self._closed:
                    return
                actions, self._actions = self._actions, {}
            for act in actions.values():
                self._guard(act)
            now = monotonic()
            if actions:
                changed, settled = now, False
            advanced = session.playing and now - last >= _FRAME
            if advanced:
                elapsed = now - last
                self._guard(lambda: session.advance(elapsed))  # noqa: B023
            if advanced or not session.playing:
                last = now
            if actions or (advanced and now - shown >= _PANEL):
                self._guard(self._show)
                shown = now
            elif advanced:
                self._guard(self._show_picture)
            if not settled and now - changed >= _SETTLED:
                settled = not session.playing
                changed = now
                self._guard(lambda: self._show(settled=True))

    def _until(self, last: float, changed: float, settled: bool) -> float | None:
        """Return the time until the next picture, s; None where it waits for an action."""
        now = monotonic()
        times = [last + _FRAME - now] if self._session.playing else []
        times += [] if settled else [changed + _SETTLED - now]
        return max(0.0, min(times)) if times else None

    def _guard(self, act: Callable[[], object]) -> None:
        """Act; a failure is reported on the page, and the last good state stays."""
        session = self._session
        try:
            act()
        except PteronError as error:
            session.playing = False
            session.state = stopped(session.state, _sentence(str(error)))
        except Exception as error:
            session.playing = False
            self._faults.append(traceback.format_exc())
            message = f"Something failed in the viewer ({type(error).__name__}: {error})."
            session.state = stopped(session.state, message)

    # What the page shows.

    def _set_up(self) -> None:
        """Put the machine into the picture, in its working mode."""
        session = self._session
        self._robot = session.state.robot
        self._scene = Scene(self._server, self._robot, session.examples, self._compared)
        self._handle = Handle(self._server, self._robot, self._scene.size, self._pulled)

    def _pulled(self, pose: Array) -> None:
        self.do("handle", lambda: self._session.set_pose(pose))

    def _show(self, *, settled: bool = False) -> None:
        """Show all of the session's state: the picture first, which the panel need not delay."""
        server = self._server
        found = self._show_picture()
        with server.atomic():
            self._panel.show(found, settled=settled)
            if settled:
                self._panel.show_settled()
                self._show_slice()
        server.flush()

    def _show_picture(self) -> Readings:
        """Show the machine; return its numbers."""
        state, server = self._session.state, self._server
        found = readings(state)
        with server.atomic():
            if state.robot != self._robot:
                self._handle.remove()
                self._scene.remove()
                self._set_up()
                self._panel.show_ranges()
                self._looks = self._sliced = ()
            if self._scaled != self._scaled_for():
                self._scale, self._scaled = self._session.force_scale(), self._scaled_for()
            self._show_looks()
            self._scene.show(state, found.forces, self._scale)
            self._handle.show(state)
        server.flush()
        return found

    def _scaled_for(self) -> tuple[object, ...]:
        state = self._session.state
        return state.robot, state.payload, self._session.title

    def _show_looks(self) -> None:
        panel = self._panel
        # A handle is for a platform that waits to be moved.
        handle = panel.handle.value and not self._session.playing
        looks = panel.screws.value, panel.forces.value, handle
        if looks != self._looks:
            self._looks = looks
            self._scene.set_visible("screws", looks[0])
            self._scene.set_visible("forces", looks[1])
            self._handle.set_visible(looks[2])

    def _show_slice(self) -> None:
        state, span = self._session.state, self._session.pose_range
        plane = choices(state.robot)[self._panel.plane.value]
        # A map shows where the machine is, too.
        rest = [
            value
            for name, value in zip(state.robot.coordinates, state.pose, strict=True)
            if not isinstance(plane, str) or name not in plane
        ]
        key = (plane, state.robot, *np.round(rest, 9)) if plane else ()
        if key == self._sliced:
            return
        self._sliced = key
        given = state.robot, state.pose
        self._scene.show_slice(slice_meshes(*given, plane, span) if isinstance(plane, str) else [])
        self._panel.map.content = slice_map(*given, plane, span) if isinstance(plane, tuple) else ""


def _sentence(text: str) -> str:
    return text if text.endswith((".", "?", "!")) else f"{text}."


def view(
    robot: RobotLike,
    *,
    host: str = "127.0.0.1",
    port: int = 8080,
    motion: Motion | Simulation | str | Path | None = None,
    payload: float = 0.0,
    compare: RobotLike | None = None,
    enlarge: float | None = None,
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

    Returns
    -------
    Viewer
        Its `url` is the page's address; `close` it, or use it in a ``with`` block.

    Raises
    ------
    ModelError
        If the machine reaches no pose, or if viser is not installed.
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
    session = Session(as_manipulator(robot), payload)
    if isinstance(motion, Motion | Simulation):
        session.take(motion.motion if isinstance(motion, Simulation) else motion, "motion")
    elif motion == STANDARD_CYCLE:
        session.load_standard()
    elif motion is not None:
        session.load(str(motion), read_bytes(motion))
    return Viewer(session, host, port, _compared(session, compare, enlarge))


def _compared(
    session: Session, compare: RobotLike | None, enlarge: float | None
) -> tuple[Manipulator, float] | None:
    if compare is None:
        return None
    robot, other = session.state.robot, as_manipulator(compare)
    expect_alike(robot, other)
    if enlarge is None:
        one, there = (joint_points(each, session.home) for each in (robot, other))
        size = machine_size(one, joint_guides(robot, session.home))
        enlarge = enlargement(greatest_difference(one, there), size)
    return other, enlarge


def read_bytes(path: str | Path) -> bytes:
    """Return the bytes of a file."""
    try:
        return Path(path).read_bytes()
    except OSError as error:
        name = shown(str(path), bare=True)
        raise DataError(f"{name}: cannot be read ({error.strerror or error})") from None
