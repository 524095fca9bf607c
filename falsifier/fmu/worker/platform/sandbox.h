/* What an FMU may do, and who holds it to that: guard.c, and of each system sandbox_linux.c or sandbox_none.c. */

#ifndef SANDBOX_H
#define SANDBOX_H

#include <stdint.h>
#include <sys/types.h>

/* The lists end with NULL. All paths are absolute and, but for those of hidden, without symbolic links. */
struct policy {
    const char **writable; /* may be changed, with all below; the first is the working folder */
    const char **hidden;   /* may not be read, with all below, except what is readable, or writable itself */
    const char **readable;
    const char **command;  /* the program that the process becomes; none: it stays this one */
    int programs;          /* may execute programs */
    int network;           /* may open connections */
    int is_wine;           /* is Wine, whose processes talk to each other in more ways */
    uint64_t memory;       /* bytes that its processes may use together; 0: no limit */
};

/* What is enforced, as bits. */
enum enforced {
    FILES = 1,        /* files are not changed, hidden ones not read, programs not executed: by the kernel */
    PROCESSES = 2,    /* other processes are neither signalled nor looked into */
    SYSTEM_CALLS = 4, /* no network if that is denied; no namespaces, no settings of other processes */
    REFUSALS = 8      /* what is refused is told; without FILES, that is also what refuses it */
};

/* What the guard tells: one letter, then a path, how many there may be, or nothing. First it tells what is enforced, as one more letter. */
enum told {
    ENFORCED = 'e',
    CHANGE = 'w', /* refused */
    EXECUTE = 'x',
    SIGNAL = 's',
    PROCESS = 'p',
    FORK = 'f',
    REPLACE = 'r', /* causes of its end */
    MEMORY = 'm'
};
void tell(enum told what, const char *path);

/* Hold this process and all that descend from it to a policy, for good; returns bits of enum enforced.
 * *listener becomes a descriptor for answer_call, or -1. */
unsigned confine(const struct policy *policy, int *listener);

/* Answer one system call that waits for it. worker is the process that the guard has started. */
void answer_call(int listener, const struct policy *policy, unsigned enforced, pid_t worker);

/* What descends from this process: its children after its own end, as the system can; and memory in bytes. */
void adopt_orphans(void);
void end_with_parent(pid_t parent);
void kill_children(pid_t worker);
uint64_t memory_used(pid_t worker, unsigned enforced);

/* guard.c: returns in the process that is to run the FMU; the one that has called it watches that process. */
void start_guarded(void);
int read_exactly(int from, void *target, size_t count); /* returns 0 at the end of what is read */
void end_like(int status) __attribute__((noreturn)); /* as a process that has ended with this status */

#endif
