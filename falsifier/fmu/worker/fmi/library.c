/* The FMU's library: loaded, instantiated, its messages passed on. */

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "platform/platform.h"
#include "worker.h"

#define MESSAGE_BYTES 4096

typedef void (*logger)(void *, const char *, unsigned, const char *, const char *, ...);

/* The callbacks of FMI 1 and 2; FMI 1 has four, FMI 2 has the environment too. */
struct callbacks {
    logger log;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, unsigned);
    void *environment;
};

struct callbacks_1 {
    logger log;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, unsigned);
};

struct callbacks_1_model {
    logger log;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
};

typedef void (*log_3)(void *, unsigned, const char *, const char *);
typedef void *(*slave_1)(const char *, const char *, const char *, const char *, double, char, char,
                         struct callbacks_1, char);
typedef void *(*model_1)(const char *, const char *, struct callbacks_1_model, char);
typedef void *(*instance_2)(const char *, int, const char *, const char *, const struct callbacks *, int, int);
typedef void *(*slave_3)(const char *, const char *, const char *, uint8_t, uint8_t, uint8_t, uint8_t,
                         const uint32_t *, size_t, void *, log_3, void *);
typedef void *(*model_3)(const char *, const char *, const char *, uint8_t, uint8_t, void *, log_3);
typedef void (*release_instance)(void *);

static void log_formatted(
    void *environment, const char *name, unsigned status, const char *category, const char *format, ...)
{
    char text[MESSAGE_BYTES];
    va_list arguments;
    (void)environment, (void)name, (void)category;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format ? format : "", arguments);
    va_end(arguments);
    say(status, text);
}

static void log_plain(void *environment, unsigned status, const char *category, const char *text)
{
    (void)environment, (void)category;
    say(status, text ? text : "");
}

static const struct callbacks callbacks = {log_formatted, calloc, free, NULL, NULL};

void *fmu_function(const struct fmu *fmu, const char *name)
{
    char symbol[1024];
    /* FMI 1 prefixes exported functions with the model identifier. */
    if (fmu->major == 1)
        snprintf(symbol, sizeof symbol, "%s_fmi%s", fmu->identifier, name);
    else
        snprintf(symbol, sizeof symbol, "fmi%d%s", fmu->major, name);
    return find_symbol(fmu->module, symbol);
}

void *fmu_required(const struct fmu *fmu, const char *name)
{
    void *found = fmu_function(fmu, name);
    if (!found) {
        if (fmu->major == 1)
            give_up("the library does not export %s_fmi%s", fmu->identifier, name);
        give_up("the library does not export fmi%d%s", fmu->major, name);
    }
    return found;
}

const char *fmu_load(struct fmu *fmu)
{
    static char text[MESSAGE_BYTES];
    const char *wrong = NULL;
    fmu->module = load_library(fmu->library, &wrong);
    if (!fmu->module)
        snprintf(text, sizeof text, "the library cannot be loaded: %s", wrong);
    return fmu->module ? NULL : text;
}

static void *instantiate_1(const struct fmu *fmu)
{
    char logging = (char)fmu->logging;
    if (fmu->is_model_exchange) {
        struct callbacks_1_model c = {log_formatted, calloc, free};
        return ((model_1)fmu_required(fmu, "InstantiateModel"))(fmu->name, fmu->token, c, logging);
    }
    struct callbacks_1 c = {log_formatted, calloc, free, NULL};
    slave_1 f = (slave_1)fmu_required(fmu, "InstantiateSlave");
    return f(fmu->name, fmu->token, fmu->resources, "application/x-fmu-sharedlibrary", 0.0, 0, 0, c, logging);
}

static void *instantiate_3(const struct fmu *fmu)
{
    uint8_t logging = (uint8_t)fmu->logging, events = (uint8_t)fmu->event_mode;
    if (fmu->is_model_exchange) {
        model_3 f = (model_3)fmu_required(fmu, "InstantiateModelExchange");
        return f(fmu->name, fmu->token, fmu->resources, 0, logging, NULL, log_plain);
    }
    slave_3 f = (slave_3)fmu_required(fmu, "InstantiateCoSimulation");
    return f(fmu->name, fmu->token, fmu->resources, 0, logging, events, events, NULL, 0, NULL, log_plain, NULL);
}

const char *fmu_instantiate(struct fmu *fmu)
{
    if (fmu->major == 1) {
        fmu->instance = instantiate_1(fmu);
    } else if (fmu->major == 2) {
        instance_2 f = (instance_2)fmu_required(fmu, "Instantiate");
        fmu->instance = f(fmu->name, !fmu->is_model_exchange, fmu->token, fmu->resources, &callbacks, 0,
                          fmu->logging);
    } else {
        fmu->instance = instantiate_3(fmu);
    }
    /* Some FMUs change the working folder. */
    return_to_folder();
    return fmu->instance ? NULL : "instantiating the FMU failed";
}

void fmu_unload(struct fmu *fmu)
{
    unload_library(fmu->module);
    fmu->module = NULL;
}

void fmu_free(struct fmu *fmu)
{
    const char *name = "FreeInstance";
    if (fmu->major == 1)
        name = fmu->is_model_exchange ? "FreeModelInstance" : "FreeSlaveInstance";
    if (fmu->instance)
        ((release_instance)fmu_required(fmu, name))(fmu->instance);
    fmu->instance = NULL;
}
