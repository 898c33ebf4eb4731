/* The tree in MuJoCo, between the closed form of closure.h before it and after it. */

#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <mujoco/mujoco.h>

#include "closure.h"

typedef struct {
    Closure closure;
    mjModel *model;
    mjData *data;
} Peer;

Peer *create(const char *model_file, const double *closure) {
    mjModel *model = mj_loadModel(model_file, NULL);
    if (!model || model->nq != 16 || model->nv != 16) return NULL;
    Peer *peer = aligned_alloc(64, (sizeof(Peer) + 63) / 64 * 64);
    memcpy(&peer->closure, closure, sizeof(Closure));
    peer->model = model;
    peer->data = mj_makeData(model);
    return peer;
}

static void inverse(const Peer *peer, const double *pose, const double *velocity,
                    const double *acceleration, double *forces) {
    const mjModel *m = peer->model;
    mjData *d = peer->data;
    Legs legs;
    follow(&peer->closure, pose, cos(pose[3]), sin(pose[3]), velocity, acceleration, &legs);
    for (int i = 0; i < 4; i++) {
        d->qpos[3 * i] = legs.position[i];
        d->qpos[3 * i + 1] = atan2(legs.sin_upper[i], legs.cos_upper[i]);
        d->qpos[3 * i + 2] = atan2(legs.sin_elbow[i], legs.cos_elbow[i]);
        for (int k = 0; k < 3; k++) {
            d->qvel[3 * i + k] = legs.rate[k][i];
            d->qacc[3 * i + k] = legs.acceleration[k][i];
        }
    }
    memcpy(d->qpos + 12, pose, 4 * sizeof(double));
    memcpy(d->qvel + 12, velocity, 4 * sizeof(double));
    memcpy(d->qacc + 12, acceleration, 4 * sizeof(double));
#ifdef CLOSED
    mj_inverse(m, d);
    const double *found = d->qfrc_inverse;
#else
    /* What mj_inverse does, less its stages for what the model has not (and the mass matrix). */
    double found[16];
    mj_kinematics(m, d);
    mj_comPos(m, d);
    mj_comVel(m, d);
    mj_rne(m, d, 1, found);
#endif
    Lanes tau[3];
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 3; k++) tau[k][i] = found[3 * i + k];
    project(&peer->closure, &legs, tau, found + 12, forces);
}

/* Fill the forces of a batch and return the seconds that it took. */
double sweep(const Peer *peer, int64_t count, const double *pose, const double *velocity,
             const double *acceleration, double *forces) {
    struct timespec begin, end;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (int64_t i = 0; i < 4 * count; i += 4)
        inverse(peer, pose + i, velocity + i, acceleration + i, forces + i);
    clock_gettime(CLOCK_MONOTONIC, &end);
    return (end.tv_sec - begin.tv_sec) + 1e-9 * (end.tv_nsec - begin.tv_nsec);
}
