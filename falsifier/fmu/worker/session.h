/* What is simulated again and again, and how the next simulation starts. */

#ifndef SESSION_H
#define SESSION_H

#include "worker.h"

/* How a simulation starts, the cheapest first: with the same instance after a reset or from its saved state, with
 * a new instance, with the library loaded again, or in a new process. As REUSES in order.py. */
enum reuse { BY_RESET, BY_STATE, BY_INSTANCE, BY_LIBRARY, BY_PROCESS, UNKNOWN };

/* One FMU or a system of several: what a session asks of it. Functions that fail return what went wrong, or end
 * the request. */
struct subject {
    void *self;
    int saves_state; /* it declares that */
    const char *(*load)(void *self);
    const char *(*renew)(void *self); /* replaces its instances */
    void (*unload)(void *self);       /* frees them and unloads the libraries */
    void (*prepare)(void *self, struct request request);
    struct outcome (*simulate)(void *self, struct progress *progress);
    int (*reset)(void *self);
    int (*take_state)(void *self);
    int (*restore_state)(void *self);
    void (*forget_state)(void *self);
    size_t (*memory_elsewhere)(void *self); /* in KiB, of other processes; NULL: there are none */
    double **recorded; /* where the simulations write their outputs, and how many numbers */
    size_t recorded_count;
    double *header;    /* of the shared memory */
    double stop_time;
};

/* session.c */
void start_session(struct subject *subject, enum reuse reuse, unsigned untrusted);
void prepare_session(struct request request);
struct outcome simulate_again(double limit, unsigned shares, double *reached);
int awaits_test(void);  /* whether find_reuse must be called next */
void find_reuse(void (*announce)(const char *way));
const char *way_to_start(void);
int is_spent(void);     /* whether the process should be replaced */

/* one_fmu.c */
void read_one_fmu(struct request *request, struct subject *subject);

/* one_system.c */
void read_one_system(struct request *request, struct subject *subject);

#endif
