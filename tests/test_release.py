"""What a release needs says the same: its version, its dependencies, its place in the changelog."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

import pteron

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
CHANGELOG = (ROOT / "CHANGELOG.md").read_text("utf-8")
RELEASED = re.search(r"(?m)^## \[(\d.*?)\]", CHANGELOG)[1]
"""The latest release."""
RECIPE = yaml.safe_load((ROOT / "recipe" / "recipe.yaml").read_text("utf-8"))


@pytest.mark.parametrize(
    ("file", "line"),
    [
        ("CITATION.cff", r"(?m)^version: (.*)$"),
        ("recipe/recipe.yaml", r'(?m)^  version: "(.*)"$'),
        ("docs/start/install.md", r"pteron-(.*)-py3-none-any\.whl"),
    ],
)
def test_a_release_has_one_version(file, line):
    assert re.search(line, (ROOT / file).read_text("utf-8"))[1] == RELEASED


def test_the_version_changes_with_the_first_change_after_a_release():
    changes = CHANGELOG.partition("## [Unreleased]")[2].partition(f"## [{RELEASED}]")[0]
    if not changes.strip():
        assert pteron.__version__ == RELEASED
        return
    following, is_development, number = pteron.__version__.partition(".dev")
    assert is_development
    assert number.isdecimal()
    assert [*map(int, following.split("."))] > [*map(int, RELEASED.split("."))]


def test_the_changelog_and_the_citation_have_one_date():
    date = re.search(r'(?m)^date-released: "(.*)"$', (ROOT / "CITATION.cff").read_text("utf-8"))[1]
    assert f"\n## [{RELEASED}] - {date}\n" in CHANGELOG


def test_the_conda_recipe_needs_what_the_wheel_needs():
    wheel = {f"python{PROJECT['requires-python']}", *PROJECT["dependencies"]}
    recipe = {one.replace(" ", "") for one in RECIPE["requirements"]["run"]}
    assert {one.replace("matplotlib-base", "matplotlib") for one in recipe} == wheel
    (command,) = RECIPE["build"]["python"]["entry_points"]
    assert PROJECT["scripts"] == dict([command.split(" = ")])
