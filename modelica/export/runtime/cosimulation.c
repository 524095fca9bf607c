/* Co-simulation: communication steps, including the events within them. */
#include "model.h"

#define MAX_IDLE_EVENTS 10000

/* Ticks and time events at the end of a communication step act immediately, with the inputs of that step, so that
 * the outputs read there include their effect. If the inputs change for the next step, the tick is repeated with the
 * new inputs, as if there were no communication points. SOLVER_REPEAT_TICKS: 0 never, 2 always, 1 unless the tick has
 * changed a discrete output: an output that was read must not be revoked (a gear would appear for one communication
 * step only).
 */
static int seen(const Model *before, const Model *now) {
    for (int k = 0; k < MODEL_OUTPUT_INTS; k++)
        if (before->i[model_output_ints[k]] != now->i[model_output_ints[k]]) return 1;
    for (int k = 0; k < MODEL_OUTPUT_REALS; k++)
        if (before->r[model_output_reals[k]] != now->r[model_output_reals[k]]) return 1;
    return 0;
}

static void end_of_step_events(Simulation *s) {
    if (events_next_time(&s->now) > s->now.time + TIME_TOLERANCE) return;
    s->before = s->now;
    events_handle(&s->now);
    s->repeatable = SOLVER_REPEAT_TICKS == 2 || (SOLVER_REPEAT_TICKS == 1 && !seen(&s->before, &s->now));
}

void simulation_start(Simulation *s) {
    events_initialize(&s->now);
    s->changed_reals = s->changed_others = 0;
    s->before = s->now;
    events_handle(&s->now);
    s->repeatable = 1;
}

static void keep_settings(Model *to, const Model *from) {
    for (int k = 0; k < MODEL_REALS; k++)
        if (model_real_kind[k] >= KIND_TUNABLE) to->r[k] = from->r[k];
    for (int k = 0; k < MODEL_INTS; k++)
        if (model_int_kind[k] >= KIND_TUNABLE) to->i[k] = from->i[k];
}

static void take_inputs(Simulation *s) {
    double z[MODEL_CROSSINGS + 1];
    Model *m = &s->now;
    m->current = m->rest_current = 0;
    if (s->repeatable) {
        keep_settings(&s->before, m);
        s->before.current = s->before.rest_current = 0;
        s->now = s->before;
        model_parameters(m);
        events_handle(m);
    } else if (s->changed_others) {
        events_handle(m);
    } else if (MODEL_CROSSINGS) {
        events_evaluate(m);
        if (events_crossed(m, z)) events_handle(m);
    }
    if (MODEL_LINES) lines_record(m); /* with the inputs, the input of a delay may have jumped */
    s->changed_reals = s->changed_others = 0;
}

int simulation_step(Simulation *s, double start, double size) {
    Model *m = &s->now;
    double end = start + size;
    if (fabs(start - m->time) > TIME_TOLERANCE * max_real(1, fabs(start))) {
        model_fail(m, "the communication step does not start where the last one ended");
        return 1;
    }
    if (s->changed_reals || s->changed_others) take_inputs(s);
    s->repeatable = 0;
    while (end - m->time > TIME_TOLERANCE && !m->error[0]) {
        double next = events_next_time(m), before = m->time;
        if (next > end - TIME_TOLERANCE) next = end;
        int state_event = next > m->time ? integrate(m, next) : 0;
        if (m->error[0]) break;
        if (m->time - before > TIME_TOLERANCE) m->idle_events = 0;
        if (state_event || end - m->time > TIME_TOLERANCE) {
            if (++m->idle_events > MAX_IDLE_EVENTS) model_fail(m, "the events never end");
            events_handle(m);
        }
    }
    if (!m->error[0]) {
        m->time = end;
        end_of_step_events(s);
    }
    return m->error[0] != 0;
}
