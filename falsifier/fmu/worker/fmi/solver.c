/* Model exchange: the solver.
 *
 * Inputs are applied at every stage of every step. Steps end at communication points, control points of the inputs and
 * time events. State events are located on the dense output, and the step is repeated up to the event; the state
 * at the event is then the result of a step and not interpolated. If stability rather than accuracy limits
 * explicit steps, the rest of the simulation uses implicit ones. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi/model_exchange.h"
#include "platform/platform.h"

/* Constants of Hairer and Wanner: a problem is stiff after 15 steps with h times the dominant eigenvalue above
 * 3.25 (the method is stable up to 3.3); 6 other steps in a row reset the count. */
#define STIFF_BOUND 3.25
#define STIFF_STEPS 15
#define OTHER_STEPS 6
#define SAFETY 0.9
#define MIN_FACTOR 0.2
#define MAX_FACTOR 5.0
/* Events within one output interval after which the FMU is considered stuck (Zeno behaviour). */
#define MOST_EVENTS 10000

/* Numbers that the FMU writes end where accessible memory ends: an FMU that writes past them crashes there. */
static double *guarded(size_t count)
{
    void *memory = guarded_memory(count * sizeof(double));
    if (!memory)
        give_up("not enough memory for the FMU and what surrounds it");
    return memory;
}

void prepare_solver(struct fmu *fmu, struct plan *plan)
{
    int is_known = fmu->solver != NULL;
    if (!is_known) {
        get_sizes(fmu);
        fmu->solver = need(1, sizeof *fmu->solver);
    }
    struct solver *s = fmu->solver;
    s->fmu = fmu;
    s->plan = plan;
    s->n = fmu->states;
    s->indicators = fmu->indicators;
    find_functions(s);
    if (is_known)
        return;
    s->weights = need(s->n, sizeof(double));
    s->x = guarded(s->n);
    s->new_x = guarded(s->n);
    for (int i = 0; i < STAGES; i++)
        s->stages[i] = guarded(s->n);
    for (int i = 0; i < 4; i++)
        s->work[i] = guarded(s->n);
    s->pivots = need(s->n, sizeof(size_t));
    double **z[] = {&s->z, &s->new_z, &s->z_low, &s->z_high, &s->z_trial};
    for (int i = 0; i < 5; i++)
        *z[i] = guarded(s->indicators);
}

static struct outcome start(struct solver *s)
{
    struct inputs *both[] = {&s->plan->inputs, &s->plan->held};
    for (int k = 0; k < 2; k++)
        for (size_t j = 0; j < both[k]->ports.count; j++)
            both[k]->current[j] = 0;
    s->time = 0.0;
    s->next_step = s->plan->max_step;
    s->next_event = INFINITY;
    s->implicit = s->stiff_hits = s->other_hits = s->events = s->jacobian_known = 0;
    for (size_t i = 0; i < s->n; i++)
        s->x[i] = s->new_x[i] = 0.0;
    for (size_t i = 0; i < s->indicators; i++)
        s->z[i] = s->new_z[i] = 0.0;
    struct outcome o = checked(weigh_states(s), GETTING);
    return o.where == DONE ? checked(get_states(s), GETTING) : o;
}

/* Get from initialisation to continuous time, handling the events at time 0. */
struct outcome begin_solving(struct fmu *fmu, const struct event_info_1 *first)
{
    struct solver *s = fmu->solver;
    struct outcome o = start(s);
    if (o.where != DONE)
        return o;
    if (s->fmu->major > 1 || !first->converged) {
        o = settle_events(s);
    } else {
        if (first->terminate)
            return (struct outcome){0, TERMINATED};
        s->next_event = first->has_next_time ? first->next_time : INFINITY;
        o = refresh(s);
    }
    if (o.where == DONE && s->fmu->major > 1) {
        /* Event mode may have changed the states, whether the FMU reports it or not. */
        o = checked(get_states(s), GETTING);
        if (o.where == DONE)
            o = refresh(s);
    }
    return o;
}

static struct trial try_step(struct solver *s, double h)
{
    if (!s->implicit)
        return explicit_step(s, h);
    struct trial t = implicit_step(s, h);
    /* The FMU was last evaluated at an iterate of Newton's method; set it to the end of the step. */
    if (t.status <= 1 && isfinite(t.error))
        t.status = derive(s, s->time + h, s->new_x, s->work[1]);
    return t;
}

/* Count steps at the limit of stability; after enough of them step_towards changes to implicit steps. */
static void watch_stiffness(struct solver *s, double stiffness)
{
    if (stiffness > STIFF_BOUND) {
        s->other_hits = 0;
        s->stiff_hits++;
    } else if (s->stiff_hits && ++s->other_hits >= OTHER_STEPS) {
        s->stiff_hits = 0;
    }
}

/* Most systems never need them. Where there is no memory for them, steps remain explicit. */
static int has_matrices(struct solver *s)
{
    if (!s->jacobian)
        s->jacobian = calloc(s->n * s->n, 2 * sizeof(double));
    return s->jacobian != NULL;
}

static double spacing(double x)
{
    return nextafter(x, INFINITY) - x;
}

/* Shorten the step until its error is within the tolerance; the event indicators at its end are new_z. */
static struct outcome accepted_step(struct solver *s, double *h)
{
    double tried = *h;
    for (;;) {
        struct trial t = try_step(s, *h);
        /* FMUs may discard a step here, too. */
        if (t.status <= 1 && t.error <= 1.0)
            t.status = get_indicators(s, s->new_z);
        if (t.status > 2)
            return (struct outcome){t.status, STEPPING};
        double factor = MIN_FACTOR;
        if (t.status != 2 && isfinite(t.error)) {
            factor = SAFETY * pow(fmax(t.error, 1e-10), -1.0 / (s->implicit ? 4.0 : 5.0));
            factor = fmin(MAX_FACTOR, fmax(MIN_FACTOR, factor));
        }
        int is_accepted = t.status <= 1 && t.error <= 1.0;
        if (is_accepted) {
            /* A step that was cut short by a target is no reason to propose less than before. */
            double proposal = *h < tried ? *h * factor : fmax(*h * factor, s->next_step);
            s->next_step = fmin(proposal, s->plan->max_step);
        } else {
            *h = s->next_step = *h * fmin(factor, 0.9);
        }
        if (!s->implicit && isfinite(t.error))
            watch_stiffness(s, t.stiffness);
        if (is_accepted)
            return (struct outcome){t.status, DONE};
        /* Give up once the step is too small to change the time in floating point. */
        if (*h < 4.0 * spacing(fmax(fabs(s->time), 1e-3 * s->plan->stop_time)))
            return (struct outcome){0, TOO_SMALL};
    }
}

static int changes_sign(const struct solver *s, const double *z)
{
    for (size_t i = 0; i < s->indicators; i++)
        if ((s->z[i] > 0.0) != (z[i] > 0.0))
            return 1;
    return 0;
}

/* Locate the first sign change within the last trial step; theta is just after it.
 *
 * Alternates two trials on either side of the secant's root with a bisection, which guarantees convergence. */
static unsigned locate(struct solver *s, double h, double *theta)
{
    double low = 0.0, width = fmax(1e-13, 0.1 * rounding(s->time) / h);
    size_t bytes = s->indicators * sizeof(double);
    memcpy(s->z_low, s->z, bytes);
    memcpy(s->z_high, s->new_z, bytes);
    memcpy(s->z_trial, s->new_z, bytes);
    *theta = 1.0;
    for (int trial = 0; *theta - low > width; trial++) {
        double gap = *theta - low, root = 0.5;
        if (trial % 3 != 2) {
            root = 1.0;
            for (size_t i = 0; i < s->indicators; i++)
                if ((s->z_low[i] > 0.0) != (s->z_high[i] > 0.0) && s->z_low[i] != s->z_high[i])
                    root = fmin(root, s->z_low[i] / (s->z_low[i] - s->z_high[i]));
            root += trial % 3 == 0 ? 1e-3 : -1e-3;
        }
        double at = low + gap * fmin(fmax(root, 1e-4), 1.0 - 1e-4);
        interpolate(s, h, at, s->implicit ? 5 : 6, s->work[0]);
        unsigned status = derive(s, s->time + at * h, s->work[0], s->work[1]);
        if (status <= 1)
            status = get_indicators(s, s->z_trial);
        if (status > 1)
            return status;
        if (changes_sign(s, s->z_trial)) {
            *theta = at;
            memcpy(s->z_high, s->z_trial, bytes);
        } else {
            low = at;
            memcpy(s->z_low, s->z_trial, bytes);
        }
    }
    return 0;
}

/* Repeat the last step up to the first sign change of an event indicator within it. */
static struct outcome stop_at_event(struct solver *s, double *h)
{
    double theta, nudge = fmax(1e-12, rounding(s->time) / *h);
    unsigned status = locate(s, *h, &theta);
    if (status > 1)
        return (struct outcome){status, EVENT};
    for (;; theta += nudge, nudge *= 4.0) {
        double shorter = *h * fmin(theta, 1.0);
        struct trial t = try_step(s, shorter);
        if (t.status <= 1 && isfinite(t.error))
            t.status = get_indicators(s, s->new_z);
        if (t.status > 1 || !isfinite(t.error))
            return (struct outcome){t.status > 2 ? t.status : 2, STEPPING};
        /* On the interpolant the sign may change slightly earlier than in the repeated step. */
        if (changes_sign(s, s->new_z) || theta >= 1.0) {
            *h = shorter;
            return done;
        }
    }
}

/* The proposed step, adjusted so that no tiny step remains before the target. */
static double step_size(const struct solver *s, double target)
{
    double left = target - s->time, h = s->next_step;
    if (h >= left * (1.0 - 1e-6))
        return left;
    return 2.0 * h > left ? fmin(h, 0.5 * left) : h;
}

/* Do one accepted step that ends at the target, at an event or in between. */
static struct outcome step_towards(struct solver *s, double target, int *wants_event)
{
    double h = step_size(s, target);
    struct outcome o = accepted_step(s, &h);
    *wants_event = o.where == DONE && changes_sign(s, s->new_z);
    if (*wants_event)
        o = stop_at_event(s, &h);
    if (o.where != DONE)
        return o;
    double end = s->time + h;
    s->time = target - end <= rounding(target) ? target : end;
    memcpy(s->x, s->new_x, s->n * sizeof(double));
    memcpy(s->stages[0], s->stages[s->implicit ? 5 : 6], s->n * sizeof(double));
    memcpy(s->z, s->new_z, s->indicators * sizeof(double));
    if (s->stiff_hits >= STIFF_STEPS && !s->implicit && has_matrices(s)) {
        s->implicit = 1;
        s->jacobian_known = 0;
    }
    int asks, ends;
    o = checked(complete_step(s, &asks, &ends), STEPPING);
    *wants_event = *wants_event || asks;
    if (o.where == DONE && ends)
        o.where = TERMINATED;
    return o;
}

/* Handle an event, unless there were too many since the last output. */
static struct outcome pass_event(struct solver *s)
{
    if (++s->events > MOST_EVENTS)
        return (struct outcome){0, STUCK};
    return handle_event(s);
}

/* Do at most one step towards a time limit, and handle the events at its end. */
static struct outcome proceed(struct solver *s, double limit)
{
    double target = fmax(fmin(limit, fmin(next_break(s), s->next_event)), s->time);
    int wants_event = 0;
    if (target - s->time > rounding(target)) {
        struct outcome o = step_towards(s, target, &wants_event);
        if (o.where != DONE)
            return o;
    } else {
        s->time = target;
    }
    int jumps = enter_pieces(s);
    int is_event = wants_event || jumps || s->next_event <= s->time + rounding(s->time);
    return is_event ? pass_event(s) : done;
}

/* Integrate over a communication step, perhaps after an event at its start. Where the progress is known, it is told
 * after each step of the solver, which may do many. */
struct outcome solve_step(
    struct fmu *fmu, double start, double end, int has_event, struct progress *progress, int *ends)
{
    struct solver *s = fmu->solver;
    s->time = start;
    s->events = 0;
    struct outcome o = has_event ? pass_event(s) : done;
    while (o.where == DONE && end - s->time > rounding(end)) {
        o = proceed(s, end);
        if (progress && is_late(progress, s->time) && o.where == DONE)
            o = (struct outcome){0, TIMEOUT};
    }
    *ends = o.where == TERMINATED;
    if (*ends && end - s->time <= rounding(end))
        o.where = DONE;
    return o;
}

/* Copy what changes in a step to memory behind the structure, or back; the rest follows from it. */
static size_t move(const struct solver *s, char *kept, int is_kept)
{
    const struct inputs *plain = &s->plan->inputs, *held = &s->plan->held;
    const struct { void *at; size_t count; } vectors[] = {
        {s->weights, s->n}, {s->x, s->n}, {s->stages[0], s->n}, {s->z, s->indicators},
        {plain->current, plain->ports.count}, {held->current, held->ports.count},
    };
    size_t total = 0;
    for (size_t k = 0; k < sizeof vectors / sizeof *vectors; k++) {
        size_t bytes = vectors[k].count * sizeof(double);
        if (kept && bytes)
            memcpy(is_kept ? kept + total : vectors[k].at, is_kept ? vectors[k].at : kept + total, bytes);
        total += bytes;
    }
    return total;
}

/* Keep what a step changes, in new memory if there is none yet; bring_back_solver undoes the step. */
void *keep_solver(const struct fmu *fmu, void *kept)
{
    const struct solver *s = fmu->solver;
    struct solver *copy = kept ? kept : need(1, sizeof *copy + move(s, NULL, 1));
    *copy = *s;
    move(s, (char *)(copy + 1), 1);
    return copy;
}

void bring_back_solver(struct fmu *fmu, void *kept)
{
    struct solver *s = fmu->solver;
    double *jacobian = s->jacobian;
    *s = *(const struct solver *)kept;
    s->jacobian = jacobian;
    move(s, (char *)kept + sizeof *s, 0);
    s->jacobian_known = 0;
}
