/* A system of FMUs, simulated as one. */

#include "platform.h"
#include "session.h"
#include "system.h"

static struct system fmus;
static struct subject *subject;

/* Processes for the components are started before any library is loaded. */
static const char *load(void *self)
{
    (void)self;
    for (size_t k = 0; k < fmus.count && fmus.is_separate; k++)
        start_process(&fmus.components[k]);
    return ask_each(&fmus, LOAD_LIBRARY).where == DONE ? NULL : failing;
}

static const char *renew(void *self)
{
    return ask_each(self, NEW_INSTANCE).where == DONE ? NULL : failing;
}

static void unload(void *self)
{
    ask_each(self, UNLOAD);
    for (size_t k = 0; k < fmus.count; k++)
        if (fmus.components[k].process)
            end_process_of(&fmus.components[k]);
}

static void prepare(void *self, struct request request)
{
    fmus.header = read_room(&request);
    for (size_t k = 0; k < fmus.count; k++)
        if (fmus.components[k].process)
            send_plan(&fmus.components[k], &request);
    read_system_plan(&request, self, fmus.header + HEADER);
    ask_each(self, TAKE_PLAN);
    subject->recorded = &fmus.recorded;
    subject->recorded_count = fmus.recorded_count;
    subject->header = fmus.header;
    subject->stop_time = fmus.stop_time;
}

static struct outcome simulate(void *self, struct progress *progress)
{
    return simulate_system(self, progress);
}

static int reset_all(void *self)
{
    return all_accept(self, RESET_INSTANCE);
}

static int take(void *self)
{
    if (all_accept(self, TAKE_STATE))
        return 1;
    ask_each(self, FORGET_STATES);
    return 0;
}

static int restore(void *self)
{
    return all_accept(self, RESTORE_STATE);
}

static void forget(void *self)
{
    ask_each(self, FORGET_STATES);
}

/* The processes of the components, in KiB. */
static size_t memory_elsewhere(void *self)
{
    size_t total = 0;
    (void)self;
    for (size_t k = 0; k < fmus.count; k++)
        total += fmus.components[k].exchange->memory;
    return total;
}

void read_one_system(struct request *request, struct subject *made)
{
    /* Which component is loaded is told there, if it can be mapped before the plan is known. */
    fmus.header = map_room("");
    read_components(request, &fmus);
    subject = made;
    *made = (struct subject){
        .self = &fmus,
        .saves_state = fmus.saves_state,
        .load = load,
        .renew = renew,
        .unload = unload,
        .prepare = prepare,
        .simulate = simulate,
        .reset = reset_all,
        .take_state = take,
        .restore_state = restore,
        .forget_state = forget,
        .memory_elsewhere = memory_elsewhere,
    };
}
