"""Files that version 0.1 wrote: each is read to the same values; a map that was ended goes on.

A search that was ended is refused: its quantities are others since.

The C code that version 0.1 exported: the present one declares and returns the same.

`data/files-0.1/make.py` says how they were made.
"""

import json

import numpy as np
import pytest
from earlier_files import FILES, FOLDER, ROBOTS, label
from exported_code import COMPILER, exported
from mechanisms import NIGHTLY, gated

VALUES = json.loads((FOLDER / "values.json").read_text("utf-8"))
EXPORTS = json.loads((FOLDER / "exported-c.json").read_text("utf-8"))


def expect_alike(found, expected, place):
    """Compare plain data; a later version may tell more, under other keys."""
    if isinstance(expected, dict):
        assert expected.keys() <= found.keys(), place
        for key in expected:
            expect_alike(found[key], expected[key], f"{place}, {key}")
    elif _numbers(expected):
        expected = np.array(expected, dtype=float)
        scale = np.max(np.abs(expected), initial=0.0, where=np.isfinite(expected))
        np.testing.assert_allclose(
            np.array(found, dtype=float), expected, rtol=1e-9, atol=1e-10 * scale, err_msg=place
        )
    elif isinstance(expected, list):
        assert len(found) == len(expected), place
        for k, both in enumerate(zip(found, expected, strict=True)):
            expect_alike(*both, f"{place}[{k}]")
    else:
        assert found == expected, place


def _numbers(value):
    """Whether a value is a number, or a list of numbers or of equally long such lists."""
    try:
        return np.array(value).dtype.kind in "if"
    except ValueError:
        return False


def waits(path):
    """Say whether a file is one more robot of a kind that another one stands for."""
    stand = ("delta-4", "five-bar", "mixed", "quadrupteron")
    return path.parent == ROBOTS and path.suffix == ".toml" and path.stem not in stand


@pytest.mark.parametrize(
    ("kind", "path"),
    [
        pytest.param(kind, path, id=label(path), marks=NIGHTLY if waits(path) else ())
        for kind, (_, paths) in FILES.items()
        for path in paths
    ],
)
@pytest.mark.filterwarnings("ignore::pteron.UnlikelyValue")
def test_a_file_of_version_0_1_holds_what_it_held(kind, path):
    read, _ = FILES[kind]
    expect_alike(json.loads(json.dumps(read(path))), VALUES[kind][label(path)], label(path))


def test_every_file_of_version_0_1_is_read():
    assert {kind: {label(path) for path in paths} for kind, (_, paths) in FILES.items()} == {
        kind: set(values) for kind, values in VALUES.items()
    }


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("name", gated(EXPORTS, ("delta",)))
def test_exported_c_declares_and_returns_what_it_did_in_version_0_1(name):
    expected = EXPORTS[name]
    found = exported(name, expected["state"])
    assert set(expected["signatures"]) <= set(found["signatures"])
    expect_alike(found["returned"], expected["returned"], name)
