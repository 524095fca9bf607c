/* Lower bound for the time of a simulation: a C program that makes the calls of one co-simulation and nothing else.

   fmu_loop LIBRARY VERSION GUID STEPS STEP INPUT OUTPUT...: INPUT and OUTPUT are value references, INPUT is -1 if
   there is none. It simulates once per line on stdin and prints the time in microseconds. The input is a sine,
   sampled beforehand. */

#include <dlfcn.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef void *Component;
typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *finished;
    void *environment;
} Callbacks;

static void *library;

static void *symbol(int version, const char *name) {
    char full[100];
    snprintf(full, sizeof full, "fmi%d%s", version, name);
    void *found = dlsym(library, full);
    if (!found) exit(2);
    return found;
}

static void quiet(void *e, const char *n, int s, const char *c, const char *m, ...) {
    (void)e; (void)n; (void)s; (void)c; (void)m;
}

int main(int count, char **arguments) {
    library = dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) return 2;
    const int version = atoi(arguments[2]);
    const long steps = atol(arguments[4]);
    const double h = atof(arguments[5]);
    const int input = atoi(arguments[6]);
    const size_t outputs = (size_t)(count - 7);
    unsigned int read[16], driven[1] = {(unsigned int)input};
    for (size_t i = 0; i < outputs; i++) read[i] = (unsigned int)atoi(arguments[7 + i]);
    double *u = malloc(sizeof(double) * (size_t)steps), *y = malloc(sizeof(double) * outputs * (size_t)(steps + 1));
    for (long k = 0; k < steps; k++) u[k] = sin(0.001 * (double)k);

    static Callbacks callbacks = {quiet, calloc, free, NULL, NULL};
    Component c;
    if (version == 2) {
        Component (*make)(const char *, int, const char *, const char *, void *, int, int) = symbol(2, "Instantiate");
        c = make("c", 1, arguments[3], "", &callbacks, 0, 0);
    } else {
        Component (*make)(const char *, const char *, const char *, bool, bool, bool, bool, const unsigned int *,
                          size_t, void *, void *, void *) = symbol(3, "InstantiateCoSimulation");
        c = make("c", arguments[3], "", false, false, true, true, NULL, 0, NULL, NULL, NULL);
    }
    int (*reset)(Component) = symbol(version, "Reset"), (*leave)(Component) = symbol(version, "ExitInitializationMode");
    int (*terminate)(Component) = symbol(version, "Terminate");
    const char *set_name = version == 2 ? "SetReal" : "SetFloat64", *get_name = version == 2 ? "GetReal" : "GetFloat64";
    char line[100];
    while (fgets(line, sizeof line, stdin)) {
        struct timespec begin, end;
        int status = 0;
        clock_gettime(CLOCK_MONOTONIC, &begin);
        status |= reset(c);
        if (version == 2) {
            int (*setup)(Component, int, double, double, int, double) = symbol(2, "SetupExperiment");
            int (*enter)(Component) = symbol(2, "EnterInitializationMode");
            int (*set)(Component, const unsigned int *, size_t, const double *) = symbol(2, set_name);
            int (*get)(Component, const unsigned int *, size_t, double *) = symbol(2, get_name);
            int (*step)(Component, double, double, int) = symbol(2, "DoStep");
            status |= setup(c, 0, 0.0, 0.0, 1, (double)steps * h) | enter(c) | leave(c);
            status |= get(c, read, outputs, y);
            for (long k = 0; k < steps; k++) {
                if (input >= 0) status |= set(c, driven, 1, u + k);
                status |= step(c, (double)k * h, h, 1);
                status |= get(c, read, outputs, y + (size_t)(k + 1) * outputs);
            }
        } else {
            int (*enter)(Component, bool, double, double, bool, double) = symbol(3, "EnterInitializationMode");
            int (*set)(Component, const unsigned int *, size_t, const double *, size_t) = symbol(3, set_name);
            int (*get)(Component, const unsigned int *, size_t, double *, size_t) = symbol(3, get_name);
            int (*step)(Component, double, double, bool, bool *, bool *, bool *, double *) = symbol(3, "DoStep");
            bool event, ends, early;
            double reached;
            status |= enter(c, false, 0.0, 0.0, true, (double)steps * h) | leave(c);
            status |= get(c, read, outputs, y, outputs);
            for (long k = 0; k < steps; k++) {
                if (input >= 0) status |= set(c, driven, 1, u + k, 1);
                status |= step(c, (double)k * h, h, true, &event, &ends, &early, &reached);
                status |= get(c, read, outputs, y + (size_t)(k + 1) * outputs, outputs);
            }
        }
        status |= terminate(c);
        clock_gettime(CLOCK_MONOTONIC, &end);
        if (status) return 3;
        printf("%.3f\n", 1e6 * (double)(end.tv_sec - begin.tv_sec) + 1e-3 * (double)(end.tv_nsec - begin.tv_nsec));
        fflush(stdout);
    }
    return 0;
}
