/* Systems other than Linux: nothing is enforced, and only the group of a process is found after it. */

#include <signal.h>

#include "platform/sandbox.h"

unsigned confine(const struct policy *policy, int *listener)
{
    (void)policy;
    *listener = -1;
    return 0;
}

void answer_call(int listener, const struct policy *policy, unsigned enforced, pid_t worker)
{
    (void)listener, (void)policy, (void)enforced, (void)worker;
}

void adopt_orphans(void)
{
}

void end_with_parent(pid_t parent)
{
    (void)parent;
}

void kill_children(pid_t worker)
{
    kill(-worker, SIGKILL);
}

uint64_t memory_used(pid_t worker, unsigned enforced)
{
    (void)worker, (void)enforced;
    return 0;
}
