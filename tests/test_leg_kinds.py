"""Kinds of legs from elsewhere that break the protocol are refused in one line."""

import importlib
import sys
from dataclasses import dataclass, replace
from typing import ClassVar
from unittest.mock import patch

import numpy as np
import pytest
from mechanisms import CATALOG
from typer.testing import CliRunner

import pteron
from pteron.cli.main import app
from pteron.closures import conformance as of_closures
from pteron.legs import KINDS, PRR, UPS
from pteron.legs.conformance import faults
from pteron.legs.leg import LegEquations
from pteron.legs.prr import PRREquations
from pteron.legs.ram import RamLeg
from pteron.legs.ups import UPSEquations


class UndrivenEquations(PRREquations):
    """No joint is marked as driven."""

    def motion(self, point, rotation):
        found = super().motion(point, rotation)
        return found._replace(chain=tuple(joint._replace(driven=False) for joint in found.chain))


class ElsewhereEquations(PRREquations):
    """A passive joint is marked as the driven one."""

    def motion(self, point, rotation):
        found = super().motion(point, rotation)
        driven, first, *others = found.chain
        chain = (driven._replace(driven=False), first._replace(driven=True), *others)
        return found._replace(chain=chain)


class SilentEquations(PRREquations):
    def motion(self, point, rotation):
        found = super().motion(point, rotation)
        return found._replace(chain=tuple(joint._replace(body="") for joint in found.chain))


class TwiceEquations(PRREquations):
    def motion(self, point, rotation):
        found = super().motion(point, rotation)
        return found._replace(chain=tuple(joint._replace(body="p") for joint in found.chain))


class IdleEquations(PRREquations):
    def motion(self, point, rotation):
        found = super().motion(point, rotation)
        return found._replace(row=0 * found.row)


class StrutEquations(UPSEquations):
    """A ram whose cylinder and piston count for nothing."""

    kinds: ClassVar = {}
    rides = ()
    needs, change_frame = LegEquations.needs, LegEquations.change_frame

    def motion(self, point, rotation):
        motion = super().motion(point, rotation)
        chain = tuple(joint._replace(body="") for joint in motion.chain)
        return motion._replace(bodies={}, chain=chain)


@dataclass(frozen=True)
class Strut(RamLeg):
    upper: None = None
    lower: None = None
    limits: tuple[float, float] = (0.1, 1.0)

    type = "Strut"
    names: ClassVar = {}
    extents: ClassVar = {}
    keys: ClassVar = {k: UPS.keys[k] for k in ("guide_point", "limits", "elbow", "direction")}
    equations_class = StrutEquations
    quantities, free_axes, base_axis = UPS.quantities, UPS.free_axes, UPS.base_axis


@pytest.fixture
def struts():
    """The catalog's hexapod with rams that have no bodies."""
    names = "guide_point", "platform_point", "limits", "elbow", "direction"
    robot = pteron.load("stewart")
    legs = tuple(Strut(**{name: getattr(leg, name) for name in names}) for leg in robot.legs)
    return replace(robot, name="struts", legs=legs)


def test_a_leg_without_bodies_is_valid(struts):
    assert faults(struts.legs[0], tilts=True) == ()
    pose = pteron.random_poses(struts, 5)
    rates, growths = np.random.default_rng(0).normal(size=(2, *pose.shape))
    forces = pteron.inverse_dynamics(struts, pose, rates, growths)
    of_platform = slice(-len(pteron.parameters(struts)), None)
    regressor = pteron.regressor("stewart", pose, rates, growths)[..., of_platform]
    expected = regressor @ pteron.parameters("stewart")[of_platform]
    np.testing.assert_allclose(forces, expected, rtol=1e-12)
    back = pteron.forward_dynamics(struts, pose, rates, forces)
    np.testing.assert_allclose(back, growths, rtol=1e-9, atol=1e-9)
    assert pteron.base_parameters(struts).rank == 10


def test_engines_refuse_a_leg_without_bodies(struts, tmp_path):
    with pytest.raises(pteron.ModelError, match="leg 1: a Strut leg has no bodies"):
        pteron.export.export_mjcf(struts, tmp_path)


@pytest.mark.parametrize("count", [2, 4])
def test_other_numbers_of_legs_than_coordinates_are_refused_by_closures(count):
    robot = CATALOG["delta"]
    with pytest.raises(pteron.ModelError, match=f"legs: {count} given, 3 expected, one for each"):
        of_closures.faults((robot.legs * 2)[:count], robot.platform, [0.1, 0.0, -0.9])


@dataclass(frozen=True)
class Sizeless(PRR):
    type = "Sizeless"

    @property
    def quantities(self):
        return tuple(q._replace(role="number") for q in super().quantities if q.role != "point")


def kind(equations):
    @dataclass(frozen=True)
    class Own(PRR):
        type = "Own"
        equations_class = equations

    return Own


def with_kind(kind):
    """Return a planar machine whose second leg is of a kind."""
    robot = CATALOG["3-prr"]
    old = robot.legs[1]
    leg = kind(**{name: getattr(old, name) for name in old.every_key()})
    return replace(robot, legs=(robot.legs[0], leg, robot.legs[2]))


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (
            kind(UndrivenEquations),
            "leg 2: 0 joints of a Own leg's chain are marked as driven",
        ),
        (
            kind(ElsewhereEquations),
            "leg 2: the driven joint of a Own leg does not move as its coordinate does",
        ),
        (
            kind(SilentEquations),
            r'leg 2: the body "l" \(link\) of a Own leg is carried by 0 joints',
        ),
        (
            kind(TwiceEquations),
            r'leg 2: the body "p" \(slider\) of a Own leg is carried by 4 joints',
        ),
        (kind(IdleEquations), "leg 2: a Own leg moves nothing"),
        (Sizeless, 'leg 2: a Sizeless leg has no size, 0 m, .* of role "length"'),
    ],
    ids=["none driven", "another driven", "no body", "bodies twice", "idle", "no size"],
)
def test_a_kind_that_breaks_the_protocol_is_refused(made, words):
    with pytest.raises(pteron.ModelError, match=words) as caught:
        with_kind(made)
    assert all("\n" not in fault for fault in caught.value.faults)


def test_a_file_that_names_such_a_kind_is_refused(tmp_path):
    path = pteron.save(CATALOG["3-prr"], tmp_path / "own.toml")
    path.write_text(path.read_text().replace('type = "PRR"', 'type = "Own"', 1))
    with (
        patch.dict(KINDS, Own=kind(UndrivenEquations)),
        pytest.raises(pteron.ModelError, match=r"own.toml: .*leg 1: 0 joints of a Own leg"),
    ):
        pteron.load(path)


def test_a_kind_that_keeps_it_is_taken():
    robot = with_kind(kind(PRREquations))
    pose = pteron.random_poses(robot, 1)[0]
    rest = [0.0] * 3
    expected = pteron.inverse_dynamics("3-prr", pose, rest, rest)
    assert pteron.inverse_dynamics(robot, pose, rest, rest) == pytest.approx(expected, rel=1e-12)


def installed(folder, text, value):
    """Write a package of an environment that has a kind of leg as its entry point."""
    (folder / "own_legs.py").write_text(text)
    info = folder / "own_legs-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: own-legs\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[pteron.legs]\nFromElsewhere = {value}\n")
    return folder


KIND = """
from dataclasses import dataclass
from pteron.legs import PRR

@dataclass(frozen=True)
class FromElsewhere(PRR):
    type = "FromElsewhere"
"""


@pytest.fixture
def named(tmp_path, monkeypatch):
    """A file that names a kind of leg, whose package is then installed."""
    path = pteron.save(CATALOG["3-prr"], tmp_path / "own.toml")
    path.write_text(path.read_text().replace('type = "PRR"', 'type = "FromElsewhere"', 1))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "own_legs", raising=False)
    with patch.dict(KINDS):
        yield path


def test_a_kind_of_an_installed_package_is_known(named, tmp_path):
    with pytest.raises(pteron.ModelError, match=r"'FromElsewhere' is not one of PRRR, .*UPU$"):
        pteron.load(named)
    installed(tmp_path, KIND, "own_legs:FromElsewhere")
    result = CliRunner().invoke(app, ["check", str(named)])
    assert result.exit_code == 0, result.output
    robot = pteron.load(named)
    assert robot.legs[0].type == "FromElsewhere"
    pose = pteron.random_poses(robot, 1)[0]
    np.testing.assert_array_equal(
        pteron.inverse_kinematics(robot, pose), pteron.inverse_kinematics("3-prr", pose)
    )


def test_a_machine_with_an_installed_kind_is_saved_before_a_file_named_it(named, tmp_path):
    installed(tmp_path, KIND, "own_legs:FromElsewhere")
    kind = importlib.import_module("own_legs").FromElsewhere
    robot = CATALOG["3-prr"]
    legs = tuple(kind(**vars(leg)) for leg in robot.legs)
    path = pteron.save(replace(robot, legs=legs), tmp_path / "saved.toml")
    assert pteron.load(path).legs == legs
    del KINDS["FromElsewhere"]
    (tmp_path / "own_legs-1.0.dist-info" / "entry_points.txt").write_text("")
    with pytest.raises(pteron.ModelError, match="no kind of leg 'FromElsewhere' is installed"):
        pteron.save(replace(robot, legs=legs), tmp_path / "other.toml")


@pytest.mark.parametrize(
    ("text", "value", "words"),
    [
        ("import nowhere_at_all", "own_legs:FromElsewhere", "cannot be loaded: .*No module"),
        (KIND, "own_legs:PRR", "cannot be loaded: own_legs:PRR is no kind of leg with type"),
    ],
    ids=["import", "another"],
)
def test_a_package_that_has_no_such_kind_is_told(named, tmp_path, text, value, words):
    installed(tmp_path, text, value)
    with pytest.raises(pteron.ModelError, match=f"leg 1: type: 'FromElsewhere' {words}"):
        pteron.load(named)
