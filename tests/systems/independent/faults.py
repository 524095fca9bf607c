"""The faulty controllers, implemented differently: by times of events, a transition table, in closed form."""

import numpy as np

from tests.systems.independent.stepping import Array


def missed_pulses(contact: Array, *, period: float = 0.05) -> int:
    """Count the pulses that the meter loses.

    Args:
        contact: state of the contact at every tick, 0 or 1.
        period: sample time in s.
    """
    closed = np.flatnonzero(np.concatenate([[False], contact > 0.5]))  # tick 0 is number 1 here
    begins = [int(k) for k in closed if k - 1 not in closed]
    missed, deaf_until = 0, 0
    for k in begins:
        if k < deaf_until:
            missed += 1
            continue
        last = max((int(j) for j in closed if j < k), default=0)
        slept = (k - 1 - last) * period > 6 - period / 2
        deaf_until = k + 1 + round((1.2 if slept else 0.1) / period)
    return missed


WAIT, LOCK, UNLOCK, PRECHARGE, CLOSE, OPEN, RESET = range(1, 8)
IDLE, LOCKED, PRECHARGING, READY, CHARGING = range(1, 6)
_NEXT = {(IDLE, LOCK): LOCKED, (LOCKED, PRECHARGE): PRECHARGING, (READY, CLOSE): CHARGING}
_LONGEST = {LOCKED: 25, PRECHARGING: 40, READY: 20}
_ABORTS = {
    LOCKED: {UNLOCK},
    PRECHARGING: {WAIT, LOCK, UNLOCK, CLOSE},
}


def charger(command: Array, *, period: float = 0.1) -> Array:
    """Return phase, lock, contactors and voltage at every tick, shape (ticks, 4).

    Args:
        command: command of the car at every tick.
        period: sample time in s.
    """
    phase, since, locked, voltage = IDLE, 0, 0, 0.0
    rows = []
    for tick, asked in enumerate(command.astype(int)):
        too_late = tick - since > _LONGEST.get(phase, 10**9)
        if too_late or asked in {OPEN, RESET} | _ABORTS.get(phase, set()):
            following, locked = IDLE, 0
        elif phase == PRECHARGING and voltage >= 380:
            following = READY
        else:
            following = _NEXT.get((phase, asked), phase)
        if following == LOCKED != phase:
            locked = 1
        if asked == UNLOCK and following != CHARGING:
            locked = 0
        if following != phase:
            phase, since = following, tick
        rows.append((phase, locked, int(phase == CHARGING), voltage))
        goal, lag = (400.0, 0.8) if phase >= PRECHARGING else (0.0, 0.5)
        voltage = goal + (voltage - goal) * float(np.exp(-period / lag))
    return np.array(rows, dtype=np.float64)


def heater(disagreement: Array) -> Array:
    """Return temperature, limp-home mode and trips at every tick of 0.1 s, shape (ticks, 3).

    Args:
        disagreement: difference between the sensors at every tick, in K.
    """
    rows = np.empty((len(disagreement), 3))
    bath, part = 60.0, 50.0
    limp, frozen, tripped = False, False, False
    agreed, ended = 0, -1000000
    for tick, apart in enumerate(disagreement):
        agreed = agreed + 1 if 0.1 < apart < 0.3 else 0
        was_limp = limp
        limp = 6.8 < apart < 7.2 or (limp and agreed < 11)
        if was_limp and not limp:
            ended = tick
        if limp and not was_limp:
            frozen = tick - ended >= 15
        wish = 5 * (60 - bath) + part
        given = min(max(wish, 0.0), 30.0 if limp else 100.0)
        if limp and not frozen:
            part = min(100.0, part + 0.05 * (wish - given))
        if not limp and 0 < wish < 100:
            part += 0.02 * (60 - bath)
        tripped = tripped or bath >= 64
        rows[tick] = bath, limp, tripped
        goal = 20 + 0.8 * (0.0 if tripped else given)
        bath = goal + (bath - goal) * np.exp(-0.1 / 40)
    return rows
