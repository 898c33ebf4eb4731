// The tree in Pinocchio, between the closed form of closure.h before it and after it.

#include <chrono>
#include <cstdint>
#include <cstring>
#include <exception>
#include <string>

#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>

#include "closure.h"

namespace {

using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

enum Kind { slide = 0, turn = 1, translation = 2 };

// One joint as tree.py's `table` writes it.
struct Joint {
    double kind, parent;
    double rotation[9], offset[3], axis[3];
    double mass, center[3], inertia[3];
};

struct Peer {
    Closure closure;
    pinocchio::Model model;
    pinocchio::Data data;
    // Unbounded revolute joints take cosine and sine, so that nothing needs an arctangent.
    Eigen::Matrix<double, 25, 1> q;
    Eigen::Matrix<double, 16, 1> v, a;

    Peer(const pinocchio::Model &tree, const double *numbers) : model(tree), data(tree) {
        std::memcpy(static_cast<void *>(&closure), numbers, sizeof(Closure));
    }

    void inverse(const double *pose, const double *velocity, const double *acceleration,
                 double *forces) {
        const double cosine = std::cos(pose[3]), sine = std::sin(pose[3]);
        Legs legs;
        follow(&closure, pose, cosine, sine, velocity, acceleration, &legs);
        for (int i = 0; i < 4; i++) {
            q[5 * i] = legs.position[i];
            q[5 * i + 1] = legs.cos_upper[i];
            q[5 * i + 2] = legs.sin_upper[i];
            q[5 * i + 3] = legs.cos_elbow[i];
            q[5 * i + 4] = legs.sin_elbow[i];
            for (int k = 0; k < 3; k++) {
                v[3 * i + k] = legs.rate[k][i];
                a[3 * i + k] = legs.acceleration[k][i];
            }
        }
        for (int k = 0; k < 3; k++) q[20 + k] = pose[k];
        q[23] = cosine;
        q[24] = sine;
        for (int k = 0; k < 4; k++) {
            v[12 + k] = velocity[k];
            a[12 + k] = acceleration[k];
        }
        const auto &found = pinocchio::rnea(model, data, q, v, a);
        Lanes tau[3];
        for (int i = 0; i < 4; i++)
            for (int k = 0; k < 3; k++) tau[k][i] = found[3 * i + k];
        project(&closure, &legs, tau, found.data() + 12, forces);
    }
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
        else if (joint.kind == translation)
            kind = pinocchio::JointModelTranslation();
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

}  // namespace

#pragma GCC visibility push(default)
extern "C" {

Peer *create(const double *joints, int count, const double *gravity, const double *closure) {
    try {
        const auto model = built(reinterpret_cast<const Joint *>(joints), count, gravity);
        return model.nq == 25 && model.nv == 16 ? new Peer(model, closure) : nullptr;
    } catch (const std::exception &) {
        return nullptr;
    }
}

// Fill the forces of a batch and return the seconds that it took.
double sweep(Peer *peer, std::int64_t count, const double *pose, const double *velocity,
             const double *acceleration, double *forces) {
    const auto begin = std::chrono::steady_clock::now();
    for (std::int64_t i = 0; i < 4 * count; i += 4)
        peer->inverse(pose + i, velocity + i, acceleration + i, forces + i);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}
}
