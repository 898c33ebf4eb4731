"""A session that tabs show and act on: the one thread that changes it and sends what they show."""

from __future__ import annotations

import json
import threading
import traceback
from collections.abc import Callable
from contextlib import suppress
from secrets import token_hex
from time import monotonic
from typing import Any

import numpy as np

from pteron.errors import DataError, PteronError
from pteron.manipulator import Manipulator
from pteron.report.motion_frames import picture_points
from pteron.report.typeset import resource, template
from pteron.viewer import panel
from pteron.viewer.picture import ViewerPicture
from pteron.viewer.readings import readings
from pteron.viewer.readout import readout
from pteron.viewer.server import Tab
from pteron.viewer.session import Session
from pteron.viewer.slices import choices, slice_map, slice_parts
from pteron.viewer.state import stop_motion

_FRAME = 1.0 / 30.0
"""Time between two pictures of a motion, s."""

_SETTLED = 0.25
"""Time without an action after which results that take longer are shown, s."""

_SPANNED = 0.03
"""Time that the spans of joints may take while the machine moves, s: about one picture."""

_ONE = 1.0
"""Time, s, within which actions of one name are undone as one."""

_LONGEST = 0.1
"""Greatest step of time of a motion between two pictures, s."""

_UNDONE = ("pose", "joint", "drag", "type", "payload", "home", "mode", "assembly", "move_to")
"""Beginnings of the names of actions that can be undone."""


class Live:
    """A session with the tabs that show it, and a queue of its actions.

    Attributes
    ----------
    session : Session
    name : str
        The machine's name.
    idle : Event
        Set while no action waits.
    faults : list of str
        Tracebacks of unexpected failures.
    """

    def __init__(self, session: Session, compared: tuple[Manipulator, float] | None) -> None:
        self.session, self._compared = session, compared
        self.name = session.state.robot.name
        self.idle, self.faults = threading.Event(), list[str]()
        self._run_name = token_hex(8)  # a page of an earlier run is loaded again
        self._actions: dict[str, Callable[[], object]] = {}
        self._wake = threading.Condition()
        self._closed = False
        self._tabs, self._last_messages = set[Tab](), dict[str, str]()
        self._files: dict[Tab, str] = {}
        self._last: tuple[str, float] = ("", 0.0)
        self._sliced: tuple[object, ...] = ()
        self._scaled: tuple[object, ...] = ()
        self._robot: Manipulator | None = None
        self._show(settled=True)
        self._thread = threading.Thread(target=self._run, name="pteron viewer", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread."""
        with self._wake:
            if self._closed:
                return
            self._closed = True
            self._wake.notify()
        self._thread.join()

    def queue_action(self, name: str, act: Callable[[], object]) -> None:
        """Queue an action; it replaces a waiting action with the same name."""
        with self._wake:
            self._actions.pop(name, None)
            self._actions[name] = act
            self.idle.clear()
            self._wake.notify()

    # What tabs see and say.

    def page(self) -> str:
        """Return the page, HTML."""
        script = resource("picture.js") + resource("live.js", "viewer")
        style = resource("page.css") + resource("live.css", "viewer")
        return template("live.html.j2", "viewer").render(
            name=self.name, script=script, style=style, controls=panel.controls(self.session)
        )

    def open_tab(self, tab: Tab) -> None:
        """Send a new tab its contents."""
        with self._wake:
            self._tabs.add(tab)
            for kind, message in self._last_messages.items():
                tab.send(kind, message)

    def close_tab(self, tab: Tab) -> None:
        """Forget a tab that is closed."""
        with self._wake:
            self._tabs.discard(tab)
            self._files.pop(tab, None)

    def handle_message(self, tab: Tab, message: str | bytes) -> None:
        """Handle a tab's message; the contents of a file follow its name."""
        session = self.session
        if isinstance(message, bytes):
            name = self._files.pop(tab, "")
            self.queue_action("load", lambda: session.load(name, message))
            return
        try:
            request = json.loads(message)
            if isinstance(request, dict) and request.get("do") == "file":
                self._files[tab] = str(request.get("name"))
                return
            if isinstance(request, dict) and request.get("do") == "push":
                self._push(str(request.get("drives")))
                return
            name, act = panel.action(session, message)
        except (DataError, ValueError, RecursionError) as error:
            reason = str(error)
            self.queue_action("refused", lambda: self._tell(reason))
            return
        self.queue_action(name, act)

    def _push(self, drives: str) -> None:
        """Compile the equations of motion in a thread, then begin the push."""
        session = self.session

        def prepare() -> None:
            """Stop playback, and all motion but that of a push, until equations are compiled."""
            session.playing, session.preparing = False, True
            if session.push is None:
                session.state = stop_motion(session.state)

        def begin() -> None:
            """Begin the push, compiled by now."""
            session.preparing = False
            session.begin_push(drives)

        def compile_equations() -> None:
            """Compile the equations of the push, then queue its beginning."""
            with suppress(Exception):  # `begin` raises it again, and reports it
                session.prepare_push(drives)
            self.queue_action("push", begin)

        self.queue_action("prepare", prepare)
        threading.Thread(target=compile_equations, name="pteron push", daemon=True).start()

    def _tell(self, text: str) -> None:
        """Stop the motion, and show a message on the page."""
        self.session.playing = False
        self.session.state = stop_motion(self.session.state, _sentence(text))

    def _send(self, kind: str, content: dict[str, Any]) -> None:
        """Send data of a kind to all tabs, and store it for new tabs."""
        text = json.dumps({kind: content}, allow_nan=False)
        with self._wake:
            self._last_messages[kind] = text
            for tab in self._tabs:
                tab.send(kind, text)

    # The thread that owns the session.

    def _run(self) -> None:
        """Run the thread: do queued actions, advance the motion, and send the state to the tabs."""
        session = self.session
        last = changed = monotonic()
        settled = not session.playing
        while True:
            with self._wake:
                if not self._actions:
                    self.idle.set()
                if not self._actions and not self._closed:
                    self._wake.wait(self._waiting_time(last, changed, settled))
                if self._closed:
                    return
                actions, self._actions = self._actions, {}
            for name, act in actions.items():
                self._guard(lambda: self._run_action(name, act))  # noqa: B023
            now = monotonic()
            if actions:
                changed, settled = now, False
            moves = session.playing or session.push is not None
            advanced = moves and now - last >= _FRAME
            if advanced:
                elapsed = min(now - last, _LONGEST)
                self._guard(lambda: session.advance(elapsed))  # noqa: B023
            if advanced or not moves:
                last = now
            if actions or advanced:
                self._guard(self._show)
            if not settled and now - changed >= _SETTLED:
                settled = not moves
                changed = now
                self._guard(self._show_spans if moves else lambda: self._show(settled=True))

    def _waiting_time(self, last: float, changed: float, settled: bool) -> float | None:
        """Return the time until the next picture, s; None without motion: wait for an action."""
        now = monotonic()
        moves = self.session.playing or self.session.push is not None
        times = [last + _FRAME - now] if moves else []
        times += [] if settled else [changed + _SETTLED - now]
        return max(0.0, min(times)) if times else None

    def _run_action(self, name: str, act: Callable[[], object]) -> None:
        """Do an action; the session is remembered before it if the action can be undone."""
        last_act, now = self._last, monotonic()
        if name.startswith(_UNDONE):
            if last_act[0] != name or now - last_act[1] > _ONE:
                self.session.remember()
            self._last = name, now
        elif name == "undo":
            self._last = "", now
        act()

    def _guard(self, act: Callable[[], object]) -> None:
        """Run an action; a failure is reported on the page, and the last good state stays."""
        try:
            act()
        except PteronError as error:
            self.session.push = None
            self._tell(str(error))
        except Exception as error:
            self.faults.append(traceback.format_exc())
            self.session.push = None
            self._tell(f"Something failed in the viewer ({type(error).__name__}: {error}).")

    # What the page shows.

    def _show(self, *, settled: bool = False) -> None:
        """Send the state to the tabs; `settled` also sends values that are slow to compute."""
        session = self.session
        state, push = session.state, session.push
        if state.robot != self._robot:
            self._robot, self._sliced = state.robot, ()
            self._picture = ViewerPicture(state.robot, session.examples, self._compared)
            drawn = {"still": self._picture.still, "cloud": self._picture.cloud}
            self._send("machine", panel.controls(session) | drawn | {"run": self._run_name})
        scaled = state.robot, state.payload, session.title
        if self._scaled != scaled:
            self._scaled, self._scale = scaled, session.force_scale()
        numbers = readings(state, None if push is None else push.forces)
        moment = self._picture.moment(state, numbers.forces, self._scale, screws=session.screws)
        spring = push.spring if push else None
        self._send(
            "state",
            panel.values(session, numbers.joints)
            | moment
            | {
                "clock": monotonic(),
                "message": state.message or panel.activity_text(session),
                "warns": bool(state.message),
                "readout": readout(state, numbers),
                "plotted": {
                    "forces": _finite_or_none(numbers.forces),
                    "joints": panel.joints_in_display_units(state.robot, numbers.joints),
                    "power": _finite_or_none(numbers.power),
                },
                "legend": self._picture.legend(self._scale),
                "spring": spring and [picture_points(state.robot, end) for end in spring],
            },
        )
        if settled:
            spans = panel.span_values(session, lambda: bool(self._actions))
            if spans["joint"] is not None and not self._actions:
                self._send("spans", spans)
                self._send("settled", panel.assembly_values(session))
                self._show_slice()

    def _show_spans(self) -> None:
        """Send the sliders' spans and the slice of a machine that moves."""
        end = monotonic() + _SPANNED
        spans = panel.span_values(self.session, lambda: bool(self._actions) or monotonic() > end)
        self._send("spans", spans)
        self._show_slice()

    def _show_slice(self) -> None:
        """Send the slice through the reach or the map of the chosen plane, if it has changed."""
        state, span = self.session.state, self.session.pose_range
        plane = choices(state.robot).get(self.session.plane)
        # A map shows where the machine is, too.
        fixed_coordinates = [
            coordinate
            for name, coordinate in zip(state.robot.coordinates, state.pose, strict=True)
            if not isinstance(plane, str) or name not in plane
        ]
        key = (plane, state.robot, *np.round(fixed_coordinates, 9)) if plane else ()
        if key == self._sliced:
            return
        self._sliced = key
        robot_and_pose = state.robot, state.pose
        map_, parts = "", []
        if isinstance(plane, str):
            for color, rings in slice_parts(*robot_and_pose, plane, span):
                parts.append(
                    {"color": color, "rings": [picture_points(state.robot, r) for r in rings]}
                )
        elif plane is not None:
            map_ = slice_map(*robot_and_pose, plane, span)
        self._send("slice", {"parts": parts, "map": map_})


def _finite_or_none(numbers: Any) -> list[float | None]:
    """Return values as floats; None, which JSON can hold, for NaN and infinities."""
    return [float(number) if np.isfinite(number) else None for number in numbers]


def _sentence(text: str) -> str:
    """Return a text that ends with a full stop or another mark."""
    return text if text.endswith((".", "?", "!")) else f"{text}."
