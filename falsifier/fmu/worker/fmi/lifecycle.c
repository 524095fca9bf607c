/* Start, end and reset of a simulation: the calls that FMI 1, 2 and 3 require, in their order.
 *
 * Parameters and start values are set before initialisation, inputs within initialisation mode. */

#include <stdio.h>

#include "worker.h"

typedef unsigned (*only)(void *);
typedef unsigned (*time_1)(void *, double);
typedef unsigned (*initialise_slave_1)(void *, double, char, double);
typedef unsigned (*initialise_1)(void *, char, double, struct event_info_1 *);
typedef unsigned (*setup_2)(void *, int, double, double, int, double);
typedef unsigned (*enter_3)(void *, uint8_t, double, double, uint8_t, double);
typedef unsigned (*string_2)(void *, const uint32_t *, size_t, char *const *);
typedef unsigned (*string_3)(void *, const uint32_t *, size_t, char *const *, size_t);

static struct outcome called(const char *name, unsigned status)
{
    failing = name;
    return checked(status, CALLING);
}

static struct outcome call(struct fmu *fmu, const char *name)
{
    return called(name, ((only)fmu_required(fmu, name))(fmu->instance));
}

static struct outcome set_strings(struct fmu *fmu, const struct plan *plan)
{
    static char position[24];
    for (size_t k = 0; k < plan->strings_count; k++) {
        const struct string *s = &plan->strings[k];
        void *set = fmu_required(fmu, "SetString");
        unsigned status = fmu->major == 3
                              ? ((string_3)set)(fmu->instance, &s->reference, 1, &s->text, 1)
                              : ((string_2)set)(fmu->instance, &s->reference, 1, &s->text);
        if (status > 1) {
            snprintf(position, sizeof position, "%zu", k);
            failing = position;
            return (struct outcome){status, TEXT};
        }
    }
    return done;
}

static void write_fixed(const struct inputs *inputs, const double *parameters)
{
    for (size_t k = 0; k < inputs->fixed_count; k++)
        put(&inputs->fixed[k], parameters[inputs->fixed_rows[k]]);
}

static struct outcome set_parameters(struct fmu *fmu, const struct plan *plan)
{
    struct outcome o = set_strings(fmu, plan);
    write_fixed(&plan->inputs, plan->parameter_values);
    write_fixed(&plan->held, plan->parameter_values);
    if (o.where != DONE || !plan->parameters.count)
        return o;
    unsigned status = write_row(fmu, &plan->parameters, plan->parameter_values);
    failing = "parameters";
    return checked(status, WRITING);
}

/* Set the parameters and enter initialisation mode, which FMI 1 does not have. */
struct outcome enter_initialisation(struct fmu *fmu, struct plan *plan)
{
    struct outcome o = done;
    if (fmu->major == 1 && fmu->is_model_exchange)
        o = called("SetTime", ((time_1)fmu_required(fmu, "SetTime"))(fmu->instance, 0.0));
    if (o.where == DONE)
        o = set_parameters(fmu, plan);
    if (o.where != DONE || fmu->major == 1)
        return o;
    if (fmu->major == 3) {
        enter_3 f = (enter_3)fmu_required(fmu, "EnterInitializationMode");
        return called("EnterInitializationMode",
                      f(fmu->instance, plan->has_tolerance, plan->tolerance, 0.0, 1, plan->stop_time));
    }
    setup_2 f = (setup_2)fmu_required(fmu, "SetupExperiment");
    o = called("SetupExperiment",
               f(fmu->instance, plan->has_tolerance, plan->tolerance, 0.0, 1, plan->stop_time));
    return o.where == DONE ? call(fmu, "EnterInitializationMode") : o;
}

/* End the initialisation after the inputs were set; FMI 1 initialises here. Its model exchange fills first_events. */
struct outcome leave_initialisation(struct fmu *fmu, struct plan *plan, struct event_info_1 *first_events)
{
    if (fmu->major > 1)
        return call(fmu, "ExitInitializationMode");
    if (!fmu->is_model_exchange) {
        initialise_slave_1 f = (initialise_slave_1)fmu_required(fmu, "InitializeSlave");
        return called("InitializeSlave", f(fmu->instance, 0.0, 1, plan->stop_time));
    }
    initialise_1 f = (initialise_1)fmu_required(fmu, "Initialize");
    return called("Initialize", f(fmu->instance, (char)plan->has_tolerance, plan->tolerance, first_events));
}

/* End the simulation; a bad status is ignored, because the trajectory is complete. */
void terminate(struct fmu *fmu)
{
    const char *name = fmu->major == 1 && !fmu->is_model_exchange ? "TerminateSlave" : "Terminate";
    ((only)fmu_required(fmu, name))(fmu->instance);
}

/* Reset the instance; FMI 1 model exchange does not define that. Returns whether it worked. */
int reset(struct fmu *fmu)
{
    if (fmu->major == 1 && fmu->is_model_exchange)
        return 0;
    only f = (only)fmu_function(fmu, fmu->major == 1 ? "ResetSlave" : "Reset");
    return f && f(fmu->instance) <= 1;
}

static void *state_function(const struct fmu *fmu, const char *verb)
{
    char name[32];
    snprintf(name, sizeof name, "%sFMU%state", verb, fmu->major == 3 ? "S" : "s");
    return fmu->major == 1 ? NULL : fmu_function(fmu, name);
}

/* Look up what saves states; returns whether the library has all of it. */
int find_saving(struct fmu *fmu)
{
    struct saving *f = &fmu->saving;
    f->get = (get_state)state_function(fmu, "Get");
    f->set = (set_state)state_function(fmu, "Set");
    f->release = (get_state)state_function(fmu, "Free");
    return f->get && f->set && f->release;
}

/* Save the current state; returns whether it worked. */
int take_state(struct fmu *fmu)
{
    return find_saving(fmu) && fmu->saving.get(fmu->instance, &fmu->state) <= 1 && fmu->state;
}

int restore_state(struct fmu *fmu)
{
    return fmu->state && fmu->saving.set(fmu->instance, fmu->state) <= 1;
}

/* Free the saved state; required before its instance is freed. */
void forget_state(struct fmu *fmu)
{
    if (fmu->state)
        fmu->saving.release(fmu->instance, &fmu->state);
    fmu->state = NULL;
}
