/* FMI 2.0: model exchange and co-simulation. Types as defined in the standard. */
#include "instance.h"

#ifdef FMI2_FUNCTION_PREFIX
#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define F(name) JOIN(FMI2_FUNCTION_PREFIX, name)
#else
#define F(name) name
#endif
#define API(type) FMI_EXPORT type

typedef unsigned fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean, fmi2Status;
typedef const char *fmi2String;
typedef char fmi2Byte;
typedef struct {
    void (*logger)(void *, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(void *, fmi2Status);
    void *componentEnvironment;
} fmi2CallbackFunctions;
typedef struct {
    fmi2Boolean newDiscreteStatesNeeded, terminateSimulation, nominalsOfContinuousStatesChanged;
    fmi2Boolean valuesOfContinuousStatesChanged, nextEventTimeDefined;
    fmi2Real nextEventTime;
} fmi2EventInfo;

static void log_message(void *environment, const char *name, int status, const char *message) {
    Instance *c = environment;
    const fmi2CallbackFunctions *f = c->callbacks;
    if (f && f->logger) f->logger(f->componentEnvironment, name, status, "logStatusError", "%s", message);
}

API(const char *) F(fmi2GetTypesPlatform)(void) { return "default"; }
API(const char *) F(fmi2GetVersion)(void) { return "2.0"; }
API(fmi2Status) F(fmi2SetDebugLogging)(void *c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    (void)c, (void)on, (void)n, (void)categories;
    return RESULT_OK;
}

API(void *) F(fmi2Instantiate)(fmi2String name, int type, fmi2String guid, fmi2String resources,
                               const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)resources, (void)visible, (void)logging;
    Instance *c = instance_new(name, guid, type == 1);
    if (!c) {
        if (functions && functions->logger)
            functions->logger(functions->componentEnvironment, name, RESULT_ERROR, "logStatusError", "%s",
                              "the GUID does not match this FMU, or memory allocation failed");
        return NULL;
    }
    c->callbacks = functions;
    c->environment = c;
    c->log = log_message;
    return c;
}
API(void) F(fmi2FreeInstance)(void *c) { instance_free(c); }

API(fmi2Status) F(fmi2SetupExperiment)(void *p, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                                       fmi2Boolean stop_defined, fmi2Real stop) {
    (void)stop_defined, (void)stop;
    Instance *c = p;
    if (c->state.phase != PHASE_CREATED) return instance_error(c, "fmi2SetupExperiment: already initialized; call fmi2Reset first");
    c->state.start_time = start;
    c->state.simulation.now.time = start;
    if (tolerance_defined && tolerance > 0) c->state.simulation.now.tolerance = tolerance;
    return RESULT_OK;
}
API(fmi2Status) F(fmi2EnterInitializationMode)(void *p) {
    Instance *c = p;
    if (c->state.phase != PHASE_CREATED) return instance_error(c, "fmi2EnterInitializationMode: already initialized; call fmi2Reset first");
    c->state.phase = PHASE_INITIALIZING;
    return RESULT_OK;
}
API(fmi2Status) F(fmi2ExitInitializationMode)(void *p) {
    Instance *c = p;
    if (c->state.phase != PHASE_INITIALIZING) return instance_error(c, "fmi2ExitInitializationMode: not in initialization mode");
    return (fmi2Status)instance_end_initialization(c);
}
API(fmi2Status) F(fmi2Terminate)(void *p) {
    ((Instance *)p)->state.phase = PHASE_ENDED;
    return RESULT_OK;
}
API(fmi2Status) F(fmi2Reset)(void *p) {
    instance_reset(p);
    return RESULT_OK;
}

API(fmi2Status) F(fmi2GetReal)(void *c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    return (fmi2Status)instance_get_reals(c, vr, n, value);
}
API(fmi2Status) F(fmi2SetReal)(void *c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    return (fmi2Status)instance_set_reals(c, vr, n, value);
}
API(fmi2Status) F(fmi2GetInteger)(void *c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]) {
    Result result = RESULT_OK;
    for (size_t k = 0; k < n && result == RESULT_OK; k++) result = instance_get_int(c, vr[k], &value[k]);
    return (fmi2Status)result;
}
API(fmi2Status) F(fmi2SetInteger)(void *c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]) {
    Result result = RESULT_OK;
    for (size_t k = 0; k < n && result == RESULT_OK; k++) result = instance_set_int(c, vr[k], value[k]);
    return (fmi2Status)result;
}
API(fmi2Status) F(fmi2GetBoolean)(void *c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]) {
    return F(fmi2GetInteger)(c, vr, n, value);
}
API(fmi2Status) F(fmi2SetBoolean)(void *c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]) {
    Result result = RESULT_OK;
    for (size_t k = 0; k < n && result == RESULT_OK; k++) result = instance_set_int(c, vr[k], value[k] != 0);
    return (fmi2Status)result;
}
API(fmi2Status) F(fmi2GetString)(void *c, const fmi2ValueReference vr[], size_t n, fmi2String value[]) {
    (void)vr, (void)value;
    return n ? (fmi2Status)instance_error(c, "this FMU has no String variables") : RESULT_OK;
}
API(fmi2Status) F(fmi2SetString)(void *c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]) {
    (void)vr, (void)value;
    return n ? (fmi2Status)instance_error(c, "this FMU has no String variables") : RESULT_OK;
}

API(fmi2Status) F(fmi2GetFMUstate)(void *c, void **state) { return (fmi2Status)instance_save(c, state); }
API(fmi2Status) F(fmi2SetFMUstate)(void *c, void *state) { return (fmi2Status)instance_restore(c, state); }
API(fmi2Status) F(fmi2FreeFMUstate)(void *c, void **state) {
    (void)c;
    free(*state);
    *state = NULL;
    return RESULT_OK;
}
API(fmi2Status) F(fmi2SerializedFMUstateSize)(void *c, void *state, size_t *size) {
    (void)c, (void)state;
    *size = sizeof(State);
    return RESULT_OK;
}
API(fmi2Status) F(fmi2SerializeFMUstate)(void *c, void *state, fmi2Byte bytes[], size_t size) {
    return (fmi2Status)instance_serialize(c, state, bytes, size);
}
API(fmi2Status) F(fmi2DeSerializeFMUstate)(void *c, const fmi2Byte bytes[], size_t size, void **state) {
    return (fmi2Status)instance_deserialize(c, bytes, size, state);
}
API(fmi2Status) F(fmi2GetDirectionalDerivative)(void *c, const fmi2ValueReference u[], size_t nu, const fmi2ValueReference k[],
                                                size_t nk, const fmi2Real dk[], fmi2Real du[]) {
    (void)u, (void)nu, (void)k, (void)nk, (void)dk, (void)du;
    return instance_error(c, "directional derivatives are not provided");
}

/* ---- model exchange ---- */
API(fmi2Status) F(fmi2EnterEventMode)(void *p) {
    ((Instance *)p)->state.phase = PHASE_EVENT;
    return RESULT_OK;
}
API(fmi2Status) F(fmi2NewDiscreteStates)(void *p, fmi2EventInfo *info) {
    memset(info, 0, sizeof *info);
    return (fmi2Status)instance_update(p, &info->valuesOfContinuousStatesChanged, &info->nextEventTimeDefined, &info->nextEventTime);
}
API(fmi2Status) F(fmi2EnterContinuousTimeMode)(void *p) {
    ((Instance *)p)->state.phase = PHASE_CONTINUOUS;
    return RESULT_OK;
}
API(fmi2Status) F(fmi2CompletedIntegratorStep)(void *p, fmi2Boolean keep, fmi2Boolean *enter, fmi2Boolean *terminate) {
    (void)keep;
    *terminate = 0;
    return (fmi2Status)instance_step_completed(p, enter);
}
API(fmi2Status) F(fmi2SetTime)(void *c, fmi2Real time) { return (fmi2Status)instance_set_time(c, time); }
API(fmi2Status) F(fmi2SetContinuousStates)(void *c, const fmi2Real x[], size_t n) { return (fmi2Status)instance_set_states(c, x, n); }
API(fmi2Status) F(fmi2GetDerivatives)(void *c, fmi2Real dx[], size_t n) { return (fmi2Status)instance_get_derivatives(c, dx, n); }
API(fmi2Status) F(fmi2GetEventIndicators)(void *c, fmi2Real z[], size_t n) { return (fmi2Status)instance_get_indicators(c, z, n); }
API(fmi2Status) F(fmi2GetContinuousStates)(void *c, fmi2Real x[], size_t n) { return (fmi2Status)instance_get_states(c, x, n); }
API(fmi2Status) F(fmi2GetNominalsOfContinuousStates)(void *c, fmi2Real x[], size_t n) { return (fmi2Status)instance_get_nominals(c, x, n); }

/* ---- co-simulation ---- */
API(fmi2Status) F(fmi2SetRealInputDerivatives)(void *c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[], const fmi2Real value[]) {
    (void)vr, (void)n, (void)order, (void)value;
    return instance_error(c, "inputs are held during a communication step; input derivatives are not supported");
}
API(fmi2Status) F(fmi2GetRealOutputDerivatives)(void *c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[], fmi2Real value[]) {
    (void)vr, (void)n, (void)order, (void)value;
    return instance_error(c, "output derivatives are not supported");
}
API(fmi2Status) F(fmi2DoStep)(void *p, fmi2Real time, fmi2Real size, fmi2Boolean no_set_state_prior) {
    (void)no_set_state_prior;
    Instance *c = p;
    if (c->state.phase != PHASE_STEPPING) return instance_error(c, "fmi2DoStep: not initialized for co-simulation");
    return (fmi2Status)instance_step(c, time, size);
}
API(fmi2Status) F(fmi2CancelStep)(void *c) { return instance_error(c, "steps are synchronous and cannot be cancelled"); }
API(fmi2Status) F(fmi2GetStatus)(void *c, int kind, fmi2Status *value) {
    (void)c, (void)kind, (void)value;
    return RESULT_DISCARD;
}
API(fmi2Status) F(fmi2GetRealStatus)(void *p, int kind, fmi2Real *value) {
    if (kind != 2) return RESULT_DISCARD; /* fmi2LastSuccessfulTime */
    *value = ((Instance *)p)->state.simulation.now.time;
    return RESULT_OK;
}
API(fmi2Status) F(fmi2GetIntegerStatus)(void *c, int kind, fmi2Integer *value) {
    (void)c, (void)kind, (void)value;
    return RESULT_DISCARD;
}
API(fmi2Status) F(fmi2GetBooleanStatus)(void *c, int kind, fmi2Boolean *value) {
    (void)c, (void)kind, (void)value;
    return RESULT_DISCARD;
}
API(fmi2Status) F(fmi2GetStringStatus)(void *c, int kind, fmi2String *value) {
    (void)c, (void)kind, (void)value;
    return RESULT_DISCARD;
}
