/* What requests say of a system: its components, and the tables that its values pass through. */

#include "system/system.h"

static size_t *read_rows(struct request *r, size_t count)
{
    size_t *rows = need(count, sizeof *rows);
    for (size_t k = 0; k < count; k++)
        rows[k] = read_size(r);
    return rows;
}

/* Read what the components are. */
void read_components(struct request *r, struct system *s)
{
    s->is_separate = (int)read_size(r);
    s->saves_state = 1;
    s->count = read_size(r);
    s->components = need(s->count, sizeof *s->components);
    for (size_t k = 0; k < s->count; k++) {
        struct component *c = &s->components[k];
        c->system = s;
        c->exchange = need(1, sizeof *c->exchange);
        read_fmu(r, &c->fmu);
        s->saves_state = s->saves_state && c->fmu.saves_state;
    }
}

/* Where the value of an input comes from: a row of the table of pieces, or a signal. */
static void read_feed(struct request *r, const struct system *s, const double *table, struct feed *f)
{
    int is_connected = (int)read_size(r);
    size_t row = read_size(r);
    if (is_connected)
        f->signal = &s->signals[row];
    else
        f->pieces = (const struct piece *)(table + row * 5 * s->pieces);
    f->factor = read_number(r);
    f->offset = read_number(r);
    f->start = read_number(r);
    f->is_linear = (int)read_size(r);
}

static size_t larger(size_t a, size_t b)
{
    return a > b ? a : b;
}

/* Lay out the numbers that a component is given and that are read from it. */
static void make_exchange(struct component *c)
{
    const struct plan *plan = &c->plan;
    size_t inputs = plan->inputs.ports.count + plan->held.ports.count;
    size_t in = larger(inputs, plan->parameters.count), out = larger(c->connected.count, plan->outputs.count);
    size_t lines = c->fmu.is_model_exchange ? inputs * plan->inputs.pieces : 0;
    size_t count = in + out + 5 * lines;
    double *numbers = c->process ? shared_numbers(c, count) : need(count, sizeof(double));
    c->in = numbers;
    c->out = numbers + in;
    struct piece *line = (struct piece *)(numbers + in + out);
    for (size_t j = 0; j < inputs && lines; j++, line += plan->inputs.pieces) {
        struct inputs *which = j < plan->inputs.ports.count ? &c->plan.inputs : &c->plan.held;
        which->rows[j - (which == &plan->held ? plan->inputs.ports.count : 0)] = line;
        c->feeds[j].line = line;
    }
    c->plan.parameter_values = c->in;
}

static void read_component(struct request *r, const struct system *s, const double *table, struct component *c)
{
    struct plan *plan = &c->plan;
    plan->solver_tolerance = read_number(r);
    c->every = read_size(r);
    c->loop_end = read_size(r);
    c->is_iterated = (int)read_size(r);
    read_strings(r, plan);
    read_ports(r, &c->fmu, "Set", &plan->parameters);
    c->parameter_rows = read_rows(r, plan->parameters.count);
    read_inputs(r, &c->fmu, s->pieces, &plan->inputs);
    read_inputs(r, &c->fmu, s->pieces, &plan->held);
    size_t inputs = plan->inputs.ports.count + plan->held.ports.count;
    c->feeds = need(inputs, sizeof *c->feeds);
    c->kept_feeds = need(inputs, sizeof *c->kept_feeds);
    for (size_t j = 0; j < inputs; j++)
        read_feed(r, s, table, &c->feeds[j]);
    read_ports(r, &c->fmu, "Get", &c->connected);
    read_ports(r, &c->fmu, "Get", &plan->outputs);
    c->output_rows = read_rows(r, plan->outputs.count);
    make_exchange(c);
}

/* Read the plan of a system; the room is nobody's in the process of a component, which takes part of it. */
void read_system_plan(struct request *r, struct system *s, double *room)
{
    struct plan common = {0};
    s->samples = read_size(r);
    s->every = read_size(r);
    s->pieces = read_size(r);
    size_t parameters = read_size(r), inputs = read_size(r);
    s->recorded_count = read_size(r) * s->samples;
    common.has_tolerance = (int)read_size(r);
    common.stop_time = s->stop_time = read_number(r);
    common.max_step = read_number(r);
    common.tolerance = read_number(r);
    s->is_jacobi = (int)read_size(r);
    s->max_rounds = read_size(r);
    s->tolerance = read_number(r);
    s->signal_count = read_size(r);
    s->signals = need(s->signal_count, sizeof *s->signals);
    s->parameters = room;
    const double *table = room + parameters;
    s->recorded = room + parameters + inputs * 5 * s->pieces;
    struct signal *first = s->signals;
    for (size_t k = 0; k < s->count; k++) {
        struct component *c = &s->components[k];
        c->plan = common;
        read_component(r, s, table, c);
        c->signals = first;
        first += c->connected.count;
    }
    s->copy_count = read_size(r);
    s->copies = need(s->copy_count, sizeof *s->copies);
    for (size_t k = 0; k < s->copy_count; k++) {
        s->copies[k].signal = &s->signals[read_size(r)];
        s->copies[k].row = read_size(r);
    }
}
