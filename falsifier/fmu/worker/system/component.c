/* One component of a system: what the master asks of it, in this process or in one of its own. */

#include <stdlib.h>

#include "system/system.h"

static struct outcome made(const char *wrong)
{
    failing = wrong ? wrong : "";
    return (struct outcome){0, wrong ? CANNOT_RENEW : DONE};
}

static struct outcome load(struct fmu *fmu)
{
    const char *wrong = fmu_load(fmu);
    return made(wrong ? wrong : fmu_instantiate(fmu));
}

static struct outcome renew(struct fmu *fmu)
{
    fmu_free(fmu);
    return made(fmu_instantiate(fmu));
}

static void forget_step(struct component *c)
{
    if (c->kept_state)
        c->fmu.saving.release(c->fmu.instance, &c->kept_state);
    c->kept_state = NULL;
}

static void forget_all(struct component *c)
{
    forget_step(c);
    forget_state(&c->fmu);
}

/* Look up what the simulations of a plan call. */
static void take_plan(struct component *c)
{
    forget_step(c);
    c->fmu.is_repeated = c->is_iterated;
    if (c->fmu.is_model_exchange)
        prepare_solver(&c->fmu, &c->plan);
    else
        find_step_functions(&c->fmu);
    if (c->is_iterated && !find_saving(&c->fmu))
        give_up("it declares that its state can be restored, but the library does not export all functions for "
                "that: fmi%dGet, Set and FreeFMU%state", c->fmu.major, c->fmu.major == 3 ? "S" : "s");
    free(c->kept_solver);
    c->kept_solver = NULL;
}

/* Set all inputs in initialisation mode. */
static struct outcome set_first(struct component *c)
{
    const struct ports *plain = &c->plan.inputs.ports, *held = &c->plan.held.ports;
    unsigned status = write_row(&c->fmu, plain, c->in);
    if (status <= 1)
        status = write_row(&c->fmu, held, c->in + plain->count);
    return checked(status, SETTING);
}

static struct outcome leave(struct component *c)
{
    struct event_info_1 first_events = {0};
    struct outcome o = leave_initialisation(&c->fmu, &c->plan, &first_events);
    if (o.where != DONE)
        return o;
    return c->fmu.is_model_exchange ? begin_solving(&c->fmu, &first_events) : begin_steps(&c->fmu);
}

/* Give a component its inputs and do its step. */
static struct outcome step(struct component *c)
{
    struct exchange *x = c->exchange;
    x->ends = 0;
    if (c->fmu.is_model_exchange)
        return solve_step(&c->fmu, x->start, x->end, x->jumps, c->system->progress, &x->ends);
    const struct ports *plain = &c->plan.inputs.ports, *held = &c->plan.held.ports;
    struct outcome o = checked(write_row(&c->fmu, plain, c->in), SETTING);
    if (o.where == DONE && x->jumps) {
        for (size_t j = 0; j < held->count; j++)
            put(&held->places[j], c->in[plain->count + j]);
        o = change_at_event(&c->fmu, held);
    }
    return o.where == DONE ? do_step(&c->fmu, x->start, x->end, &x->ends) : o;
}

static struct outcome keep(struct component *c)
{
    if (c->fmu.is_model_exchange)
        c->kept_solver = keep_solver(&c->fmu, c->kept_solver);
    return checked(c->fmu.saving.get(c->fmu.instance, &c->kept_state), RESTORING);
}

static struct outcome bring_back(struct component *c)
{
    if (c->fmu.is_model_exchange)
        bring_back_solver(&c->fmu, c->kept_solver);
    return checked(c->fmu.saving.set(c->fmu.instance, c->kept_state), RESTORING);
}

static struct outcome read(struct component *c, const struct ports *ports)
{
    return checked(read_values(&c->fmu, ports, c->out, 1), GETTING);
}

static struct outcome accepted(int worked)
{
    return (struct outcome){0, worked ? DONE : RESTORING};
}

/* Do in this process what the master asks of a component. */
struct outcome carry_out(struct component *c)
{
    switch (c->exchange->task) {
    case LOAD_LIBRARY: return load(&c->fmu);
    case TAKE_PLAN: take_plan(c); break;
    case ENTER: return enter_initialisation(&c->fmu, &c->plan);
    case SET_FIRST: return set_first(c);
    case LEAVE: return leave(c);
    case STEP: return step(c);
    case KEEP: return keep(c);
    case BRING_BACK: return bring_back(c);
    case READ_SIGNALS: return read(c, &c->connected);
    case READ_OTHERS: return read(c, &c->plan.outputs);
    case END: terminate(&c->fmu); break;
    case RESET_INSTANCE: return accepted(reset(&c->fmu));
    case TAKE_STATE: return accepted(take_state(&c->fmu));
    case RESTORE_STATE: return accepted(restore_state(&c->fmu));
    case FORGET_STATES: forget_all(c); break;
    case NEW_INSTANCE: return renew(&c->fmu);
    case UNLOAD:
        fmu_free(&c->fmu);
        fmu_unload(&c->fmu);
        break;
    }
    return done;
}

struct outcome ask(struct component *c, enum task task)
{
    c->exchange->task = task;
    return c->process ? ask_process(c) : carry_out(c);
}
