"""Performance of a machine at a pose: indices, stiffness, errors and reactions."""

from pteron.arguments import check_arguments
from pteron.indices.compliance import Stiffness, stiffness
from pteron.indices.conditioning import GlobalConditioning, global_conditioning
from pteron.indices.elasticity import ALUMINIUM, STEEL, Elasticity, Material, Section
from pteron.indices.evaluation import evaluate
from pteron.indices.index import INDICES, Index, indices_of
from pteron.indices.joint_reactions import Reactions, reactions
from pteron.indices.pose_errors import PoseError, Tolerances, pose_error
from pteron.indices.sensitivities import Sensitivities, geometric_sensitivities

__all__ = [
    "ALUMINIUM",
    "INDICES",
    "STEEL",
    "Elasticity",
    "GlobalConditioning",
    "Index",
    "Material",
    "PoseError",
    "Reactions",
    "Section",
    "Sensitivities",
    "Stiffness",
    "Tolerances",
    "evaluate",
    "geometric_sensitivities",
    "global_conditioning",
    "indices_of",
    "pose_error",
    "reactions",
    "stiffness",
]
check_arguments(__name__, classes=("Elasticity", "Tolerances"))


def __dir__() -> list[str]:
    return sorted(__all__)
