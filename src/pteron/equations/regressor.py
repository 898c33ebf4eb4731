"""The regressor as the paper's Eq. (15) writes it: J^-T [ J^T Om_p  J_u^T Om_u  J_l^T Om_l  Om_e ].

Om are the wrenches on sliders, links and platform per unit of their parameters. `virtual_work`
gives the same regressor at less cost; this form checks it. `Terms` keeps the factors apart, for
benchmarks of how they are multiplied.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate, pairwise

import casadi as ca

from pteron.bodies.motion import Expression, wrench_matrix
from pteron.bodies.parameters import LEG_BODIES
from pteron.equations.kinematics import body_jacobian, jacobian
from pteron.equations.machine import Machine, State


@dataclass(frozen=True)
class RegressorTerms:
    """The factors of Eq. (15), for one state."""

    jacobian: Expression
    """J (n, m)."""
    sliders: Expression
    """Om_p (n, n): for each slider the force on it, per unit of its mass; zero without one."""
    with_slider: tuple[int, ...]
    """The legs, from 0, that have a slider: the columns of Om_p that have a parameter."""
    link_jacobians: tuple[Expression, ...]
    """J_u1..J_un, J_l1..J_ln, each (6, m)."""
    links: tuple[Expression, ...]
    """Om_u1..Om_un, Om_l1..Om_ln, each (6, 4), or (6, 3) for rods."""
    platform: Expression
    """Om_e (m, k), a column for each of the platform's k parameters."""

    @property
    def columns(self) -> list[slice]:
        """Column ranges in the parameter vector: of sliders, of each link, of the platform."""
        sizes = [len(self.with_slider), *(om.shape[1] for om in (*self.links, self.platform))]
        return [slice(*ends) for ends in pairwise(accumulate(sizes, initial=0))]

    @property
    def bracket(self) -> Expression:
        """The bracket of Eq. (15), (m, N): generalized forces per inertial parameter, negated."""
        links = (
            ca.mtimes(jac.T, matrix)
            for jac, matrix in zip(self.link_jacobians, self.links, strict=True)
        )
        sliders = ca.mtimes(self.jacobian.T, self.sliders[:, self.with_slider])
        return ca.horzcat(sliders, *links, self.platform)  # Eq. (15)


def terms(machine: Machine, state: State) -> RegressorTerms:
    """Return the factors of the regressor in Eq. (15): link Jacobians and wrench matrices."""
    slider, *links = LEG_BODIES
    n = len(machine.legs)
    with_slider = tuple(i for i in range(n) if slider in state.legs[i].bodies)
    forces = [ca.SX(1, 1)] * n
    for i in with_slider:
        leg = state.legs[i]
        acceleration = leg.bodies[slider].acceleration
        forces[i] = ca.dot(
            leg.actuated_joint.axis, machine.gravity - acceleration
        )  # Eq. (14), m_p = 1
    places = [(i, link) for link in links for i in range(n) if link in state.legs[i].bodies]
    jacobians = [body_jacobian(state, i, link) for i, link in places]
    matrices = [wrench_matrix(state.legs[i].bodies[link], machine.gravity) for i, link in places]
    return RegressorTerms(
        jacobian(state),
        ca.diag(ca.vertcat(*forces)),
        with_slider,
        tuple(jacobians),
        tuple(matrices),
        state.platform.pose_forces(machine.platform.wrench_matrix(state.platform, machine.gravity)),
    )


def paper_regressor(machine: Machine, state: State) -> Expression:
    """Return the regressor D (n, N) of Eq. (15): drive forces F_a = D P for parameters P.

    Eq. (15) is the paper's: each body's link Jacobian, transposed, times its matrix Omega, whose
    product with the body's parameters is the inertial force that acts on it; the drive forces
    balance these, hence a minus sign.
    """
    bracket = state.platform.quasi_forces(terms(machine, state).bracket)
    return -machine.closure.forces(bracket, state.platform, state.legs)  # J^-T of Eq. (15)
