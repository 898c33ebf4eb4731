from pteron.indices.compliance import Stiffness as Stiffness, stiffness as stiffness
from pteron.indices.conditioning import (
    GlobalConditioning as GlobalConditioning,
    global_conditioning as global_conditioning,
)
from pteron.indices.elasticity import (
    ALUMINIUM as ALUMINIUM,
    STEEL as STEEL,
    Elasticity as Elasticity,
    Material as Material,
    Section as Section,
)
from pteron.indices.evaluation import evaluate as evaluate
from pteron.indices.index import INDICES as INDICES, Index as Index, indices_of as indices_of
from pteron.indices.joint_reactions import Reactions as Reactions, reactions as reactions
from pteron.indices.pose_errors import (
    PoseError as PoseError,
    Tolerances as Tolerances,
    pose_error as pose_error,
)
from pteron.indices.sensitivities import (
    Sensitivities as Sensitivities,
    geometric_sensitivities as geometric_sensitivities,
)
