/* Runge-Kutta integration with the Dormand-Prince pair 5(4), with fixed or adaptive steps.
 *
 * State events are detected by comparing relations with their frozen values at several points of a step, and located
 * on the continuous extension of the pair. Coefficients: Dormand, Prince (1980) and Hairer, Norsett, Wanner,
 * Solving Ordinary Differential Equations I, sections II.5 and II.6.
 */
#include "model.h"

#include <stdio.h>

#define N MODEL_STATES

typedef struct {
    double t, h;
    double y0[N + 1], y1[N + 1];
    double k[7][N + 1];
    double dense[N + 1]; /* highest coefficient of the continuous extension */
    int has_dense;
} Step;

static void evaluate_at(Model *m, double t, const double *y, double *k) {
    m->time = t;
    memcpy(m->r, y, N * sizeof(double));
    model_derivatives(m);
    memcpy(k, m->r + N, N * sizeof(double));
}

static void stages(Model *m, Step *s) {
    static const double a[6][5] = {
        {0},
        {1.0 / 5},
        {3.0 / 40, 9.0 / 40},
        {44.0 / 45, -56.0 / 15, 32.0 / 9},
        {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
        {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656}};
    static const double c[6] = {0, 1.0 / 5, 3.0 / 10, 4.0 / 5, 8.0 / 9, 1};
    double y[N + 1];
    events_evaluate(m);
    memcpy(s->k[0], m->r + N, N * sizeof(double));
    for (int stage = 1; stage < 6; stage++) {
        for (int j = 0; j < N; j++) {
            double sum = 0;
            for (int l = 0; l < stage; l++) sum += a[stage][l] * s->k[l][j];
            y[j] = s->y0[j] + s->h * sum;
        }
        evaluate_at(m, s->t + c[stage] * s->h, y, s->k[stage]);
    }
    for (int j = 0; j < N; j++)
        s->y1[j] = s->y0[j] + s->h * (35.0 / 384 * s->k[0][j] + 500.0 / 1113 * s->k[2][j] + 125.0 / 192 * s->k[3][j] -
                                      2187.0 / 6784 * s->k[4][j] + 11.0 / 84 * s->k[5][j]);
    s->has_dense = 0;
}

static void finish(Model *m, Step *s, double t) {
    evaluate_at(m, t, s->y1, s->k[6]);
    m->current = 1;
    m->rest_current = 0;
}

static double error_of(const Model *m, const Step *s) {
    double sum = 0;
    for (int j = 0; j < N; j++) {
        double e = s->h * (71.0 / 57600 * s->k[0][j] - 71.0 / 16695 * s->k[2][j] + 71.0 / 1920 * s->k[3][j] -
                           17253.0 / 339200 * s->k[4][j] + 22.0 / 525 * s->k[5][j] - 1.0 / 40 * s->k[6][j]);
        double scale = m->tolerance * (model_nominal[j] + max_real(fabs(s->y0[j]), fabs(s->y1[j])));
        sum += square(e / scale);
    }
    return N ? sqrt(sum / N) : 0;
}

static void interpolate(Step *s, double theta, double *y) {
    if (!s->has_dense) {
        for (int j = 0; j < N; j++)
            s->dense[j] = s->h * (-12715105075.0 / 11282082432.0 * s->k[0][j] + 87487479700.0 / 32700410799.0 * s->k[2][j] -
                                  10690763975.0 / 1880347072.0 * s->k[3][j] + 701980252875.0 / 199316789632.0 * s->k[4][j] -
                                  1453857185.0 / 822651844.0 * s->k[5][j] + 69997945.0 / 29380423.0 * s->k[6][j]);
        s->has_dense = 1;
    }
    for (int j = 0; j < N; j++) {
        double rise = s->y1[j] - s->y0[j], bend = s->h * s->k[0][j] - rise;
        double twist = rise - s->h * s->k[6][j] - bend;
        y[j] = s->y0[j] + theta * (rise + (1 - theta) * (bend + theta * (twist + (1 - theta) * s->dense[j])));
    }
}

/* Evaluate the model at a point of the step; returns whether a relation differs from its frozen value there. */
static int probe(Model *m, Step *s, double theta, double *z) {
    double y[N + 1], k[N + 1];
    interpolate(s, theta, y);
    evaluate_at(m, s->t + theta * s->h, y, k);
    return events_crossed(m, z);
}

/* Locate the earliest crossing in (lo, hi], given that nothing has crossed at lo and something has at hi. */
static void locate(Model *m, Step *s, double lo, double hi, double *z_lo, double *z_hi) {
    double z[MODEL_CROSSINGS + 1];
    double tolerance = 1e-13 * max_real(1, fabs(s->t)) / s->h;
    for (int n = 0; n < 200 && hi - lo > tolerance; n++) {
        double theta = 0.5 * (lo + hi);
        if (n % 3 < 2) { /* one point on either side of the secant's zero, then a bisection */
            double nearest = hi;
            for (int k = 0; k < MODEL_CROSSINGS; k++)
                if ((z_lo[k] < 0) != (z_hi[k] < 0) || z_hi[k] == 0)
                    nearest = min_real(nearest, lo + (hi - lo) * z_lo[k] / (z_lo[k] - z_hi[k]));
            theta = n % 3 ? nearest - 0.4 * tolerance : nearest + 0.4 * tolerance;
        }
        if (!(theta > lo && theta < hi)) theta = 0.5 * (lo + hi);
        if (theta <= lo || theta >= hi) break;
        if (probe(m, s, theta, z)) {
            hi = theta;
            memcpy(z_hi, z, sizeof z);
        } else {
            lo = theta;
            memcpy(z_lo, z, sizeof z);
        }
    }
    probe(m, s, hi, z);
    m->current = 1;
    m->rest_current = 0;
}

/* Returns whether there is a state event in the step; if so, the model is set to the time of the first one.
 *
 * Relations are compared at SOLVER_CHECKS points of the step. Just after an event they are also compared near the
 * start of the step: a relation that has just changed may soon change back (a ball on a very low bounce), and both
 * changes would otherwise be missed within one step.
 */
static int find_event(Model *m, Step *s, double end, double *z_start) {
    static const double near[] = {1e-5, 1e-3, 3e-2};
    const int early = m->after_event ? 3 : 0, count = early + SOLVER_CHECKS;
    double z_lo[MODEL_CROSSINGS + 1], z_hi[MODEL_CROSSINGS + 1], lo = 0;
    memcpy(z_lo, z_start, sizeof z_lo);
    for (int k = 0; k < count; k++) {
        int last = k + 1 == count, crossed;
        double theta = k < early ? near[k] : (double)(k - early + 1) / SOLVER_CHECKS;
        if (last) {
            if (k) evaluate_at(m, end, s->y1, s->k[6]);
            crossed = events_crossed(m, z_hi);
        } else {
            crossed = probe(m, s, theta, z_hi);
        }
        if (crossed) {
            locate(m, s, lo, theta, z_lo, z_hi);
            return 1;
        }
        lo = theta;
        memcpy(z_lo, z_hi, sizeof z_lo);
    }
    memcpy(z_start, z_hi, sizeof z_lo);
    m->after_event = 0;
    return 0;
}

static double first_step(const Model *m, double rest) {
    double size = SOLVER_MAX_STEP;
    for (int j = 0; j < N; j++) {
        double slope = fabs(m->r[N + j]);
        if (slope > 0) size = min_real(size, 0.01 * (model_nominal[j] + fabs(m->r[j])) / slope);
    }
    return min_real(max_real(size, 1e-9), rest);
}

static int all_finite(const Model *m, const double *y) {
    for (int j = 0; j < N; j++)
        if (!isfinite(y[j])) return 0;
    return !m->error[0];
}

static double step_size(Model *m, double rest) {
    if (SOLVER_STEP > 0) {
        double count = ceil(rest / SOLVER_STEP - 1e-6);
        return rest / max_real(1, count);
    }
    if (!(m->step > 0)) {
        events_evaluate(m);
        m->step = first_step(m, rest);
    }
    double size = min_real(m->step, SOLVER_MAX_STEP);
    if (size >= rest) return rest;
    return size > 0.5 * rest ? 0.5 * rest : size;
}

int integrate(Model *m, double stop) {
    Step s;
    double z[MODEL_CROSSINGS + 1];
    int crossings = MODEL_CROSSINGS > 0;
    events_evaluate(m);
    if (crossings) {
        if (events_crossed(m, z)) return 1;
    }
    while (stop - m->time > 0) {
        double rest = stop - m->time;
        s.t = m->time;
        s.h = step_size(m, rest);
        double end = s.h >= rest ? stop : s.t + s.h;
        memcpy(s.y0, m->r, N * sizeof(double));
        stages(m, &s);
        if (!all_finite(m, s.y1) && !(SOLVER_STEP > 0) && s.h > 1e-12 && !m->error[0]) s.y1[0] = NAN;
        finish(m, &s, end);
        if (!(SOLVER_STEP > 0)) {
            double error = error_of(m, &s);
            double factor = error > 0 ? 0.9 * pow(error, -0.2) : 5;
            if (!(error <= 1)) { /* also if the error is NaN */
                m->step = s.h * (error > 1 && isfinite(error) ? max_real(0.2, factor) : 0.2);
                if (m->step < 1e-13 * max_real(1, fabs(s.t))) {
                    model_fail(m, "the integrator cannot reach its tolerance");
                    return 0;
                }
                m->time = s.t;
                memcpy(m->r, s.y0, N * sizeof(double));
                memcpy(m->r + N, s.k[0], N * sizeof(double));
                m->error[0] = 0;
                continue;
            }
            if (s.h >= m->step || factor < 1) m->step = s.h * min_real(5, max_real(0.2, factor)); /* not if `stop` cut it short */
        }
        if (!all_finite(m, s.y1)) {
            if (!m->error[0]) model_fail(m, "a state is not a finite number");
            return 0;
        }
        if (crossings && find_event(m, &s, end, z)) return 1;
    }
    return 0;
}
