/* Co-simulation: the FMU contains its own solver; it gets inputs and communication steps. */

#include <math.h>

#include "worker.h"

/* Early returns at one time, or rounds of one event iteration, after which the FMU is considered stuck. */
#define MOST_ROUNDS 1000

enum { DISCARD = 2, LAST_SUCCESSFUL_TIME_2 = 2, TERMINATED_2 = 3 };

typedef unsigned (*step_1)(void *, double, double, char);
typedef unsigned (*step_2)(void *, double, double, int);
typedef unsigned (*boolean_status_2)(void *, int, int *);
typedef unsigned (*real_status_2)(void *, int, double *);
typedef unsigned (*step_3)(void *, double, double, uint8_t, uint8_t *, uint8_t *, uint8_t *, double *);

/* Iterate events in FMI 3's event mode until nothing changes any more. */
static struct outcome settle(struct fmu *fmu)
{
    for (int round = 0; round < MOST_ROUNDS; round++) {
        uint8_t again = 0, end = 0, nominals = 0, states = 0, defined = 0;
        double next_time = 0.0;
        struct outcome o = checked(
            fmu->step.update(fmu->instance, &again, &end, &nominals, &states, &defined, &next_time), EVENT);
        if (o.where == DONE && end)
            o.where = TERMINATED;
        if (o.where != DONE || !again)
            return o;
    }
    return (struct outcome){0, STUCK};
}

/* Leave the event mode, in which initialisation ends too, if the FMU has one. */
struct outcome begin_steps(struct fmu *fmu)
{
    if (!fmu->event_mode)
        return done;
    struct outcome o = settle(fmu);
    return o.where == DONE ? checked(fmu->step.enter_step_mode(fmu->instance), EVENT) : o;
}

/* Enter event mode, set inputs if there are any, update the discrete states, return to step mode. */
struct outcome change_at_event(struct fmu *fmu, const struct ports *ports)
{
    struct outcome o = checked(fmu->step.enter_event_mode(fmu->instance), EVENT);
    if (o.where == DONE && ports)
        o = checked(exchange_values(fmu, ports), SETTING);
    return o.where == DONE ? begin_steps(fmu) : o;
}

/* Do one communication step of FMI 3, in several calls if the FMU returns early. */
static struct outcome advance_3(struct fmu *fmu, double start, double end, int *ends)
{
    double time = start;
    int rounds = 0;
    for (;;) {
        uint8_t event = 0, terminate = 0, early = 0;
        double reached = end;
        unsigned status = ((step_3)fmu->step.do_step)(
            fmu->instance, time, end - time, !fmu->is_repeated, &event, &terminate, &early, &reached);
        *ends = 0;
        if (status > 1)
            return (struct outcome){status, STEPPING};
        *ends = terminate != 0;
        double before = time;
        time = early ? reached : end;
        if (event && fmu->event_mode && !*ends) {
            struct outcome o = change_at_event(fmu, NULL);
            if (o.where == TERMINATED) {
                *ends = 1;
                return (struct outcome){o.status, time >= end ? DONE : TERMINATED};
            }
            if (o.where != DONE)
                return o;
            status = o.status;
        }
        /* A remainder smaller than this is a rounding error; FMUs reject steps that short. */
        if (*ends || end - time <= 1e-12 * fmax(1.0, fabs(end)))
            return (struct outcome){status, end - time <= 1e-9 * fmax(1.0, fabs(end)) ? DONE : TERMINATED};
        rounds = time > before ? 0 : rounds + 1;
        if (rounds > MOST_ROUNDS)
            return (struct outcome){0, STUCK};
    }
}

/* What a step of FMI 2 that was discarded means: the FMU may want to end, and may have done the step. */
static struct outcome discarded_2(struct fmu *fmu, double end, int *ends)
{
    boolean_status_2 terminated = (boolean_status_2)fmu_function(fmu, "GetBooleanStatus");
    real_status_2 successful = (real_status_2)fmu_function(fmu, "GetRealStatus");
    double reached = -1.0;
    *ends = terminated && terminated(fmu->instance, TERMINATED_2, ends) <= 1 && *ends;
    if (!*ends)
        return (struct outcome){DISCARD, STEPPING};
    int is_known = successful && successful(fmu->instance, LAST_SUCCESSFUL_TIME_2, &reached) <= 1;
    return (struct outcome){0, is_known && end - reached <= 1e-9 * fmax(1.0, fabs(end)) ? DONE : TERMINATED};
}

/* Do one communication step; ends says whether the FMU ends the simulation. */
struct outcome do_step(struct fmu *fmu, double start, double end, int *ends)
{
    if (fmu->major == 3)
        return advance_3(fmu, start, end, ends);
    *ends = 0;
    unsigned status = fmu->major == 2
                          ? ((step_2)fmu->step.do_step)(fmu->instance, start, end - start, !fmu->is_repeated)
                          : ((step_1)fmu->step.do_step)(fmu->instance, start, end - start, 1);
    return fmu->major == 2 && status == DISCARD ? discarded_2(fmu, end, ends) : checked(status, STEPPING);
}

/* Look up what is called in every step. */
void find_step_functions(struct fmu *fmu)
{
    fmu->step.do_step = fmu_required(fmu, "DoStep");
    if (fmu->event_mode) {
        fmu->step.enter_event_mode = (without_arguments)fmu_required(fmu, "EnterEventMode");
        fmu->step.enter_step_mode = (without_arguments)fmu_required(fmu, "EnterStepMode");
        fmu->step.update = (update_discrete_states_3)fmu_required(fmu, "UpdateDiscreteStates");
    }
}
