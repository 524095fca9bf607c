"""Numbers that the compiled loops and their callers share; a worker imports them without the compiler."""

# Where a loop stopped, in `report[WHERE]`; DONE: nowhere before its end. PAUSED: the solver, at its caller's
# wish.
DONE, SETTING, STEPPING, GETTING, EVENT, TERMINATED, STUCK, TOO_SMALL = range(8)
PAUSED = 100
STATUS, WHERE, STEP = range(3)

# Rows of the table of function addresses of a co-simulation FMU.
INSTANCE, DO_STEP, ENTER_EVENT_MODE, UPDATE_DISCRETE_STATES, ENTER_STEP_MODE, FMI_VERSION, EVENT_MODE = range(
    7
)

# Bytes per row in the tables of calls and places (Ports) and of pieces (Signal.pieces).
CALL_BYTES, PLACE_BYTES, PIECE_BYTES = 40, 32, 40

# Early returns at one time, or rounds of one event iteration, after which the FMU is considered stuck.
MOST_ROUNDS = 1000

# What to ask of the entry to the loops of co-simulation, and of that to the solver.
WRITE_ROW, READ_ROW, PUT, FETCH, ENTER_STEP_MODE_FIRST, CO_SIMULATE = range(6)
SETTLE, REFRESH, ADVANCE = range(3)

# Where the arguments of co_simulate are in what is passed to its entry, in words of 8 bytes.
FUNCTIONS, PORTS, PIECES, HELD_PORTS, HELD_PIECES = 0, 7, 11, 13, 17
CURRENT, VALUES, GETTERS, OUTPUTS, WIDTH, STEPS, FIRST, LAST, EVERY = 19, 20, 21, *range(25, 31)
REPORT, STOP_TIME = 31, 32
# The same of a table of ports: WRITE_ROW has the address of the numbers behind it, READ_ROW that of the rows,
# their length and the column.
ROW_INSTANCE, ROW_VERSION, ROW_PORTS, ROW_NUMBERS, ROW_LENGTH, ROW_COLUMN = 0, 1, 2, 6, 7, 8
