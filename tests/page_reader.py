"""Pages as a browser reads them: their texts, and JSON without NaN."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import pteron

HOSTILE = '</script><b onload="x">&\'{{ 7 * 6 }}'
"""A machine's name comes from a file that anyone may have written."""


VOID = {"meta", "input", "br", "hr", "img", "link"}


class Reader(HTMLParser):
    """Collects what a page holds, and what does not balance."""

    def __init__(self, text):
        super().__init__()
        self.open, self.faults, self.ids, self.links, self.sources = [], [], [], [], []
        self.counts, self.words, self.scripts = {}, [], {}
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.counts[tag] = self.counts.get(tag, 0) + 1
        if "id" in found:
            self.ids.append(found["id"])
        self.links += [v for k, v in attributes if k.endswith("href")]
        self.sources += [v for k, v in attributes if k in ("src", "srcset", "data", "action")]
        self.faults += [f"{k} on {tag}" for k, _ in attributes if k.startswith("on")]
        if tag not in VOID:
            self.open.append((tag, found.get("id")))

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        if not self.open or self.open[-1][0] != tag:
            self.faults.append(f"</{tag}> at {self.getpos()}, open: {self.open[-3:]}")
        else:
            self.open.pop()

    def handle_data(self, data):
        if self.open and self.open[-1][0] == "script":
            key = self.open[-1][1]
            self.scripts[key] = self.scripts.get(key, "") + data
        elif not (self.open and self.open[-1][0] == "style"):
            self.words.append(data)

    @property
    def text(self):
        return re.sub(r"\s+", " ", " ".join(self.words))


def strict(text):
    def refuse(constant):
        raise AssertionError(f"{constant} is not JSON")

    return json.loads(text, parse_constant=refuse)


def driven(robot):
    """Return the machine with drives, of which the first has neither limits nor a ratio."""
    motor = pteron.legs.Drive(3.0, 12.0, 0.1, 3e-5, 392.7, max_force=40.0, max_speed=9.0)
    drives = (pteron.legs.Drive(2.0), *(motor for _ in robot.legs[1:]))
    legs = zip(robot.legs, drives, strict=True)
    return replace(robot, legs=tuple(replace(leg, drive=drive) for leg, drive in legs))
