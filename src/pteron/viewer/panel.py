"""The viewer's side panel: controls that show the machine's state and change it."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np

from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.platforms.coordinates import SHOWN
from pteron.report.typeset import fixed
from pteron.viewer.readings import Readings
from pteron.viewer.readout import readout, status
from pteron.viewer.session import SPEEDS, STANDARD, Session
from pteron.viewer.slices import choices
from pteron.viewer.state import pose_factors, pose_units

if TYPE_CHECKING:
    import viser

Post = Callable[[str, Callable[[], object]], None]
"""Sends an action to the viewer, under a name: of several under one name only the last counts."""

_STEP = 0.1
"""Step of sliders, mm or degrees."""

_SHORT = 0.01
"""Step of the slider of time, s."""

_NO_MODE = "none of them"
"""The choice shown where the pose is in no assembly mode of the list."""

_HELD = 0.2
"""Time, s, for which a control that a person moves is not updated: an older answer would pull it
back."""

_SAME = 1e-6
"""Difference of a slider from its value that counts as none, mm, degrees or s."""


class Panel:
    """The controls of one machine."""

    def __init__(self, server: viser.ViserServer, session: Session, post: Post) -> None:
        self._server, self._session, self._post = server, session, post
        self._poses: Array = np.zeros((0, session.state.robot.freedom))
        self._touched: dict[str, float] = {}
        gui = server.gui
        self._status = gui.add_html("")
        self._readout = gui.add_html("")
        tabs = gui.add_tab_group()
        with tabs.add_tab("Move"):
            self._add_movers(gui)
        with tabs.add_tab("Play"):
            self._add_player(gui)
        with tabs.add_tab("Show"):
            self._add_looks(gui)

    # What there is.

    def _add_movers(self, gui: viser.GuiApi) -> None:
        session, robot = self._session, self._session.state.robot
        self._factors = pose_factors(robot)
        self._coordinates = []
        for i, name in enumerate(robot.coordinates):
            label = f"{name} ({SHOWN[robot.units[i]][0]})"
            low, high = self._factors[i] * session.pose_range[:, i]
            value = float(self._factors[i] * session.state.pose[i])
            slider = self._slider(gui, label, low, high, value)
            factor = float(self._factors[i])
            self._on(slider, f"pose{i}", self._to_coordinate(i, factor))
            self._coordinates.append(slider)
        shown = " ".join(fixed(x, 0).replace("\u2212", "-") for x in self._factors * session.home)
        self._typed = gui.add_text(
            "type a pose", "", hint=f"{' '.join(robot.coordinates)} in {pose_units(robot)}: {shown}"
        )
        self._button(gui, "Go there", lambda: session.type_pose(self._typed.value))
        self._button(gui, "Home", session.go_home)
        self._joints, self._joint_factors = [], []
        for i, leg in enumerate(robot.legs):
            unit, factor = SHOWN[leg.joint.unit]
            low, high = factor * session.joint_range[:, i]
            value = float(factor * session.state.joints[i])
            label = f"{leg.joint.noun} {i + 1} ({unit})"
            slider = self._slider(gui, label, low, high, value)
            self._on(slider, f"joint{i}", self._to_joint(i, factor))
            self._joints.append(slider)
            self._joint_factors.append(factor)
        modes = session.modes()
        self._modes = {_signs(mode): mode for mode in modes}
        now = _signs(tuple(leg.elbow for leg in robot.legs))
        self._mode: Any = gui.add_dropdown(
            "working mode",
            tuple(self._modes),
            initial_value=now,
            hint="The side of each leg's elbow, leg 1 first",
        )
        self._on(self._mode, "mode", lambda value: session.set_working_mode(self._modes[value]))
        self._assembly: Any = gui.add_dropdown(
            "assembly mode", (_NO_MODE,), hint="Poses with the same joint coordinates: choose one"
        )
        self._on(self._assembly, "assembly", self._to_assembly)
        self._payload: Any = gui.add_text(
            "payload (kg)", f"{session.state.payload:g}", hint="At the tool's centre point"
        )
        self._on(self._payload, "payload", session.set_payload)

    def _add_player(self, gui: viser.GuiApi) -> None:
        session = self._session
        self._title = gui.add_html("")
        self._button(gui, f"Load the {STANDARD}", session.load_standard)
        upload = gui.add_upload_button(
            "Load a file: motion, log or simulation",
            hint="CSV or Parquet: t and the pose, or t and the joints; or a log",
        )

        @upload.on_upload
        async def _(event: Any) -> None:
            file = event.target.value
            self._post("load", lambda: session.load(file.name, file.content))

        self._play: Any = gui.add_checkbox("play", initial_value=False)
        self._on(self._play, "play", lambda on: session.play(on=on))
        self._time = gui.add_slider("time (s)", 0.0, 1.0, _SHORT, 0.0, disabled=True)
        self._on(self._time, "time", self._to_time)
        self._speed = gui.add_dropdown("speed", tuple(SPEEDS), initial_value="real time")
        self._on(self._speed, "speed", lambda name: setattr(session, "speed", SPEEDS[name]))

    def _add_looks(self, gui: viser.GuiApi) -> None:
        self.screws = gui.add_checkbox(
            "joint axes (screws)",
            initial_value=False,
            hint="Dark: the joint turns about it. Gold: it slides along it",
        )
        self.forces = gui.add_checkbox(
            "drive forces",
            initial_value=True,
            hint="At the actuators. A crank's torque is along its axis, as a screw turns",
        )
        self.handle = gui.add_checkbox("handle on the platform", initial_value=True)
        planes = tuple(choices(self._session.state.robot))
        self.plane = gui.add_dropdown(
            "workspace slice",
            planes,
            hint="Blue: in reach. Amber: a joint's limit forbids it. Along an angle: a map, here",
        )
        self.map = gui.add_html("")
        for one in (self.screws, self.forces, self.handle, self.plane):
            self._on(one, "look", lambda _: None)

    # What happens.

    def _to_coordinate(self, i: int, factor: float) -> Callable[[float], None]:
        return lambda value: self._session.set_coordinate(i, value / factor)

    def _to_joint(self, i: int, factor: float) -> Callable[[float], None]:
        return lambda value: self._session.set_joint(i, value / factor)

    def _to_assembly(self, label: str) -> None:
        k = label.partition(":")[0]
        if k.isdigit() and int(k) <= len(self._poses):
            self._session.set_assembly(self._poses[int(k) - 1])

    def _to_time(self, time: float) -> None:
        self._session.playing = False
        self._session.seek(time)

    def _on(self, control: Any, name: str, act: Callable[[Any], object]) -> None:
        """Let a control act when a person, and not the viewer itself, has changed it."""

        # Not a coroutine: the viewer's own changes come by here too, and are to cost nothing.
        def changed(event: Any) -> None:
            if event.client_id is not None:
                value = control.value
                self._touched[name] = monotonic()
                self._post(name, lambda: act(value))

        control.on_update(changed)

    def _button(self, gui: viser.GuiApi, label: str, act: Callable[[], object]) -> None:
        @gui.add_button(label).on_click
        async def _(event: Any) -> None:
            self._post(label, act)

    def _slider(
        self, gui: viser.GuiApi, label: str, low: float, high: float, value: float
    ) -> viser.GuiSliderHandle[float]:
        least, most = _round_out(min(low, value), max(high, value))
        return gui.add_slider(label, least, most, _STEP, round(value, 1))

    # What is shown.

    def show(self, found: Readings, *, settled: bool = False) -> None:
        """Show a session's state; what a person is moving follows once it has settled."""
        session = self._session
        state = session.state
        self._status.content = status(state.message, empty=_doing(session))
        self._readout.content = readout(state, found)
        joints = np.array(self._joint_factors) * found.joints
        for name, sliders, values in (
            ("pose", self._coordinates, self._factors * state.pose),
            ("joint", self._joints, joints),
        ):
            for i, (slider, value) in enumerate(zip(sliders, values, strict=True)):
                self._set(f"{name}{i}", slider, round(float(value), 1), settled)
        if self._play.value != session.playing:
            self._play.value = session.playing
        # A text that was refused goes with the next action, and not while it is being typed.
        carried = f"{state.payload:g}"
        last = max(self._touched, key=self._touched.__getitem__, default="")
        if last != "payload" and self._payload.value != carried:
            self._payload.value = carried
        if session.motion is not None:
            most = max(_SHORT, round(session.motion.duration, 2))
            if self._time.max != most:
                self._time.max = most
            self._set("time", self._time, min(most, round(session.time, 2)), settled)

    def _set(self, name: str, slider: Any, value: float, settled: bool) -> None:
        """Move a slider, whose range grows where it must."""
        if not settled and monotonic() - self._touched.get(name, -_HELD) < _HELD:
            return
        if value < slider.min:
            slider.min = _round_out(value, value)[0]
        if value > slider.max:
            slider.max = _round_out(value, value)[1]
        if abs(slider.value - value) > _SAME:
            slider.value = value

    def show_settled(self) -> None:
        """Show the parts that take longer to find, or seldom change."""
        session = self._session
        state = session.state
        self._poses, now = session.assemblies()
        labels = tuple(self._told_pose(k, pose) for k, pose in enumerate(self._poses, start=1))
        if now is None:
            labels = (*labels, _NO_MODE)
        if self._assembly.options != labels:
            self._assembly.options = labels
        self._assembly.value = labels[-1 if now is None else now]
        self._mode.value = _signs(tuple(leg.elbow for leg in state.robot.legs))
        motion = session.motion
        self._time.disabled = motion is None
        name = f"{session.title}: {motion.duration:.3g} s" if motion else ""
        self._title.content = status("", empty=name or "No motion is loaded")

    def show_ranges(self) -> None:
        """Set what the sliders span."""
        session = self._session
        pairs = [
            (self._coordinates, self._factors * session.pose_range),
            (self._joints, np.array(self._joint_factors) * session.joint_range),
        ]
        for sliders, ranges in pairs:
            for slider, (low, high) in zip(sliders, ranges.T, strict=True):
                slider.min, slider.max = _round_out(float(low), float(high))

    def _told_pose(self, k: int, pose: Array) -> str:
        turns = self._session.state.robot.platform.angular
        values = zip(self._factors * pose, turns, strict=True)
        parts = [fixed(value) + "°" * bool(angle) for value, angle in values]
        return f"{k}: {' '.join(parts)}"


def _doing(session: Session) -> str:
    robot: Manipulator = session.state.robot
    if session.playing:
        return f"{robot.name} moves: forces are those of the motion"
    moving = bool(session.state.velocity.any() or session.state.acceleration.any())
    return f"{robot.name} {'at a moment of its motion' if moving else 'at rest'}"


def _round_out(low: float, high: float) -> tuple[float, float]:
    """Return the next whole tenths."""
    return float(np.floor(10.0 * low) / 10.0), float(np.ceil(10.0 * high) / 10.0) + 0.1 * (
        low == high
    )


def _signs(mode: tuple[int, ...]) -> str:
    return "".join("+" if side > 0 else "-" for side in mode)
