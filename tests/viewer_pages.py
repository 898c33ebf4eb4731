"""The viewer in a real browser."""

from __future__ import annotations

from contextlib import contextmanager


@contextmanager
def opened(browser, url, width=1100, height=800, **context):
    """A tab with the page, whose first numbers have come."""
    there = browser.new_context(viewport={"width": width, "height": height}, **context)
    tab = there.new_page()
    tab.failures = []
    tab.on("pageerror", lambda error: tab.failures.append(str(error)))
    tab.goto(url)
    tab.wait_for_selector("table.legs", state="attached")
    try:
        yield tab
        assert tab.failures == []
    finally:
        there.close()


def wait_for(tab, condition, argument=None):
    tab.wait_for_function(condition, arg=argument, timeout=60_000)


def slide(tab, label, keys):
    """Focus a slider by its label and press keys."""
    tab.get_by_label(label, exact=True).focus()
    for key in keys:
        tab.keyboard.press(key)


def unfold(tab, *names):
    for name in names:
        tab.evaluate("id => { document.getElementById(id).open = true; }", name)
