"""The workspace of a machine: margins, home pose, reach, joints' ranges, and proofs of them."""

from pteron.public import publish as _publish

_publish(__name__, checked=True)
