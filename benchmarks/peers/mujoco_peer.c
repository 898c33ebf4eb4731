/* The tree in MuJoCo, between the closed form before it and after it. */

#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <mujoco/mujoco.h>

#include CLOSED_FORM

typedef struct {
    Closure closure;
    mjModel *model;
    mjData *data;
} Peer;

Peer *create(const char *model_file, const double *closure) {
    mjModel *model = mj_loadModel(model_file, NULL);
    if (!model || model->nq != NQ || model->nv != NV) return NULL;
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
    before(&peer->closure, pose, velocity, acceleration, d->qpos, d->qvel, d->qacc, &legs);
#ifdef CLOSED
    mj_inverse(m, d);
    const double *found = d->qfrc_inverse;
#else
    /* What mj_inverse does, less its stages for what the model has not (and the mass matrix). */
    double found[NV];
    mj_kinematics(m, d);
    mj_comPos(m, d);
    mj_comVel(m, d);
    mj_rne(m, d, 1, found);
#endif
    after(&peer->closure, &legs, found, forces);
}

/* Fill the forces of a batch and return the seconds that it took. */
double sweep(const Peer *peer, int64_t count, const double *pose, const double *velocity,
             const double *acceleration, double *forces) {
    struct timespec begin, end;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (int64_t i = 0; i < M * count; i += M)
        inverse(peer, pose + i, velocity + i, acceleration + i, forces + i);
    clock_gettime(CLOCK_MONOTONIC, &end);
    return (end.tv_sec - begin.tv_sec) + 1e-9 * (end.tv_nsec - begin.tv_nsec);
}
