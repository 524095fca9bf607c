/* Initialization, events and their iteration. */
#include "model.h"

#include <stdio.h>

#define MAX_ITERATIONS 200

void model_fail(Model *m, const char *message) {
    if (!m->error[0]) snprintf(m->error, sizeof m->error, "at t = %.9g s: %s", m->time, message);
}

void model_fail_subscript(Model *m, int index, int size, int line) {
    char text[96];
    snprintf(text, sizeof text, "the subscript %d is outside 1..%d (line %d)", index, size, line);
    model_fail(m, text);
}

static int holds(int op, double z) {
    switch (op) {
    case OP_LT: return z < 0;
    case OP_LE: return z <= 0;
    case OP_GT: return z > 0;
    default: return z >= 0;
    }
}

/* The two crossing functions of a floor must always hold: x - f >= 0 and x - (f + 1) < 0. */
static int expected(const Model *m, int k) { return k < MODEL_RELATIONS ? m->rel[k] : 1; }

int events_crossed(Model *m, double *z) {
    int crossed = 0;
    model_operands(m);
    model_crossings(m, z);
    for (int k = 0; k < MODEL_CROSSINGS; k++)
        crossed |= holds(model_crossing_op[k], z[k]) != expected(m, k);
    return crossed;
}

/* Returns whether a relation has changed. */
static int freeze_relations(Model *m) {
    int changed = 0;
    double z[MODEL_CROSSINGS + 1], at[MODEL_TIME_RELATIONS + 1];
    if (MODEL_CROSSINGS) {
        model_floors(m, m->fl);
        model_crossings(m, z);
        for (int k = 0; k < MODEL_RELATIONS; k++) {
            unsigned char now = (unsigned char)holds(model_crossing_op[k], z[k]);
            changed |= m->rel[k] != now;
            m->rel[k] = now;
        }
    }
    if (MODEL_TIME_RELATIONS) {
        model_thresholds(m, at);
        for (int k = 0; k < MODEL_TIME_RELATIONS; k++) m->trel[k] = (unsigned char)time_reached(m, at[k]);
    }
    return changed;
}

static void remember_continuous(Model *m) {
    for (int k = MODEL_DISCRETE_REALS; k < MODEL_PRE_REALS; k++) m->pr[k] = m->r[model_pre_reals[k]];
}

static void remember(Model *m) {
    memcpy(m->pi, m->i, sizeof m->i);
    memcpy(m->pw, m->w, sizeof m->w);
    for (int k = 0; k < MODEL_DISCRETE_REALS; k++) m->pr[k] = m->r[model_pre_reals[k]];
    remember_continuous(m);
}

static int discrete_changed(const Model *m) {
    if (memcmp(m->pi, m->i, sizeof m->i)) return 1;
    for (int k = 0; k < MODEL_DISCRETE_REALS; k++)
        if (m->pr[k] != m->r[model_pre_reals[k]]) return 1;
    return 0;
}

static int apply_reinits(Model *m) {
    int changed = 0;
    for (int k = 0; k < MODEL_STATES; k++)
        if (m->reinit_set[k]) {
            m->r[k] = m->reinit_value[k];
            m->reinit_set[k] = 0;
            changed = 1;
        }
    return changed;
}

static void iterate(Model *m) {
    int changed = 1;
    for (int n = 0; changed && !m->error[0]; n++) {
        if (n == MAX_ITERATIONS) {
            model_fail(m, "the event iteration of the when clauses does not converge");
            break;
        }
        if (n) remember(m);
        else remember_continuous(m); /* the others are as the last event left them, except for inputs */
        model_event(m);
        memset(m->tick, 0, sizeof m->tick);
        m->after_event |= freeze_relations(m);
        int jump = apply_reinits(m);
        m->after_event |= jump;
        changed = discrete_changed(m) || jump;
    }
    memcpy(m->pw, m->w, sizeof m->w);
    m->current = m->rest_current = 1;
}

static double tick_time(Model *m, int k) {
    double start, interval;
    model_tick_times(m, k, &start, &interval);
    return start + (double)m->tick_count[k] * interval;
}

void events_initialize(Model *m) {
    model_parameters(m);
    model_starts(m);
    remember(m);
    model_initial(m);
    (void)freeze_relations(m);
    remember(m);
    for (int k = 0; k < MODEL_TICKS; k++) {
        double start, interval;
        model_tick_times(m, k, &start, &interval);
        if (!(interval > 0)) model_fail(m, "the interval of sample(start, interval) must be positive");
        m->tick_count[k] = 0;
        if (interval > 0 && m->time > start)
            m->tick_count[k] = (long long)ceil((m->time - start - TIME_TOLERANCE) / interval);
    }
    m->current = m->rest_current = 1;
    if (MODEL_LINES) lines_start(m);
}

void events_handle(Model *m) {
    for (int k = 0; k < MODEL_TICKS; k++)
        if (time_reached(m, tick_time(m, k))) {
            m->tick[k] = 1;
            m->tick_count[k]++;
        }
    iterate(m);
    if (MODEL_LINES) {
        lines_record(m);
        if (m->ahead) model_fail(m, "a delay time is negative");
    }
}

double events_next_time(Model *m) {
    double next = HUGE_VAL, at[MODEL_TIME_RELATIONS + 1];
    for (int k = 0; k < MODEL_TICKS; k++) next = min_real(next, tick_time(m, k));
    if (MODEL_TIME_RELATIONS) {
        model_thresholds(m, at);
        for (int k = 0; k < MODEL_TIME_RELATIONS; k++)
            if (!m->trel[k]) next = min_real(next, at[k]);
    }
    return next;
}

void events_evaluate(Model *m) {
    if (m->current) return;
    model_derivatives(m);
    m->current = 1;
}

void events_evaluate_all(Model *m) {
    events_evaluate(m);
    if (m->rest_current) return;
    model_rest(m);
    m->rest_current = 1;
}
