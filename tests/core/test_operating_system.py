"""Only the modules of each system call what not all systems have."""

import ast
from pathlib import Path

import falsifier

PACKAGE = Path(falsifier.__file__).parent
SYSTEMS = {
    "core/posix.py",
    "core/posix_files.py",
    "core/windows.py",
    "core/windows_files.py",
}

MODULES = {
    "fcntl",
    "grp",
    "msvcrt",
    "pty",
    "pwd",
    "resource",
    "select",
    "termios",
    "tty",
    "winreg",
    "_winapi",
}
MODULES |= {"multiprocessing.shared_memory", "multiprocessing.resource_tracker"}
OF_OS = """
    O_CLOEXEC O_DIRECTORY O_NOFOLLOW O_NONBLOCK O_PATH WNOHANG chown fchmod fchown fork forkpty getegid
    geteuid getgid getpgid getppid getpriority getuid initgroups kill killpg lchown memfd_create mkfifo
    nice pidfd_open posix_spawn pread pwrite register_at_fork sched_getaffinity sched_setaffinity
    sched_yield setegid seteuid setgid setpgid setpriority setsid setuid sysconf uname wait waitid waitpid
"""
OF_SIGNAL = """
    SIGKILL SIGSTOP SIGHUP SIGALRM SIGUSR1 SIGUSR2 SIGCHLD SIGPIPE SIGQUIT alarm setitimer pthread_kill
"""
OF_SOCKET = "AF_UNIX MSG_DONTWAIT SCM_RIGHTS SO_SNDTIMEO fromshare recv_fds send_fds"
OF_SUBPROCESS = "CREATE_NEW_PROCESS_GROUP CREATE_NO_WINDOW STARTUPINFO"
OF_CTYPES = "WinDLL windll wintypes"
NAMES = {
    "os": {*OF_OS.split()},
    "signal": {*OF_SIGNAL.split()},
    "socket": {*OF_SOCKET.split()},
    "subprocess": {*OF_SUBPROCESS.split()},
    "ctypes": {*OF_CTYPES.split()},
}
ARGUMENTS = {"creationflags", "pass_fds", "preexec_fn", "process_group", "start_new_session", "startupinfo"}
PLACES = ("/proc/", "/dev/", "/tmp")


def used(source: str) -> set[str]:
    """What a module imports, uses of the modules above, passes to calls, or says of places."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names} & MODULES
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = {alias.name for alias in node.names}
            found |= ({node.module} | {f"{node.module}.{name}" for name in names}) & MODULES
            found |= {f"{node.module}.{name}" for name in names & NAMES.get(node.module, set())}
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.attr in NAMES.get(node.value.id, set()):
                found.add(f"{node.value.id}.{node.attr}")
        elif isinstance(node, ast.keyword) and node.arg in ARGUMENTS:
            found.add(node.arg)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.startswith(PLACES):
            found.add(node.value)
    return found


def test_no_other_module_calls_what_not_all_systems_have() -> None:
    wrong = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        place = path.relative_to(PACKAGE).as_posix()
        if place not in SYSTEMS and (found := used(path.read_text(encoding="utf-8"))):
            wrong[place] = sorted(found)
    assert not wrong


def test_all_other_modules_take_it_from_one_place() -> None:
    names = {Path(place).stem for place in SYSTEMS}
    wrong = []
    for path in sorted(PACKAGE.rglob("*.py")):
        place = path.relative_to(PACKAGE).as_posix()
        if place in SYSTEMS | {"core/operating_system.py"}:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module in ("falsifier.core", "falsifier"):
                wrong += [f"{place}: {alias.name}" for alias in node.names if alias.name in names]
            elif isinstance(node, ast.ImportFrom) and (node.module or "").rpartition(".")[2] in names:
                wrong.append(f"{place}: {node.module}")
    assert not wrong


def test_the_modules_of_the_systems_do_use_such_things() -> None:
    assert all(used((PACKAGE / place).read_text(encoding="utf-8")) for place in SYSTEMS)
