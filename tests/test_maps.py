"""Maps of indices over grids of poses, their files, and sweeps that resume."""

import re
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import meshio
import numpy as np
import polars as pl
import pytest
import xarray
import zarr
from compared_maps import alike
from dying import dies_once, rows, slow_rows
from mechanisms import CATALOG, CLIENTS

import pteron
from pteron.errors import DataError, ModelError, OutputError
from pteron.indices import evaluate
from pteron.kernels import numeric
from pteron.kinematics import random_poses
from pteron.maps import (
    Axis,
    Grid,
    Map,
    TableStore,
    load_map,
    map_index,
    pose_grid,
    save_map,
    surfaces,
    sweep,
)
from pteron.plots import map_figure, map_film
from pteron.workspace import BEYOND_LIMITS, bounding_box, reach_volume
from pteron.workspace.margins import distance_to_limits

INDICES = ("condition", "kappa", "margin")
SPANS = {"x": (-1.0, 1.0), "y": (-1.0, 1.0)}


@pytest.fixture(scope="module")
def delta():
    return pteron.load("delta")


@pytest.fixture(scope="module")
def whole(delta):
    """Return a map in space, coarse."""
    return map_index(delta, INDICES, pose_grid(delta, {}, points=31, rim=0.04))


# Grids.


def test_a_grid_holds_what_is_held_and_the_reach_bounds_the_rest(delta):
    grid = pose_grid(delta, {"z": -0.9}, points=5)
    box = bounding_box(delta, [0.0, 0.0, -0.9])
    assert [(a.name, a.least, a.greatest) for a in grid.axes] == [
        ("x", *box[:, 0]),
        ("y", *box[:, 1]),
    ]
    poses = grid.poses()
    assert poses.shape == (5, 5, 3)
    assert (poses[:, 2, 0] == grid.axes[0].values).all()
    assert (poses[3, :, 1] == grid.axes[1].values).all()
    assert (poses[..., 2] == -0.9).all()


def test_the_chunks_of_a_grid_are_the_grid():
    axes = (Axis("x", 0.0, 1.0, 301), Axis("y", 0.0, 1.0, 201), Axis("phi", 0.0, 1.0, 7))
    grid = Grid(("x", "y", "phi"), (0.5, 0.5, 0.5), axes)
    seen = np.zeros(grid.shape, dtype=int)
    poses = grid.poses()
    for region in grid.regions():
        seen[region] += 1
        assert (grid.poses(region) == poses[region]).all()
    assert (seen == 1).all()
    assert grid.regions()[0] == tuple(slice(0, side) for side in grid.chunk)


@CLIENTS
def test_an_angle_varies_over_its_turn_and_the_box_is_that_of_all_its_values():
    robot = pteron.load("3-prr")
    grid = pose_grid(robot, {}, {"phi": (-0.5, 0.5, 9)}, points=4)
    assert grid.shape == (4, 4, 9)
    box = bounding_box(robot, [0.0, 0.0, 0.5])
    assert all(a.least <= box[0, k] + 1e-9 for k, a in enumerate(grid.axes[:2]))
    assert all(a.greatest >= box[1, k] - 1e-9 for k, a in enumerate(grid.axes[:2]))
    spans = {"x": (-0.1, 0.1), "y": (-0.1, 0.1)}
    assert pose_grid(robot, {}, spans, points=2).axes[2].greatest == np.pi


@pytest.mark.parametrize(
    ("held", "ranges", "words"),
    [
        ({"w": 0.0}, {}, "w: is no coordinate of delta, whose poses have x, y, z"),
        ({"z": -900.0}, {}, "z up to 900: are these mm? m are expected"),
        ({"z": np.nan}, {}, "z: a finite number expected"),
        ({"x": 0.0, "y": 0.0, "z": -1.0}, {}, "nothing varies: leave one of x, y, z out"),
        ({"z": -1.0}, {"x": (1.0, 0.0)}, "x: from 1 to 0 given, an ascending range expected"),
        ({"z": -1.0}, {"z": (0.0, 1.0)}, "z: both held and given a range"),
        (
            {"z": -1.0},
            {"x": (0.0, 1.0, 1), "y": (0.0, 1.0)},
            "x: 1 points given, at least 2 expected",
        ),
    ],
)
def test_a_grid_that_cannot_be_is_refused(delta, held, ranges, words):
    with pytest.raises(DataError, match="^" + words.replace("?", r"\?")):
        pose_grid(delta, held, ranges)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (lambda robot: pose_grid(robot, {"z": -0.9}, SPANS, rim=np.nan), "rim: nan given, a fin"),
        (lambda robot: pose_grid(robot, {"z": -0.9}, SPANS, rim=-0.1), "rim: -0.1 given, 0 or "),
        (
            lambda robot: pose_grid(robot, {"z": -0.9}, SPANS, points=2.5),
            "points: 2.5 given, a whole",
        ),
        (
            lambda robot: pose_grid(robot, {"z": -0.9}, SPANS, points=True),
            "points: True given, a whole",
        ),
        (lambda _: Axis("x", 0.0, 1.0, 2.5), "x: 2.5 points given, a whole number expected"),
        (lambda _: Axis("x", 0.0, 1.0, 1), "x: 1 points given, at least 2 expected"),
        (lambda _: Axis("x", 0.0, np.nan, 3), "x: greatest: nan given, a finite number expected"),
        (lambda _: Axis("x", 0.0, 10**400, 3), "x: greatest: 1000.* given, a finite number"),
        (lambda _: Axis("x", -1e308, 1e308, 3), "x: from -1e.308 to 1e.308 given, an ascending"),
        (lambda _: Axis("w", 0.0, 1.0, 3), "name: 'w' given, one of x, y, z, phi, roll"),
        (lambda _: Grid(("x", "x"), (0.0, 0.0), ()), "coordinates: .'x', 'x'. given, some of x, y"),
        (lambda _: Grid(("x", "y"), (0.0,), ()), "pose: 1 numbers given, x y expected"),
        (lambda _: Grid(("x",), (True,), ()), "pose: .True,. given, a sequence .each a"),
        (
            lambda _: Grid(("x", "y"), (0.0, 0.0), (Axis("y", 0.0, 1.0, 2),) * 2),
            "axes: .'y', 'y'. given, some of x, y expected, each once and in this order",
        ),
    ],
)
def test_axes_and_grids_check_what_they_are_given(delta, given, words):
    with pytest.raises(DataError, match="^" + words):
        given(delta)


# Values.


@pytest.mark.parametrize("name", CATALOG)
def test_the_status_says_which_leg_or_limit_ends_the_reach(name):
    """Against the legs' own reach and the room to limits, one by one."""
    robot = pteron.load(name)
    pose, width = random_poses(robot, 1)[0], {"phi": 1.0}
    size = max(leg.size for leg in robot.legs)
    spans = {
        c: (p - width.get(c, size), p + width.get(c, size), 5)
        for c, p in zip(robot.coordinates, pose, strict=True)
    }
    found = map_index(robot, (), pose_grid(robot, {}, spans))
    margin, type_i, _, _ = numeric(robot, "reach")(found.grid.poses())
    room = distance_to_limits(robot, found.grid.poses()).min(axis=-1)
    missed, least = np.isnan(type_i).any(axis=-1), margin.min(axis=-1)
    status = np.where(missed, margin.argmin(axis=-1) + 1, np.where(room < 0.0, BEYOND_LIMITS, 0))
    assert (found.status == status).all()
    expected = np.where(missed, least, np.fmin(least, room))
    np.testing.assert_allclose(found.values["margin"], expected, atol=1e-14)
    assert 0.0 < found.share < 1.0
    assert sum(found.causes.values()) + found.share == pytest.approx(1.0)


def test_the_summary_is_over_poses_that_serve(whole):
    for name, best, worst in (("condition", np.nanmin, np.nanmax), ("margin", np.max, np.min)):
        found, own = whole.statistics(name), whole.values[name][whole.reachable]
        assert (found.best, found.worst) == (best(own), worst(own))
        at = (whole.grid.poses() == found.best_pose).all(axis=-1) & (
            whole.values[name] == found.best
        )
        assert at.sum() == 1
        assert (found.mean, found.count) == (pytest.approx(own.mean()), len(own))
    with pytest.raises(DataError, match=r"^speed: is not in this map; it has condition, kappa"):
        whole.statistics("speed")


def test_threads_and_chunks_change_no_bit(delta):
    """Of more than one chunk, as of the whole at once."""
    grid = pose_grid(delta, {"z": -0.9}, {"x": (-0.5, 0.5, 512), "y": (-0.5, 0.5, 300)})
    assert len(grid.regions()) == 2
    found = map_index(delta, "condition", grid)
    values = evaluate(delta, "condition", grid.poses())
    assert np.array_equal(found.values["condition"], values, equal_nan=True)


@CLIENTS
def test_jax_agrees_to_rounding():
    """In two chunks, of which the second is filled up."""
    pytest.importorskip("jax")
    grid = pose_grid("five-bar", {}, {"x": (-0.2, 0.2, 401), "y": (-0.1, 0.2, 401)})
    here, there = (
        map_index("five-bar", ("kappa", "margin"), grid, engine=engine)
        for engine in ("auto", "jax")
    )
    assert (here.status == there.status).all()
    for name, values in here.values.items():
        # Next to singularities digits are lost.
        safe = (here.values["margin"] > 1e-3) & (here.values["kappa"] < 100.0)
        np.testing.assert_allclose(there.values[name][safe], values[safe], rtol=1e-12)
        np.testing.assert_allclose(there.values[name], values, rtol=1e-8, atol=1e-14)


# Files.


@pytest.mark.parametrize("ending", [".csv", ".parquet", ".npz", ".zarr"])
def test_a_file_gives_the_same_map_back(whole, tmp_path, ending):
    path = save_map(whole, tmp_path / f"delta{ending}")
    back = load_map(path)
    assert alike(back, whole)
    assert back.robot == "delta"
    assert back.units == {"condition": "", "kappa": "", "margin": "m"}


def test_tables_carry_units_and_zarr_stores_axes(whole, tmp_path):
    save_map(whole, tmp_path / "map.csv")
    first = (tmp_path / "map.csv").read_text().splitlines()[0]
    assert first == "x [m],y [m],z [m],condition,kappa,margin [m],status"
    group = zarr.open_group(save_map(whole, tmp_path / "map.zarr"), mode="r")
    assert group["margin"].metadata.dimension_names == ("x", "y", "z")
    assert group["margin"].attrs["units"] == group["x"].attrs["units"] == "m"


@CLIENTS
def test_xarray_opens_a_store(whole, tmp_path):
    path = save_map(whole, tmp_path / "map.zarr")
    with xarray.open_zarr(path, consolidated=False) as found:
        for name, values in whole.values.items():
            assert found[name].dims == ("x", "y", "z")
            np.testing.assert_array_equal(found[name].to_numpy(), values)
        np.testing.assert_array_equal(found["status"].to_numpy(), whole.status)
        np.testing.assert_array_equal(found["x"].to_numpy(), whole.grid.axes[0].values)
        assert found["margin"].attrs["units"] == "m"
        near = found["margin"].sel(z=-0.9, method="nearest")
        np.testing.assert_array_equal(near.to_numpy(), whole.slice_at("z", -0.9).values["margin"])


def test_the_surface_of_the_reach_encloses_its_volume(delta, whole, tmp_path):
    """A closed surface has a volume, by the divergence theorem; so have random positions."""
    found = surfaces(whole, "condition")
    assert [part.level is None for part in found] == [True, False, False, False]
    corners = found[0].points[found[0].triangles]
    inside = abs(np.linalg.det(corners).sum() / 6.0)
    expected = reach_volume(delta, [0.0, 0.0, -0.9])
    assert inside == pytest.approx(expected.volume, rel=0.02)
    # The levels are where the index has them.
    at = found[2].points
    values = evaluate(delta, "condition", at)
    assert np.nanmedian(np.abs(values - found[2].level)) < 0.01 * found[2].level
    count = sum(len(part.triangles) for part in found)
    for ending in (".vtk", ".vtu", ".ply", ".stl"):
        mesh = meshio.read(save_map(whole, tmp_path / f"delta{ending}"))
        assert len(mesh.cells[0].data) == count
        if ending != ".stl":
            assert np.ptp(mesh.points - np.concatenate([part.points for part in found])) < 1e-6
            value = np.concatenate([part.values for part in found])
            np.testing.assert_allclose(mesh.point_data["condition"], value, rtol=1e-6)
    mesh = meshio.read(tmp_path / "delta.vtk")
    assert set(np.unique(mesh.cell_data["surface"][0])) == {0, 1, 2, 3}
    # Types of arrays that VTK's reader of legacy files knows: vtktypeint32 is none of them.
    lines = (tmp_path / "delta.vtk").read_bytes().split(b"\n")
    arrays = [
        line.split() for line in lines if re.fullmatch(rb"(condition|surface) 1 \d+ \w+", line)
    ]
    assert [(name, kind) for name, _, _, kind in arrays] == [
        (b"condition", b"double"),
        (b"surface", b"vtktypeint64"),
    ]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("map.txt", r"\.txt ending, \.csv, \.parquet"),
        ("map", "no ending, "),
        ("nowhere/map.csv", "there is no folder "),
    ],
)
def test_a_file_that_cannot_be_written_is_refused_before_the_work(delta, tmp_path, name, words):
    with pytest.raises(OutputError, match=words):
        map_index(delta, "condition", out=tmp_path / name)


def test_what_is_no_map_is_refused(whole, tmp_path):
    pl.DataFrame({"x [m]": [0.0], "y": [1.0]}).write_csv(tmp_path / "a.csv")
    (tmp_path / "a.npz").write_bytes(b"PK")
    zarr.create_group(tmp_path / "a.zarr")
    for ending in (".csv", ".npz", ".zarr"):
        with pytest.raises(DataError, match="is no map's "):
            load_map(tmp_path / f"a{ending}")
    with pytest.raises(OutputError, match="is no map's store; name another place"):
        save_map(whole, tmp_path / "a.zarr")
    with pytest.raises(DataError, match=r"b\.csv: no such file"):
        load_map(tmp_path / "b.csv")


def test_indices_and_machines_that_do_not_go_together_are_refused(delta):
    with pytest.raises(DataError, match=r"^index: 'speed' is not known; choose from condition"):
        map_index(delta, "speed")
    with pytest.raises(ModelError, match="is about turning"):
        map_index(delta, "turning_speed")
    grid = pose_grid("five-bar", {}, SPANS, points=3)
    with pytest.raises(DataError, match=r"^grid: of poses \(x, y\), while those of delta are"):
        map_index(delta, "condition", grid)
    with pytest.raises(DataError, match=r"^engine: 'gpu' given, one of auto, jax expected"):
        map_index(delta, "condition", engine="gpu")


# Sweeps.


# Whom a killed process was talking to finds its sockets closed, in threads of its own.
@CLIENTS
@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_worker_and_a_client_may_die_and_nothing_is_lost(delta, tmp_path):
    """A map on two workers, one of which is killed, is resumed from a part; so is any sweep."""
    grid = pose_grid(delta, {"z": -0.9}, SPANS, points=20)
    plain = map_index(delta, "condition", grid)
    map_index(delta, "condition", grid, out=tmp_path / "map.zarr")
    group = zarr.open_group(tmp_path / "map.zarr", mode="r+")
    group["checksum"][0] = 0
    group["condition"][:] = 0.0
    told = []
    found = map_index(delta, "condition", grid, out=tmp_path / "map.zarr", progress=told.append)
    assert alike(found, plain)
    assert told == [0.0, 1.0]

    here, there = (TableStore(tmp_path / name, {"seed": 1}) for name in ("here", "there"))
    assert sweep(rows, range(12), here) == 12
    with pytest.raises(ZeroDivisionError):  # who asks is gone after a part
        sweep(rows, range(12), there, progress=lambda share: 1 // (5 - round(12 * share)))
    assert len(there.finished_chunks()) == 5
    work = partial(dies_once, str(tmp_path / "flag"), rows, 8)
    assert sweep(work, range(12), there, workers=2) == 7
    assert (tmp_path / "flag").exists()
    assert there.scan().collect().equals(here.scan().collect())
    assert sweep(work, range(12), there, workers=2) == 0  # and starts nothing


SCHEDULER = """\
import distributed
options = {"processes": False, "protocol": "tcp", "dashboard_address": None}
with distributed.LocalCluster(1, threads_per_worker=1, **options) as cluster:
    print(cluster.scheduler_address, flush=True)
    input()
"""


@CLIENTS
@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_scheduler_may_die_and_nothing_is_lost(tmp_path):
    """It has its worker in its own process, so that both go at once."""
    store = TableStore(tmp_path, {"seed": 1})
    told = []
    with subprocess.Popen(
        [sys.executable, "-c", SCHEDULER],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parent,
    ) as cluster:
        address = cluster.stdout.readline().strip()

        def progress(share):
            told.append(round(40 * share))
            if told[-1] == 3:
                cluster.kill()

        with pytest.raises(pteron.PteronError) as refused:
            sweep(slow_rows, range(40), store, scheduler=address, progress=progress)
    assert str(refused.value) == (
        f"scheduler {address}: has ended, or its connection has; what is finished is kept: run it "
        "again"
    )
    kept = len(store.finished_chunks())
    assert told[-1] <= kept < 40
    assert sweep(rows, range(40), store) == 40 - kept
    assert store.scan().collect()["number"].to_list() == [k for k in range(40) for _ in range(3)]


def test_the_store_of_another_plan_is_refused(delta, tmp_path):
    grid = pose_grid(delta, {"z": -0.9}, SPANS, points=4)
    map_index(delta, "condition", grid, out=tmp_path / "map.zarr")
    heavy = replace(delta, gravity=(0.0, 0.0, -1.6))
    coarse = pose_grid(delta, {"z": -0.9}, SPANS, points=5)
    for robot, index, own, words in (
        (heavy, "condition", grid, r"robot delta: gravity \[0.0, 0.0, -9.81\], not \[0.0, 0.0"),
        (delta, "kappa", grid, r"index \['condition'\], not \['kappa'\]"),
        (delta, "condition", coarse, r"grid.axes\[1\].count 4, not 5; grid.axes\[2\].count 4"),
    ):
        with pytest.raises(OutputError, match=f"holds results of another plan .{words}"):
            map_index(robot, index, own, out=tmp_path / "map.zarr")
    TableStore(tmp_path / "table", {"seed": 1})
    with pytest.raises(OutputError, match=r"another plan \(seed 1, not 2\); name another place"):
        TableStore(tmp_path / "table", {"seed": 2})
    with pytest.raises(OutputError, match="holds other files"):
        TableStore(tmp_path, {"seed": 1})


def test_workers_that_cannot_be_are_refused(tmp_path):
    store = TableStore(tmp_path / "table", {})
    with pytest.raises(DataError, match=r"^scheduler and workers given"):
        sweep(rows, range(3), store, scheduler="tcp://127.0.0.1:9", workers=2)
    with pytest.raises(DataError, match=r"^workers: 0 given, a whole number from 1 to"):
        sweep(rows, range(3), store, workers=0)
    with pytest.raises(pteron.PteronError, match=r"^scheduler nonsense::: does not answer"):
        sweep(rows, range(3), store, scheduler="nonsense::")


# Pictures.


def test_pictures_hatch_and_name_what_does_not_serve(whole):
    plane = whole.slice_at("z", -0.9)
    assert plane.grid.fixed_coordinates["z"] == pytest.approx(-0.9, abs=0.03)
    figure = map_figure(plane, "margin", "condition")
    panels = [axes for axes in figure.axes if axes.get_legend() is not None]
    named = [[text.get_text() for text in axes.get_legend().get_texts()] for axes in panels]
    assert named[0][:4] == [
        "beyond a joint's limit",
        *(f"out of reach of leg {leg}" for leg in (1, 2, 3)),
    ]
    assert named[1][:2] == ["beyond a joint's limit", "out of reach"]
    assert [axes.get_xlabel() for axes in panels] == ["x (mm)", "x (mm)"]
    assert "distance to the end of the reach (mm)" in figure.axes[1].get_ylabel()
    meshes = [axes.collections[0].get_array() for axes in panels]
    assert [mesh.count() for mesh in meshes] == [plane.reachable.sum()] * 2
    assert len(map_figure(whole, "condition").axes) == 6  # three planes, each with its colours
    with pytest.raises(DataError, match="speed: is not in this map"):
        map_figure(whole, "speed")
    status = np.resize(np.arange(7, dtype=np.int8), plane.status.shape)
    figure = map_figure(replace(plane, status=status), "margin")  # as of a hexapod
    told = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert told[:6] == [f"out of reach of leg {leg}" for leg in range(1, 7)]


def test_a_film_goes_through_the_last_coordinate(whole, tmp_path):
    grid = replace(whole.grid, axes=(*whole.grid.axes[:2], replace(whole.grid.axes[2], count=3)))
    small = Map(
        "delta",
        grid,
        {"condition": whole.values["condition"][..., ::15]},
        whole.status[..., ::15],
    )
    told = []
    made = map_film(small, "condition", tmp_path / "a.gif", progress=told.append)
    assert told == [1 / 3, 2 / 3, 1.0]
    assert (made.frames, made.path.stat().st_size > 1000) == (3, True)


def test_a_map_says_what_it_is(whole):
    assert repr(whole) == "<Map of 'delta': condition, kappa, margin over x 31 x y 31 x z 31>"
    html = whole._repr_html_()
    assert f"{whole.share:.1%} of 29791 poses in reach" in html
    assert "<p>29779 more rows: see table()</p>" in html
