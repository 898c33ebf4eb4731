"""The pages in a real browser, and in print: report, motion and identification."""

import json
import re
import shutil
import subprocess
from base64 import b64decode
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from logs_of_motions import log_of
from mechanisms import CATALOG, CLIENTS, MECHANISMS, gated, several
from page_reader import driven
from PIL import Image

import pteron
from pteron.identification import identify
from pteron.identification.logs import write_log
from pteron.motion import Motion, pick_and_place
from pteron.playback import Playback, playback
from pteron.report import write_motion_page, write_report
from pteron.report.identification import write_identification
from pteron.report.motion_frames import frames
from pteron.report.typeset import significant
from pteron.workspace import home_pose

MACHINES = {
    **{name: CATALOG[name] for name in ("quadrupteron", "par4", "five-bar", "3-rrr")},
    "mixed": MECHANISMS["random PRR 0"],
    "driven": driven(CATALOG["tripteron"]),
}


@lru_cache
def cycle(name):
    """Return a closed motion of a machine about its home pose."""
    robot = MACHINES[name]
    return pick_and_place(robot, home_pose(robot), samples=481, least=0.1)


def way_out(name):
    """Return a motion that ends elsewhere than it begins: the first half of the cycle."""
    whole = cycle(name)
    half = slice(len(whole.time) // 2 + 1)
    return Motion(
        *(getattr(whole, key)[half] for key in ("time", "pose", "velocity", "acceleration"))
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("pages")


@lru_cache
def _written(folder, kind, name):
    target = folder / f"{kind}-{name}.html"
    if kind == "motion":
        return write_motion_page(MACHINES[name], cycle(name), target)
    if kind == "out":
        return write_motion_page(MACHINES[name], way_out(name), target)
    if kind == "report":
        return write_report(MACHINES[name], folder / name)
    robot = CATALOG["delta"]
    noise = {} if name == "noise-free" else {"joint_noise": 2e-7, "force_noise": 0.05}
    log = log_of(robot, duration=5.0, rate=300.0, **noise)
    return write_identification(identify(robot, log), folder / f"identified-{name}").page


@pytest.fixture
def page_of(folder):
    return lambda kind, name="": _written(folder, kind, name)


@contextmanager
def opened(browser, path, width=1440, query="", **context) -> Iterator:
    """Open a page; it must ask for nothing but itself, and have nothing to complain of."""
    look = {"viewport": {"width": width, "height": 900}, "reduced_motion": "reduce", **context}
    there = browser.new_context(**look)
    page = there.new_page()
    faults, asked = [], []
    page.on("console", lambda message: faults.append(message.text))
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(path.as_uri() + query)
    yield page
    assert faults == []
    assert set(asked) == {path.as_uri() + query}
    there.close()


def picture(page):
    """Return the view's picture, once what was asked for is drawn."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return page.evaluate("document.getElementById('view').toDataURL()")


def scene(page):
    return json.loads(page.inner_text("#scene"))


def middle(page):
    box = page.locator("#view").bounding_box()
    return box["x"] + box["width"] / 2.0, box["y"] + box["height"] / 2.0


# The view


@CLIENTS
def test_a_drag_turns_the_view_and_a_button_turns_it_back(browser, page_of):
    with opened(browser, page_of("report", "driven")) as page:
        before = picture(page)
        page.mouse.move(*middle(page))
        page.mouse.down()
        page.mouse.move(*(value + 60.0 for value in middle(page)), steps=4)
        page.mouse.up()
        assert picture(page) != before
        page.click("#reset")
        assert picture(page) == before


@CLIENTS
def test_the_wheel_is_the_pages_until_the_view_is_clicked(browser, page_of):
    with opened(browser, page_of("report", "driven")) as page:
        place = page.evaluate_handle("window")

        def turned():
            page.mouse.wheel(0, 120)
            page.wait_for_timeout(250)  # smooth scrolling
            return place.evaluate("(window) => window.scrollY"), picture(page)

        before = picture(page)
        page.mouse.move(*middle(page))
        down, same = turned()
        assert down > 0.0
        assert same == before
        page.mouse.move(*middle(page))
        page.mouse.down()
        page.mouse.up()
        still, zoomed = turned()
        assert still == down
        assert zoomed != before
        page.mouse.move(2, 2)  # away, and back
        page.mouse.move(*middle(page))
        further, same = turned()
        assert further > down
        assert same == zoomed


PRESS = """([key, count]) => {
    const canvas = document.getElementById("view");
    for (let k = 0; k < count; k++) canvas.dispatchEvent(new KeyboardEvent("keydown", { key }));
}"""


def drawn(page):
    """Return where something is drawn in the view."""
    data = b64decode(picture(page).partition(",")[2])
    return np.asarray(Image.open(BytesIO(data)))[..., 3] > 0


def border(image, width):
    inner = image.copy()
    inner[width:-width, width:-width] = False
    return inner


@CLIENTS
@pytest.mark.parametrize(
    ("name", "width"),
    several([("quadrupteron", 390), ("mixed", 1440), ("3-rrr", 390)], [("3-rrr", 390)]),
)
def test_the_machine_is_in_the_view_at_any_angle(browser, page_of, name, width):
    with opened(browser, page_of("motion", name), width) as page:
        for rise, tilts in (("ArrowUp", 3), ("ArrowDown", 5)):
            for _ in range(tilts):
                page.evaluate(PRESS, [rise, 5])
                page.evaluate(PRESS, ["ArrowRight", 7])
                assert not border(drawn(page), 2).any()
        page.evaluate(PRESS, ["Home", 1])
        image = drawn(page)
        assert not border(image, 8).any()
        assert border(image, image.shape[0] // 8).any(), "it fills the view, too"


CURSORS = """() => [...document.querySelectorAll("svg[data-time]")].map((svg) => {
    const [start, end, left, right] = svg.dataset.time.split(" ").map(Number);
    const x = Number(svg.querySelector(".cursor").getAttribute("x1"));
    return start + ((x - left) / (right - left)) * (end - start);
})"""
"""Times at which the lines in the curves stand."""


@CLIENTS
def test_a_line_in_every_curve_over_time_follows_the_picture(browser, page_of):
    with opened(browser, page_of("motion", "par4")) as page:
        data = scene(page)
        page.fill("#seek", "100")
        places = page.evaluate(CURSORS)
        assert len(places) == 4
        np.testing.assert_allclose(places, data["time"][100], atol=1e-4)


@CLIENTS
@pytest.mark.parametrize("width", [360, 800])
def test_in_a_frame_of_another_page_there_is_nothing_to_scroll(browser, page_of, width):
    with opened(browser, page_of("motion", "par4"), width=width, query="?embedded") as page:
        page.set_viewport_size({"width": width, "height": 544})
        assert page.evaluate("document.documentElement.scrollHeight") <= 544
        shown = [name for name in ("#view", "#play", "#seek") if page.locator(name).is_visible()]
        assert shown == ["#view", "#play", "#seek"]
        assert page.locator("#view").bounding_box()["height"] > 300
        assert not page.locator("h1").is_visible()


@CLIENTS
@pytest.mark.parametrize("system", ["dark", "light"])
def test_a_frame_follows_the_theme_that_the_page_around_it_sends(browser, page_of, system):
    paper = "getComputedStyle(document.body).backgroundColor"
    with opened(browser, page_of("motion", "par4"), query="?embedded", color_scheme=system) as page:
        own, drawn = page.evaluate(paper), picture(page)
        for theme in ("dark", "light"):
            page.evaluate("theme => window.postMessage(theme, '*')", theme)
            page.wait_for_function(
                f"own => ({paper} === own) === {json.dumps(theme == system)}", arg=own
            )
            assert (picture(page) == drawn) == (theme == system)


@CLIENTS
def test_keys_alone_do_everything(browser, page_of):
    with opened(browser, page_of("out", "quadrupteron")) as page:
        order = []
        for _ in range(5):
            page.keyboard.press("Tab")
            order.append(page.evaluate("document.activeElement.id"))
        assert order == ["view", "play", "seek", "pace", "reset"]
        page.focus("#view")
        start = picture(page)
        for keys, back in (("ArrowLeft", "ArrowRight"), ("+", "-"), ("ArrowUp", "Home")):
            page.keyboard.press(keys)
            assert picture(page) != start
            page.keyboard.press(back)
        page.keyboard.press("Home")
        assert picture(page) == start
        assert page.evaluate("window.scrollY") == 0.0
        page.focus("#seek")
        page.keyboard.press("ArrowRight")
        assert page.input_value("#seek") == "1"
        page.focus("#play")
        page.keyboard.press("Space")
        assert page.get_attribute("#play", "aria-label") == "Pause"


# Playback


def seconds(page):
    return float(page.inner_text("#clock").split()[0])


@CLIENTS
@pytest.mark.parametrize("kind", ["motion", "out"])
def test_playback_keeps_the_time_it_says(browser, page_of, kind):
    whole = cycle("quadrupteron").duration
    with opened(browser, page_of(kind, "quadrupteron")) as page:
        page.clock.install(time=0)
        page.reload()
        page.clock.pause_at(1000)
        step = scene(page)["time"][1]
        assert page.input_value("#pace") == "0.4"
        assert page.inner_text("#pace option:checked") == "40 % of real speed"
        assert seconds(page) == 0.0, "it does not move of itself where motion is to be reduced"
        page.click("#play")
        for pace, at in (("0.4", 0.2), ("1", 0.7 * whole), ("0.1", 0.1)):
            page.select_option("#pace", pace)
            page.evaluate("document.getElementById('seek').value = 0")
            page.dispatch_event("#seek", "input")
            page.click("#play")
            page.clock.run_for(int(1e3 * at / float(pace)))
            shown = at if kind == "motion" else min(at, whole / 2.0)
            assert seconds(page) == pytest.approx(shown, abs=step + 0.02 * float(pace) + 0.006)
            stopped = kind == "out" and at > whole / 2.0
            label = "Play" if stopped else "Pause"
            assert page.get_attribute("#play", "aria-label") == label
            assert ("stops at its end" in page.inner_text(".hint")) == (kind == "out")
            if not stopped:
                page.click("#play")
        # A closed motion goes on; the other one begins anew when it is asked to.
        page.select_option("#pace", "1")
        page.click("#play")
        page.clock.run_for(int(1e3 * 1.3 * whole))
        assert (seconds(page) < 0.45 * whole) == (kind == "motion")
        if kind == "out":
            page.click("#play")
            page.clock.run_for(100)
            assert 0.0 < seconds(page) < 0.2


@CLIENTS
def test_a_motion_begins_by_itself_where_motion_is_welcome(browser, page_of):
    with opened(browser, page_of("motion", "quadrupteron"), reduced_motion="no-preference") as page:
        assert page.get_attribute("#play", "aria-label") == "Pause"
        page.wait_for_function("document.getElementById('seek').value > 3")
        page.click("#play")
        held = page.inner_text("#clock")
        picture(page)
        assert page.inner_text("#clock") == held


SHOWN = """(k) => {
    const seek = document.getElementById("seek"), next = requestAnimationFrame;
    const texts = (word) => [...document.querySelectorAll("b[id^=" + word + "]")];
    seek.value = k; seek.dispatchEvent(new Event("input"));
    return new Promise((done) => next(() => next(() => done(
        ["force", "joint", "pose"].map((word) => texts(word).map((one) => one.textContent))))));
}"""
"""The texts of forces, joints and pose in a frame."""


@CLIENTS
@pytest.mark.parametrize(
    "name", gated(["quadrupteron", "par4", "five-bar", "mixed", "driven"], ["mixed"])
)
def test_the_numbers_shown_are_the_librarys(browser, page_of, name):
    robot, motion = MACHINES[name], cycle(name)
    with opened(browser, page_of("motion", name)) as page:
        times = np.array(scene(page)["time"])
        for k in (0, 37, 101, len(times) - 1):
            i = int(np.argmin(np.abs(motion.time - times[k])))
            assert motion.time[i] == pytest.approx(times[k], abs=1e-6)
            state = motion.pose[i], motion.velocity[i], motion.acceleration[i]
            lengths = [180.0 / np.pi if c == "phi" else 1e3 for c in robot.coordinates]
            factors = [180.0 / np.pi if leg.joint.unit == "rad" else 1e3 for leg in robot.legs]
            expected = (
                pteron.drive_forces(robot, *state, smooth=True),
                pteron.inverse_kinematics(robot, state[0]) * factors,
                state[0] * lengths,
            )
            for texts, values in zip(page.evaluate(SHOWN, k), expected, strict=True):
                for text, value in zip(texts, values, strict=True):
                    places = len(text.partition(".")[2])
                    assert places > 0
                    # Half of the last digit, and what the page's data are rounded to.
                    close = 0.5 * 10.0**-places + 1e-4
                    assert float(text.replace("\u2212", "-")) == pytest.approx(value, abs=close)


# Pages


PAGES = [("report", "driven"), ("out", "3-rrr"), ("motion", "par4"), ("identification", "")]
EACH_PAGE = pytest.mark.parametrize(("kind", "name"), PAGES)


@CLIENTS
@pytest.mark.parametrize(
    ("kind", "name", "width"),
    [
        *(("report", "driven", width) for width in (390, 800, 1440)),
        *(("out", "3-rrr", width) for width in (390, 1440)),
        *(("identification", "", width) for width in (390, 1440)),
    ],
)
def test_a_page_is_as_broad_as_its_window_and_cuts_nothing_without_a_cue(
    browser, page_of, kind, name, width
):
    with opened(browser, page_of(kind, name), width) as page:
        assert page.evaluate("document.documentElement.scrollWidth") == width
        page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true })")
        assert page.evaluate("document.documentElement.scrollWidth") == width
        cut = 0
        for box in page.locator(".scroll").all():
            hidden = box.evaluate("(box) => box.scrollWidth - box.clientWidth")
            left, right = shades(box)
            assert (right > 20.0) == (hidden > 0), "the cue says that there is more"
            assert left < 3.0
            if hidden > 0:
                cut += 1
                box.evaluate("(box) => { box.scrollLeft = box.scrollWidth }")
                left, right = shades(box)
                assert left > 20.0
                assert right < 3.0
                assert box.get_attribute("tabindex") == "0", "keys reach what is cut off"
        assert (cut > 0) == (width == 390)
        assert page.evaluate(
            "[...document.querySelectorAll('svg, canvas, table, p')].every((one) => "
            "one.closest('.scroll') || one.getBoundingClientRect().right <= innerWidth)"
        )


OVERLAPS = """() => [...document.querySelectorAll("svg.plot")].flatMap((plot) => {
    const boxes = [...plot.querySelectorAll("g[id*=axis_] text, g[id*=legend_] text")]
        .filter((text) => text.textContent.trim())
        .map((text) => [text.textContent, text.getBoundingClientRect()]);
    const shared = (a, b, low, high) => Math.min(a[high], b[high]) - Math.max(a[low], b[low]);
    return boxes.flatMap(([one, a], i) => boxes.slice(0, i)
        .filter(([, b]) => shared(a, b, "left", "right") > 1 && shared(a, b, "top", "bottom") > 2)
        .map(([other]) => [plot.getAttribute("aria-label"), one, other]));
})"""
"""Pairs of a picture's labels that lie on each other."""

LETTERS = """() => Math.min(...[...document.querySelectorAll("figure svg.plot")].flatMap((plot) => {
    const scale = plot.getBoundingClientRect().width / plot.viewBox.baseVal.width;
    const texts = [...plot.querySelectorAll("g[id*=axes_] g[id*=axis_] text")];
    return plot.closest(".scroll, .still") || !scale ? []
        : texts.map((text) => scale * parseFloat(getComputedStyle(text).fontSize));
}))"""
"""Size of the smallest letters of scales, pixels."""

FAINT = """() => {
    const rgb = (color) => color.match(/[\\d.]+/g).slice(0, 3).map(Number);
    const light = (color) => rgb(color).map((c) => c / 255)
        .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
        .reduce((sum, c, i) => sum + [0.2126, 0.7152, 0.0722][i] * c, 0);
    const paper = light(getComputedStyle(document.body).backgroundColor);
    const texts = "g[id*=axis_] text, g[id*=legend_] text, p, td, th, caption, figcaption, dt";
    return [...document.querySelectorAll(texts)]
        .filter((one) => one.textContent.trim())
        .map((one) => getComputedStyle(one)[one.closest("svg") ? "fill" : "color"])
        .filter((color) => color.startsWith("rgb"))
        .filter((color) => {
            const [low, high] = [light(color), paper].sort((a, b) => a - b);
            return (high + 0.05) / (low + 0.05) < 4.5;
        });
}"""
"""Colours of texts that are too near to the page's."""


@CLIENTS
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize(
    ("kind", "name"), [("identification", "noise-free"), ("report", "driven"), ("motion", "par4")]
)
def test_letters_of_pictures_can_be_read(browser, page_of, kind, name, scheme):
    for width in (390, 1440):
        with opened(browser, page_of(kind, name), width, color_scheme=scheme) as page:
            assert page.evaluate("document.documentElement.scrollWidth") == width
            assert page.evaluate(OVERLAPS) == []
            assert page.evaluate(LETTERS) > 9.0
            assert page.evaluate(FAINT) == []
            names = "[...document.querySelectorAll('.scroll')].every((b) => b.ariaLabel)"
            assert page.evaluate(names), "what scrolls has a name"


def shades(box):
    """Return how much darker an element is at its left and right border than between, of 255."""
    box.scroll_into_view_if_needed()
    image = np.asarray(Image.open(BytesIO(box.screenshot())).convert("L"), dtype=float)
    # Most of a column is neither letters nor lines.
    light = np.percentile(image, 70.0, axis=0)
    return light.max() - light[1], light.max() - light[-2]


@CLIENTS
@EACH_PAGE
def test_dark_is_dark_on_the_screen_and_white_on_paper(browser, page_of, kind, name):
    with opened(browser, page_of(kind, name), color_scheme="dark") as page:
        shade = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)"
        ink = shade.replace("backgroundColor", "color")
        assert max(page.evaluate(shade)) < 60 < 200 < min(page.evaluate(ink))
        page.emulate_media(media="print")
        assert max(page.evaluate(ink)) < 60 < 200 < min(page.evaluate(shade))


BESIDE_TEXT = """() => [...document.querySelectorAll("svg.plot g text")]
    .filter((text) => text.ownerSVGElement.getBoundingClientRect().width)
    .map((text) => {
        const drawn = text.ownerSVGElement, scale = drawn.getBoundingClientRect().width;
        const size = parseFloat(getComputedStyle(text).fontSize);
        const own = parseFloat(getComputedStyle(document.body).fontSize);
        return (size * scale) / drawn.viewBox.baseVal.width / own;
    })"""
"""Sizes of the letters in pictures, as shares of those of the text."""


@CLIENTS
@EACH_PAGE
def test_letters_of_pictures_are_about_as_large_as_the_text(browser, page_of, kind, name):
    for media, width in (("print", 695), ("screen", 1440)):  # a sheet of A4, and a wide window
        with opened(browser, page_of(kind, name), width) as page:
            page.emulate_media(media=media)
            shares = page.evaluate(BESIDE_TEXT)
            assert min(shares) > 0.6
            assert max(shares) < 1.1


PRINTED = """() => {
    const all = (what) => [...document.querySelectorAll(what)];
    const figures = all("figure").filter((figure) => figure.querySelector("figcaption"));
    return [
        all("caption").map((one) => one.textContent),
        figures.map((one) => [
            one.querySelector("figcaption").lastChild.textContent,
            [...one.querySelectorAll("g text")].map((text) => text.textContent),
        ]),
        all("details:not([open])").map((one) => one.lastElementChild.textContent),
    ];
}"""
"""Captions of tables, captions and labels of pictures, ends of closed sections."""


@CLIENTS
@EACH_PAGE
def test_in_print_nothing_is_left_out_or_left_behind(browser, page_of, kind, name, tmp_path):
    if shutil.which("pdftotext") is None:
        pytest.skip("no pdftotext on this machine")
    with opened(browser, page_of(kind, name)) as page:
        captions, figures, folded = page.evaluate(PRINTED)
        page.pdf(
            path=tmp_path / "page.pdf", format="A4", margin=dict.fromkeys(("top", "bottom"), "14mm")
        )
    text = subprocess.run(
        ["pdftotext", tmp_path / "page.pdf", "-"], capture_output=True, check=True, text=True
    ).stdout
    sheets = [bare(sheet) for sheet in text.split("\f")]
    assert captions
    assert figures
    for caption in map(bare, captions):
        (rest,) = {sheet.partition(caption)[2] for sheet in sheets if caption in sheet} or {""}
        assert re.match(r".{3,}\d", rest), f"{caption} stands alone"
    for caption, labels in figures:
        around = [sheet for sheet in sheets if bare(caption)[:20] in sheet]
        known = [sum(bare(label) in sheet for label in labels) for sheet in around]
        assert max(known, default=0) > 0.7 * len(labels), f"{caption} stands alone"
    assert len(folded) == (2 if kind == "report" else 0)
    for part in folded:
        assert any(bare(part)[:40] in sheet for sheet in sheets), part
    assert "Dragor" not in "".join(sheets), "what only a screen can do"


def bare(text):
    """Return letters and digits alone: print sets indices and columns where they fit."""
    return re.sub(r"[\W_]+", "", text)


@CLIENTS
def test_without_a_script_there_is_a_picture(browser, page_of):
    path = page_of("motion", "quadrupteron")
    with opened(browser, path, java_script_enabled=False) as page:
        assert page.locator(".still svg").is_visible()
        assert not page.locator(".stage").is_visible()
        assert not page.locator(".live").is_visible()


# Motions


def test_a_long_motion_is_thinned_to_moments_that_were_sampled():
    robot = MACHINES["quadrupteron"]
    rest = np.zeros((40_001, 4))
    time = np.linspace(0.0, 20.0, len(rest))
    wave = 0.03 * np.sin(time)[:, None] * [1.0, 1.0, 0.0, 1.0]
    forces = np.arange(len(rest))[:, None] + np.arange(4.0)
    found = frames(robot, Motion(time, wave, rest, rest), forces)
    assert len(found.time) == 1201
    rows = found.forces[:, 0].astype(int)
    np.testing.assert_array_equal(found.time, time[rows])
    np.testing.assert_array_equal(found.pose, wave[rows])
    np.testing.assert_array_equal(
        found.points.coordinates, pteron.inverse_kinematics(robot, wave[rows])
    )
    assert np.ptp(np.diff(found.time)) <= 1.01 * time[1]
    assert rows[0] == 0
    assert rows[-1] == 40_000
    assert len(frames(robot, Motion(9.0 * time, wave, rest, rest), forces).time) == 2401


def test_a_coarse_motion_has_moments_between_its_samples():
    motion = way_out("quadrupteron")
    few = Motion(
        *(getattr(motion, key)[::48] for key in ("time", "pose", "velocity", "acceleration"))
    )
    given = np.outer(few.time, np.ones(4))
    found = frames(MACHINES["quadrupteron"], few, given)
    assert len(found.time) == 241
    np.testing.assert_array_equal(found.pose, few.at(found.time)[0])
    np.testing.assert_allclose(found.forces[:, 2], found.time, atol=1e-12)
    assert not found.closed
    assert frames(MACHINES["quadrupteron"], cycle("quadrupteron")).closed


def test_a_log_is_shown_as_it_was_measured(tmp_path):
    robot = CATALOG["quadrupteron"]
    log = log_of(robot, duration=4.0, rate=500.0, joint_noise=1e-7, force_noise=0.05)
    file = write_log(log, tmp_path / "log.csv")
    found = playback(robot, file)
    assert found.log
    assert found.source == "log.csv"
    assert len(found.motion.time) == len(log.time)
    np.testing.assert_array_equal(found.forces, log.forces)
    joints = pteron.inverse_kinematics(robot, found.motion.pose)
    np.testing.assert_allclose(joints, log.joints, atol=6e-7)
    page = write_motion_page(robot, file, tmp_path / "log.html").read_text("utf-8")
    assert "a log: poses follow from the measured joints" in page
    assert "as they were measured" in page
    # In millimetres, as the file beside it says, and with a hole.
    text = file.read_text().replace("rho", "s").splitlines()
    rows = [line.split(",") for line in text[1:600] + text[700:]]
    scaled = [[r[0], *(repr(1e3 * float(cell)) for cell in r[1:5]), *r[5:]] for r in rows]
    other = tmp_path / "other.csv"
    other.write_text("\n".join([text[0], *map(",".join, scaled)]))
    other.with_suffix(".toml").write_text(
        '[joints]\ncolumns = ["s1", "s2", "s3", "s4"]\nunit = "mm"\n[motion]\nperiod = 1.0\n'
    )
    again = playback(robot, other)
    start = int(np.argmin(np.abs(log.forces - again.forces[0]).sum(axis=1)))
    np.testing.assert_allclose(again.motion.pose[0], found.motion.pose[start], atol=1e-6)


@CLIENTS
def test_a_simulation_and_a_table_bring_their_forces(tmp_path):
    robot = MACHINES["driven"]
    motion = cycle("driven")
    table = tmp_path / "table.csv"
    names = ["t", *robot.coordinates, *robot.force_names]
    forces = np.full_like(motion.pose, 7.25)
    values = np.column_stack([motion.time, motion.pose, forces])
    np.savetxt(table, values, delimiter=",", header=",".join(names), comments="", fmt="%.12g")
    found = playback(robot, table)
    np.testing.assert_array_equal(found.forces, forces)
    page = write_motion_page(robot, found, tmp_path / "a.html").read_text("utf-8")
    assert "Given force" in page
    assert "those of the table" in page
    assert json.loads(re.search(r'id="scene">(.*?)</script>', page)[1])["forces"][5] == [7.25] * 3
    held = Playback(motion)
    assert "Drive force" in write_motion_page(robot, held, tmp_path / "b.html").read_text("utf-8")


def test_a_table_of_poses_may_have_semicolons_and_decimal_commas(tmp_path):
    robot = MACHINES["driven"]
    motion = cycle("driven")
    plain, other = tmp_path / "plain.csv", tmp_path / "other.csv"
    values = np.column_stack([motion.time, motion.pose])
    header = ",".join(["t", *robot.coordinates])
    np.savetxt(plain, values, delimiter=",", header=header, comments="", fmt="%.12g")
    other.write_text(plain.read_text().replace(",", ";").replace(".", ","))
    found = playback(robot, other)
    assert not found.log
    np.testing.assert_array_equal(found.motion.pose, playback(robot, plain).motion.pose)


@CLIENTS
def test_a_report_shows_the_motion_that_it_is_given(tmp_path):
    robot = MACHINES["driven"]
    motion = way_out("driven")
    page = write_report(robot, tmp_path / "out", motion=motion).read_text("utf-8")
    data = json.loads((tmp_path / "out" / "report.json").read_text())["cycle"]
    assert data["standard"] is False
    assert data["scale"] is None
    np.testing.assert_array_equal(data["pose"], motion.pose)
    state = motion.pose, motion.velocity, motion.acceleration
    expected = pteron.drive_forces(robot, *state, smooth=True)
    np.testing.assert_allclose(data["forces"], expected, atol=1e-10)
    np.testing.assert_allclose(data["peak_forces"], np.abs(expected).max(axis=0), rtol=1e-3)
    assert all(f">{significant(peak)}</td>" in page for peak in data["peak_forces"])
    assert "does not end as it begins" in page
    assert "Pick-and-place" not in page
    assert "on the motion" in page
    assert "on the cycle" not in page


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"z": 0.12}, r"table\.csv: row \d+ \(line \d+\), at .* leaves the reach of leg \d"),
        ({"x": 50.0}, r"table\.csv: row 1 .* is it in millimetres"),
        ({"t": -1.0}, r"table\.csv: row 2 \(line 3\), column t: .* times must ascend"),
        ({"y": np.nan}, r"table\.csv: row 1 \(line 2\), column y"),
    ],
)
def test_a_motion_that_cannot_be_is_one_line(tmp_path, change, told):
    t = np.linspace(0.0, 4.0, 41)
    columns = {"t": t, "x": 0.05 * np.sin(t), "y": 0.04 * np.cos(t), "z": 0.01 * t, "phi": 0.1 * t}
    columns |= {
        name: factor * t + (0.0 if name == "t" else 1e-9) for name, factor in change.items()
    }
    table = tmp_path / "table.csv"
    values = np.column_stack(list(columns.values()))
    np.savetxt(table, values, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")
    with pytest.raises(pteron.PteronError, match=told) as caught:
        write_motion_page(CATALOG["quadrupteron"], table, tmp_path / "page.html")
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == [table], "nothing is left behind"


@pytest.mark.parametrize(
    ("path", "told"),
    [
        ("page.pdf", r"whose name ends in \.html"),
        ("", "the name is empty"),
        ("none/page.html", "there is no folder none"),
        ("folder.html", "is a folder"),
    ],
)
def test_a_page_that_cannot_be_written_is_one_line(tmp_path, monkeypatch, path, told):
    monkeypatch.chdir(tmp_path)
    Path("folder.html").mkdir()
    with pytest.raises(pteron.OutputError, match=told):
        write_motion_page(CATALOG["quadrupteron"], cycle("quadrupteron"), path)
