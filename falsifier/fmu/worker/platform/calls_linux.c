/* Linux: the system calls that are forbidden or asked for, and the guard's answers.
 *
 * An answer may let a call go on, which Landlock then decides about: another thread may have changed meanwhile what
 * the guard has read. So that only serves to tell what is refused. Where the guard itself does what was asked for,
 * it does so with a descriptor that it has checked. */

#define _GNU_SOURCE

#include <asm/unistd.h>
#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

#include "platform/calls_linux.h"
#include "platform/sandbox.h"

#ifndef SECCOMP_USER_NOTIF_FLAG_CONTINUE
#define SECCOMP_USER_NOTIF_FLAG_CONTINUE 1
#endif

/* Of answers, beside numbers of errors and 0, if the guard has done it. */
enum { GO_ON = -1 };
enum { MOST_PROCESSES = 256, MOST_THREADS = 8192, MOST_ANCESTORS = 1000, SMALL = 16 << 20 };

#define KIND(number, treatment) {number, treatment, -1, -1, -1, -1}
#define NO(name) KIND(__NR_##name, FORBIDDEN)
#define LOOK(name) KIND(__NR_##name, LOOKING_INTO)
#define ATTRIBUTE(name) KIND(__NR_##name, UNSUPPORTED)
#define PATH(name, treatment, folder, path) {__NR_##name, treatment, folder, path, -1, -1}
#define PATHS(name, folder, path, folder_2, path_2) {__NR_##name, CHANGING, folder, path, folder_2, path_2}

/* Numbers above 423 are the same for all processors. */
const struct call calls[] = {
    /* the machine */
    NO(mount), NO(umount2), NO(pivot_root), NO(chroot), NO(setns), NO(swapon), NO(swapoff), NO(reboot), NO(acct),
    NO(init_module), NO(finit_module), NO(delete_module), NO(kexec_load), NO(kexec_file_load), NO(settimeofday),
    NO(clock_settime), NO(sethostname), NO(setdomainname), NO(quotactl), NO(syslog), NO(vhangup),
    NO(perf_event_open), NO(fanotify_init), NO(open_by_handle_at), NO(bpf), NO(userfaultfd),
    KIND(428 /* open_tree */, FORBIDDEN), KIND(429 /* move_mount */, FORBIDDEN), KIND(430 /* fsopen */, FORBIDDEN),
    KIND(431 /* fsconfig */, FORBIDDEN), KIND(432 /* fsmount */, FORBIDDEN), KIND(433 /* fspick */, FORBIDDEN),
    KIND(442 /* mount_setattr */, FORBIDDEN), KIND(443 /* quotactl_fd */, FORBIDDEN),
    KIND(467 /* open_tree_attr */, FORBIDDEN),
#ifdef __NR_iopl
    NO(iopl), NO(ioperm),
#endif
    /* what outlives a process: keys, shared objects of System V and POSIX */
    NO(keyctl), NO(add_key), NO(request_key), NO(shmget), NO(shmat), NO(shmctl), NO(msgget), NO(msgsnd), NO(msgrcv),
    NO(msgctl), NO(semget), NO(semop), NO(semtimedop), NO(semctl), NO(mq_open), NO(mq_unlink),
    /* owners of files, places of memory */
    NO(fchown), NO(fchownat), NO(migrate_pages), NO(move_pages),
#ifdef __NR_chown
    NO(chown), NO(lchown),
#endif
    ATTRIBUTE(setxattr), ATTRIBUTE(lsetxattr), ATTRIBUTE(fsetxattr), ATTRIBUTE(removexattr),
    ATTRIBUTE(lremovexattr), ATTRIBUTE(fremovexattr), KIND(463 /* setxattrat */, UNKNOWN),
    KIND(466 /* removexattrat */, UNKNOWN), KIND(469 /* file_setattr */, UNKNOWN),
    LOOK(ptrace), LOOK(process_vm_readv), LOOK(process_vm_writev), LOOK(kcmp),
    KIND(438 /* pidfd_getfd */, LOOKING_INTO), KIND(440 /* process_madvise */, LOOKING_INTO),
    KIND(448 /* process_mrelease */, LOOKING_INTO),
    /* Filters see neither arguments in memory nor those in a queue; memory of no process escapes the limit. All
     * processes of the machine share a number of queues. */
    KIND(435 /* clone3 */, UNKNOWN), KIND(437 /* openat2 */, UNKNOWN), KIND(425 /* io_uring_setup */, UNKNOWN),
    KIND(426 /* io_uring_enter */, UNKNOWN), KIND(427 /* io_uring_register */, UNKNOWN),
    KIND(__NR_io_setup, UNKNOWN),
    KIND(424 /* pidfd_send_signal */, UNKNOWN), KIND(__NR_memfd_create, UNKNOWN),
    KIND(447 /* memfd_secret */, UNKNOWN),
    PATH(openat, OPENING, 0, 1), PATH(unlinkat, CHANGING, 0, 1), PATH(mkdirat, CHANGING, 0, 1),
    PATH(mknodat, MAKING, 0, 1), PATH(symlinkat, CHANGING, 1, 2), PATHS(linkat, 0, 1, 2, 3),
    PATH(truncate, CHANGING, -1, 0), PATHS(renameat2, 0, 1, 2, 3),
    PATH(fchmod, SETTING, 0, -1), PATH(fchmodat, SETTING, 0, 1), PATH(utimensat, SETTING, 0, 1),
    {452 /* fchmodat2 */, SETTING, 0, 1, -1, -1},
    PATH(execve, EXECUTING, -1, 0), PATH(execveat, EXECUTING, 0, 1),
#ifdef __NR_renameat
    PATHS(renameat, 0, 1, 2, 3),
#endif
#ifdef __NR_open
    PATH(open, OPENING, -1, 0), PATH(creat, MAKING, -1, 0), PATH(unlink, CHANGING, -1, 0),
    PATH(rmdir, CHANGING, -1, 0), PATH(mkdir, CHANGING, -1, 0), PATH(mknod, MAKING, -1, 0),
    PATH(symlink, CHANGING, -1, 1), PATHS(link, -1, 0, -1, 1), PATHS(rename, -1, 0, -1, 1),
    PATH(chmod, SETTING, -1, 0), PATH(utime, SETTING, -1, 0), PATH(utimes, SETTING, -1, 0),
    PATH(futimesat, SETTING, 0, 1),
#endif
};
const size_t call_count = sizeof calls / sizeof *calls;

const int process_calls[] = {__NR_kill, __NR_tkill, __NR_tgkill, __NR_rt_sigqueueinfo, __NR_rt_tgsigqueueinfo,
                             __NR_prlimit64, __NR_sched_setaffinity, __NR_sched_setparam, __NR_sched_setscheduler,
                             __NR_sched_setattr};
const size_t process_call_count = sizeof process_calls / sizeof *process_calls;
enum { SIGNALLING_CALLS = 5 };

/* One number of /proc/PID/status, 0 if there is none. */
static long status_of(pid_t pid, const char *name)
{
    char path[64], line[256];
    long number = 0;
    snprintf(path, sizeof path, "/proc/%d/status", (int)pid);
    FILE *file = fopen(path, "re");
    while (file && !number && fgets(line, sizeof line, file))
        if (!strncmp(line, name, strlen(name)))
            number = strtol(line + strlen(name), NULL, 10);
    if (file)
        fclose(file);
    return number;
}

/* Whether a process or thread descends from this one. */
static int is_ours(pid_t pid)
{
    for (int k = 0; pid > 1 && k < MOST_ANCESTORS; k++) {
        pid = (pid_t)status_of(pid, "PPid:");
        if (pid == getpid())
            return 1;
    }
    return 0;
}

/* The processes that descend from this one; returns their number. The array is kept for the next call. */
static size_t find_ours(const pid_t **found)
{
    static struct family {
        pid_t pid, parent;
    } *all;
    static pid_t *ours;
    static size_t space;
    size_t count = 0, known = 0;
    DIR *folder = opendir("/proc");
    for (struct dirent *entry; folder && (entry = readdir(folder));) {
        char path[64], text[512];
        if (!isdigit((unsigned char)*entry->d_name))
            continue;
        if (count == space) {
            struct family *more = realloc(all, (space + 1024) * sizeof *all);
            all = more ? more : all;
            pid_t *more_ours = realloc(ours, (space + 1024) * sizeof *ours);
            ours = more_ours ? more_ours : ours;
            if (!more || !more_ours)
                break;
            space += 1024;
        }
        snprintf(path, sizeof path, "/proc/%.20s/stat", entry->d_name);
        const int file = open(path, O_RDONLY | O_CLOEXEC);
        const ssize_t length = file < 0 ? 0 : read(file, text, sizeof text - 1);
        if (file >= 0)
            close(file);
        text[length > 0 ? length : 0] = 0;
        const char *rest = strrchr(text, ')'); /* names may contain anything */
        int parent;
        if (rest && sscanf(rest, ") %*c %d", &parent) == 1)
            all[count++] = (struct family){(pid_t)atoi(entry->d_name), parent};
    }
    if (folder)
        closedir(folder);
    for (size_t next = 0; next <= known; next++) {
        const pid_t parent = next ? ours[next - 1] : getpid();
        for (size_t k = 0; k < count; k++)
            if (all[k].parent == parent)
                ours[known++] = all[k].pid;
    }
    *found = ours;
    return known;
}

/* Children whose own children stay behind are followed by these, which this process adopts. */
void kill_children(pid_t worker)
{
    const pid_t *ours;
    (void)worker;
    for (size_t k = find_ours(&ours); k > 0; k--)
        kill(ours[k - 1], SIGKILL);
}

/* Own memory and shared memory; what comes from files does not count. A process whose first thread has ended, while
 * others go on, does not show its memory and is killed. */
static uint64_t memory_of(pid_t pid)
{
    char path[64];
    unsigned long size = 1, all = 0, shared = 0;
    const uint64_t page = (uint64_t)sysconf(_SC_PAGESIZE);
    snprintf(path, sizeof path, "/proc/%d/statm", (int)pid);
    FILE *file = fopen(path, "re");
    if (file && fscanf(file, "%lu %lu %lu", &size, &all, &shared) != 3)
        all = shared = 0;
    if (!size)
        kill(pid, SIGKILL);
    if (file)
        fclose(file);
    /* To tell shared memory from files takes longer. */
    return page * (all - shared) + (page * shared < SMALL ? 0 : 1024 * (uint64_t)status_of(pid, "RssShmem:"));
}

/* Processes that were counted last, and those that have been allowed to start since; when a further one was not. */
static size_t processes = 1;
static time_t refused_last;

uint64_t memory_used(pid_t worker, unsigned enforced)
{
    const pid_t *ours;
    uint64_t sum = 0;
    if (enforced & REFUSALS && processes == 1)
        return memory_of(worker);
    processes = find_ours(&ours);
    for (size_t k = 0; k < processes; k++)
        sum += memory_of(ours[k]);
    return sum;
}

static int may_start_another(void)
{
    const pid_t *ours;
    const time_t now = time(NULL);
    if (processes >= MOST_PROCESSES && now != refused_last)
        processes = find_ours(&ours);
    if (processes >= MOST_PROCESSES) {
        refused_last = now;
        return 0;
    }
    processes++;
    return 1;
}

/* Threads are counted when as many as there may be have started since they were counted last. */
static int may_start_thread(void)
{
    static size_t threads;
    const pid_t *ours;
    if (++threads <= MOST_THREADS)
        return 1;
    threads = 1;
    for (size_t k = find_ours(&ours); k > 0; k--)
        threads += (size_t)status_of(ours[k - 1], "Threads:");
    return threads <= MOST_THREADS;
}

static int read_memory(pid_t pid, uint64_t address, void *target, size_t count)
{
    struct iovec here = {target, count}, there = {(void *)(uintptr_t)address, count};
    return process_vm_readv(pid, &here, 1, &there, 1, 0) == (ssize_t)count;
}

/* A text in the memory of another process, which may end where its memory ends. */
static int read_text_of(pid_t pid, uint64_t address, char *text)
{
    for (size_t have = 0; have < PATH_MAX;) {
        size_t more = 4096 - (address + have) % 4096;
        more = more > PATH_MAX - have ? PATH_MAX - have : more;
        if (!read_memory(pid, address + have, text + have, more))
            return 0;
        if (memchr(text + have, 0, more))
            return 1;
        have += more;
    }
    return 0;
}

/* The path that a process means, absolute but not resolved. Without a path: that of a descriptor. */
static int read_path(const struct seccomp_notif *asked, int folder, int argument, char *path)
{
    char link[64], given[PATH_MAX] = "";
    const __u64 *args = asked->data.args;
    if (argument >= 0 && args[argument] && !read_text_of((pid_t)asked->pid, args[argument], given))
        return 0;
    if (*given == '/')
        return strlen(strcpy(path, given)) > 0;
    if (folder >= 0 && (int)args[folder] != AT_FDCWD)
        snprintf(link, sizeof link, "/proc/%d/fd/%d", (int)asked->pid, (int)args[folder]);
    else
        snprintf(link, sizeof link, "/proc/%d/cwd", (int)asked->pid);
    const ssize_t length = readlink(link, path, PATH_MAX - 1);
    if (length <= 0 || (size_t)length + strlen(given) + 2 > PATH_MAX)
        return 0;
    path[length] = 0;
    if (*given)
        strcat(strcat(path, "/"), given);
    return 1;
}

static int is_beneath(const char *path, const char **places)
{
    for (const char **place = places; *place; place++) {
        const size_t length = strcmp(*place, "/") ? strlen(*place) : 0;
        if (!strncmp(path, *place, length) && (path[length] == '/' || !path[length]))
            return 1;
    }
    return 0;
}

/* The path of an open file without links; empty and 0 if it has none, such as a pipe or memory. */
static int path_of(int file, char *path)
{
    char place[64];
    snprintf(place, sizeof place, "/proc/self/fd/%d", file);
    const ssize_t length = readlink(place, path, PATH_MAX - 1);
    path[length > 0 ? length : 0] = 0;
    if (*path != '/' || access(path, F_OK))
        *path = 0;
    return *path != 0;
}

/* Replace a path by that of the file that it leads to; 0 if that has none, -1 if it does not exist. Much faster than
 * realpath for deep ones. */
static int follow_links(char *path)
{
    const int file = open(path, O_PATH | O_CLOEXEC);
    if (file < 0)
        return errno == ENOENT ? -1 : 0;
    const int found = path_of(file, path);
    close(file);
    return found;
}

/* Make a path canonical, but for its last part if that is not followed or does not exist yet. */
static int resolve(char *path, int follow)
{
    char last[PATH_MAX], *slash;
    size_t length = strlen(path);
    const int found = follow ? follow_links(path) : -1;
    if (found >= 0)
        return found;
    while (length > 1 && path[length - 1] == '/')
        path[--length] = 0;
    if (!(slash = strrchr(path, '/')))
        return 0;
    strcpy(last, slash);
    slash[slash == path] = 0;
    if (follow_links(path) <= 0 || strlen(path) + strlen(last) + 1 > PATH_MAX)
        return 0;
    strcpy(path + (path[1] ? strlen(path) : 0), last);
    return 1;
}

/* Whether the user might do this, and the policy does not allow it. */
static int is_refused(char *path, const struct policy *policy, int follow)
{
    char folder[PATH_MAX];
    const int is_device = !strncmp(path, "/dev/", 5) && strncmp(path, "/dev/shm/", 9); /* shared memory is none */
    if (!strncmp(path, "/proc/", 6) || is_device || !resolve(path, follow))
        return 0;
    if (is_beneath(path, policy->writable))
        return 0;
    if (follow && !access(path, F_OK))
        return !access(path, W_OK);
    strcpy(folder, path);
    *strrchr(folder, '/') = 0;
    return !access(*folder ? folder : "/", W_OK);
}

/* Tell if a change is refused; without Landlock, refuse it. */
static int answer_change(
    const struct seccomp_notif *asked, const struct call *call, const struct policy *policy, unsigned enforced)
{
    char path[PATH_MAX];
    const signed char places[][2] = {{call->folder, call->path}, {call->folder_2, call->path_2}};
    const __u64 *mode = &asked->data.args[call->path + 1];
    int refused = 0, makes = call->treatment == MAKING;
    if (call->treatment == OPENING && *mode & (O_CREAT | (O_TMPFILE & ~O_DIRECTORY)))
        makes = 1, mode++;
    if (makes && *mode & (S_ISUID | S_ISGID))
        return EPERM; /* whoever executes it would have this user's rights */
    for (int k = 0; k < 2; k++) {
        if (places[k][1] < 0 || !read_path(asked, places[k][0], places[k][1], path))
            continue;
        if (is_refused(path, policy, call->treatment == OPENING || call->number == __NR_truncate)) {
            tell(CHANGE, path);
            refused = 1;
        }
    }
    return refused && !(enforced & FILES) ? EACCES : GO_ON;
}

/* The new times of a file, each of two numbers; 0 if they cannot be read. */
static int read_times(const struct seccomp_notif *asked, struct timespec *times)
{
    const __u64 *args = asked->data.args;
    long numbers[4] = {0, UTIME_NOW, 0, UTIME_NOW};
    int is_short = 0, is_micro = 0, position = 2;
#ifdef __NR_utime
    is_short = asked->data.nr == __NR_utime;
    is_micro = asked->data.nr == __NR_utimes || asked->data.nr == __NR_futimesat;
    position = asked->data.nr == __NR_utimes || is_short ? 1 : 2;
#endif
    if (args[position]) {
        if (!read_memory((pid_t)asked->pid, args[position], numbers, sizeof *numbers * (is_short ? 2 : 4)))
            return 0;
        if (is_short)
            numbers[2] = numbers[1], numbers[1] = numbers[3] = 0;
        for (int k = 1; is_micro && k < 4; k += 2)
            numbers[k] = numbers[k] < 0 || numbers[k] >= 1000000 ? -1 : 1000 * numbers[k]; /* -1 is refused */
    }
    for (int k = 0; k < 2; k++) {
        times[k].tv_sec = numbers[2 * k];
        times[k].tv_nsec = numbers[2 * k + 1];
    }
    return 1;
}

/* Give a file of the FMU other permissions or times. */
static int answer_setting(const struct seccomp_notif *asked, const struct call *call, const struct policy *policy)
{
    const __u64 *args = asked->data.args;
    const int number = asked->data.nr, has_flags = number == __NR_utimensat || number == 452 /* fchmodat2 */;
    const int is_link = has_flags && args[3] & AT_SYMLINK_NOFOLLOW;
    char path[PATH_MAX], place[64];
    struct timespec times[2];
    struct stat found;
    int is_mode = number == __NR_fchmod || number == __NR_fchmodat || number == 452;
    int position = number == __NR_fchmod ? 1 : 2, error = 0;
#ifdef __NR_chmod
    is_mode |= number == __NR_chmod;
    position = number == __NR_chmod ? 1 : position;
#endif
    if (!read_path(asked, call->folder, call->path, path) || (!is_mode && !read_times(asked, times)))
        return EFAULT;
    const int file = open(path, O_PATH | O_CLOEXEC | (is_link ? O_NOFOLLOW : 0));
    if (file < 0)
        return errno;
    snprintf(place, sizeof place, "/proc/self/fd/%d", file);
    if (!path_of(file, path) || !is_beneath(path, policy->writable)) {
        error = EPERM;
        if (*path && !fstat(file, &found) && (found.st_uid == geteuid() || !geteuid()))
            tell(CHANGE, path);
    } else if (is_mode ? chmod(place, (mode_t)args[position] & 0777) : utimensat(AT_FDCWD, place, times, 0)) {
        error = errno;
    }
    close(file);
    return error;
}

static int answer_execution(
    const struct seccomp_notif *asked, const struct call *call, const struct policy *policy, pid_t worker)
{
    char path[PATH_MAX];
    if (read_path(asked, call->folder, call->path, path) && !access(path, X_OK)) {
        if (!policy->programs)
            tell(EXECUTE, path);
        else if (!*policy->command && status_of((pid_t)asked->pid, "Tgid:") == worker)
            tell(REPLACE, path);
    }
    return policy->programs ? GO_ON : EACCES;
}

static int answer_process(const struct seccomp_notif *asked)
{
    const int number = asked->data.nr;
    const int is_by_kind = number == __NR_setpriority || number == __NR_ioprio_set;
    const int pid = (int)asked->data.args[is_by_kind ? 1 : 0];
    if (is_ours(pid < -1 ? (pid_t)-(unsigned)pid : pid)) /* a group; the smallest number remains negative */
        return GO_ON;
    for (int k = 0; k < SIGNALLING_CALLS; k++)
        if (number == process_calls[k]) {
            tell(SIGNAL, "");
            return EPERM;
        }
    tell(PROCESS, "");
    return EPERM;
}

static int answer(const struct seccomp_notif *asked, const struct policy *policy, unsigned enforced, pid_t worker)
{
    for (size_t k = 0; k < call_count; k++) {
        if (calls[k].number != asked->data.nr)
            continue;
        switch (calls[k].treatment) {
        case OPENING:
        case MAKING:
        case CHANGING: return answer_change(asked, &calls[k], policy, enforced);
        case SETTING: return answer_setting(asked, &calls[k], policy);
        case EXECUTING: return answer_execution(asked, &calls[k], policy, worker);
        default: return EPERM;
        }
    }
    int is_fork = asked->data.nr == __NR_clone;
#ifdef __NR_fork
    is_fork |= asked->data.nr == __NR_fork || asked->data.nr == __NR_vfork;
#endif
    if (!is_fork)
        return answer_process(asked);
    const int is_thread = asked->data.nr == __NR_clone && asked->data.args[0] & CLONE_THREAD;
    if (is_thread ? may_start_thread() : may_start_another())
        return GO_ON;
    char most[64];
    snprintf(most, sizeof most, "%d processes or %d threads", MOST_PROCESSES, MOST_THREADS);
    tell(FORK, most);
    return EAGAIN;
}

void answer_call(int listener, const struct policy *policy, unsigned enforced, pid_t worker)
{
    /* The kernel's may be larger. */
    union {
        struct seccomp_notif asked;
        char space[512];
    } request;
    union {
        struct seccomp_notif_resp answer;
        char space[512];
    } reply;
    memset(&request, 0, sizeof request);
    memset(&reply, 0, sizeof reply);
    if (ioctl(listener, SECCOMP_IOCTL_NOTIF_RECV, &request.asked))
        return;
    reply.answer.id = request.asked.id;
    int error = answer(&request.asked, policy, enforced, worker);
    if (error == GO_ON)
        reply.answer.flags = SECCOMP_USER_NOTIF_FLAG_CONTINUE;
    else
        reply.answer.error = -error;
    ioctl(listener, SECCOMP_IOCTL_NOTIF_SEND, &reply.answer);
}
