/* Integration with fixed or adaptive steps, by the method of explicit.h or implicit.h.
 *
 * State events are detected by comparing relations with their frozen values at several points of a step, and located
 * on the continuous extension of the method.
 */
#include "step.h"

#include SOLVER_METHOD /* "explicit.h" or "implicit.h" */

#include <stdio.h>

#define MAX_HALVINGS 4 /* of a step, to add points to a delay line */

static void step_evaluate(Model *m, double t, const double *y, double *k) {
    m->time = t;
    memcpy(m->r, y, N * sizeof(double));
    model_derivatives(m);
    memcpy(k, m->r + N, N * sizeof(double));
}

static void finish(Model *m, Step *s, double t) {
    step_evaluate(m, t, s->y1, s->k[6]);
    m->current = 1;
    m->rest_current = 0;
}

static double error_of(const Model *m, const Step *s) {
    double sum = 0;
    for (int j = 0; j < N; j++) {
        double scale = m->tolerance * (model_nominal[j] + max_real(fabs(s->y0[j]), fabs(s->y1[j])));
        sum += square(step_error(s, j) / scale);
    }
    return N ? sqrt(sum / N) : 0;
}

static void interpolate(Step *s, double theta, double *y) {
    if (!s->extended) step_extend(s);
    s->extended = 1;
    for (int j = 0; j < N; j++) {
        double rise = s->y1[j] - s->y0[j];
        double curve = s->bend[j] + theta * (s->twist[j] + (1 - theta) * s->dense[j]);
        y[j] = s->y0[j] + theta * (rise + (1 - theta) * curve);
    }
}

/* Evaluate the model at a point of the step; returns whether a relation differs from its frozen value there. */
static int probe(Model *m, Step *s, double theta, double *z) {
    double y[N + 1], k[N + 1];
    interpolate(s, theta, y);
    step_evaluate(m, s->t + theta * s->h, y, k);
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
            if (k) step_evaluate(m, end, s->y1, s->k[6]);
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
        double count = ceil(rest / (MODEL_LINES ? min_real(SOLVER_STEP, m->longest) : SOLVER_STEP) - 1e-6);
        return rest / max_real(1, count);
    }
    if (!(m->step > 0)) {
        events_evaluate(m);
        m->step = first_step(m, rest);
    }
    double size = min_real(m->step, SOLVER_MAX_STEP);
    if (MODEL_LINES) size = min_real(size, m->longest);
    if (size >= rest) return rest;
    return size > 0.5 * rest ? 0.5 * rest : size;
}

/* Record points of the delay lines inside a step, if straight lines between its ends are not accurate enough. */
static void refine(Model *m, Step *s, double from, double to, const Entries *first, const Entries *last, int depth) {
    double y[N + 1], k[N + 1], middle = 0.5 * (from + to);
    Entries entries;
    interpolate(s, middle, y);
    step_evaluate(m, s->t + middle * s->h, y, k);
    model_lines(m, &entries);
    if (lines_are_straight(m, first, &entries, last)) return;
    if (depth) refine(m, s, from, middle, first, &entries, depth - 1);
    lines_insert(m, &entries);
    if (depth) refine(m, s, middle, to, &entries, last, depth - 1);
}

/* Record a completed step, which may have ended early at an event. */
static void record(Model *m, Step *s) {
    double end = m->time, reals[MODEL_REALS + 1];
    Entries first, last;
    lines_last(m, &first);
    model_lines(m, &last);
    memcpy(reals, m->r, sizeof reals);
    refine(m, s, 0, (end - s->t) / s->h, &first, &last, MAX_HALVINGS);
    memcpy(m->r, reals, sizeof reals);
    m->time = end;
    lines_record(m);
}

/* Return to the beginning of a rejected step. */
static void reject(Model *m, const Step *s) {
    m->time = s->t;
    memcpy(m->r, s->y0, N * sizeof(double));
    memcpy(m->r + N, s->k[0], N * sizeof(double));
    m->error[0] = 0;
}

static int shorter_than_delay(Model *m, const Step *s) {
    m->ahead = 0;
    m->longest = 0.5 * s->h;
    if (m->longest < 1e-9) {
        model_fail(m, "a delay is shorter than the smallest step");
        return 0;
    }
    reject(m, s);
    return 1;
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
        s.extended = 0;
        step_stages(m, &s);
        if (!all_finite(m, s.y1) && !(SOLVER_STEP > 0) && s.h > 1e-12 && !m->error[0]) s.y1[0] = NAN;
        finish(m, &s, end);
        if (MODEL_LINES && m->ahead) {
            if (!shorter_than_delay(m, &s)) return 0;
            continue;
        }
        if (!(SOLVER_STEP > 0)) {
            double error = error_of(m, &s);
            double factor = error > 0 ? 0.9 * pow(error, -1.0 / STEP_ORDER) : 5;
            if (!(error <= 1)) { /* also if the error is NaN */
                m->step = s.h * (error > 1 && isfinite(error) ? max_real(0.2, factor) : 0.2);
                if (m->step < 1e-13 * max_real(1, fabs(s.t))) {
                    model_fail(m, "the integrator cannot reach its tolerance");
                    return 0;
                }
                reject(m, &s);
                continue;
            }
            double proposal = s.h * min_real(5, max_real(0.2, factor));
            m->step = s.h >= m->step || factor < 1 ? proposal : max_real(m->step, proposal); /* `stop` cut this one short */
        }
        if (!all_finite(m, s.y1)) {
            if (!m->error[0]) model_fail(m, "a state is not a finite number");
            return 0;
        }
        int event = crossings && find_event(m, &s, end, z);
        if (MODEL_LINES) record(m, &s);
        if (event) return 1;
    }
    return 0;
}
