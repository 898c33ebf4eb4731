"""Gymnasium environments for reinforcement learning: a machine reaches poses or follows a motion.

Actions are the forces of its drives. `import pteron.environments` registers `pteron/Reach-v0`.
Needs the extra `gymnasium`.
"""

from pteron.extras import install_command

try:
    import gymnasium
except ImportError:
    raise ImportError(
        "pteron.environments needs Gymnasium, which is not installed; "
        + install_command("gymnasium")
    ) from None

from pteron.arguments import check_arguments
from pteron.environments.environment import PteronEnv
from pteron.environments.vector_environment import PteronVectorEnv
from pteron.environments.world import World

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

__all__ = ["EPISODE", "REACH", "PteronEnv", "PteronVectorEnv", "World"]
check_arguments(__name__, classes=("PteronEnv", "PteronVectorEnv"))


def __dir__() -> list[str]:
    return sorted(__all__)
