// The tree in Pinocchio, between the closed form before it and after it; or, SYMBOLIC, its algorithm
// as a CasADi function.

#include <chrono>
#include <cstdint>
#include <cstring>
#include <exception>
#include <string>

#ifdef SYMBOLIC
#include <pinocchio/autodiff/casadi.hpp>
#else
// Unbounded revolute joints take cosine and sine, so that nothing needs an arctangent.
#define UNBOUNDED
#include CLOSED_FORM
#endif
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>

namespace {

using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

enum Kind { slide = 0, turn = 1, translation = 2, turn_y = 3, loose = 4 };

// One joint as tree.py's `table` writes it.
struct Joint {
    double kind, parent;
    double rotation[9], offset[3], axis[3];
    double mass, center[3], inertia[3];
};

pinocchio::Model built(const Joint *joints, int count, const double *gravity) {
    pinocchio::Model model;
    model.gravity.linear(Eigen::Map<const Vector3>(gravity));
    for (int i = 0; i < count; i++) {
        const Joint &joint = joints[i];
        const Vector3 axis = Eigen::Map<const Vector3>(joint.axis);
        const pinocchio::SE3 place(Eigen::Map<const Matrix3>(joint.rotation),
                                   Eigen::Map<const Vector3>(joint.offset));
        pinocchio::JointModel kind;
        if (joint.kind == turn)
            kind = pinocchio::JointModelRUBZ();
        else if (joint.kind == turn_y)
            kind = pinocchio::JointModelRUBY();
        else if (joint.kind == translation)
            kind = pinocchio::JointModelTranslation();
        else if (joint.kind == loose)
            kind = pinocchio::JointModelFreeFlyer();
        else if (axis == Vector3::UnitX())
            kind = pinocchio::JointModelPX();
        else if (axis == Vector3::UnitY())
            kind = pinocchio::JointModelPY();
        else if (axis == Vector3::UnitZ())
            kind = pinocchio::JointModelPZ();
        else
            kind = pinocchio::JointModelPrismaticUnaligned(axis);
        const auto id = model.addJoint(static_cast<pinocchio::JointIndex>(joint.parent), kind,
                                       place, "joint " + std::to_string(i));
        const Vector3 moments = Eigen::Map<const Vector3>(joint.inertia);
        if (joint.mass > 0.0)
            model.appendBodyToJoint(
                id, pinocchio::Inertia(joint.mass, Eigen::Map<const Vector3>(joint.center),
                                       Eigen::Matrix3d(moments.asDiagonal())));
    }
    return model;
}

#ifndef SYMBOLIC
struct Peer {
    Closure closure;
    pinocchio::Model model;
    pinocchio::Data data;
    Eigen::Matrix<double, NQ, 1> q;
    Eigen::Matrix<double, NV, 1> v, a;

    Peer(const pinocchio::Model &tree, const double *numbers) : model(tree), data(tree) {
        std::memcpy(static_cast<void *>(&closure), numbers, sizeof(Closure));
    }

    void inverse(const double *pose, const double *velocity, const double *acceleration,
                 double *forces) {
        Legs legs;
        before(&closure, pose, velocity, acceleration, q.data(), v.data(), a.data(), &legs);
        after(&closure, &legs, pinocchio::rnea(model, data, q, v, a).data(), forces);
    }
};
#endif

}  // namespace

#pragma GCC visibility push(default)
extern "C" {

#ifdef SYMBOLIC
// Write the function from (q, v, a) to tau to a file.
int save(const double *joints, int count, const double *gravity, const char *path) {
    using casadi::SX;
    using Vector = Eigen::Matrix<SX, Eigen::Dynamic, 1>;
    try {
        const auto tree = built(reinterpret_cast<const Joint *>(joints), count, gravity);
        const pinocchio::ModelTpl<SX> model = tree.cast<SX>();
        pinocchio::DataTpl<SX> data(model);
        const SX q = SX::sym("q", model.nq), v = SX::sym("v", model.nv), a = SX::sym("a", model.nv);
        Vector at(model.nq), rate(model.nv), acceleration(model.nv);
        pinocchio::casadi::copy(q, at);
        pinocchio::casadi::copy(v, rate);
        pinocchio::casadi::copy(a, acceleration);
        SX tau(model.nv, 1);
        pinocchio::casadi::copy(pinocchio::rnea(model, data, at, rate, acceleration), tau);
        casadi::Function("rnea", {q, v, a}, {tau}).save(path);
        return 0;
    } catch (const std::exception &) {
        return 1;
    }
}
#else
Peer *create(const double *joints, int count, const double *gravity, const double *closure) {
    try {
        const auto model = built(reinterpret_cast<const Joint *>(joints), count, gravity);
        return model.nq == NQ && model.nv == NV ? new Peer(model, closure) : nullptr;
    } catch (const std::exception &) {
        return nullptr;
    }
}

// Fill the forces of a batch and return the seconds that it took.
double sweep(Peer *peer, std::int64_t count, const double *pose, const double *velocity,
             const double *acceleration, double *forces) {
    const auto begin = std::chrono::steady_clock::now();
    for (std::int64_t i = 0; i < M * count; i += M)
        peer->inverse(pose + i, velocity + i, acceleration + i, forces + i);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}
#endif
}
