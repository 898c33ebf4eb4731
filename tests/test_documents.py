"""README and docs show what is there: links, names, commands, examples, pictures, equations.

What Sphinx itself refuses is left to `make docs`. Commands and their outputs are tried in
test_console_blocks.py, README's doctests where pytest collects them, the examples in
test_examples.py.
"""

import ast
import doctest
import importlib
import re
import runpy
import shutil
import sys

import console_blocks
import pytest
from claimed_machines import FREE, IN_THE_LOOP, LIMITED
from console_blocks import steps
from documentation import DOCS, MADE, PAGES, ROOT, TEXTS
from mechanisms import CATALOG, CLIENTS, TILTED, gated
from typer.main import get_command

import pteron
from pteron.cli.main import app

NAMES = pytest.mark.parametrize("name", TEXTS)

sys.path.insert(0, str(DOCS / "extensions"))


# Links.


def headings(page):
    """Return the anchors of a page: of its headings as GitHub and MyST make them, and labels."""
    text = re.sub(r"(?ms)^```.*?^```", "", page.read_text(encoding="utf-8"))
    found = {
        re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-")
        for title in re.findall(r"(?m)^#+ (.*)$", text)
    }
    return found | set(re.findall(r"(?m)^\((.*)\)=$", text))


@NAMES
def test_links_lead_somewhere(name):
    page, text = ROOT / name, re.sub(r"(?s)```.*?```", "", TEXTS[name])
    links = re.findall(r"\]\(([^)\s]+)\)", text) + re.findall(r'src="([^"]+)"', text)
    for link in links:
        if link.startswith(("https://", "http://")):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if target.is_relative_to(DOCS) and {*target.relative_to(DOCS).parts} & {*MADE}:
            continue  # `make docs` writes it, and follows the link
        assert target.exists(), f"{name}: {link}"
        if anchor:
            assert anchor in headings(target), f"{name}: {link}"


@NAMES
def test_names_and_paths_are_there(name):
    for path in re.findall(r"`((?:tests|benchmarks|examples|docs)/[\w./-]+)`", TEXTS[name]):
        assert (ROOT / path).exists() or path == "docs/_build/html", f"{name}: {path}"
    for path in re.findall(r"`((?:legs|closures|platforms|equations)/\w+\.py)`", TEXTS[name]):
        assert (ROOT / "src" / "pteron" / path).exists(), f"{name}: {path}"
    roles = re.findall(r"\{py:\w+\}`(?:[^`<]*<)?([\w.]+)>?`", TEXTS[name])
    for dotted in [*roles, *re.findall(r"`(pteron(?:\.\w+)+)(?:\(.*?\))?`", TEXTS[name])]:
        thing, *rest = dotted.split(".")
        found = importlib.import_module(thing)
        for part in rest:
            if not hasattr(found, part):
                found = importlib.import_module(f"{found.__name__}.{part}")
            else:
                found = getattr(found, part)


# Commands.


@NAMES
def test_options_that_are_shown_exist(name):
    group = get_command(app)
    for step in steps(name, TEXTS[name]):
        if step.words[0] != "pteron":
            continue
        line, (subcommand, *words) = step.command, step.words[1:]
        assert subcommand in group.commands, f"{name}: {line}"
        known = {option for p in group.commands[subcommand].params for option in p.opts}
        used = {word.split("=")[0] for word in words if word.startswith("--")}
        assert used <= known, f"{name}: {line}"


# Examples in Python.


def blocks(text):
    """Return the fenced blocks of Python of a page."""
    return re.findall(r"(?ms)^```python\n(.*?)^```", text)


WITH_BLOCKS = [name for name, text in TEXTS.items() if name != "README.md" and blocks(text)]


QUICK = [name for name in WITH_BLOCKS if "theory" in name]


@pytest.mark.parametrize("name", gated(WITH_BLOCKS, QUICK, CLIENTS))
def test_python_runs(name, tmp_path, monkeypatch):
    """In order, in one session; what follows `>>>` is compared with what is shown."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("builtins.input", lambda *words: "")  # Enter ends the viewer
    for machine in (ROOT / name).parent.glob("*.toml"):  # it lies beside the page
        shutil.copy(machine, tmp_path)
    names: dict[str, object] = {}
    finder = doctest.DocTestParser()
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    for block in blocks(TEXTS[name]):
        if ">>>" in block:
            test = finder.get_doctest(block, names, name, name, 0)
            assert runner.run(test, clear_globs=False).failed == 0
            names |= test.globs
        else:
            exec(compile(ast.parse(block), name, "exec"), names)


# Pictures.


@CLIENTS
def test_pictures_are_those_that_are_drawn(tmp_path, monkeypatch):
    """Those of the catalog take longer, and MuJoCo's need OpenGL: `make docs` compares all."""
    monkeypatch.syspath_prepend(DOCS / "pictures")
    script = runpy.run_path(str(DOCS / "pictures" / "draw.py"))
    for name in ("cycle", "legs", "vectors"):
        script["DRAWN"][name](tmp_path)
    drawn = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert len(drawn) == 2 + len(pteron.legs.KINDS) + 21
    for path in drawn:
        kept = DOCS / path.relative_to(tmp_path)
        assert script["alike"](kept, path), f"{kept} is not what is drawn; run make docs"
    other = next(path for path in drawn if path.name == "PSS.svg")
    assert not script["alike"](DOCS / "legs" / "RSS.svg", other)
    assert not script["alike"](DOCS / "catalog" / "delta.png", DOCS / "catalog" / "par4.png")
    assert not script["alike"](DOCS / "catalog" / "none.png", DOCS / "catalog" / "par4.png")


# The site.


def test_the_check_of_a_site_finds_what_is_wrong(tmp_path):
    """`make docs` ends with it."""
    faults = runpy.run_path(str(DOCS / "check_site.py"))["faults"]
    (tmp_path / "searchindex.js").write_text('"jacobian" "delta"')
    (tmp_path / "index.html").write_text('<p id="top"><a href="next.html#end">on</a>')
    (tmp_path / "next.html").write_text('<p id="end"><a href="index.html#top">back</a>')
    assert faults(tmp_path) == []
    (tmp_path / "index.html").write_text(
        '<script src="https://cdn.example/x.js"></script><a href="none.html">a</a>'
        '<a href="https://example.com">elsewhere</a><a href="#nowhere">b</a>'
    )
    assert set(faults(tmp_path)) == {
        "index.html: none.html leads nowhere",
        "index.html: #nowhere names no place of its page",
        "index.html: https://cdn.example/x.js is loaded from the network",
        "next.html: index.html#top names no place of its page",
        "next.html: no way leads there",
    }


CSS = """
@media screen { body article img { filter: invert(0.9); } }
@media print {
  .skip-to-content { display: none; }
}
table.docutils thead:not(:has(th p:not(:empty))) { display: none; }
"""


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({}, None),
        ({"css": CSS.replace("table.docutils", "table")}, "a table's head has words and is hidden"),
        ({"frame": '<iframe src="a.html">'}, "the frame of a.html scrolls within the page"),
        ({"picture": '<img src="a.png">'}, "the picture a.png has no name"),
        ({"picture": f'<img src="a.png" alt="{32 * "a"}.png">'}, "the picture a.png has no name"),
        ({"css": CSS.replace("@media screen {", "@media all {")}, "pictures are inverted on paper"),
        ({"css": CSS.replace("none", "block", 1)}, "the way past the menu is printed"),
        ({"keys": "NAVIGATION_WITH_KEYS: true"}, "an arrow key in code that scrolls"),
    ],
)
def test_the_check_of_a_site_finds_what_cannot_be_read(tmp_path, change, fault):
    parts = {
        "css": CSS,
        "frame": '<iframe src="a.html" scrolling="no"></iframe>',
        "picture": '<img src="a.png" alt="A Delta">',
        "keys": "NAVIGATION_WITH_KEYS: false",
    } | change
    for name in ("a.html", "a.png"):
        (tmp_path / name).write_text("")
    (tmp_path / "_static").mkdir()
    (tmp_path / "_static" / "site.css").write_text(parts["css"])
    (tmp_path / "_static" / "documentation_options.js").write_text(parts["keys"])
    (tmp_path / "searchindex.js").write_text('"jacobian" "delta"')
    (tmp_path / "index.html").write_text(
        f'<a href="a.html">a</a>{parts["frame"]}{parts["picture"]}'
        '<table class="dataframe"><thead><tr><th>torque</th></tr></thead></table>'
        '<table class="docutils"><thead><tr><th><p></p></th></tr></thead></table>'
    )
    found = runpy.run_path(str(DOCS / "check_site.py"))["faults"](tmp_path)
    assert [line for line in found if fault is None or fault not in line] == []
    assert bool(found) == (fault is not None)


def test_the_sites_own_style_is_fit_for_paper():
    checks = runpy.run_path(str(DOCS / "check_site.py"))
    style = (DOCS / "_static" / "site.css").read_text(encoding="utf-8")
    assert checks["style_faults"](style) == []


def test_pictures_without_a_name_get_the_heading_above_them():
    from for_everyone import name_pictures

    page = (
        '<h2>Forces<a class="headerlink" href="#f">#</a></h2><img alt="../_images/'
        f'{64 * "0"}.png" src="a.png"><img alt="A Delta" src="b.png">'
        '<div><img alt="" src="c.png"><p>x</p><div class="sphx-glr-thumbnail-title">A film</div>'
    )
    assert re.findall('alt="(.*?)"', name_pictures(page)) == ["Figure: Forces", "A Delta", "A film"]


def test_lines_of_code_break_on_a_phone_and_those_of_tables_do_not():
    from for_everyone import break_lines

    code = "<pre>&gt;&gt;&gt; f(1)  <span># one</span>\n</pre>"
    table = "<pre><span>leg</span>  force\n  1  2.0</pre>"
    assert 'class="breaks"' in break_lines(code)
    assert 'class="breaks"' not in break_lines(table)
    assert all("tabindex" in break_lines(block) for block in (code, table))


def test_each_page_has_a_title_of_its_own_and_the_how_tos_are_named_by_it():
    pages = [page for page in PAGES if page.is_relative_to(DOCS)]
    titles = {}
    for page in (*pages, *(DOCS / "notebooks").glob("*.ipynb")):
        title = re.search(r'(?m)^ *"?# (.*?)(?:\\n",)?$', page.read_text(encoding="utf-8"))
        titles[str(page.relative_to(ROOT))] = title[1]
    assert len(titles) == len(set(titles.values()))
    for page in ("docs/how-to/index.md", "docs/notebooks/index.md"):
        for words, path in re.findall(r"\[([^\]]+)\]\(([^)#]+\.(?:md|ipynb))\)", TEXTS[page]):
            target = str(((ROOT / page).parent / path).resolve().relative_to(ROOT))
            assert words == titles[target], page


@CLIENTS
@pytest.mark.parametrize(("columns", "is_cut"), [(30, False), (300, True)])
def test_the_check_in_a_browser_counts_code_that_is_cut(browser, tmp_path, columns, is_cut):
    checks = runpy.run_path(str(DOCS / "check_in_browser.py"))
    code = f"<pre style='overflow: auto'>{'x' * columns}</pre>"
    (tmp_path / "index.html").write_text(f"<article><details>{code}</details></article>")
    with checks["served"](tmp_path) as address:
        page = browser.new_page()
        faults = checks["code_faults"](page, address, tmp_path, False)
        page.close()
    assert len(faults) == (len(checks["CUT"]) if is_cut else 0)


def test_the_rank_of_a_page_among_the_results_of_a_search():
    rank = runpy.run_path(str(DOCS / "check_in_browser.py"))["rank"]
    links = ["sizing.html", "reference/functions/code.html#pteron.export_c", "view.html#keys"]
    assert [rank(links, page) for page in ("sizing", "pteron.export_c", "view")] == [1, 2, 4]


def test_topics_lead_to_one_page_each():
    from topics import TOPICS

    topics = [topic for of_page in TOPICS.values() for topic in of_page]
    assert len(topics) == len(set(topics))
    assert {str(DOCS / f"{page}.md") for page in TOPICS} <= {str(page) for page in PAGES}


def test_the_reference_lists_every_module():
    from reference import public_modules

    listed = re.findall(r"(?m)^   (pteron\.\w+)$", TEXTS["docs/reference/index.md"])
    assert sorted(listed) == sorted(module.__name__ for module in public_modules())


BREADTH = 88
"""Columns of code that fit the site's page at 1440 pixels."""


@NAMES
def test_code_is_no_wider_than_the_page(name):
    long = [
        f"{name}:{first + k}: {line}"
        for first, language, lines in console_blocks.blocks(TEXTS[name])
        if not language.startswith("{")
        for k, line in enumerate(lines)
        if len(line) > BREADTH
    ]
    assert long == []


# Counts.


NUMBERS = "four five six seven eight nine ten eleven twelve"
WORDS = {word: n for n, word in enumerate(NUMBERS.split(), start=4)} | {"thirty-six": 36}
"""Numbers from four on: two or three machines are named one by one, or in a title."""


def script(path, name):
    """Return what a script of the clone calls so."""
    sys.path.insert(0, str(ROOT / "benchmarks"))
    try:
        return runpy.run_path(str(ROOT / path))[name]
    finally:
        sys.path.pop(0)


COUNTS = (
    ("README.md", r"lists ([\w-]+) robots", lambda: len(pteron.catalog())),
    ("README.md", r"\[([\w-]+) machines\]\(docs/evidence", lambda: intervals_of_evidence()),
    ("docs/index.md", r"\[([\w-]+) machines to start", lambda: len(pteron.catalog())),
    ("docs/start/tour.md", r"lists ([\w-]+) machines", lambda: len(pteron.catalog())),
    ("docs/start/first-result.md", r"([\w-]+) machines come", lambda: len(pteron.catalog())),
    ("docs/evidence.md", r"all (\w+) machines of the catalog", lambda: len(CATALOG | TILTED)),
    (
        "docs/evidence.md",
        r"MuJoCo's closed loops, 20 random states of each of (\w+) machines",
        lambda: len(script("benchmarks/mujoco_convergence.py", "MACHINES")),
    ),
    (
        "docs/evidence.md",
        r"energy of free motion, 100 random states of each of (\w+) machines",
        lambda: len(FREE),
    ),
    (
        "docs/evidence.md",
        r"exact rates, pick-and-place cycle at 10 m/s\^2, (\w+) machines",
        lambda: len(script("benchmarks/control.py", "_MACHINES")),
    ),
    ("docs/evidence.md", r"time-optimal pick-and-place, (\w+) machines", lambda: len(CATALOG)),
    ("docs/trajectories.md", r"0\.99962 (\d+) machines: ", lambda: len(CATALOG)),
    (
        "docs/identification.md",
        r"each fault into logs of (\w+) machines",
        lambda: TEXTS["docs/faults.md"].partition("| fault |")[2].split("\n")[0].count("|"),
    ),
    (
        "docs/other-tools.md",
        r"The (\w+) machines of the catalog that tilt on rods",
        lambda: sum(map(on_rods_and_rams, TILTED.values())),
    ),
    ("docs/simulation.md", r"alike in C and NumPy: (\w+) machines", lambda: len(LIMITED)),
    ("docs/simulation.md", r"all laws, (\w+) machines", lambda: len(IN_THE_LOOP)),
)
"""Pages, the words on them that count machines, and where the true count comes from."""


def on_rods_and_rams(robot):
    """Return whether a machine was among those that LinuxCNC has moved."""
    kinds = {"UPS", "PSS", "RSS", "RPS", "PRS", "RRS"}
    return {leg.type for leg in robot.legs} <= kinds and robot.platform.axis_offset is None


def intervals_of_evidence():
    """Return of how many machines the evidence gives intervals."""
    return len(re.findall(r"(?m)^\| .*, \d+ values \|", TEXTS["docs/evidence.md"]))


@pytest.mark.parametrize(("name", "words", "count"), COUNTS)
def test_counts_are_those_of_what_is_counted(name, words, count):
    (shown,) = re.findall(words, " ".join(TEXTS[name].split()))
    shown = shown.lower()
    assert (int(shown) if shown.isdigit() else WORDS[shown]) == count(), f"{name}: {shown}"


@NAMES
def test_every_count_of_machines_is_derived(name):
    """One that is not in the table above would grow old unseen."""
    text = " ".join(re.sub(r"(?ms)^```.*?^```", "", TEXTS[name]).split())
    number = rf"\b(?:\d+|{'|'.join(WORDS)})"
    every = re.findall(rf"(?i){number} (?:machines|robots)\b", text)
    known = [pattern for page, pattern, _ in COUNTS if page == name]
    expected = 0 if name in FROM_OTHERS else len(every)
    assert len(known) >= expected, f"{name}: {every}"


FROM_OTHERS = {"docs/theory/direct-position.md": "a run of hours, benchmarks/direct_position.py"}
"""Pages whose counts of machines come from elsewhere."""


INTERVALS = {
    "Quadrupteron": "quadrupteron",
    "oblique Quadrupteron": "quadrupteron-oblique",
    "Tripteron": "tripteron",
    "Delta": "delta",
    "Par4": "par4",
    "6-UPS (`stewart`)": "stewart",
    "3-RRS (`ball-table`)": "ball-table",
}
"""Rows of the evidence, and the machine of the measured results."""


def test_intervals_of_the_evidence_are_those_that_were_measured():
    results = (ROOT / "benchmarks" / "identification" / "RESULTS.md").read_text(encoding="utf-8")
    measured = {}
    for line in results.split("\n"):
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if cells[0] in pteron.catalog() and len(cells) == 11:
            measured[cells[0]] = cells
    rows = re.findall(r"(?m)^\| (.*), (\d+) values \| (.*) \|$", TEXTS["docs/evidence.md"])
    assert [row[0] for row in rows] == list(INTERVALS)
    for machine, count, cells in rows:
        true = measured.pop(INTERVALS[machine])
        assert [count, *cells.split(" | ")[:3]] == true[1:5], machine
        assert cells.split(" | ")[3] in (f"{float(true[8]) + e:.2f}" for e in (0.0, 1e-9)), machine
    assert not measured
    shares = [float(row[2].split(" %")[0]) for row in rows]
    assert f"{min(shares):g} to {max(shares):g} % of the time" in TEXTS["README.md"]


def test_times_of_the_evidence_are_those_that_were_measured():
    """The first number of each row; the others are ratios to it, or other programs'."""
    results = (ROOT / "benchmarks" / "RESULTS.md").read_text(encoding="utf-8")
    _, _, section = TEXTS["docs/evidence.md"].partition("## How fast is it?")
    tables, _, _ = section.partition("| Quadrupteron, operations a state")
    rows = re.findall(r"(?m)^\| [^|]*[\w)] \| ([\d.]+)", tables)
    assert len(rows) >= 7
    for number in rows:
        assert re.search(rf"(?<![\d.]){re.escape(number)}(?![\d.])", results), number
    (batch,) = re.findall(r"forces of a batch of states \| ([\d.]+) ns", TEXTS["README.md"])
    assert f"| batch of 100 000 | {batch};" in tables


def test_the_catalogs_page_has_a_card_for_each_machine():
    tables = re.findall(r"(?ms)^:::\{machines\}\n(.*?)^:::$", TEXTS["docs/catalog.md"])
    rows = re.findall(r"(?m)^\| `([\w-]+)` \|", "".join(tables))
    assert sorted(rows) == sorted(pteron.catalog())


# The theory.


def test_each_equation_has_code_and_each_citation_an_equation():
    from equation_code import CODE
    from equations import cited

    theory = "\n".join(text for name, text in TEXTS.items() if "/theory/" in name)
    labels = re.findall(r"(?m)^\$\$ \(eq-(\w+)\)$", theory)
    assert len(labels) == len(set(labels))
    assert set(labels) == set(CODE)
    assert {str(number) for number in range(1, 17)} <= set(labels)
    for place in {place for places in CODE.values() for place in places}:
        parts = place.split(".")
        for k in range(len(parts), 0, -1):
            try:
                found = importlib.import_module(".".join(parts[:k]))
            except ImportError:
                continue
            for part in parts[k:]:
                found = getattr(found, part)
            break
        assert callable(found), place
    source = "\n".join(p.read_text(encoding="utf-8") for p in (ROOT / "src").rglob("*.py"))
    assert set(cited(source)) <= set(labels)
    assert set(re.findall(r"\{eq\}`eq-(\w+)`", theory)) <= set(labels)
    assert len(set(cited(source))) > 10


def test_sources_that_are_cited_are_in_the_bibliography():
    known = set(re.findall(r"@\w+\{(\w+),", (DOCS / "references.bib").read_text(encoding="utf-8")))
    cited = {
        key
        for text in TEXTS.values()
        for keys in re.findall(r"\{cite:p\}`([\w,]+)`", text)
        for key in keys.split(",")
    }
    assert cited
    assert cited <= known


def test_the_paper_cites_what_it_lists_and_states_what_the_evidence_does():
    paper = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
    known = re.findall(r"@\w+\{(\w+),", (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8"))
    assert sorted(set(re.findall(r"[\[ ]@([a-z]\w+)", paper))) == sorted(known)
    assert 250 <= len(paper.partition("# Summary")[2].split()) <= 1000
    evidence = TEXTS["docs/evidence.md"]
    for figure in ("385", "323", "806", "11.3", "93.9", "95.5", "9e-14"):
        assert re.search(rf"\b{figure}\b", paper), figure
        assert re.search(rf"\b{figure}\b", evidence), figure
