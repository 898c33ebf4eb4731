"""What installed packages add: indices and exports by entry points, as kinds of legs are."""

import json
import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from commands import refused, run

import pteron
from pteron.export import export_named, export_names
from pteron.indices import INDICES, Index, evaluate
from pteron.manipulator import dumps, loads
from pteron.maps import load_map, map_index, pose_grid, save_map
from pteron.platforms.kinds import KINDS
from pteron.plots import map_figure

PACKAGE = """
import json
from pteron.indices import Index
from pteron.platforms.translating import Translating

class Gantry(Translating):
    motion_name = "gantry"

def heights(robot, poses):
    return poses[:, 2]

height = Index("height", "height over the base", unit="m", function=heights)
unnamed = Index("other", "other", function=heights)

def write(robot, folder):
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{robot.name}.json"
    path.write_text(json.dumps({"legs": len(robot.legs)}))
    return [path]

def silent(robot, folder):
    return None
"""
ENTRY_POINTS = """
[pteron.indices]
height = acme_pteron:height
wrong = acme_pteron:unnamed
[pteron.export]
acme = acme_pteron:write
silent = acme_pteron:silent
number = acme_pteron:__name__
gone = acme_nowhere:write
[pteron.platforms]
gantry = acme_pteron:Gantry
other = acme_pteron:Gantry
absent = acme_nowhere:Gantry
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Install a package with an index and exports."""
    (tmp_path / "acme_pteron.py").write_text(PACKAGE)
    info = tmp_path / "acme_pteron-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme-pteron\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRY_POINTS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "acme_pteron", raising=False)


POSES = np.array([[0.0, 0.01, 0.02], [9.0, 0.0, 0.0], [0.02, 0.0, -0.01]])


def test_an_own_index_is_evaluated_where_the_machine_reaches():
    seen = []

    def heights(robot, poses):
        seen.append(poses)
        return poses[:, 2]

    height = Index("height", "height", unit="m", function=heights)
    values = evaluate("tripteron", height, POSES, on_failure="nan")
    np.testing.assert_array_equal(values, [0.02, np.nan, -0.01])
    assert [poses.shape for poses in seen] == [(2, 3)]
    assert evaluate("tripteron", height, POSES[0]) == 0.02
    assert evaluate("tripteron", height, POSES.reshape(3, 1, 3), on_failure="nan").shape == (3, 1)
    with pytest.raises(pteron.UnreachablePose):
        evaluate("tripteron", height, POSES)


@pytest.mark.parametrize(
    ("index", "words"),
    [
        (Index("own", "own"), "index: 'own' has no function"),
        (Index("condition", "own", function=lambda *_: 1), "is the name of an index of Pteron"),
        (Index("own", "own", function=lambda *_: 1.0), "index 'own': its function returns 1.0"),
        (Index("own", "own", function=lambda _, p: p), "2 real numbers expected, one for each"),
        (Index("own", "own", function=lambda _, p: p[:, 0] * 1j), "2 real numbers expected"),
        (Index("own", "own", function=lambda *_: ["a", "b"]), "2 real numbers expected"),
        ("nothing", "index: 'nothing' is not known; choose from condition"),
    ],
)
def test_an_own_index_that_is_none_is_refused(index, words):
    with pytest.raises(pteron.DataError, match=re.escape(words)):
        evaluate("tripteron", index, POSES, on_failure="nan")


def test_an_index_of_an_installed_package_is_known(installed):
    values = evaluate("tripteron", "height", POSES, on_failure="nan")
    np.testing.assert_array_equal(values, [0.02, np.nan, -0.01])
    with pytest.raises(pteron.ModelError, match=r"acme_pteron:unnamed is no .*Index 'wrong'"):
        evaluate("tripteron", "wrong", POSES)
    assert "height" not in INDICES


def test_an_export_of_an_installed_package_writes_its_files(installed, tmp_path):
    assert {"acme", "silent"} <= set(export_names())
    line = f"export tripteron --target acme={tmp_path / 'out'} --json"
    files = json.loads(run(line).stdout)["files"]
    assert [json.loads((tmp_path / "out" / "tripteron.json").read_text())] == [{"legs": 3}]
    assert files == [str(tmp_path / "out" / "tripteron.json")]
    assert export_named("acme")("tripteron", tmp_path / "out") == [tmp_path / "out/tripteron.json"]


@pytest.mark.parametrize(
    ("target", "words"),
    [
        ("acme", "--target: 'acme' given, NAME=DIR expected"),
        ("nothing=out", "export: 'nothing' is not known; choose from: acme"),
        ("silent=out", "acme_pteron:silent returns no list of the files"),
        ("number=out", "acme_pteron:__name__ is no function"),
        ("gone=out", "acme_nowhere:write: ModuleNotFoundError: No module named 'acme_nowhere'"),
    ],
)
def test_an_export_that_is_none_is_refused(installed, target, words):
    assert words in refused(f"export tripteron --target {target}")


def machine_with_motion(motion, folder):
    """Write the catalog's Tripteron with another motion, and return the file's path."""
    path = folder / f"{motion}.toml"
    path.write_text(dumps("tripteron").replace('"3T"', f'"{motion}"'))
    return path


def test_a_platform_of_an_installed_package_is_one_of_pteron(installed, tmp_path, monkeypatch):
    monkeypatch.setattr("pteron.platforms.kinds.KINDS", dict(KINDS))
    robot = pteron.load(machine_with_motion("gantry", tmp_path))
    assert robot.platform.kind.motion_name == "gantry"
    motion = POSES[0], [0.1, 0.2, 0.3], [1.0, 2.0, 3.0]
    forces = pteron.inverse_dynamics("tripteron", *motion)
    np.testing.assert_array_equal(pteron.inverse_dynamics(robot, *motion), forces)
    assert loads(dumps(robot)) == robot
    assert "3 legs" in run(f"check {tmp_path / 'gantry.toml'}").stdout


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        ("other", "acme_pteron:Gantry is no kind of platform with motion_name 'other'"),
        ("absent", "acme_nowhere:Gantry: ModuleNotFoundError"),
        ("4T", "platform.motion: '4T' given, '3T', '3T1R'"),
        ("4T", "'absent', 'gantry' or 'other' expected"),
    ],
)
def test_a_platform_that_is_none_is_refused(installed, motion, words, tmp_path):
    assert words in refused(f"check {machine_with_motion(motion, tmp_path)}")


# Maps of own indices.

HEIGHT = Index("height", "height of P", unit="m", better="less", function=lambda _, p: p[:, 2])


def test_a_map_has_own_indices_beside_those_of_pteron():
    grid = pose_grid("tripteron", {"y": 0.0}, points=11, rim=0.3)
    index_map = map_index("tripteron", ["condition", HEIGHT], grid)
    poses = grid.poses()
    expected = np.where(np.isnan(index_map.values["condition"]), np.nan, poses[..., 2])
    np.testing.assert_array_equal(index_map.values["height"], expected)
    assert 0 < np.isnan(expected).sum() < expected.size
    assert index_map.units == {"condition": "", "height": "m"}
    assert index_map.statistics("height").best == np.nanmin(expected)
    assert "height [m]" in index_map.table().columns
    (labels,) = [axes.get_ylabel() for axes in map_figure(index_map, "height").axes[1:]]
    assert "height of P (mm)" in labels
    assert index_map.slice_at("x", 0.0).index("height").better == "less"


@pytest.mark.parametrize("ending", ["npz", "zarr"])
def test_a_file_keeps_what_an_own_index_is(ending, tmp_path):
    grid = pose_grid("tripteron", {"y": 0.0}, points=7)
    out = tmp_path / f"map.{ending}"
    index_map = map_index("tripteron", [HEIGHT, "kappa"], grid, out=out)
    loaded = load_map(out)
    assert loaded.index("height").title == "height of P"
    assert (loaded.index("height").unit, loaded.index("height").better) == ("m", "less")
    np.testing.assert_array_equal(loaded.values["height"], index_map.values["height"])
    assert (
        load_map(save_map(loaded, tmp_path / f"again.{ending}")).own_indices == loaded.own_indices
    )


def test_own_indices_that_a_map_cannot_have_are_refused():
    grid = pose_grid("tripteron", {"y": 0.0}, points=5)
    with pytest.raises(pteron.DataError, match="index: 'height' is named twice"):
        map_index("tripteron", [HEIGHT, replace(HEIGHT, title="another")], grid)
    with pytest.raises(pteron.DataError, match="index: 'height' is a function, and engine \"jax\""):
        map_index("tripteron", HEIGHT, grid, engine="jax")
