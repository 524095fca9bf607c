/* What is simulated again and again, and how the next simulation starts. */

#ifndef SESSION_H
#define SESSION_H

#include "worker.h"

/* How a simulation starts, the cheapest first: with the same instance after a reset or from its saved state, with
 * a new instance, with the library loaded again, or in a new process. As REUSES in worker.py. */
enum reuse { BY_RESET, BY_STATE, BY_INSTANCE, BY_LIBRARY, BY_PROCESS, UNKNOWN };

void start_session(struct request *request);
void prepare_session(struct request request);
struct outcome simulate_again(double limit, unsigned shares, double *reached);
int awaits_test(void);  /* whether find_reuse must be called next */
void find_reuse(void (*announce)(const char *way));
const char *way_to_start(void);
int is_spent(void);     /* whether the process should be replaced */

#endif
