"""Extras: the command that installs one, and that `make demo` brings those of what is shown."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from pteron.extras import install_command

ROOT = Path(__file__).parent.parent
NEEDED = {"design": "design", "film": "film", "identify": "consistency"}
"""Subcommands that do their work only with an extra."""

ORIGINS = {
    "registry": (None, '"pteron[film]"'),
    "folder": ({"url": "file:///a%20b", "dir_info": {}}, '"/a b[film]"'),
    "editable": (
        {"url": "file:///clone", "dir_info": {"editable": True}},
        '--editable "/clone[film]"',
    ),
    "wheel": (
        {"url": "file:///w/pteron-1.whl", "archive_info": {}},
        '"pteron[film] @ file:///w/pteron-1.whl"',
    ),
    "repository": (
        {"url": "https://host/p", "vcs_info": {"vcs": "git", "commit_id": "c0ffee"}},
        '"pteron[film] @ git+https://host/p@c0ffee"',
    ),
}


@pytest.mark.parametrize("origin", ORIGINS)
def test_an_extra_is_installed_from_where_pteron_came(origin, tmp_path, monkeypatch):
    record, wanted = ORIGINS[origin]
    folder = tmp_path / "pteron-1.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Name: pteron\nVersion: 1\n")
    if record is not None:
        (folder / "direct_url.json").write_text(json.dumps(record))
    monkeypatch.syspath_prepend(tmp_path)
    assert install_command("film") == f"{sys.executable} -m pip install {wanted}"


def test_sources_that_are_not_installed_are_installed():
    code = f"import runpy; made = runpy.run_path({str(ROOT / 'src' / 'pteron' / 'extras.py')!r})"
    code += "; print(made['install_command']('film'))"
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.rstrip().endswith(f'-m pip install --editable "{ROOT}[film]"')


@pytest.mark.parametrize(
    ("words", "module", "extra"),
    [
        (["design", "task.toml"], "pymoo", "design"),
        (["film", "delta", "-o", "cycle.mp4"], "imageio_ffmpeg", "film"),
    ],
)
def test_a_missing_extra_is_told_before_anything_slow_is_imported(words, module, extra):
    code = (
        f"import sys; sys.modules[{module!r}] = None\n"
        f"from pteron_command import main; sys.argv[1:] = {words!r}\n"
        "try:\n    main()\nfinally:\n    print('casadi' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert f"{sys.executable} -m pip install" in done.stderr
    assert f"[{extra}]" in done.stderr
    assert done.stdout == "False\n"


def test_the_set_up_of_readme_has_what_its_commands_need():
    """Tried with pip, in an empty environment, by `make first`."""
    text = "".join((ROOT / name).read_text("utf-8") for name in ("README.md", "docs/start/tour.md"))
    shown = set(re.findall(r"(?m)^ {4}(?:\.venv/bin/)?pteron (\w+)", text))
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    (set_up,) = re.findall(r"(?m)/\.runtime: EXTRAS := ([\w,]+)$", makefile)
    assert shown >= NEEDED.keys()
    assert {NEEDED[name] for name in shown & NEEDED.keys()} <= set(set_up.split(","))
