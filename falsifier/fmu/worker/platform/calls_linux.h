/* Linux: which system calls are not simply allowed, and processes as /proc shows them. */

#ifndef CALLS_LINUX_H
#define CALLS_LINUX_H

#include <linux/audit.h>
#include <stddef.h>

#ifdef __x86_64__
#define NATIVE AUDIT_ARCH_X86_64
#else
#define NATIVE AUDIT_ARCH_AARCH64
#endif

enum treatment {
    FORBIDDEN,
    UNKNOWN,      /* as on an older kernel */
    UNSUPPORTED,  /* as on another file system */
    LOOKING_INTO, /* other processes' memory; Wine does it, and Landlock allows it in its own processes */
    OPENING,      /* a file, to change it if the flags say so */
    CHANGING,     /* a folder or a file by its path */
    MAKING,       /* the same, with the file's permissions behind the path */
    SETTING,      /* permissions or times, which Landlock does not see: the guard does it */
    EXECUTING
};

/* Positions of arguments, -1 where there is none: the folder that a relative path starts from, and the path. */
struct call {
    int number;
    enum treatment treatment;
    signed char folder, path, folder_2, path_2;
};

extern const struct call calls[];
extern const size_t call_count;

/* Calls whose first argument is a process or thread. */
extern const int process_calls[];
extern const size_t process_call_count;

#endif
