/* Linux: Landlock for files and processes, seccomp for system calls that Landlock does not know.
 *
 * Both hold for all that descends from the process, and nothing can take them back. Each is used as far as the kernel
 * has it. Landlock allows by folders, so "all but the hidden ones" is a rule for each of their neighbours; what
 * is made there later is hidden too. It does not stop the loading of libraries, which only map files. */

#define _GNU_SOURCE

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <linux/audit.h>
#include <linux/capability.h>
#include <linux/filter.h>
#include <linux/netlink.h>
#include <linux/sched.h>
#include <linux/seccomp.h>
#include <signal.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "platform/calls_linux.h"
#include "platform/sandbox.h"

/* linux/landlock.h, which many machines do not have. */
enum { CREATE_RULESET = 444, ADD_RULE, RESTRICT_SELF };
enum {
    RUN_FILE = 1 << 0,
    WRITE_FILE = 1 << 1,
    READ_FILE = 1 << 2,
    READ_FOLDER = 1 << 3,
    CHANGE_FOLDER = 0x1ff << 4, /* make and remove entries of all kinds */
    MOVE = 1 << 13,             /* to another folder; from version 2 */
    TRUNCATE = 1 << 14,         /* 3 */
    DEVICE_CALLS = 1 << 15,     /* 5 */
    UNIX_SOCKETS = 1 << 16      /* 9 */
};
enum { ABSTRACT_SOCKETS = 1, SIGNALS = 2, SCOPES_FROM = 6, MOVES_FROM = 2, TRUNCATE_FROM = 3 };
enum { READING = READ_FILE | READ_FOLDER, OF_FILES = RUN_FILE | WRITE_FILE | READ_FILE | TRUNCATE | DEVICE_CALLS };

struct ruleset {
    uint64_t files, network, scopes;
};

struct __attribute__((packed)) rule {
    uint64_t allowed;
    int32_t parent;
};

static const char *const devices[] = {"/dev/null", "/dev/zero", "/dev/full", "/dev/random", "/dev/urandom", NULL};

static void allow(int rules, const char *path, uint64_t what, uint64_t handled)
{
    struct stat found;
    struct rule rule = {what & handled, open(path, O_PATH | O_CLOEXEC | O_NOFOLLOW)};
    if (rule.parent < 0)
        return;
    if (fstat(rule.parent, &found) || !S_ISDIR(found.st_mode))
        rule.allowed &= OF_FILES;
    if (rule.allowed)
        syscall(ADD_RULE, rules, 1, &rule, 0);
    close(rule.parent);
}

/* Allow reading a folder or file, and all below, but for what is hidden. */
static void allow_reading(int rules, char *path, size_t length, const char **hidden, uint64_t handled)
{
    int is_above = 0;
    for (const char **h = hidden; *h; h++)
        if (!strncmp(*h, path, length)) {
            if (!(*h)[length])
                return;
            is_above |= (*h)[length] == '/';
        }
    if (!is_above) {
        allow(rules, length ? path : "/", READING, handled);
        return;
    }
    DIR *folder = opendir(length ? path : "/");
    if (!folder)
        return;
    for (struct dirent *entry; (entry = readdir(folder));) {
        size_t more = strlen(entry->d_name) + 1;
        if (entry->d_type == DT_LNK || !strcmp(entry->d_name, ".") || !strcmp(entry->d_name, ".."))
            continue;
        if (length + more >= PATH_MAX)
            continue;
        path[length] = '/';
        memcpy(path + length + 1, entry->d_name, more);
        allow_reading(rules, path, length + more, hidden, handled);
        path[length] = 0;
    }
    closedir(folder);
}

/* Whether anything hidden is below a folder: what may be changed there may not be read for that. */
static int is_above_hidden(const char *folder, const char **hidden)
{
    const size_t length = strcmp(folder, "/") ? strlen(folder) : 0;
    for (const char **h = hidden; *h; h++)
        if (!strncmp(*h, folder, length) && (*h)[length] == '/')
            return 1;
    return 0;
}

static unsigned enter_landlock(const struct policy *policy)
{
    char path[PATH_MAX] = "";
    const long version = syscall(CREATE_RULESET, NULL, 0, 1);
    if (version < 1)
        return 0;
    struct ruleset all = {RUN_FILE | WRITE_FILE | READING | CHANGE_FOLDER, 0, 0};
    all.files |= version >= MOVES_FROM ? MOVE : 0;
    all.files |= version >= TRUNCATE_FROM ? TRUNCATE : 0;
    all.files |= version >= 5 ? DEVICE_CALLS : 0;
    all.files |= version >= 9 ? UNIX_SOCKETS : 0;
    all.scopes = version >= SCOPES_FROM ? SIGNALS | ABSTRACT_SOCKETS : 0;
    if (policy->programs)
        all.files &= ~(uint64_t)RUN_FILE;
    /* Older kernels know fewer fields. */
    const size_t size = version >= SCOPES_FROM ? sizeof all : sizeof all.files;
    const int rules = (int)syscall(CREATE_RULESET, &all, size, 0);
    if (rules < 0)
        return 0;
    allow_reading(rules, path, 0, policy->hidden, all.files);
    for (const char **p = policy->readable; *p; p++)
        allow(rules, *p, READING, all.files);
    for (const char **p = policy->writable; *p; p++) {
        const uint64_t kept = is_above_hidden(*p, policy->hidden) ? READING : 0;
        allow(rules, *p, all.files & ~(kept | RUN_FILE | DEVICE_CALLS), all.files);
    }
    for (const char *const *d = devices; *d; d++)
        allow(rules, *d, READ_FILE | WRITE_FILE, all.files);
    const int failed = syscall(RESTRICT_SELF, rules, 0) != 0;
    close(rules);
    return failed ? 0 : FILES | (version >= SCOPES_FROM ? PROCESSES : 0);
}

/* Root keeps none of its rights over other users' files and the machine. */
static void drop_capabilities(void)
{
    struct __user_cap_header_struct header = {_LINUX_CAPABILITY_VERSION_3, 0};
    struct __user_cap_data_struct none[2];
    memset(none, 0, sizeof none);
    for (int k = 0; k < 64 && !prctl(PR_CAPBSET_DROP, k, 0, 0, 0); k++)
        continue;
    prctl(47 /* PR_CAP_AMBIENT */, 4 /* CLEAR_ALL */, 0, 0, 0);
    syscall(SYS_capset, &header, none);
}

/* The filter of system calls. */
struct program {
    struct sock_filter steps[1024];
    unsigned short count;
};

static void add(struct program *p, unsigned short code, unsigned char yes, unsigned char no, uint32_t value)
{
    p->steps[p->count++] = (struct sock_filter){code, yes, no, value};
}

static void load(struct program *p, size_t offset)
{
    add(p, BPF_LD | BPF_W | BPF_ABS, 0, 0, (uint32_t)offset);
}

static void finish(struct program *p, uint32_t action)
{
    add(p, BPF_RET | BPF_K, 0, 0, action);
}

/* If the number loaded last is this one, take an action. */
static void on_value(struct program *p, uint32_t value, uint32_t action)
{
    add(p, BPF_JMP | BPF_JEQ | BPF_K, 0, 1, value);
    finish(p, action);
}

static void on_bits(struct program *p, uint32_t bits, uint32_t action)
{
    add(p, BPF_JMP | BPF_JSET | BPF_K, 0, 1, bits);
    finish(p, action);
}

static void load_argument(struct program *p, int k)
{
    load(p, offsetof(struct seccomp_data, args) + 8 * (size_t)k);
}

/* Begin what is done for one system call; it must end with finish. */
static unsigned short begin(struct program *p, uint32_t number)
{
    add(p, BPF_JMP | BPF_JEQ | BPF_K, 0, 0, number);
    return (unsigned short)(p->count - 1);
}

static void end(struct program *p, unsigned short begun)
{
    p->steps[begun].jf = (unsigned char)(p->count - begun - 1);
}

static uint32_t refuse(int error)
{
    return SECCOMP_RET_ERRNO | (uint32_t)error;
}

#define ALLOW SECCOMP_RET_ALLOW

/* A call that names a process or thread: this one, or one that is looked at. */
static void on_process(struct program *p, uint32_t number, int argument, uint32_t others)
{
    const unsigned short begun = begin(p, number);
    load_argument(p, argument);
    on_value(p, 0, ALLOW);
    on_value(p, (uint32_t)getpid(), ALLOW);
    finish(p, others);
    end(p, begun);
}

/* A call that names a process, group or user, which its first argument says. */
static void on_any(struct program *p, uint32_t number, uint32_t process, uint32_t user, uint32_t others)
{
    const unsigned short begun = begin(p, number);
    load_argument(p, 0);
    on_value(p, user, refuse(EPERM));
    load_argument(p, 1);
    on_value(p, 0, ALLOW);
    load_argument(p, 0);
    on_value(p, process, others);
    finish(p, refuse(EPERM));
    end(p, begun);
}

static void on_open(struct program *p, uint32_t number, int argument, uint32_t changing)
{
    const uint32_t changes = O_WRONLY | O_RDWR | O_CREAT;
    const unsigned short begun = begin(p, number);
    load_argument(p, argument);
    on_bits(p, changes, changing);
    on_bits(p, O_TRUNC, refuse(EINVAL)); /* shortens a file that is only read; old Landlocks do not see it */
    finish(p, ALLOW);
    end(p, begun);
}

static void on_sockets(struct program *p, const struct policy *policy)
{
    unsigned short begun = begin(p, SYS_socket);
    load_argument(p, 0);
    if (policy->is_wine)
        on_value(p, AF_UNIX, ALLOW);
    if (policy->network) {
        on_value(p, AF_INET, ALLOW);
        on_value(p, AF_INET6, ALLOW);
        add(p, BPF_JMP | BPF_JEQ | BPF_K, 0, 3, AF_NETLINK);
        load_argument(p, 2);
        on_value(p, NETLINK_ROUTE, ALLOW); /* which addresses this machine has */
    }
    finish(p, refuse(EACCES));
    end(p, begun);
    /* Datagrams could be sent elsewhere. */
    begun = begin(p, SYS_socketpair);
    load_argument(p, 0);
    add(p, BPF_JMP | BPF_JEQ | BPF_K, 1, 0, AF_UNIX);
    finish(p, refuse(EACCES));
    load_argument(p, 1);
    add(p, BPF_ALU | BPF_AND | BPF_K, 0, 0, 0xf);
    on_value(p, SOCK_STREAM, ALLOW);
    on_value(p, SOCK_SEQPACKET, ALLOW);
    finish(p, refuse(EACCES));
    end(p, begun);
}

/* Only those of terminals, which include those of all files, and of sockets: file systems have others that change
 * what is merely open for reading, and make folders. Neither input to terminals, nor who gets signals of a file. */
static void on_device_calls(struct program *p)
{
    static const uint32_t refused[] = {TIOCSTI, TIOCLINUX, FIOSETOWN, SIOCSPGRP};
    const unsigned short begun = begin(p, SYS_ioctl);
    load_argument(p, 1);
    for (size_t k = 0; k < sizeof refused / sizeof *refused; k++)
        on_value(p, refused[k], refuse(EPERM));
    add(p, BPF_ALU | BPF_AND | BPF_K, 0, 0, 0xff00);
    on_value(p, 'T' << 8, ALLOW);
    on_value(p, 0x8900, ALLOW);
    finish(p, refuse(ENOTTY));
    end(p, begun);
}

static void on_starts(struct program *p, uint32_t forking)
{
    const uint32_t spaces = CLONE_NEWNS | CLONE_NEWCGROUP | CLONE_NEWUTS | CLONE_NEWIPC | CLONE_NEWUSER |
                            CLONE_NEWPID | CLONE_NEWNET | 0x80 /* CLONE_NEWTIME */;
    unsigned short begun = begin(p, SYS_clone);
    load_argument(p, 0);
    on_bits(p, spaces & ~0xffu, refuse(EPERM)); /* the lowest byte is a signal */
    finish(p, forking);
    end(p, begun);
    begun = begin(p, SYS_unshare);
    load_argument(p, 0);
    on_bits(p, spaces, refuse(EPERM));
    finish(p, ALLOW);
    end(p, begun);
#ifdef SYS_fork
    on_value(p, SYS_fork, forking);
    on_value(p, SYS_vfork, forking);
#endif
}

/* How a call is decided: refused, or asked for where a guard answers; without one, it is left to Landlock. */
static uint32_t action_of(enum treatment treatment, const struct policy *policy, int has_guard)
{
    const uint32_t ask = SECCOMP_RET_USER_NOTIF;
    switch (treatment) {
    case FORBIDDEN: return refuse(EPERM);
    case UNKNOWN: return refuse(ENOSYS); /* programs use an older call then, which can be looked at */
    case UNSUPPORTED: return refuse(EOPNOTSUPP);
    case LOOKING_INTO: return policy->is_wine ? ALLOW : refuse(EPERM);
    case MAKING:
    case CHANGING: return has_guard ? ask : ALLOW;
    case SETTING: return has_guard ? ask : refuse(EPERM);
    case EXECUTING: return has_guard ? ask : policy->programs ? ALLOW : refuse(EACCES);
    case OPENING: break;
    }
    return ALLOW;
}

static void write_filter(struct program *p, const struct policy *policy, int has_guard)
{
    const uint32_t ask = SECCOMP_RET_USER_NOTIF, ours = has_guard ? ask : refuse(EPERM);
    const uint32_t changing = has_guard ? ask : ALLOW;
    unsigned short begun;
    p->count = 0;
    load(p, offsetof(struct seccomp_data, arch));
    add(p, BPF_JMP | BPF_JEQ | BPF_K, 1, 0, NATIVE);
    finish(p, refuse(ENOSYS));
    load(p, offsetof(struct seccomp_data, nr));
#ifdef __x86_64__
    add(p, BPF_JMP | BPF_JGE | BPF_K, 0, 1, 0x40000000); /* x32 */
    finish(p, refuse(ENOSYS));
#endif
    for (size_t k = 0; k < call_count; k++)
        if (calls[k].treatment != OPENING)
            on_value(p, (uint32_t)calls[k].number, action_of(calls[k].treatment, policy, has_guard));
#ifdef SYS_open
    on_open(p, SYS_open, 1, changing);
#endif
    on_open(p, SYS_openat, 2, changing);
    on_sockets(p, policy);
    on_device_calls(p);
    on_starts(p, changing);
    for (size_t k = 0; k < process_call_count; k++)
        on_process(p, (uint32_t)process_calls[k], 0, ours);
    on_any(p, SYS_setpriority, PRIO_PROCESS, PRIO_USER, ours);
    on_any(p, SYS_ioprio_set, 1, 3, ours);
    /* The owner of a file may get any signal whenever something can be read; Landlock sees it since version 6. A
     * lease lets others wait who open the file. */
    begun = begin(p, SYS_fcntl);
    load_argument(p, 1);
    on_value(p, F_SETOWN, refuse(EPERM));
    on_value(p, F_SETOWN_EX, refuse(EPERM));
    on_value(p, F_SETLEASE, refuse(EPERM));
    finish(p, ALLOW);
    end(p, begun);
    begun = begin(p, SYS_prctl);
    load_argument(p, 0);
    on_value(p, PR_SET_PDEATHSIG, refuse(EPERM));
    on_value(p, PR_SET_DUMPABLE, refuse(EPERM)); /* /proc may hide it from the guard then */
    finish(p, ALLOW);
    end(p, begun);
    finish(p, ALLOW);
}

static unsigned filter_calls(const struct policy *policy, int *listener)
{
    static const unsigned flags[] = {SECCOMP_FILTER_FLAG_SPEC_ALLOW, 0};
    struct program *p = calloc(1, sizeof *p);
    for (int has_guard = 1; p && has_guard >= 0; has_guard--)
        for (int k = 0; k < 2; k++) {
            write_filter(p, policy, has_guard);
            struct sock_fprog filter = {p->count, p->steps};
            const unsigned asking = has_guard ? SECCOMP_FILTER_FLAG_NEW_LISTENER : 0;
            const long done = syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, flags[k] | asking, &filter);
            if (done < 0)
                continue;
            *listener = has_guard ? (int)done : -1;
            free(p);
            return SYSTEM_CALLS | PROCESSES | (has_guard ? REFUSALS : 0);
        }
    free(p);
    return 0;
}

unsigned confine(const struct policy *policy, int *listener)
{
    *listener = -1;
    prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
    const unsigned enforced = enter_landlock(policy);
    drop_capabilities();
    return enforced | filter_calls(policy, listener);
}

void adopt_orphans(void)
{
    prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0);
}

void end_with_parent(pid_t parent)
{
    prctl(PR_SET_PDEATHSIG, SIGKILL, 0, 0, 0);
    if (getppid() != parent) /* it has ended already */
        _exit(1);
}
