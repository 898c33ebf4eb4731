"""Machines made by a program: other dimensions, as text and as dictionaries."""

from dataclasses import replace
from typing import Any

import pteron
from pteron.manipulator import dumps, from_dict, loads, to_dict

robot = pteron.load("delta")
tables: dict[str, Any] = to_dict(robot)
for leg in tables["legs"]:
    leg["lower_length"] = 1.1
longer: pteron.Manipulator = from_dict(tables)
owned = replace(longer, owner={"serial": "D-3"})
again = loads(dumps(owned))
print(again == longer, again.owner["serial"], longer == robot)
