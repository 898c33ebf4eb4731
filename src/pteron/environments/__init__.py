"""Gymnasium environments for reinforcement learning: a machine reaches poses or follows a motion.

Actions are the forces of its drives. `import pteron.environments` registers `pteron/Reach-v0`.
Needs the extra `gymnasium`.
"""

from pteron.extras import install_command as _install_command
from pteron.public import publish as _publish

try:
    import gymnasium
except ImportError:
    raise ImportError(
        "pteron.environments needs Gymnasium, which is not installed; "
        + _install_command("gymnasium")
    ) from None

from pteron.environments.environment import PteronEnv as PteronEnv
from pteron.environments.vector_environment import PteronVectorEnv as PteronVectorEnv
from pteron.environments.world import World as World

REACH = "pteron/Reach-v0"
"""Name of the registered environment: ``gymnasium.make(REACH, robot="delta")``."""

EPISODE = 300
"""Steps after which an episode is truncated."""

if REACH not in gymnasium.registry:
    gymnasium.register(
        REACH,
        entry_point="pteron.environments.environment:PteronEnv",
        vector_entry_point="pteron.environments.vector_environment:PteronVectorEnv",
        max_episode_steps=EPISODE,
    )

_publish(__name__, checked=True)
