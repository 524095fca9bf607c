/* Common to both FMI versions: an instance, its phases, checked access to variables. */
#ifndef INSTANCE_H
#define INSTANCE_H

#include "model.h"

#if defined _WIN32
#define FMI_EXPORT __declspec(dllexport)
#else
#define FMI_EXPORT __attribute__((visibility("default")))
#endif

typedef enum { PHASE_CREATED, PHASE_INITIALIZING, PHASE_EVENT, PHASE_CONTINUOUS, PHASE_STEPPING, PHASE_ENDED } Phase;
typedef enum { RESULT_OK = 0, RESULT_WARNING = 1, RESULT_DISCARD = 2, RESULT_ERROR = 3, RESULT_FATAL = 4 } Result;

typedef struct {
    Simulation simulation;
    Line lines[MODEL_LINES + !MODEL_LINES];
    Phase phase;
    int cosimulation;
    double start_time;
} State; /* everything that get/set FMU state saves */

typedef struct {
    State state;
    void *environment;
    void (*log)(void *environment, const char *name, int status, const char *message);
    const void *callbacks; /* FMI 2: the callback functions of the environment */
    const char *name;
    int told;       /* the message about a step longer than a delay has been logged */
    Model *preview; /* during initialization: a copy with the initial system solved */
} Instance;

Instance *instance_new(const char *name, const char *guid, int cosimulation);
void instance_free(Instance *c);
void instance_reset(Instance *c);
Result instance_error(Instance *c, const char *message);
Result instance_result(Instance *c);
Result instance_end_initialization(Instance *c);

Result instance_get_reals(Instance *c, const unsigned *vr, size_t n, double *values);
Result instance_set_reals(Instance *c, const unsigned *vr, size_t n, const double *values);
Result instance_get_int(Instance *c, unsigned vr, int *value);
Result instance_set_int(Instance *c, unsigned vr, int value);

Result instance_save(Instance *c, void **state);
Result instance_restore(Instance *c, const void *state);
Result instance_serialize(Instance *c, const void *state, void *bytes, size_t size);
Result instance_deserialize(Instance *c, const void *bytes, size_t size, void **state);

Result instance_set_time(Instance *c, double time);
Result instance_set_states(Instance *c, const double *x, size_t n);
Result instance_get_states(Instance *c, double *x, size_t n);
Result instance_get_derivatives(Instance *c, double *dx, size_t n);
Result instance_get_indicators(Instance *c, double *z, size_t n);
Result instance_get_nominals(Instance *c, double *x, size_t n);
Result instance_update(Instance *c, int *states_changed, int *next_defined, double *next_time);
Result instance_step_completed(Instance *c, int *enter_event_mode);
Result instance_step(Instance *c, double start, double size);

#endif
