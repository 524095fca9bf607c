/* The master of a system: initialises its components across connections and steps them together. */

#include <math.h>
#include <stddef.h>
#include <stdio.h>

#include "system/system.h"

/* Connected outputs that the error of a system that does not converge names. */
#define MOST_NAMED 6

/* The position of an output takes up to 20 characters, a change up to 25. */
static char named[48 * (MOST_NAMED + 1)];

/* Tell the process that requests simulations which component's code runs: after a crash, it was that one. */
static struct component *at(struct system *s, size_t position)
{
    if (s->header)
        s->header[RUNNING] = (double)position;
    return &s->components[position];
}

struct outcome ask_each(struct system *s, enum task task)
{
    struct outcome o = done;
    for (size_t c = 0; c < s->count && o.where == DONE; c++)
        o = ask(at(s, c), task);
    return o;
}

int all_accept(struct system *s, enum task task)
{
    int accepted = 1;
    for (size_t c = 0; c < s->count; c++)
        accepted = ask(at(s, c), task).where == DONE && accepted;
    return accepted;
}

/* Set the text of an outcome to how many of these outputs still change, then their positions and changes. */
static void name_moving(const struct system *s, const struct signal *first, const struct signal *last)
{
    size_t total = 0, length = 0;
    for (const struct signal *k = first; k < last; k++)
        total += moves(k, s->tolerance) != 0;
    length = (size_t)snprintf(named, sizeof named, "%zu", total);
    for (const struct signal *k = first; k < last && total; k++)
        if (moves(k, s->tolerance) && length < 48 * MOST_NAMED)
            length += (size_t)snprintf(named + length, sizeof named - length, " %td %.17g", k - s->signals,
                                       fabs(k->value - k->tried));
    failing = named;
}

/* Set the text of an outcome to the positions of a component's outputs that are NaN; return whether any is. */
static int name_missing(const struct system *s, const struct component *c)
{
    size_t length = 0;
    named[0] = '\0';
    for (const struct signal *k = c->signals; k < c->signals + c->connected.count; k++)
        if (isnan(k->value) && length < 48 * MOST_NAMED)
            length += (size_t)snprintf(named + length, sizeof named - length, " %td", k - s->signals);
    failing = named;
    return length > 0;
}

/* Read a component's connected outputs. If one is NaN, the component that receives it would be blamed. */
static struct outcome read_signals(struct system *s, struct component *c, double time)
{
    if (!c->connected.count)
        return done;
    struct outcome o = ask(c, READ_SIGNALS);
    if (o.where == DONE && store_signals(c, time)) {
        name_missing(s, c);
        o.where = NOT_A_NUMBER;
    }
    return o;
}

static int any_moves(const struct system *s, const struct component *c)
{
    for (size_t j = 0; j < c->connected.count; j++)
        if (moves(&c->signals[j], s->tolerance))
            return 1;
    return 0;
}

/* In initialisation: give each component its inputs at time 0 and read its outputs, in their order. */
static struct outcome start_round(struct system *s, int *moving, size_t *missing)
{
    *moving = 0;
    *missing = s->count;
    for (size_t k = 0; k < s->count; k++) {
        struct component *c = at(s, k);
        gather(c, 0.0, 0.0);
        struct outcome o = ask(c, SET_FIRST);
        if (o.where == DONE)
            o = read_signals(s, c, 0.0);
        if (o.where == NOT_A_NUMBER && *missing == s->count)
            *missing = k;
        else if (o.where != DONE && o.where != NOT_A_NUMBER)
            return o;
        *moving = *moving || any_moves(s, c);
    }
    return done;
}

/* Repeat rounds through all components until the connected outputs at time 0 no longer change. */
static struct outcome find_first_values(struct system *s)
{
    size_t origin = s->count, missing = s->count;
    for (size_t turn = 0; turn < s->max_rounds; turn++) {
        int moving;
        struct outcome o = start_round(s, &moving, &missing);
        if (o.where != DONE)
            return o;
        /* The first round compares with what the simulation before has left. */
        if (!moving && (turn || !s->signal_count))
            return done;
        /* In the first round with a NaN, the first component that has one did not receive it. It may go
         * again: at first, not all inputs are known. */
        if (origin == s->count || missing == s->count)
            origin = missing;
    }
    if (origin < s->count) {
        if (!name_missing(s, at(s, origin)))
            name_missing(s, at(s, missing));
        return (struct outcome){0, MISSING_AT_FIRST};
    }
    name_moving(s, s->signals, s->signals + s->signal_count);
    return (struct outcome){0, UNSETTLED};
}

/* Record a sample: connected outputs as they were exchanged, other variables as the FMUs say. */
static struct outcome record(struct system *s, size_t column)
{
    for (size_t j = 0; j < s->copy_count; j++)
        s->recorded[s->copies[j].row * s->samples + column] = s->copies[j].signal->value;
    for (size_t k = 0; k < s->count; k++) {
        struct component *c = &s->components[k];
        if (!c->plan.outputs.count)
            continue;
        struct outcome o = ask(at(s, k), READ_OTHERS);
        if (o.where != DONE)
            return o;
        for (size_t j = 0; j < c->plan.outputs.count; j++)
            s->recorded[c->output_rows[j] * s->samples + column] = c->out[j];
    }
    return done;
}

static struct outcome record_first(struct system *s)
{
    for (size_t k = 0; k < s->count; k++) {
        struct outcome o = read_signals(s, at(s, k), 0.0);
        if (o.where == NOT_A_NUMBER)
            o.where = MISSING_AFTER_START;
        if (o.where != DONE)
            return o;
    }
    return record(s, 0);
}

static struct outcome initialise_system(struct system *s)
{
    forget_signals(s);
    for (size_t k = 0; k < s->count; k++) {
        struct component *c = at(s, k);
        start_feeds(c);
        for (size_t j = 0; j < c->plan.parameters.count; j++)
            c->in[j] = s->parameters[c->parameter_rows[j]];
        struct outcome o = ask(c, ENTER);
        if (o.where != DONE)
            return o;
    }
    struct outcome o = find_first_values(s);
    for (size_t k = 0; k < s->count && o.where == DONE; k++) {
        begin_lines(&s->components[k]);
        o = ask(at(s, k), LEAVE);
    }
    return o.where == DONE ? record_first(s) : o;
}

/* A communication step: its number, and the times in s that matter to it. */
struct step {
    size_t k;
    double size, end;
};

/* A component whose own step is several communication steps does it at the end of these. */
static int is_due(const struct component *c, const struct step *t)
{
    return c->every == 1 || (t->k + 1) % c->every == 0; /* a division takes as long as the rest */
}

static double start_of_step(const struct component *c, const struct step *t)
{
    return (double)(t->k + 1 - c->every) * t->size;
}

static struct outcome do_own_step(struct component *c, const struct step *t)
{
    c->exchange->start = start_of_step(c, t);
    c->exchange->end = t->end;
    return ask(c, STEP);
}

/* Let a component step with the newest values of its inputs, and read its outputs. */
static struct outcome advance(struct system *s, struct component *c, const struct step *t)
{
    double start = start_of_step(c, t);
    prepare_step(c, start, 0.5 * (start + t->end));
    struct outcome o = do_own_step(c, t);
    return o.where == DONE ? read_signals(s, c, t->end) : o;
}

static struct outcome keep_or_bring_back(struct component *c, int is_first)
{
    (is_first ? keep_feeds : bring_back_feeds)(c);
    return ask(c, is_first ? KEEP : BRING_BACK);
}

/* Repeat a step of the components of a loop until their outputs agree. */
static struct outcome iterate(struct system *s, size_t first, const struct step *t, int *ends)
{
    size_t last = s->components[first].loop_end;
    for (size_t round = 0; round < s->max_rounds; round++) {
        int moving = 0;
        *ends = 0;
        for (size_t k = first; k < last; k++) {
            if (!is_due(&s->components[k], t))
                continue;
            struct component *c = at(s, k);
            struct outcome o = keep_or_bring_back(c, round == 0);
            if (o.where == DONE)
                o = advance(s, c, t);
            if (o.where != DONE)
                return o;
            *ends = *ends || c->exchange->ends;
            moving = moving || any_moves(s, c);
        }
        if (round && !moving)
            return done;
    }
    at(s, first);
    const struct component *end = &s->components[last - 1];
    name_moving(s, s->components[first].signals, end->signals + end->connected.count);
    return (struct outcome){0, NOT_CONVERGED};
}

/* Components step one after the other: later ones get the new values of earlier ones. */
static struct outcome gauss_seidel(struct system *s, const struct step *t, size_t *ender)
{
    for (size_t k = 0; k < s->count;) {
        struct component *c = &s->components[k];
        struct outcome o = done;
        int ends = 0;
        if (c->loop_end) {
            o = iterate(s, k, t, &ends);
        } else if (is_due(c, t)) {
            o = advance(s, at(s, k), t);
            ends = c->exchange->ends;
        }
        if (o.where != DONE)
            return o;
        *ender = ends ? k : *ender;
        k = c->loop_end ? c->loop_end : k + 1;
    }
    return done;
}

/* All components step from the values of the same communication point: that at which their step starts. */
static struct outcome jacobi(struct system *s, const struct step *t, size_t *ender)
{
    for (size_t k = 0; k < s->count; k++) {
        struct component *c = &s->components[k];
        double start = (double)t->k * t->size;
        if (t->k % c->every == 0)
            prepare_step(c, start, start + 0.5 * (double)c->every * t->size);
    }
    for (size_t k = 0; k < s->count; k++) {
        if (!is_due(&s->components[k], t))
            continue;
        struct component *c = at(s, k);
        struct outcome o = do_own_step(c, t);
        if (o.where != DONE)
            return o;
        *ender = c->exchange->ends ? k : *ender;
    }
    for (size_t k = 0; k < s->count; k++) {
        if (!is_due(&s->components[k], t))
            continue;
        struct outcome o = read_signals(s, at(s, k), t->end);
        if (o.where != DONE)
            return o;
    }
    return done;
}

/* Do all communication steps.
 *
 * The step sizes are differences of the communication points. FMUs add them to their time again, which is exact for
 * these; with k * size + size they would pass the stop time by a rounding error, and some refuse. */
static struct outcome step_system(struct system *s)
{
    size_t steps = (s->samples - 1) * s->every;
    double size = s->stop_time / (double)steps;
    for (size_t k = 0; k < steps;) {
        struct step t = {k, size, k + 1 == steps ? s->stop_time : fmin((double)(k + 1) * size, s->stop_time)};
        size_t ender = s->count;
        struct outcome o = (s->is_jacobi ? jacobi : gauss_seidel)(s, &t, &ender);
        if (o.where != DONE)
            return o;
        int late = is_late(s->progress, (double)++k * size);
        if (k % s->every == 0)
            o = record(s, k / s->every);
        if (o.where != DONE || k == steps)
            return o;
        if (ender < s->count) {
            at(s, ender);
            return (struct outcome){0, TERMINATED};
        }
        if (late)
            return (struct outcome){0, TIMEOUT};
    }
    return done;
}

/* Simulate all components from time 0 to the stop time. */
struct outcome simulate_system(struct system *s, struct progress *progress)
{
    s->progress = progress;
    struct outcome o = initialise_system(s);
    if (o.where == DONE)
        o = step_system(s);
    if (o.where == DONE) {
        s->header[COMPLETE] = s->stop_time; /* FMUs may crash or hang from here on */
        ask_each(s, END);
    }
    return o;
}
