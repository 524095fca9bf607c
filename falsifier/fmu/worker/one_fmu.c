/* One FMU, simulated on its own. */

#include "session.h"

static struct fmu fmu;
static struct plan plan;
static struct subject *subject;

static const char *load(void *self)
{
    const char *wrong = fmu_load(self);
    return wrong ? wrong : fmu_instantiate(self);
}

static const char *renew(void *self)
{
    fmu_free(self);
    return fmu_instantiate(self);
}

static void prepare(void *self, struct request request)
{
    read_plan(&request, self, &plan);
    if (fmu.is_model_exchange)
        prepare_solver(self, &plan);
    subject->recorded = &plan.recorded;
    subject->recorded_count = plan.outputs.count * plan.samples;
    subject->header = plan.header;
    subject->stop_time = plan.stop_time;
}

static void rewind_inputs(struct inputs *inputs)
{
    for (size_t j = 0; j < inputs->ports.count; j++) {
        inputs->current[j] = 0;
        inputs->values[j] = 0.0;
    }
}

static struct outcome simulate(void *self, struct progress *progress)
{
    struct event_info_1 first_events = {0};
    rewind_inputs(&plan.inputs);
    rewind_inputs(&plan.held);
    struct outcome o = initialise(self, &plan, &first_events);
    if (o.where != DONE)
        return o;
    failing = "";
    o = fmu.is_model_exchange ? solve(self, &first_events, progress) : co_simulate(self, &plan, progress);
    if (o.where == DONE)
        terminate(self);
    return o;
}

static void unload(void *self)
{
    fmu_free(self);
    fmu_unload(self);
}

static int reset_it(void *self)
{
    return reset(self);
}

static int take(void *self)
{
    return take_state(self);
}

static int restore(void *self)
{
    return restore_state(self);
}

static void forget(void *self)
{
    forget_state(self);
}

void read_one_fmu(struct request *request, struct subject *made)
{
    read_fmu(request, &fmu);
    subject = made;
    *made = (struct subject){
        .self = &fmu,
        .saves_state = fmu.saves_state,
        .load = load,
        .renew = renew,
        .unload = unload,
        .prepare = prepare,
        .simulate = simulate,
        .reset = reset_it,
        .take_state = take,
        .restore_state = restore,
        .forget_state = forget,
    };
}
