"""Shell completion, asked by a real bash."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from mechanisms import CLIENTS

pytestmark = pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")

LINES = {
    "pteron inverse quad": ["quadrupteron", "quadrupteron-oblique"],
    "pteron check robots/d": ["robots/drawn.toml"],
    "pteron base no-such-rob": [],
    "pteron export delta --function inverse_d": ["inverse_dynamics", "inverse_dynamics_base"],
    "pteron workspace delta --index manip": ["manipulability"],
    "pteron base delta --keep I_u1,m_u": ["I_u1,m_u1", "I_u1,m_u2", "I_u1,m_u3"],
}
"""What is typed, the cursor behind it, and what the shell proposes."""


def bash(code: str, folder: Path) -> str:
    """Return what bash prints, `pteron` being the one under test and home being empty."""
    program = folder / "bin" / "pteron"
    program.parent.mkdir(exist_ok=True)
    text = f"#!{sys.executable}\nfrom pteron_command import main\nmain()\n"
    program.write_text(text, encoding="utf-8")
    program.chmod(0o755)
    path = f"{program.parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "--norc", "-c", f"{code}\ntrue"],
        cwd=folder,
        env={**os.environ, "PATH": path, "HOME": str(folder)},
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr, done.stderr
    return done.stdout


@CLIENTS
def test_bash_completes_machines_parameters_functions_and_choices(tmp_path: Path):
    (tmp_path / "robots").mkdir()
    for file in ("robots/drawn.csv", "robots/drawn.toml"):
        (tmp_path / file).touch()
    code = ["pteron --install-completion >/dev/null", ". ~/.bash_completions/*.sh"]
    for line in LINES:
        words = line.split(" ")
        listed = " ".join(f"'{word}'" for word in words)
        code += [f"COMP_WORDS=({listed}); COMP_CWORD={len(words) - 1}"]
        code += ["COMPREPLY=(); _pteron_completion pteron; echo ${COMPREPLY[@]}"]
    shown = bash("\n".join(code), tmp_path).splitlines()
    assert [line.split() for line in shown] == list(LINES.values())
    assert "pteron" in (tmp_path / ".bashrc").read_text(encoding="utf-8")
