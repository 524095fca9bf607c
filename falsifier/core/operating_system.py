"""What falsifier needs from the operating system: the one way to it for all other modules.

``posix``, ``posix_files`` and ``linux`` serve Linux and macOS, ``windows`` and ``windows_files`` Windows.
Each function does as much as the system offers, and does nothing, or says so, where it offers nothing.
"""

import sys

if sys.platform == "win32":
    from falsifier.core import windows as _kept_apart
    from falsifier.core import windows as _system
    from falsifier.core import windows_files as _files
else:
    from falsifier.core import linux as _kept_apart
    from falsifier.core import posix as _system
    from falsifier.core import posix_files as _files

Child = _system.Child
Program = _system.Program
FORKS_BY_DEFAULT = _system.FORKS_BY_DEFAULT
HAS_FORK = _system.HAS_FORK
SENDS_FILES = _system.SENDS_FILES
close_life = _system.close_life
exit_text = _system.exit_text
flush_lines = _system.flush_lines
guarded_memory = _system.guarded_memory
interpreter = _system.interpreter
is_running = _system.is_running
limit_resources = _system.limit_resources
machine_memory = _system.machine_memory
limit_sending = _system.limit_sending
memory_limits = _system.memory_limits
most_memory_used = _system.most_memory_used
on_fork = _system.on_fork
open_life = _system.open_life
receive_connection = _system.receive_connection
receive_descriptors = _system.receive_descriptors
receive_now = _system.receive_now
send_descriptors = _system.send_descriptors
start_silent_tracker = _system.start_silent_tracker
wait_readable = _system.wait_readable
yield_processor = _system.yield_processor

can_seal = _files.can_seal
is_own = _files.is_own
is_private = _files.is_private
is_root = _files.is_root
lock_file = _files.lock_file
read_at = _files.read_at
remove_tree = _files.remove_tree
replace = _files.replace
sealed_file = _files.sealed_file
user = _files.user
write_at = _files.write_at

adopt_orphans = _kept_apart.adopt_orphans
can_confine = _kept_apart.can_confine
confine = _kept_apart.confine
end_descendants = _kept_apart.end_descendants
hide_memory = _kept_apart.hide_memory
