/* FMI 3.0: model exchange and co-simulation. Types as defined in the standard. */
#include "instance.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef FMI3_FUNCTION_PREFIX
#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define F(name) JOIN(FMI3_FUNCTION_PREFIX, name)
#else
#define F(name) name
#endif
#define API(name) FMI_EXPORT int F(name)

typedef uint32_t VR;
typedef void (*LogMessage)(void *environment, int status, const char *category, const char *message);

typedef struct {
    LogMessage function;
    void *environment;
} Logger;

static void log_message(void *environment, const char *name, int status, const char *message) {
    Logger *logger = environment;
    (void)name;
    if (logger && logger->function) logger->function(logger->environment, status, "logStatusError", message);
}

static void *instantiate(const char *name, const char *token, int cosimulation, void *environment, LogMessage log) {
    Logger *logger = malloc(sizeof *logger);
    Instance *c = logger ? instance_new(name, token, cosimulation) : NULL;
    if (!c) {
        free(logger);
        if (log) log(environment, RESULT_ERROR, "logStatusError", "the instantiation token does not match this FMU, or memory allocation failed");
        return NULL;
    }
    logger->function = log;
    logger->environment = environment;
    c->environment = logger;
    c->log = log_message;
    return c;
}

FMI_EXPORT const char *F(fmi3GetVersion)(void) { return "3.0"; }
API(fmi3SetDebugLogging)(void *c, bool on, size_t n, const char *const categories[]) {
    (void)c, (void)on, (void)n, (void)categories;
    return RESULT_OK;
}
FMI_EXPORT void *F(fmi3InstantiateModelExchange)(const char *name, const char *token, const char *resources, bool visible,
                                                 bool logging, void *environment, LogMessage log) {
    (void)resources, (void)visible, (void)logging;
    return instantiate(name, token, 0, environment, log);
}
FMI_EXPORT void *F(fmi3InstantiateCoSimulation)(const char *name, const char *token, const char *resources, bool visible,
                                                bool logging, bool event_mode, bool early_return, const VR intermediate[], size_t n,
                                                void *environment, LogMessage log, void *update) {
    (void)resources, (void)visible, (void)logging, (void)early_return, (void)intermediate, (void)n, (void)update;
    if (event_mode) {
        if (log) log(environment, RESULT_ERROR, "logStatusError", "event mode in co-simulation is not supported");
        return NULL;
    }
    return instantiate(name, token, 1, environment, log);
}
FMI_EXPORT void *F(fmi3InstantiateScheduledExecution)(const char *name, const char *token, const char *resources, bool visible,
                                                      bool logging, void *environment, LogMessage log, void *update, void *lock, void *unlock) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)update, (void)lock, (void)unlock;
    if (log) log(environment, RESULT_ERROR, "logStatusError", "scheduled execution is not supported");
    return NULL;
}
FMI_EXPORT void F(fmi3FreeInstance)(void *p) {
    Instance *c = p;
    if (c) free(c->environment);
    instance_free(c);
}

API(fmi3EnterInitializationMode)(void *p, bool tolerance_defined, double tolerance, double start, bool stop_defined, double stop) {
    (void)stop_defined, (void)stop;
    Instance *c = p;
    if (c->state.phase != PHASE_CREATED) return instance_error(c, "fmi3EnterInitializationMode: already initialized; call fmi3Reset first");
    c->state.start_time = start;
    c->state.simulation.now.time = start;
    if (tolerance_defined && tolerance > 0) c->state.simulation.now.tolerance = tolerance;
    c->state.phase = PHASE_INITIALIZING;
    return RESULT_OK;
}
API(fmi3ExitInitializationMode)(void *p) {
    Instance *c = p;
    if (c->state.phase != PHASE_INITIALIZING) return instance_error(c, "fmi3ExitInitializationMode: not in initialization mode");
    return instance_end_initialization(c);
}
API(fmi3EnterEventMode)(void *p) {
    ((Instance *)p)->state.phase = PHASE_EVENT;
    return RESULT_OK;
}
API(fmi3Terminate)(void *p) {
    ((Instance *)p)->state.phase = PHASE_ENDED;
    return RESULT_OK;
}
API(fmi3Reset)(void *p) {
    instance_reset(p);
    return RESULT_OK;
}

/* ---- variables ---- */
API(fmi3GetFloat64)(void *c, const VR vr[], size_t n, double values[], size_t nv) {
    if (nv != n) return instance_error(c, "all variables are scalars: expected as many values as value references");
    return instance_get_reals(c, vr, n, values);
}
API(fmi3SetFloat64)(void *c, const VR vr[], size_t n, const double values[], size_t nv) {
    if (nv != n) return instance_error(c, "all variables are scalars: expected as many values as value references");
    return instance_set_reals(c, vr, n, values);
}
API(fmi3GetInt32)(void *c, const VR vr[], size_t n, int32_t values[], size_t nv) {
    int result = nv == n ? RESULT_OK : (int)instance_error(c, "all variables are scalars: expected as many values as value references");
    for (size_t k = 0; k < n && !result; k++) result = instance_get_int(c, vr[k], &values[k]);
    return result;
}
API(fmi3SetInt32)(void *c, const VR vr[], size_t n, const int32_t values[], size_t nv) {
    int result = nv == n ? RESULT_OK : (int)instance_error(c, "all variables are scalars: expected as many values as value references");
    for (size_t k = 0; k < n && !result; k++) result = instance_set_int(c, vr[k], values[k]);
    return result;
}
API(fmi3GetBoolean)(void *c, const VR vr[], size_t n, bool values[], size_t nv) {
    int result = nv == n ? RESULT_OK : (int)instance_error(c, "all variables are scalars: expected as many values as value references");
    for (size_t k = 0; k < n && !result; k++) {
        int value = 0;
        result = instance_get_int(c, vr[k], &value);
        values[k] = value != 0;
    }
    return result;
}
API(fmi3SetBoolean)(void *c, const VR vr[], size_t n, const bool values[], size_t nv) {
    int result = nv == n ? RESULT_OK : (int)instance_error(c, "all variables are scalars: expected as many values as value references");
    for (size_t k = 0; k < n && !result; k++) result = instance_set_int(c, vr[k], values[k]);
    return result;
}

/* Enumerations */
API(fmi3GetInt64)(void *c, const VR vr[], size_t n, int64_t values[], size_t nv) {
    int result = nv == n ? RESULT_OK : (int)instance_error(c, "all variables are scalars: as many values as value references");
    for (size_t k = 0; k < n && !result; k++) {
        int value = 0;
        result = instance_get_int(c, vr[k], &value);
        values[k] = value;
    }
    return result;
}
API(fmi3SetInt64)(void *c, const VR vr[], size_t n, const int64_t values[], size_t nv) {
    int result = nv == n ? RESULT_OK : (int)instance_error(c, "all variables are scalars: as many values as value references");
    for (size_t k = 0; k < n && !result; k++) result = instance_set_int(c, vr[k], (int)values[k]);
    return result;
}

#define NO_SUCH_TYPE(name, type)                                                                                   \
    API(fmi3Get##name)(void *c, const VR vr[], size_t n, type values[], size_t nv) {                               \
        (void)vr, (void)values, (void)nv;                                                                          \
        return n ? (int)instance_error(c, "this FMU has no variables of type " #name) : RESULT_OK;                 \
    }                                                                                                              \
    API(fmi3Set##name)(void *c, const VR vr[], size_t n, const type values[], size_t nv) {                         \
        (void)vr, (void)values, (void)nv;                                                                          \
        return n ? (int)instance_error(c, "this FMU has no variables of type " #name) : RESULT_OK;                 \
    }
NO_SUCH_TYPE(Float32, float)
NO_SUCH_TYPE(Int8, int8_t)
NO_SUCH_TYPE(UInt8, uint8_t)
NO_SUCH_TYPE(Int16, int16_t)
NO_SUCH_TYPE(UInt16, uint16_t)
NO_SUCH_TYPE(UInt32, uint32_t)
NO_SUCH_TYPE(UInt64, uint64_t)
typedef const char *String;
NO_SUCH_TYPE(String, String)

API(fmi3GetBinary)(void *c, const VR vr[], size_t n, size_t sizes[], const uint8_t *values[], size_t nv) {
    (void)vr, (void)sizes, (void)values, (void)nv;
    return n ? (int)instance_error(c, "this FMU has no variables of type Binary") : RESULT_OK;
}
API(fmi3SetBinary)(void *c, const VR vr[], size_t n, const size_t sizes[], const uint8_t *const values[], size_t nv) {
    (void)vr, (void)sizes, (void)values, (void)nv;
    return n ? (int)instance_error(c, "this FMU has no variables of type Binary") : RESULT_OK;
}
API(fmi3GetClock)(void *c, const VR vr[], size_t n, bool values[]) {
    (void)vr, (void)values;
    return n ? (int)instance_error(c, "this FMU has no clocks") : RESULT_OK;
}
API(fmi3SetClock)(void *c, const VR vr[], size_t n, const bool values[]) {
    (void)vr, (void)values;
    return n ? (int)instance_error(c, "this FMU has no clocks") : RESULT_OK;
}

/* ---- not supported by this FMU ---- */
API(fmi3GetNumberOfVariableDependencies)(void *c, VR vr, size_t *n) {
    (void)vr, (void)n;
    return instance_error(c, "dependencies are not provided per element");
}
API(fmi3GetVariableDependencies)(void *c, VR dependent, size_t ofDependent[], VR independents[], size_t ofIndependents[], int kinds[], size_t n) {
    (void)dependent, (void)ofDependent, (void)independents, (void)ofIndependents, (void)kinds, (void)n;
    return instance_error(c, "dependencies are not provided per element");
}
API(fmi3GetDirectionalDerivative)(void *c, const VR u[], size_t nu, const VR k[], size_t nk, const double seed[], size_t ns, double out[], size_t no) {
    (void)u, (void)nu, (void)k, (void)nk, (void)seed, (void)ns, (void)out, (void)no;
    return instance_error(c, "directional derivatives are not provided");
}
API(fmi3GetAdjointDerivative)(void *c, const VR u[], size_t nu, const VR k[], size_t nk, const double seed[], size_t ns, double out[], size_t no) {
    (void)u, (void)nu, (void)k, (void)nk, (void)seed, (void)ns, (void)out, (void)no;
    return instance_error(c, "adjoint derivatives are not provided");
}
API(fmi3EnterConfigurationMode)(void *c) { return instance_error(c, "this FMU has no structural parameters"); }
API(fmi3ExitConfigurationMode)(void *c) { return instance_error(c, "this FMU has no structural parameters"); }
#define NO_CLOCKS(name, ...)                                                        \
    API(name)(void *c, const VR vr[], size_t n, __VA_ARGS__) {                      \
        (void)vr, (void)n, (void)a, (void)b;                                        \
        return instance_error(c, "this FMU has no clocks");                         \
    }
#define NO_CLOCKS_1(name, ...)                                                      \
    API(name)(void *c, const VR vr[], size_t n, __VA_ARGS__) {                      \
        (void)vr, (void)n, (void)a;                                                 \
        return instance_error(c, "this FMU has no clocks");                         \
    }
NO_CLOCKS(fmi3GetIntervalDecimal, double a[], int b[])
API(fmi3GetIntervalFraction)(void *c, const VR vr[], size_t n, uint64_t counters[], uint64_t resolutions[], int qualifiers[]) {
    (void)vr, (void)n, (void)counters, (void)resolutions, (void)qualifiers;
    return instance_error(c, "this FMU has no clocks");
}
NO_CLOCKS_1(fmi3GetShiftDecimal, double a[])
NO_CLOCKS(fmi3GetShiftFraction, uint64_t a[], uint64_t b[])
NO_CLOCKS_1(fmi3SetIntervalDecimal, const double a[])
NO_CLOCKS(fmi3SetIntervalFraction, const uint64_t a[], const uint64_t b[])
NO_CLOCKS_1(fmi3SetShiftDecimal, const double a[])
NO_CLOCKS(fmi3SetShiftFraction, const uint64_t a[], const uint64_t b[])
API(fmi3ActivateModelPartition)(void *c, VR clock, double time) {
    (void)clock, (void)time;
    return instance_error(c, "this FMU has no clocks");
}
API(fmi3GetOutputDerivatives)(void *c, const VR vr[], size_t n, const int32_t orders[], double values[], size_t nv) {
    (void)vr, (void)n, (void)orders, (void)values, (void)nv;
    return instance_error(c, "output derivatives are not provided");
}

/* ---- FMU state ---- */
API(fmi3GetFMUState)(void *c, void **state) { return instance_save(c, state); }
API(fmi3SetFMUState)(void *c, void *state) { return instance_restore(c, state); }
API(fmi3FreeFMUState)(void *c, void **state) {
    (void)c;
    free(*state);
    *state = NULL;
    return RESULT_OK;
}
API(fmi3SerializedFMUStateSize)(void *c, void *state, size_t *size) {
    (void)c, (void)state;
    *size = sizeof(State);
    return RESULT_OK;
}
API(fmi3SerializeFMUState)(void *c, void *state, uint8_t bytes[], size_t size) { return instance_serialize(c, state, bytes, size); }
API(fmi3DeserializeFMUState)(void *c, const uint8_t bytes[], size_t size, void **state) { return instance_deserialize(c, bytes, size, state); }

/* ---- model exchange ---- */
API(fmi3EvaluateDiscreteStates)(void *c) {
    (void)c;
    return RESULT_OK;
}
API(fmi3UpdateDiscreteStates)(void *c, bool *again, bool *terminate, bool *nominals_changed, bool *states_changed, bool *next_defined, double *next_time) {
    int changed = 0, defined = 0, result = instance_update(c, &changed, &defined, next_time);
    *again = *terminate = *nominals_changed = false;
    *states_changed = changed != 0;
    *next_defined = defined != 0;
    return result;
}
API(fmi3EnterContinuousTimeMode)(void *p) {
    ((Instance *)p)->state.phase = PHASE_CONTINUOUS;
    return RESULT_OK;
}
API(fmi3CompletedIntegratorStep)(void *c, bool keep, bool *enter, bool *terminate) {
    int event = 0, result = instance_step_completed(c, &event);
    (void)keep;
    *enter = event != 0;
    *terminate = false;
    return result;
}
API(fmi3SetTime)(void *c, double time) { return instance_set_time(c, time); }
API(fmi3SetContinuousStates)(void *c, const double x[], size_t n) { return instance_set_states(c, x, n); }
API(fmi3GetContinuousStateDerivatives)(void *c, double dx[], size_t n) { return instance_get_derivatives(c, dx, n); }
API(fmi3GetEventIndicators)(void *c, double z[], size_t n) { return instance_get_indicators(c, z, n); }
API(fmi3GetContinuousStates)(void *c, double x[], size_t n) { return instance_get_states(c, x, n); }
API(fmi3GetNominalsOfContinuousStates)(void *c, double x[], size_t n) { return instance_get_nominals(c, x, n); }
API(fmi3GetNumberOfEventIndicators)(void *c, size_t *n) {
    (void)c;
    *n = MODEL_CROSSINGS;
    return RESULT_OK;
}
API(fmi3GetNumberOfContinuousStates)(void *c, size_t *n) {
    (void)c;
    *n = MODEL_STATES;
    return RESULT_OK;
}

/* ---- co-simulation ---- */
API(fmi3EnterStepMode)(void *c) { return instance_error(c, "event mode in co-simulation is not supported"); }
API(fmi3DoStep)(void *p, double time, double size, bool keep, bool *event_needed, bool *terminate, bool *early, double *last_time) {
    (void)keep;
    Instance *c = p;
    *event_needed = *terminate = *early = false;
    int result = c->state.phase == PHASE_STEPPING ? (int)instance_step(c, time, size)
                                                  : (int)instance_error(c, "fmi3DoStep: not initialized for co-simulation");
    *last_time = c->state.simulation.now.time;
    return result;
}
