/* A component with a process of its own, for libraries that cannot live in one process.
 *
 * The process is forked from that of the master before any library is loaded. Both share the component's
 * exchange: the master writes a question and counts up the questions, the other process answers and counts up
 * the answers. Both wait awake for a short time and sleep then. If the process ends by itself, that of the
 * master ends in the same way: whoever waits for it then knows how, and which component ran. */

#define _DEFAULT_SOURCE
#define _DARWIN_C_SOURCE

#include <sched.h>
#include <setjmp.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "platform/platform.h"
#include "platform/sandbox.h"
#include "system/system.h"

/* Pages that nobody writes to take no memory. */
#define SHARED_BYTES ((size_t)64 << 20)
/* How often to look before sleeping, and how often between two moments in which others may have the processor;
 * some 0.1 ms if nobody else wants it. */
#define LOOKS 40000
#define LOOKS_PER_YIELD 200
/* Lengths of a sleep in ns. They grow, so that an idle process uses less than 1 % of a processor; an answer is
 * noticed late by some 3 % of the time that it took. */
#define FIRST_NAP 50000
#define LONGEST_NAP 2000000

struct process {
    _Atomic uint64_t asked, answered;
    pid_t parent;
    size_t plan_bytes; /* of a request behind this structure */
    struct exchange exchange;
    double numbers[];
};

/* The part of the memory that is not the structure, in bytes. */
#define ROOM_BYTES (SHARED_BYTES - sizeof(struct process))

static void nap(long nanoseconds)
{
    nanosleep(&(struct timespec){0, nanoseconds}, NULL);
}

/* Wait until a counter reaches a number; return 0 if the process that counts has ended: that of a component, then
 * with its status, or its parent. */
static int await(struct component *c, _Atomic uint64_t *counter, uint64_t number, int *status)
{
    pid_t parent = c->process->parent;
    for (int k = 0; k < LOOKS; k++) {
        if (atomic_load_explicit(counter, memory_order_acquire) == number)
            return 1;
        if (k % LOOKS_PER_YIELD == 0)
            sched_yield();
    }
    for (long length = FIRST_NAP; atomic_load_explicit(counter, memory_order_acquire) != number;) {
        nap(length);
        length = length + length / 32 < LONGEST_NAP ? length + length / 32 : LONGEST_NAP;
        if (c->id ? waitpid((pid_t)c->id, status, WNOHANG) != 0 : getppid() != parent)
            return atomic_load_explicit(counter, memory_order_acquire) == number;
    }
    return 1;
}

static uint64_t count_up(_Atomic uint64_t *counter)
{
    uint64_t number = atomic_load_explicit(counter, memory_order_relaxed) + 1;
    atomic_store_explicit(counter, number, memory_order_release);
    return number;
}

/* In the process of a component: take its own part of the plan that the master has left in the memory. */
static void receive_plan(struct component *c)
{
    static double nothing;
    struct process *p = c->process;
    char *copy = need(p->plan_bytes, 1);
    memcpy(copy, p->numbers, p->plan_bytes);
    struct request r = {copy, copy + p->plan_bytes};
    read_system_plan(&r, c->system, &nothing);
}

static struct outcome answer(struct component *c)
{
    if (c->exchange->task == TAKE_PLAN)
        receive_plan(c);
    return carry_out(c);
}

/* Answer until the master asks to end, or ends itself. */
static void serve(struct component *c)
{
    struct process *p = c->process;
    struct exchange *x = c->exchange;
    while (await(c, &p->asked, atomic_load_explicit(&p->answered, memory_order_relaxed) + 1, NULL)) {
        enum task task = x->task; /* after the answer, that of the next question may be there */
        failing = "";
        if (setjmp(end_of_request))
            x->outcome = (struct outcome){0, IMPOSSIBLE};
        else
            x->outcome = answer(c);
        snprintf(x->text, sizeof x->text, "%s", failing);
        x->memory = most_memory_used();
        count_up(&p->answered);
        if (task == UNLOAD)
            break;
    }
    end_process(0);
}

/* Fork the process of a component, which has nothing of the others and of the master but this memory. */
void start_process(struct component *c)
{
    struct process *p =
        mmap(NULL, SHARED_BYTES, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (p == MAP_FAILED)
        give_up("not enough memory for the processes of the components");
    c->process = p;
    c->exchange = &p->exchange;
    p->parent = getpid();
    c->id = split_process(); /* not in what both share: 0 in the new process */
    if (c->id < 0)
        give_up("components cannot have processes of their own here; use isolation = \"together\"");
    if (c->id)
        return;
    for (size_t k = 0; k < c->system->count; k++) {
        struct component *other = &c->system->components[k];
        if (other != c && other->process) {
            munmap(other->process, SHARED_BYTES);
            other->process = NULL;
        }
    }
    c->system->progress = NULL; /* what it points to, of a simulation of the master, is in memory that has left */
    serve(c);
}

/* Wait for the end of a process that was asked to unload its library. */
void end_process_of(struct component *c)
{
    waitpid((pid_t)c->id, NULL, 0);
    munmap(c->process, SHARED_BYTES);
    c->process = NULL;
}

/* Ask the process of a component; if it has ended, end in the same way. */
struct outcome ask_process(struct component *c)
{
    struct process *p = c->process;
    int status = 0;
    if (!await(c, &p->answered, count_up(&p->asked), &status))
        end_like(status);
    struct exchange *x = c->exchange;
    x->text[sizeof x->text - 1] = '\0'; /* the FMU may have written there */
    failing = x->text;
    if (x->outcome.where == IMPOSSIBLE)
        give_up("%s", failing);
    return x->outcome;
}

/* Send a plan to the process of a component. */
void send_plan(struct component *c, const struct request *r)
{
    struct process *p = c->process;
    p->plan_bytes = (size_t)(r->end - r->at);
    if (p->plan_bytes > ROOM_BYTES)
        give_up("the plan of the system is too large for the processes of its components");
    memcpy(p->numbers, r->at, p->plan_bytes);
}

double *shared_numbers(struct component *c, size_t count)
{
    if (count > ROOM_BYTES / sizeof(double))
        give_up("its variables are too many for a process of its own; use isolation = \"together\"");
    return c->process->numbers;
}
