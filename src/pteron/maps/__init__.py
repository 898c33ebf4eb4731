"""Maps of performance indices over grids of poses, and sweeps of any function over many chunks.

Work is done in chunks, here or on a cluster; a chunk that is stored is not computed again.
"""

from pteron.public import publish as _publish

_publish(__name__, checked=True)
