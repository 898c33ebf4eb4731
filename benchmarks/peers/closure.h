/* The closed form of four legs at once: one leg in each lane of a vector.

   Both engines' C and C++ peers use it: `before` the engine and `after` it. The numbers are those of
   closure.py, in the same order. With UNBOUNDED an angle is given as its cosine and sine. */

#include <math.h>
#include <string.h>

#ifdef UNBOUNDED
enum { M = 4, NQ = 25, NV = 16 };
#else
enum { M = 4, NQ = 16, NV = 16 };
#endif

typedef double Lanes __attribute__((vector_size(32)));

typedef struct {
    Lanes project[3][3]; /* rows d_bar, and u's two, of each leg */
    Lanes cosine[3], sine[3], rest[3]; /* those rows times s0's turning parts and s0_z k - r */
    Lanes far, near, half, squares, sigma, per_upper, per_both;
    Lanes right[3], null; /* J^T F = b: what the constant columns of J have to say */
} Closure;

typedef struct {
    Lanes turn[3]; /* the rows times k x s */
    Lanes l_u[2], l_l[2], per_d;
    Lanes cos_upper, sin_upper, cos_elbow, sin_elbow;
    Lanes position, rate[3], acceleration[3]; /* slider; slider, theta_u and theta_l - theta_u */
} Legs;

static inline Lanes root_of(Lanes x) {
    Lanes y;
    for (int i = 0; i < 4; i++) y[i] = sqrt(x[i]);
    return y;
}

static inline double sum_of(Lanes x) { return (x[0] + x[1]) + (x[2] + x[3]); }

static inline void follow(const Closure *c, const double *pose, double cosine, double sine,
                          const double *velocity, const double *acceleration, Legs *legs) {
    const double turning = velocity[3], square = turning * turning;
    Lanes w[3], dw[3], ddw[3];
    for (int k = 0; k < 3; k++) {
        const Lanes *p = c->project[k];
        const Lanes out = cosine * c->cosine[k] + sine * c->sine[k];
        const Lanes turn = cosine * c->sine[k] - sine * c->cosine[k];
        w[k] = p[0] * pose[0] + p[1] * pose[1] + p[2] * pose[2] + out + c->rest[k];
        dw[k] = p[0] * velocity[0] + p[1] * velocity[1] + p[2] * velocity[2] + turning * turn;
        ddw[k] = p[0] * acceleration[0] + p[1] * acceleration[1] + p[2] * acceleration[2] +
                 acceleration[3] * turn - square * out;
        legs->turn[k] = turn;
    }
    const Lanes x = w[1], y = w[2], n2 = x * x + y * y, per_n2 = 1.0 / n2;
    const Lanes root = root_of((c->far - n2) * (n2 - c->near));
    const Lanes share = 0.5 + c->half * per_n2, offset = 0.5 * c->sigma * root * per_n2;
    const Lanes ux = share * x - offset * y, uy = share * y + offset * x;
    const Lanes lx = x - ux, ly = y - uy, per_d = -2.0 * c->sigma / root;
    const Lanes upper = (lx * dw[1] + ly * dw[2]) * per_d;
    const Lanes lower = -(ux * dw[1] + uy * dw[2]) * per_d;
    const Lanes vx = ddw[1] + upper * upper * ux + lower * lower * lx;
    const Lanes vy = ddw[2] + upper * upper * uy + lower * lower * ly;
    const Lanes d_upper = (lx * vx + ly * vy) * per_d, d_lower = -(ux * vx + uy * vy) * per_d;
    legs->l_u[0] = ux, legs->l_u[1] = uy, legs->l_l[0] = lx, legs->l_l[1] = ly;
    legs->per_d = per_d;
    legs->cos_upper = ux * c->per_upper, legs->sin_upper = uy * c->per_upper;
    legs->cos_elbow = 0.5 * (n2 - c->squares) * c->per_both;
    legs->sin_elbow = -0.5 * c->sigma * root * c->per_both;
    legs->position = w[0];
    legs->rate[0] = dw[0], legs->rate[1] = upper, legs->rate[2] = lower - upper;
    legs->acceleration[0] = ddw[0], legs->acceleration[1] = d_upper;
    legs->acceleration[2] = d_lower - d_upper;
}

/* F = J^-T (dq/dx)^T tau; `tau` holds the legs' joints, `platform` the pose's own forces. */
static inline void project(const Closure *c, const Legs *legs, const Lanes tau[3],
                           const double *platform, double *forces) {
    const Lanes upper = (tau[1] - tau[2]) * legs->per_d, lower = tau[2] * legs->per_d;
    const Lanes vx = upper * legs->l_l[0] - lower * legs->l_u[0];
    const Lanes vy = upper * legs->l_l[1] - lower * legs->l_u[1];
    Lanes balance = {0.0, 0.0, 0.0, 0.0};
    for (int k = 0; k < 3; k++) {
        const Lanes pull = c->project[1][k] * vx + c->project[2][k] * vy;
        balance += c->right[k] * (platform[k] + sum_of(pull));
    }
    const double moment = platform[3] + sum_of(legs->turn[1] * vx + legs->turn[2] * vy -
                                               legs->turn[0] * balance);
    const double share = moment / sum_of(legs->turn[0] * c->null);
    const Lanes found = tau[0] + balance + share * c->null;
    for (int i = 0; i < 4; i++) forces[i] = found[i];
}

static inline void before(const Closure *c, const double *pose, const double *velocity,
                          const double *acceleration, double *q, double *v, double *a,
                          Legs *legs) {
    const double cosine = cos(pose[3]), sine = sin(pose[3]);
    follow(c, pose, cosine, sine, velocity, acceleration, legs);
    for (int i = 0; i < 4; i++) {
#ifdef UNBOUNDED
        q[5 * i] = legs->position[i];
        q[5 * i + 1] = legs->cos_upper[i], q[5 * i + 2] = legs->sin_upper[i];
        q[5 * i + 3] = legs->cos_elbow[i], q[5 * i + 4] = legs->sin_elbow[i];
#else
        q[3 * i] = legs->position[i];
        q[3 * i + 1] = atan2(legs->sin_upper[i], legs->cos_upper[i]);
        q[3 * i + 2] = atan2(legs->sin_elbow[i], legs->cos_elbow[i]);
#endif
        for (int k = 0; k < 3; k++) {
            v[3 * i + k] = legs->rate[k][i];
            a[3 * i + k] = legs->acceleration[k][i];
        }
    }
#ifdef UNBOUNDED
    memcpy(q + 20, pose, 3 * sizeof(double));
    q[23] = cosine, q[24] = sine;
#else
    memcpy(q + 12, pose, 4 * sizeof(double));
#endif
    memcpy(v + 12, velocity, 4 * sizeof(double));
    memcpy(a + 12, acceleration, 4 * sizeof(double));
}

static inline void after(const Closure *c, const Legs *legs, const double *found, double *forces) {
    Lanes tau[3];
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 3; k++) tau[k][i] = found[3 * i + k];
    project(c, legs, tau, found + 12, forces);
}
