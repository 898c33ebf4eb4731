"""Files of maps that were reordered, changed or damaged: read, refused, or computed again."""

import json
import shutil
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
import zarr
from compared_maps import alike
from mechanisms import gated

import pteron
from pteron.errors import DataError, OutputError
from pteron.maps import Axis, Grid, Map, load_map, map_index, pose_grid, save_map

NAMES = ("condition", "margin")


@pytest.fixture(scope="module")
def robot():
    return pteron.load("five-bar")


@pytest.fixture(scope="module")
def grid(robot):
    """Return more than one chunk, the last of which is smaller than the others."""
    return pose_grid(robot, {}, {"x": (-0.1, 0.1, 515), "y": (0.1, 0.16, 257)})


@pytest.fixture(scope="module")
def small(robot):
    return map_index(robot, NAMES, pose_grid(robot, {}, {"x": (-0.1, 0.1, 6), "y": (0.1, 0.16, 5)}))


@pytest.fixture(scope="module")
def kept(robot, grid, tmp_path_factory):
    """Return a store with its map."""
    store = tmp_path_factory.mktemp("kept") / "map.zarr"
    return store, map_index(robot, NAMES, grid, out=store)


# Tables.


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_the_order_of_a_tables_rows_and_columns_does_not_count(small, tmp_path, ending):
    frame = small.table().sample(fraction=1.0, shuffle=True, seed=3)
    frame = frame.select(sorted(frame.columns, reverse=True))
    path = tmp_path / f"map{ending}"
    frame.write_csv(path) if ending == ".csv" else frame.write_parquet(path)
    found = load_map(path)
    assert found.grid == small.grid
    assert (found.status == small.status).all()
    for name in NAMES:
        np.testing.assert_array_equal(found.values[name], small.values[name])
    assert found.values["margin"].std() > 0.0


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda rows: pl.concat([rows[:7], rows[8:]]),
            r"1 of 30 poses of a grid are missing, the first at x = -0\.06, y = 0\.13$",
        ),
        (
            lambda rows: pl.concat([rows[:9], rows[11:12], rows[9:]]),
            r"row 13.*: is the pose of row 10 again; 1 rows are there already: drop them$",
        ),
        (lambda rows: rows[:-1], "1 of 30 poses of a grid are missing, the first at x = 0.1, y = "),
        (
            lambda rows: rows.with_columns(pl.col("x [m]") ** 3),
            r"x = -?0\.\d+ is not in equal steps with the others",
        ),
        (
            lambda rows: rows.with_columns(status=pl.lit(7)),
            "row 1.*, column status: 7 given, -1 to 2 expected",
        ),
        (
            lambda rows: rows.with_columns(status=pl.lit(0.5)),
            r"column status: 0\.5 given, -1 to 2 expected",
        ),
        (lambda rows: rows.rename({"x [m]": "x [mm]"}), r"column x \[mm\] given, x \[m\] expected"),
        (lambda rows: rows.with_columns(x=pl.col("x [m]")), r"columns x \[m\], x are all x; keep"),
        (lambda rows: rows.drop("status"), "is no map's table"),
    ],
)
def test_a_table_that_is_no_whole_grid_is_told_where(small, tmp_path, ending, change, words):
    path = tmp_path / f"map{ending}"
    frame = change(small.table())
    frame.write_csv(path) if ending == ".csv" else frame.write_parquet(path)
    with pytest.raises(DataError, match=words) as refused:
        load_map(path)
    assert "\n" not in str(refused.value)


# Archives and Parquet files of `save_map`.


@pytest.mark.parametrize("ending", [".npz", ".parquet"])
def test_no_flipped_byte_of_a_map_is_read_as_another_value(small, tmp_path, ending):
    """Every 37th byte, one after another: refused, or nothing that is read has changed."""
    path = save_map(small, tmp_path / f"map{ending}")
    data = path.read_bytes()
    refused = 0
    for at in range(0, len(data), 37):
        changed = bytearray(data)
        changed[at] ^= 4
        path.write_bytes(changed)
        try:
            assert alike(load_map(path), small), at
        except DataError:
            refused += 1
    assert refused > 10


def test_an_archive_with_other_values_is_refused(small, tmp_path):
    """Its own checksums are right: it was written again."""
    path = save_map(small, tmp_path / "map.npz")
    assert load_map(path).machine == small.machine
    arrays = dict(np.load(path))
    arrays["margin"] = arrays["margin"] + 1e-12
    np.savez(path, **arrays)
    with pytest.raises(DataError, match=r"or is damaged .its checksum is another one.; save the"):
        load_map(path)


@pytest.mark.parametrize(
    ("name", "values", "told"),
    [
        ("margin", np.zeros(1 << 16), "margin.npy is larger than its grid"),
        ("about", np.array("x" * (1 << 23)), "its description is too long"),
        ("more", np.zeros(1), "its arrays are others than it describes"),
    ],
)
def test_an_archive_larger_than_its_map_is_not_unpacked(small, tmp_path, name, values, told):
    path = save_map(small, tmp_path / "map.npz")
    np.savez_compressed(path, **{**np.load(path), name: values})
    with pytest.raises(DataError, match=told):
        load_map(path)


# Stores.


@pytest.mark.parametrize(
    "what", gated(["gone", "flipped", "cut", "of another chunk"], ["gone", "flipped"])
)
@pytest.mark.parametrize(
    ("name", "another"),
    [
        ("condition/c/1/0", "condition/c/0/0"),
        ("status/c/0/0", "status/c/1/0"),
        ("margin/c/1/0", "margin/c/0/0"),
        ("checksum/c/1", "checksum/c/0"),
    ],
)
def test_a_chunk_that_is_lost_or_damaged_is_computed_again(
    robot, grid, kept, tmp_path, name, another, what
):
    source, whole = kept
    store = tmp_path / "map.zarr"
    shutil.copytree(source, store)
    data = (store / name).read_bytes()
    middle = len(data) // 2
    changed = {
        "flipped": data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :],
        "cut": data[:middle],
        "of another chunk": (store / another).read_bytes(),
    }
    if what == "gone":
        (store / name).unlink()
    else:
        (store / name).write_bytes(changed[what])
    with pytest.raises(DataError, match=r"1 of 2 chunks are not finished, lost or damaged; run"):
        load_map(store)
    told = []
    again = map_index(robot, NAMES, grid, out=store, progress=told.append)
    assert told == [0.5, 1.0]
    assert alike(again, whole)
    assert alike(load_map(store), whole)


def test_what_was_not_computed_is_no_reach(kept):
    """As other readers see a chunk that is not there."""
    group = zarr.open_group(kept[0], mode="r")
    assert group["status"].fill_value not in (-1, 0, 1, 2)
    assert np.isnan(group["margin"].fill_value)


@pytest.mark.parametrize(
    "name", ["zarr.json", "status/zarr.json", "x/zarr.json", "x/c/0", "margin/zarr.json"]
)
def test_a_store_whose_plan_axes_or_arrays_are_damaged_is_refused(robot, kept, tmp_path, name):
    source, whole = kept
    store = tmp_path / "map.zarr"
    shutil.copytree(source, store)
    file = store / name
    data = file.read_bytes()
    if name == "zarr.json":
        about = json.loads(data)
        about["attributes"]["plan"]["grid"]["axes"][0]["least"] = -0.2
        changed = json.dumps(about).encode()
    else:
        changed = (
            data.replace(b'"fill_value": ', b'"fill_value":') if b"fill" in data else data[:-1]
        )
    assert changed != data
    for bad in (changed, data[: len(data) // 2], b"", b"[]", b"{}"):
        file.write_bytes(bad)
        with pytest.raises(
            DataError, match=r"is damaged: its plan, axes or|is no map's store"
        ) as e:
            load_map(store)
        assert "\n" not in str(e.value)
        with pytest.raises(OutputError, match="remove it"):
            map_index(robot, NAMES, whole.grid, out=store)


def test_a_store_keeps_its_machine_and_refuses_another(robot, small, tmp_path):
    store = save_map(small, tmp_path / "map.zarr")
    (tmp_path / "again.toml").write_text(load_map(store).machine)
    assert pteron.load(tmp_path / "again.toml") == robot
    save_map(small, store)  # the same again
    assert alike(load_map(store), small)
    longer = replace(robot, legs=(replace(robot.legs[0], lower_length=0.31), robot.legs[1]))
    other = map_index(longer, NAMES, small.grid)
    with pytest.raises(OutputError, match=r"robot five-bar: legs\[1\]\.lower_length 0\.\d+, not 0"):
        save_map(other, store)
    nameless = Map("five-bar", small.grid, small.values, small.status)
    with pytest.raises(OutputError, match=r"another plan .robot five-bar: "):
        save_map(nameless, store)
    moved = Grid(small.grid.coordinates, (0.0, 0.1), (Axis("x", -0.1, 0.1, 6),))
    line = Map("five-bar", moved, {"margin": np.zeros(6)}, np.zeros(6, np.int8), small.machine)
    with pytest.raises(
        OutputError, match=r"index \['condition', 'margin'\], not \['margin'\]; .*grid"
    ):
        save_map(line, store)
    assert alike(load_map(store), small)
    assert [file.name for file in tmp_path.iterdir() if file.name.startswith(".")] == []
