/* The part of an FMU that does not depend on the FMI version. */
#include "instance.h"

#include <stdio.h>

/* Value references: Reals in the order of `r`, then Integers and Booleans in that of `i`, then time (FMI 3). */
#define VR_INTS ((unsigned)MODEL_REALS)
#define VR_TIME ((unsigned)(MODEL_REALS + MODEL_INTS))
#define VR_INDICATORS (VR_TIME + 1) /* event indicators (FMI 3) */

Instance *instance_new(const char *name, const char *guid, int cosimulation) {
    if (!guid || strcmp(guid, model_guid)) return NULL;
    Instance *c = calloc(1, sizeof *c);
    char *copy = calloc(1, strlen(name ? name : "") + 1);
    if (!c || !copy) {
        free(c);
        free(copy);
        return NULL;
    }
    strcpy(copy, name ? name : "");
    c->name = copy;
    c->state.cosimulation = cosimulation;
    instance_reset(c);
    return c;
}

void instance_free(Instance *c) {
    if (!c) return;
    free(c->preview);
    free((char *)c->name);
    free(c);
}

static void attach_lines(State *state, Line *lines) {
    state->simulation.now.lines = state->simulation.before.lines = lines;
}

void instance_reset(Instance *c) {
    memset(&c->state.simulation, 0, sizeof c->state.simulation);
    attach_lines(&c->state, c->state.lines);
    c->state.phase = PHASE_CREATED;
    c->state.simulation.now.tolerance = SOLVER_TOLERANCE;
    model_defaults(&c->state.simulation.now);
    free(c->preview);
    c->preview = NULL;
}

Result instance_error(Instance *c, const char *message) {
    if (c->log) c->log(c->environment, c->name, RESULT_ERROR, message);
    return RESULT_ERROR;
}

Result instance_result(Instance *c) {
    Model *m = &c->state.simulation.now;
    if (m->error[0]) return instance_error(c, m->error);
    if (!m->ahead) return RESULT_OK;
    m->ahead = 0;
    if (c->log && !c->told)
        c->log(c->environment, c->name, RESULT_DISCARD, "this step is longer than a delay of the model; use a shorter one");
    c->told = 1;
    return RESULT_DISCARD;
}

Result instance_end_initialization(Instance *c) {
    Simulation *s = &c->state.simulation;
    free(c->preview);
    c->preview = NULL;
    s->now.time = c->state.start_time;
    if (c->state.cosimulation) {
        simulation_start(s);
        c->state.phase = PHASE_STEPPING;
    } else {
        events_initialize(&s->now);
        c->state.phase = PHASE_EVENT;
    }
    return instance_result(c);
}

/* The model to read from. During initialization it is a copy, because solving the initial system must not overwrite
 * start values that may still be set. */
static Model *readable(Instance *c) {
    if (c->state.phase == PHASE_CREATED) return &c->state.simulation.now;
    if (c->state.phase != PHASE_INITIALIZING) {
        events_evaluate_all(&c->state.simulation.now);
        return &c->state.simulation.now;
    }
    if (!c->preview) {
        c->preview = malloc(sizeof *c->preview);
        if (!c->preview) return &c->state.simulation.now;
        *c->preview = c->state.simulation.now;
        c->preview->time = c->state.start_time;
        events_initialize(c->preview);
        if (c->state.cosimulation) events_handle(c->preview);
    }
    return c->preview;
}

static void forget_preview(Instance *c) {
    free(c->preview);
    c->preview = NULL;
}

static double indicator(Model *m, unsigned k) {
    double z[MODEL_CROSSINGS + 1];
    events_crossed(m, z);
    return z[k];
}

Result instance_get_reals(Instance *c, const unsigned *vr, size_t n, double *values) {
    Model *m = readable(c);
    for (size_t k = 0; k < n; k++) {
        if (vr[k] < VR_INTS) values[k] = m->r[vr[k]];
        else if (vr[k] == VR_TIME) values[k] = c->state.phase < PHASE_EVENT ? c->state.start_time : m->time;
        else if (vr[k] > VR_TIME && vr[k] < VR_INDICATORS + MODEL_CROSSINGS) values[k] = indicator(m, vr[k] - VR_INDICATORS);
        else return instance_error(c, "get: no Real has this value reference");
    }
    return instance_result(c);
}

static int may_set(const Instance *c, int kind) {
    if (kind >= KIND_TUNABLE) return c->state.phase != PHASE_ENDED;
    return kind > KIND_LOCAL && c->state.phase <= PHASE_INITIALIZING;
}

static void changed(Instance *c, int kind) {
    Model *m = &c->state.simulation.now;
    if (kind == KIND_TUNABLE && c->state.phase > PHASE_INITIALIZING) model_parameters(m);
    m->current = m->rest_current = 0;
    forget_preview(c);
}

Result instance_set_reals(Instance *c, const unsigned *vr, size_t n, const double *values) {
    Simulation *s = &c->state.simulation;
    for (size_t k = 0; k < n; k++) {
        if (vr[k] >= VR_INTS) return instance_error(c, "set: no Real has this value reference");
        int kind = model_real_kind[vr[k]];
        if (!may_set(c, kind)) return instance_error(c, "set: this variable cannot be set now");
        if (s->now.r[vr[k]] == values[k]) continue;
        s->now.r[vr[k]] = values[k];
        if (kind == KIND_INPUT) s->changed_reals = 1;
        else s->changed_others = 1;
        changed(c, kind);
    }
    return RESULT_OK;
}

Result instance_get_int(Instance *c, unsigned vr, int *value) {
    if (vr < VR_INTS || vr >= VR_TIME) return instance_error(c, "get: no Integer or Boolean has this value reference");
    *value = readable(c)->i[vr - VR_INTS];
    return instance_result(c);
}

Result instance_set_int(Instance *c, unsigned vr, int value) {
    Simulation *s = &c->state.simulation;
    if (vr < VR_INTS || vr >= VR_TIME) return instance_error(c, "set: no Integer or Boolean has this value reference");
    if (!may_set(c, model_int_kind[vr - VR_INTS])) return instance_error(c, "set: this variable cannot be set now");
    if (s->now.i[vr - VR_INTS] == value) return RESULT_OK;
    s->now.i[vr - VR_INTS] = value;
    s->changed_others = 1;
    changed(c, model_int_kind[vr - VR_INTS]);
    return RESULT_OK;
}

/* ---- FMU state ---- */

Result instance_save(Instance *c, void **state) {
    if (!*state) *state = malloc(sizeof(State));
    if (!*state) return instance_error(c, "not enough memory for the FMU state");
    memcpy(*state, &c->state, sizeof(State));
    attach_lines(*state, NULL);
    return RESULT_OK;
}

Result instance_restore(Instance *c, const void *state) {
    if (!state) return instance_error(c, "there is no FMU state to set");
    memcpy(&c->state, state, sizeof(State));
    attach_lines(&c->state, c->state.lines);
    forget_preview(c);
    return RESULT_OK;
}

Result instance_serialize(Instance *c, const void *state, void *bytes, size_t size) {
    if (!state || size < sizeof(State)) return instance_error(c, "serialize: the buffer is too small");
    memcpy(bytes, state, sizeof(State));
    return RESULT_OK;
}

Result instance_deserialize(Instance *c, const void *bytes, size_t size, void **state) {
    if (size != sizeof(State)) return instance_error(c, "deserialize: these bytes are not a state of this FMU");
    if (!*state) *state = malloc(sizeof(State));
    if (!*state) return instance_error(c, "not enough memory for the FMU state");
    memcpy(*state, bytes, sizeof(State));
    return RESULT_OK;
}

/* ---- model exchange ---- */

Result instance_set_time(Instance *c, double time) {
    c->state.simulation.now.time = time;
    c->state.simulation.now.current = c->state.simulation.now.rest_current = 0;
    return RESULT_OK;
}

Result instance_set_states(Instance *c, const double *x, size_t n) {
    if (n != MODEL_STATES) return instance_error(c, "wrong number of continuous states");
    memcpy(c->state.simulation.now.r, x, n * sizeof *x);
    c->state.simulation.now.current = c->state.simulation.now.rest_current = 0;
    return RESULT_OK;
}

Result instance_get_states(Instance *c, double *x, size_t n) {
    if (n != MODEL_STATES) return instance_error(c, "wrong number of continuous states");
    memcpy(x, readable(c)->r, n * sizeof *x);
    return RESULT_OK;
}

Result instance_get_derivatives(Instance *c, double *dx, size_t n) {
    if (n != MODEL_STATES) return instance_error(c, "wrong number of derivatives");
    Model *m = &c->state.simulation.now;
    if (c->state.phase == PHASE_INITIALIZING) m = readable(c);
    events_evaluate(m);
    memcpy(dx, m->r + MODEL_STATES, n * sizeof *dx);
    return instance_result(c);
}

Result instance_get_indicators(Instance *c, double *z, size_t n) {
    double values[MODEL_CROSSINGS + 1];
    if (n != MODEL_CROSSINGS) return instance_error(c, "wrong number of event indicators");
    Model *m = &c->state.simulation.now;
    if (c->state.phase == PHASE_INITIALIZING) m = readable(c);
    events_evaluate(m);
    events_crossed(m, values);
    memcpy(z, values, n * sizeof *z);
    return instance_result(c);
}

Result instance_get_nominals(Instance *c, double *x, size_t n) {
    if (n != MODEL_STATES) return instance_error(c, "wrong number of continuous states");
    memcpy(x, model_nominal, n * sizeof *x);
    return RESULT_OK;
}

Result instance_update(Instance *c, int *states_changed, int *next_defined, double *next_time) {
    Model *m = &c->state.simulation.now;
    double before[MODEL_STATES + 1];
    memcpy(before, m->r, MODEL_STATES * sizeof(double));
    events_handle(m);
    *states_changed = memcmp(before, m->r, MODEL_STATES * sizeof(double)) != 0;
    *next_time = events_next_time(m);
    *next_defined = *next_time < HUGE_VAL;
    if (!*next_defined) *next_time = 0;
    return instance_result(c);
}

Result instance_step_completed(Instance *c, int *enter_event_mode) {
    double z[MODEL_CROSSINGS + 1];
    Model *m = &c->state.simulation.now;
    *enter_event_mode = 0;
    if (MODEL_LINES) lines_record(m);
    if (MODEL_CROSSINGS) { /* otherwise the event is lost if the solver stops just before an indicator's zero */
        events_evaluate(m);
        *enter_event_mode = events_crossed(m, z);
    }
    return instance_result(c);
}

/* ---- co-simulation ---- */

Result instance_step(Instance *c, double start, double size) {
    if (!(size > 0)) return instance_error(c, "the communication step size must be positive");
    simulation_step(&c->state.simulation, start, size);
    return instance_result(c);
}
