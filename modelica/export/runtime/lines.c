/* Delay lines: the memory of `delay` and `spatialDistribution`.
 *
 * A line is a list of points (key, value) with keys that never decrease: times, or the distance that a medium has
 * travelled. Values between two points are interpolated linearly. At a jump, two points have the same key. A point is
 * recorded at the end of every completed step and after every event. Reading beyond the last one sets the flag `ahead`:
 * the step was longer than the delay.
 *
 * The points are stored outside the Model, which stores how many of them belong to it: restoring a copy of a Model
 * discards the points recorded since the copy was made.
 */
#include "model.h"

#include <stdio.h>

static double slack(double key) { return 1e-12 * max_real(1, fabs(key)); }

static void fail(Model *m, int k, const char *what) {
    char text[160];
    snprintf(text, sizeof text, "%s: %s", model_line_names[k], what);
    model_fail(m, text);
}

static void append(Model *m, int k, double key, double value) {
    if (m->line_end[k] - m->line_begin[k] >= LINE_POINTS) {
        fail(m, k, "the delay needs more points than __falsifier_solver(delayPoints) provides");
        return;
    }
    Point *point = &m->lines[k].point[m->line_end[k]++ % LINE_POINTS];
    point->key = key;
    point->value = value;
}

static Point *at_index(const Model *m, int k, long long index) { return &m->lines[k].point[index % LINE_POINTS]; }

void line_seed(Model *m, int k, double key, double value) { append(m, k, key, value); }

void lines_start(Model *m) {
    Entries first;
    memset(m->line_begin, 0, sizeof m->line_begin);
    memset(m->line_end, 0, sizeof m->line_end);
    memset(m->line_hint, 0, sizeof m->line_hint);
    m->ahead = 0;
    m->longest = HUGE_VAL;
    m->line_time = m->time;
    model_line_seeds(m);
    model_lines(m, &first);
    for (int k = 0; k < MODEL_LINES; k++) {
        if (!(first.span[k] > 0)) fail(m, k, "the delay must be longer than 0");
        append(m, k, first.key[k], first.value[k]);
    }
}

static void record(Model *m, int k, double key, double value, double span) {
    Point *last = at_index(m, k, m->line_end[k] - 1);
    if (!isfinite(key) || !isfinite(value)) {
        fail(m, k, "the input of the delay is not a finite number");
        return;
    }
    if (key < last->key) {
        if (last->key - key > slack(key)) fail(m, k, "'x' of spatialDistribution decreases");
        key = last->key;
    }
    if (key == last->key) {
        if (value == last->value) return;
        if (m->line_end[k] - m->line_begin[k] > 1 && last[0].key == at_index(m, k, m->line_end[k] - 2)->key) {
            last->value = value;
            return;
        }
    }
    while (m->line_end[k] - m->line_begin[k] > 1 && at_index(m, k, m->line_begin[k] + 1)->key <= key - span - slack(key))
        m->line_begin[k]++;
    append(m, k, key, value);
}

void lines_insert(Model *m, const Entries *entries) {
    for (int k = 0; k < MODEL_LINES && !m->error[0]; k++)
        record(m, k, entries->key[k], entries->value[k], entries->span[k]);
}

void lines_last(const Model *m, Entries *last) {
    for (int k = 0; k < MODEL_LINES; k++) {
        const Point *point = at_index(m, k, m->line_end[k] - 1);
        last->key[k] = point->key;
        last->value[k] = point->value;
    }
}

/* Whether straight lines between two points meet the tolerance of the integration. */
int lines_are_straight(const Model *m, const Entries *from, const Entries *middle, const Entries *to) {
    for (int k = 0; k < MODEL_LINES; k++) {
        double distance = to->key[k] - from->key[k];
        double share = distance > 0 ? (middle->key[k] - from->key[k]) / distance : 0.5;
        double straight = from->value[k] + share * (to->value[k] - from->value[k]);
        if (!(fabs(middle->value[k] - straight) <= 10 * m->tolerance * max_real(1, fabs(straight)))) return 0;
    }
    return 1;
}

void lines_record(Model *m) {
    Entries now;
    events_evaluate(m);
    model_lines(m, &now);
    if (m->time < m->line_time - slack(m->time)) { /* a host that retries steps has returned to an earlier time */
        for (int k = 0; k < MODEL_LINES; k++)
            while (m->line_end[k] - m->line_begin[k] > 1 && at_index(m, k, m->line_end[k] - 1)->key > now.key[k])
                m->line_end[k]--;
    }
    m->line_time = m->time;
    lines_insert(m, &now);
}

double line_read(Model *m, int k, double position) {
    const long long begin = m->line_begin[k], end = m->line_end[k];
    if (end == begin) return 0;
    const Point *first = at_index(m, k, begin), *last = at_index(m, k, end - 1);
    if (position >= last->key) {
        if (position > last->key + slack(position)) m->ahead = 1;
        return last->value;
    }
    if (position <= first->key) {
        if (begin > 0 && position < first->key - slack(position)) fail(m, k, "the delay is longer than 'delayMax'");
        return first->value;
    }
    long long i = m->line_hint[k];
    if (i < begin || i > end - 2) i = begin;
    while (at_index(m, k, i + 1)->key <= position) i++;
    while (at_index(m, k, i)->key > position) i--;
    m->line_hint[k] = i;
    const Point *left = at_index(m, k, i), *right = at_index(m, k, i + 1);
    return left->value + (right->value - left->value) * ((position - left->key) / (right->key - left->key));
}
