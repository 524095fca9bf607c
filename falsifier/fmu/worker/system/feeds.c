/* Values on their way from outputs to inputs. */

#include <math.h>
#include <string.h>

#include "system/system.h"

static size_t inputs_of(const struct component *c)
{
    return c->plan.inputs.ports.count + c->plan.held.ports.count;
}

/* No output is known at the start of a simulation. */
void forget_signals(struct system *s)
{
    for (size_t k = 0; k < s->signal_count; k++)
        s->signals[k].time = s->signals[k].old_time = -1.0;
}

/* At the start of a simulation, nothing has been written, and driven inputs are in their first piece. */
void start_feeds(struct component *c)
{
    size_t count = c->plan.inputs.pieces;
    for (size_t j = 0; j < inputs_of(c); j++) {
        struct feed *f = &c->feeds[j];
        f->piece = 0;
        f->written = NAN;
        for (size_t p = 0; f->line && p < count; p++) {
            struct piece *line = &f->line[p];
            if (f->signal) {
                *line = (struct piece){p ? INFINITY : 0.0, {0.0}};
                continue;
            }
            line->start = f->pieces[p].start;
            for (int i = 0; i < 4; i++)
                line->c[i] = f->factor * f->pieces[p].c[i];
            line->c[0] += f->offset;
        }
    }
}

/* The lines of a model-exchange component begin with what the initialisation has written. */
void begin_lines(struct component *c)
{
    for (size_t j = 0; j < inputs_of(c); j++)
        if (c->feeds[j].line && c->feeds[j].signal)
            c->feeds[j].line->c[0] = c->feeds[j].written;
}

/* The slope of the line that an input follows, before its conversion; 0 if it is held. */
static double slope(const struct feed *f)
{
    const struct signal *s = f->signal;
    if (f->is_linear && 0.0 <= s->old_time && s->old_time < s->time)
        return (s->value - s->old_value) / (s->time - s->old_time);
    return 0.0;
}

/* The value of an input for a step: of a piece at its start, or of a signal, in a line to its middle. */
static double fed(struct feed *f, size_t count, double start, double middle)
{
    if (!f->signal) {
        while (f->piece + 1 < count && f->pieces[f->piece + 1].start <= start + rounding(start))
            f->piece++;
        return f->factor * piece_at(&f->pieces[f->piece], start) + f->offset;
    }
    if (f->signal->time < 0.0)
        return f->start;
    double value = f->signal->value + slope(f) * (middle - f->signal->time);
    return f->factor * value + f->offset;
}

/* Collect the values of a component's inputs for a step; the FMU gets them when the step begins. */
void gather(struct component *c, double start, double middle)
{
    int changed = 0;
    for (size_t j = 0; j < inputs_of(c); j++) {
        struct feed *f = &c->feeds[j];
        double value = fed(f, c->plan.inputs.pieces, start, middle);
        changed = changed || (j >= c->plan.inputs.ports.count && value != f->written);
        f->written = c->in[j] = value;
    }
    c->exchange->jumps = changed;
}

/* Write the line that a connected input follows from here; return whether it jumps, beyond rounding. */
static int draw(struct feed *f, double start, double least)
{
    double value = fed(f, 0, start, start);
    double before = f->line->c[0] + f->line->c[1] * (start - f->line->start);
    f->line->start = start;
    f->line->c[0] = value;
    f->line->c[1] = f->factor * slope(f);
    return !(fabs(value - before) <= least * fmax(fabs(value), fabs(before)));
}

/* Collect a component's inputs for a step: values, or the lines that model exchange follows. */
void prepare_step(struct component *c, double start, double middle)
{
    if (!c->fmu.is_model_exchange) {
        gather(c, start, middle);
        return;
    }
    int jumps = 0;
    for (size_t j = 0; j < inputs_of(c); j++)
        if (c->feeds[j].signal && draw(&c->feeds[j], start, j < c->plan.inputs.ports.count ? 1e-9 : 0.0))
            jumps = 1;
    c->exchange->jumps = jumps;
}

/* Keep where the inputs are before a step that may be repeated. */
void keep_feeds(struct component *c)
{
    size_t count = inputs_of(c);
    for (size_t j = 0; j < count; j++)
        if (c->feeds[j].line)
            c->feeds[j].kept_line = *c->feeds[j].line;
    memcpy(c->kept_feeds, c->feeds, count * sizeof *c->feeds);
}

void bring_back_feeds(struct component *c)
{
    size_t count = inputs_of(c);
    memcpy(c->feeds, c->kept_feeds, count * sizeof *c->feeds);
    for (size_t j = 0; j < count; j++)
        if (c->feeds[j].line)
            *c->feeds[j].line = c->feeds[j].kept_line;
}

/* Store a component's connected outputs, which have been read at this time, perhaps again. */
int store_signals(struct component *c, double time)
{
    int is_missing = 0;
    for (size_t j = 0; j < c->connected.count; j++) {
        struct signal *s = &c->signals[j];
        if (s->time != time) {
            s->old_value = s->value;
            s->old_time = s->time;
        }
        s->tried = s->value;
        s->value = c->out[j];
        s->time = time;
        is_missing = is_missing || isnan(s->value);
    }
    return is_missing;
}

/* Whether a connected output has changed since the round before; one that stays infinite has not. */
int moves(const struct signal *s, double tolerance)
{
    double change = fabs(s->value - s->tried);
    return s->value != s->tried && !(isfinite(s->value) && change <= tolerance * fmax(1.0, fabs(s->value)));
}
