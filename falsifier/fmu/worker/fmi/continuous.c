/* A model-exchange FMU as a differential equation: inputs, derivatives, event indicators, event iteration. */

#include <math.h>
#include <string.h>

#include "fmi/model_exchange.h"

/* Rounds of one event iteration after which the FMU is considered stuck. */
#define MOST_ROUNDS 1000
/* Maximum number of states, and of event indicators: an FMU may report anything. */
#define MOST_VALUES 100000
/* Absolute tolerance of a state: this share of the relative one, times its nominal value (FMI 2.0.4, 2.2.7). */
#define ABSOLUTE_SHARE 0.01

typedef unsigned (*get_size)(void *, size_t *);
typedef unsigned (*completed_1)(void *, char *);
typedef unsigned (*completed_2)(void *, int, int *, int *);
typedef unsigned (*completed_3)(void *, uint8_t, uint8_t *, uint8_t *);

/* fmi2EventInfo */
struct event_info_2 {
    int again, terminate, nominals_changed, states_changed, has_next_time;
    double next_time;
};

typedef unsigned (*update_1)(void *, char, struct event_info_1 *);
typedef unsigned (*update_2)(void *, struct event_info_2 *);

/* Look up what is called in every step. */
void find_functions(struct solver *s)
{
    const struct fmu *fmu = s->fmu;
    struct continuous_functions *f = &s->f;
    f->set_time = (set_time)fmu_required(fmu, "SetTime");
    f->completed_step = fmu_required(fmu, "CompletedIntegratorStep");
    if (s->n) {
        f->set_states = (set_vector)fmu_required(fmu, "SetContinuousStates");
        f->get_states = (get_vector)fmu_required(fmu, "GetContinuousStates");
        f->get_derivatives = (get_vector)fmu_required(
            fmu, fmu->major == 3 ? "GetContinuousStateDerivatives" : "GetDerivatives");
    }
    if (s->indicators)
        f->get_indicators = (get_vector)fmu_required(fmu, "GetEventIndicators");
    const char *updates[] = {"EventUpdate", "NewDiscreteStates", "UpdateDiscreteStates"};
    f->update = fmu_required(fmu, updates[fmu->major - 1]);
    if (fmu->major > 1) {
        f->enter_event_mode = (without_arguments)fmu_required(fmu, "EnterEventMode");
        f->enter_continuous_time_mode = (without_arguments)fmu_required(fmu, "EnterContinuousTimeMode");
    }
}

static size_t size_of(struct fmu *fmu, const char *name)
{
    size_t size = 0;
    if (((get_size)fmu_required(fmu, name))(fmu->instance, &size) > 1)
        give_up("%s failed", name);
    return size;
}

/* Ask for the numbers of states and event indicators, which FMI 3 reports only at run time, before a simulation. */
void get_sizes(struct fmu *fmu)
{
    if (fmu->major == 3) {
        fmu->states = size_of(fmu, "GetNumberOfContinuousStates");
        fmu->indicators = size_of(fmu, "GetNumberOfEventIndicators");
    }
    if (fmu->states > MOST_VALUES)
        give_up("%lld continuous states; expected 0 to %d", (long long)fmu->states, MOST_VALUES);
    if (fmu->indicators > MOST_VALUES)
        give_up("%lld event indicators; expected 0 to %d", (long long)fmu->indicators, MOST_VALUES);
}

/* Weigh the states by their nominal values, which events may change. */
unsigned weigh_states(struct solver *s)
{
    const char *name = s->fmu->major == 1 ? "GetNominalContinuousStates" : "GetNominalsOfContinuousStates";
    for (size_t i = 0; i < s->n; i++)
        s->weights[i] = 1.0;
    unsigned status = s->n ? ((get_vector)fmu_required(s->fmu, name))(s->fmu->instance, s->weights, s->n) : 0;
    for (size_t i = 0; i < s->n; i++)
        s->weights[i] = ABSOLUTE_SHARE * s->plan->solver_tolerance * (s->weights[i] > 0.0 ? s->weights[i] : 1.0);
    return status;
}

unsigned get_states(const struct solver *s)
{
    return s->n ? s->f.get_states(s->fmu->instance, s->x, s->n) : 0;
}

/* The start of a piece in s; inf after the last one. */
static double start_of(const struct inputs *inputs, size_t j, size_t piece)
{
    return piece < inputs->pieces ? inputs->rows[j][piece].start : INFINITY;
}

static double value_at(const struct inputs *inputs, size_t j, size_t piece, double time)
{
    return piece_at(&inputs->rows[j][piece], time);
}

static void put_current(const struct inputs *inputs, double time)
{
    for (size_t j = 0; j < inputs->ports.count; j++)
        put(&inputs->ports.places[j], value_at(inputs, j, inputs->current[j], time));
}

/* Get the derivatives at a time within the inputs' current pieces. */
unsigned derive(const struct solver *s, double time, const double *x, double *derivatives)
{
    void *instance = s->fmu->instance;
    unsigned status = s->f.set_time(instance, time);
    if (status <= 1 && s->n)
        status = s->f.set_states(instance, x, s->n);
    if (status <= 1 && s->plan->inputs.ports.count) {
        put_current(&s->plan->inputs, time);
        status = exchange_values(s->fmu, &s->plan->inputs.ports);
    }
    if (status <= 1 && s->n) {
        status = s->f.get_derivatives(instance, derivatives, s->n);
        /* Treat a step into a region where the model is undefined like fmi2Discard: retry a shorter one. */
        for (size_t i = 0; i < s->n; i++)
            if (!isfinite(derivatives[i]))
                return status > 2 ? status : 2;
    }
    return status;
}

/* Get the event indicators at the FMU's current time and state. */
unsigned get_indicators(const struct solver *s, double *z)
{
    return s->indicators ? s->f.get_indicators(s->fmu->instance, z, s->indicators) : 0;
}

/* Report an accepted step to the FMU. */
unsigned complete_step(const struct solver *s, int *wants_event, int *ends)
{
    void *instance = s->fmu->instance;
    unsigned status;
    *wants_event = *ends = 0;
    if (s->fmu->major == 1) {
        char event = 0;
        status = ((completed_1)s->f.completed_step)(instance, &event);
        *wants_event = event != 0;
    } else if (s->fmu->major == 2) {
        status = ((completed_2)s->f.completed_step)(instance, !s->fmu->is_repeated, wants_event, ends);
    } else {
        uint8_t event = 0, terminate = 0;
        status = ((completed_3)s->f.completed_step)(instance, !s->fmu->is_repeated, &event, &terminate);
        *wants_event = event != 0;
        *ends = terminate != 0;
    }
    return status;
}

struct update {
    int again, terminate, nominals_changed, states_changed;
};

/* Do one round of event iteration and store the next time event. */
static unsigned update(struct solver *s, struct update *u)
{
    void *instance = s->fmu->instance;
    unsigned status;
    int defined;
    double next_time = 0.0;
    if (s->fmu->major == 1) {
        struct event_info_1 i = {0};
        status = ((update_1)s->f.update)(instance, 0, &i);
        *u = (struct update){!i.converged, i.terminate != 0, 0, i.states_changed != 0};
        defined = i.has_next_time != 0;
        next_time = i.next_time;
    } else if (s->fmu->major == 2) {
        struct event_info_2 i = {0};
        status = ((update_2)s->f.update)(instance, &i);
        *u = (struct update){i.again != 0, i.terminate != 0, i.nominals_changed != 0, i.states_changed != 0};
        defined = i.has_next_time != 0;
        next_time = i.next_time;
    } else {
        uint8_t again = 0, terminate = 0, nominals = 0, states = 0, has_next_time = 0;
        status = ((update_discrete_states_3)s->f.update)(
            instance, &again, &terminate, &nominals, &states, &has_next_time, &next_time);
        *u = (struct update){again != 0, terminate != 0, nominals != 0, states != 0};
        defined = has_next_time != 0;
    }
    s->next_event = defined ? next_time : INFINITY;
    return status;
}

/* Iterate events until nothing changes, enter continuous time. */
struct outcome settle_events(struct solver *s)
{
    struct update u = {1, 0, 0, 0};
    int other_nominals = 0, any_change = 0;
    for (int round = 0; u.again; round++) {
        if (round == MOST_ROUNDS)
            return (struct outcome){0, STUCK};
        struct outcome o = checked(update(s, &u), EVENT);
        if (o.where == DONE && u.terminate)
            o.where = TERMINATED;
        if (o.where != DONE)
            return o;
        other_nominals = other_nominals || u.nominals_changed;
        any_change = any_change || u.states_changed;
    }
    unsigned status = s->fmu->major > 1 ? s->f.enter_continuous_time_mode(s->fmu->instance) : 0;
    if (status <= 1 && other_nominals)
        status = weigh_states(s);
    if (status <= 1 && any_change)
        status = get_states(s);
    return status > 1 ? checked(status, EVENT) : refresh(s);
}

/* Get derivatives and indicators at the current time and state. */
struct outcome refresh(struct solver *s)
{
    unsigned status = derive(s, s->time, s->x, s->stages[0]);
    struct outcome o = checked(status, status == 2 ? TOO_SMALL : STEPPING); /* discarded, or not finite */
    s->jacobian_known = 0;
    return o.where == DONE ? checked(get_indicators(s, s->z), EVENT) : o;
}

/* Set all inputs to their values at the current time. */
static unsigned set_event_inputs(struct solver *s)
{
    put_current(&s->plan->inputs, s->time);
    unsigned first = exchange_values(s->fmu, &s->plan->inputs.ports);
    put_current(&s->plan->held, s->time);
    unsigned second = exchange_values(s->fmu, &s->plan->held.ports);
    return first > second ? first : second;
}

/* Handle an event at the current time and state. */
struct outcome handle_event(struct solver *s)
{
    struct outcome o = checked(s->fmu->major > 1 ? s->f.enter_event_mode(s->fmu->instance) : 0, EVENT);
    if (o.where == DONE)
        o = checked(set_event_inputs(s), SETTING);
    return o.where == DONE ? settle_events(s) : o;
}

static double nearest_start(const struct inputs *inputs, double nearest)
{
    for (size_t j = 0; j < inputs->ports.count; j++)
        nearest = fmin(nearest, start_of(inputs, j, inputs->current[j] + 1));
    return nearest;
}

/* The time in s at which the next piece of any input starts; inf if there is none. */
double next_break(const struct solver *s)
{
    return nearest_start(&s->plan->held, nearest_start(&s->plan->inputs, INFINITY));
}

/* Switch to the pieces that have started by now. */
int enter_pieces(struct solver *s)
{
    double current = s->time + rounding(s->time);
    struct inputs *moving = &s->plan->inputs, *held = &s->plan->held;
    int jumps = 0;
    for (size_t j = 0; j < moving->ports.count; j++) {
        for (double start; (start = start_of(moving, j, moving->current[j] + 1)) <= current;) {
            double before = value_at(moving, j, moving->current[j], start);
            double after = value_at(moving, j, ++moving->current[j], start);
            jumps = jumps || fabs(after - before) > 1e-9 * fmax(fabs(after), fabs(before));
        }
    }
    for (size_t j = 0; j < held->ports.count; j++)
        while (start_of(held, j, held->current[j] + 1) <= current) {
            held->current[j]++;
            jumps = 1;
        }
    return jumps;
}
