"""Seven of the fourteen systems that ``bench/function_fields.py`` searches."""

from collections import deque
from collections.abc import Mapping
from math import cos, pi

from bench.example_systems import Array
from bench.function_machines import columns, held, line, numbers, requirements, switch, whole
from falsifier.core.ranges import ParameterRange


def lift(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A lift whose door lock is defeated by key, obstruction, overload in this order, each elsewhere."""
    calls, blocked, key = whole(inputs["call"]), whole(inputs["blocked"]), whole(inputs["key"])
    weight = inputs["weight"].tolist()
    place, goal, door, stay, wait, bypass, reopened, since = 0.0, 0, 0.0, 0, 0.0, 0, 0, 0
    rows: list[tuple[float, ...]] = []
    for k, call in enumerate(calls):
        heavy = weight[k] > 1
        moving = abs(goal - place) > 1e-9
        if door <= 0 or bypass == 3:
            if moving:
                place += max(-0.25, min(0.25, goal - place))
                if abs(goal - place) <= 1e-9:
                    door, stay = 0.01, 8
            elif call != goal and not heavy:
                goal = call
        if not moving and door > 0:
            if blocked[k] and stay <= 2:
                stay, reopened = 8, reopened + 1
            door = min(1.0, door + 0.25) if stay > 0 or heavy else max(0.0, door - 0.25)
            stay = max(0, stay - 1)
        since += 1
        if 0 < bypass < 3 and since > 60:
            bypass = 0
        if bypass == 0 and key[k] and moving and goal < place and place >= 3:
            bypass, since = 1, 0
        elif bypass == 1 and blocked[k] and not key[k] and door >= 1 and place < 1:
            bypass, since = 2, 0
        elif bypass == 2 and heavy and key[k] and door >= 1 and place >= 6:
            bypass, goal = 3, 0
        wait = 0.0 if abs(place - call) < 0.1 else wait + 0.5
        rows.append((place, door, wait, bypass, reopened, moving))
    return columns(rows, "place", "door", "wait", "bypass", "reopened", "moving")


LIFT = requirements(
    lift,
    {
        "lift waits": "G (wait <= 60)",
        "lift reopens": "G (reopened <= 44)",
        "lift moves open": "G (not (bypass >= 2.5 and door >= 0.5 and moving >= 0.5))",
    },
    {
        "place": "real",
        "door": "real",
        "wait": "real",
        "bypass": "integer",
        "reopened": "integer",
        "moving": "integer",
    },
    inputs=(numbers("call", 0, 6, 8), switch("blocked", 16), switch("key", 6), line("weight", 0, 1.2, 8)),
    stop=160.0,
    interval=0.5,
)


def press(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A press with two-hand control: an even count of strokes lets the guard's latch be cleared."""
    left, right, guard, reset = (whole(inputs[name]) for name in ("left", "right", "guard", "reset"))
    mode = whole(inputs["mode"])
    was_left, was_right, was_reset, tied = 0, 0, 0, 0
    strokes, down, latch, since_left, since_right, clears, unsafe, cycle = 0, 0, 0, 99, 99, 0, 0, 0
    rows: list[tuple[float, ...]] = []
    for k in range(len(times)):
        since_left = 0 if left[k] and not was_left else since_left + 1
        since_right = 0 if right[k] and not was_right else since_right + 1
        together = (
            left[k] and right[k] and abs(since_left - since_right) <= 3 and max(since_left, since_right) <= 3
        )
        tied = tied + 1 if left[k] and not right[k] else 0
        if guard[k] and not latch and mode[k] != 2:
            latch = 1
        if reset[k] and not was_reset and latch:
            clears += 1
            if strokes % 2 == 0 or clears % 3 == 0:
                latch = 0
        if down:
            cycle += 1
            if cycle > 12 or (cycle <= 8 and not (left[k] and right[k]) and mode[k] == 0):
                down = 0
            if guard[k] and mode[k] == 1:
                unsafe += 1
        elif together and not latch:
            down, cycle, strokes = 1, 0, strokes + 1
        was_left, was_right, was_reset = left[k], right[k], reset[k]
        rows.append((strokes, down, latch, clears, unsafe, tied / 10))
    return columns(rows, "strokes", "down", "latch", "clears", "unsafe", "tied")


PRESS = requirements(
    press,
    {
        "press tied": "G (tied <= 4)",
        "press strokes": "G (strokes <= 2)",
        "press open in mode 1 after strokes": "G[0,18] (strokes >= 2.5 -> G[0,6] (unsafe <= 14))",
    },
    {
        "strokes": "integer",
        "down": "integer",
        "latch": "integer",
        "clears": "integer",
        "unsafe": "integer",
        "tied": "real",
    },
    inputs=(
        switch("left", 12),
        switch("right", 12),
        switch("guard", 12),
        switch("reset", 12),
        numbers("mode", 0, 2, 4),
    ),
    stop=24.0,
    interval=0.1,
)


def router(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Two classes of packets share credits; late ones are sent again, a flap loses credits."""
    gold, bronze, link = whole(inputs["gold"]), whole(inputs["bronze"]), whole(inputs["link"])
    first: deque[int] = deque()
    second: deque[int] = deque()
    credits, flying, drops, again, lost, was = 8, deque([0] * 6, maxlen=6), 0, 0, 0, 1
    rows: list[tuple[float, ...]] = []
    for k in range(len(times)):
        back = flying.popleft()
        credits += back
        if was and not link[k]:
            gone = sum(flying)
            lost += gone % 2
            credits += gone - gone % 2
            flying = deque([0] * 5, maxlen=6)
        was = link[k]
        for queue, coming in ((first, gold[k]), (second, bronze[k])):
            for _ in range(coming if k % 6 == 0 else 0):
                if len(queue) < 25:
                    queue.append(k)
                else:
                    drops += 1
        sent = 0
        for queue in (first, second):
            while queue and link[k] and credits and sent < 2:
                queue.popleft()
                credits, sent = credits - 1, sent + 1
        if second and k - second[0] > 40:
            second.append(k)
            second.popleft()
            again += 1
        flying.append(sent)
        rows.append((len(first), len(second), credits, drops, again, lost))
    return columns(rows, "gold_queue", "bronze_queue", "credits", "drops", "again", "lost")


ROUTER = requirements(
    router,
    {
        "router sends again": "G (again <= 36)",
        "router starves bronze only": "G[0,150] F[0,50] (bronze_queue <= 23 or gold_queue >= 8)",
        "router loses credits": "G (lost <= 4)",
    },
    dict.fromkeys(("gold_queue", "bronze_queue", "credits", "drops", "again", "lost"), "integer"),
    inputs=(numbers("gold", 0, 6, 20), numbers("bronze", 0, 6, 20), numbers("link", 0, 3, 20)),
    stop=200.0,
    interval=1.0,
)


def duffing(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A forced beam with two wells, its initial state free; it is chaotic for some forcings."""
    p, dt = parameters, 0.05
    x, v, crossings, side = p["x0"], p["v0"], 0, 1 if p["x0"] > 0 else -1
    trim = inputs["trim"].tolist()
    rows: list[tuple[float, ...]] = []
    for k, time in enumerate(times.tolist()):
        for half in (0.0, 0.5):
            force = p["force"] * cos(p["omega"] * (time + half * dt) + p["phase"]) + trim[k]
            v += dt / 2 * (x - x**3 - p["damping"] * v + force)
            x += dt / 2 * v
        if x * side < -0.3:
            side, crossings = -side, crossings + 1
        rows.append((x, v, crossings, 0.5 * v * v - 0.5 * x * x + 0.25 * x**4))
    return columns(rows, "x", "v", "crossings", "energy")


DUFFING = requirements(
    duffing,
    {
        "duffing far": "G (abs(x) <= 1.75)",
        "duffing crosses": "G (crossings <= 19)",
        "duffing rests on the top, then goes left": (
            "not F[10,50] (G[0,4] (abs(x) <= 0.17) and F[4,10] (x <= -1.65))"
        ),
    },
    {"x": "real", "v": "real", "crossings": "integer", "energy": "real"},
    inputs=(line("trim", -0.3, 0.3, 7),),
    parameters=(
        ParameterRange("x0", -1.5, 1.5),
        ParameterRange("v0", -1, 1),
        ParameterRange("damping", 0.1, 0.5),
        ParameterRange("force", 0, 0.6),
        ParameterRange("omega", 0.5, 2.5),
        ParameterRange("phase", 0, 2 * pi),
    ),
    stop=60.0,
    interval=0.05,
)


def hammer(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Water hammer in a pipe of twelve cells (method of characteristics), a valve, a check valve."""
    n, friction, air = 12, parameters["friction"], parameters["air"]
    valve, pump = inputs["valve"].tolist(), whole(inputs["pump"])
    head, flow = [1.0] * (n + 1), [0.3] * (n + 1)
    top, slams, opened, vapour = 1.0, 0, 1, 0.0
    rows: list[tuple[float, ...]] = []
    for k, opening in enumerate(valve):
        plus = [h + q - friction * q * abs(q) for h, q in zip(head, flow, strict=True)]
        minus = [h - q + friction * q * abs(q) for h, q in zip(head, flow, strict=True)]
        top += 0.05 * ((1.4 if pump[k] else 0.8) - top)
        first = max(0.0, top - minus[1]) if opened or top > minus[1] else 0.0
        if opened and first <= 0:
            opened, slams = 0, slams + (flow[0] > 0.02)
        elif not opened and top > minus[1]:
            opened = 1
        for i in range(1, n):
            head[i], flow[i] = (plus[i - 1] + minus[i + 1]) / 2, (plus[i - 1] - minus[i + 1]) / 2
        head[0], flow[0] = first + minus[1], first
        square = (0.5 * opening) ** 2
        last = (-square + (square * square + 4 * square * max(0.0, plus[n - 1])) ** 0.5) / 2
        flow[n] = last + air * (plus[n - 1] - last - head[n])
        head[n] = plus[n - 1] - flow[n]
        for i in range(n + 1):
            if head[i] < -0.1:
                vapour += -0.1 - head[i]
                head[i] = -0.1
        rows.append((head[n], head[n // 2], flow[0], slams, vapour))
    return columns(rows, "end", "middle", "flow", "slams", "vapour")


HAMMER = requirements(
    hammer,
    {
        "hammer end": "G (end <= 2)",
        "hammer slams": "G (slams <= 8)",
        "hammer resounds": "G[0,400] (end >= 1.9 -> F[0,60] (middle >= 0.2 and middle <= 1.9))",
    },
    {"end": "real", "middle": "real", "flow": "real", "slams": "integer", "vapour": "real"},
    inputs=(held("valve", 0, 1, 20), switch("pump", 10)),
    parameters=(ParameterRange("friction", 0.005, 0.05), ParameterRange("air", 0, 0.6)),
    stop=480.0,
    interval=1.0,
)


def pack(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A battery for 2000 samples: half cycles count if deep, cold charging plates lithium."""
    current, ambient, fan = inputs["current"].tolist(), inputs["ambient"].tolist(), whole(inputs["fan"])
    charge, heat, plated, deep, turn, rising, opened, openings = 0.5, 15.0, 0.0, 0, 0.5, 1, 0, 0
    rows: list[tuple[float, ...]] = []
    for k, wanted in enumerate(current):
        flow = 0.0 if opened else wanted
        if (charge >= 1 and flow > 0) or (charge <= 0 and flow < 0):
            flow = 0.0
        charge += 0.006 * flow / (1 - 0.3 * min(plated, 1))
        heat += 0.02 * (ambient[k] - heat) * (1 + 2 * fan[k]) + 0.5 * flow * flow * (1 + plated)
        if flow > 0.2 and heat < 15:
            plated += 0.0012 * flow * max(0.0, charge - 0.4) * (15 - heat) / 10
        if (rising and charge > turn) or (not rising and charge < turn):
            turn = charge
        elif abs(charge - turn) > 0.45:
            turn, rising, deep = charge, 1 - rising, deep + 1
        if not opened and heat > 60:
            opened, openings = 300, openings + 1
        opened = max(0, opened - 1)
        rows.append((charge, heat, plated, deep, openings))
    return columns(rows, "charge", "heat", "plated", "deep", "openings")


PACK = requirements(
    pack,
    {
        "pack deep cycles": "G (deep <= 5)",
        "pack openings": "G (openings <= 0)",
        "pack plated, then hot and full": (
            "G[0,1500] (plated >= 0.15 -> G[0,500] (heat <= 55 or charge <= 0.8)) or G (deep <= 4)"
        ),
    },
    {"charge": "real", "heat": "real", "plated": "real", "deep": "integer", "openings": "integer"},
    inputs=(held("current", -1, 1, 20), line("ambient", -20, 45, 6), switch("fan", 5)),
    stop=2000.0,
    interval=1.0,
)


def valley(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A weak carriage between two hills: it must swing up; gears change only near the bottom, and wear."""
    throttle, gear, dt = inputs["throttle"].tolist(), whole(inputs["gear"]), 0.1
    x, v, engaged, shifts, swings, side = -0.5, 0.0, 2, 0, 0, 0
    rows: list[tuple[float, ...]] = []
    for k, push in enumerate(throttle):
        if gear[k] != engaged and abs(v) < 0.35 and abs(x + 0.5) < 0.4:
            engaged, shifts = gear[k], shifts + 1
        power = (0.0, 0.16, 0.20, 0.13)[engaged] * push
        v += dt * (power - 0.6 * cos(3 * x) - 0.03 * v * engaged)
        x += dt * v
        if x < -1.6:
            x, v = -1.6, 0.0
        if x > 1.55:
            x, v = 1.55, 0.0
        if side >= 0 and x < -0.8:
            side, swings = -1, swings + 1
        elif side <= 0 and x > -0.2:
            side, swings = 1, swings + 1
        rows.append((x, v, shifts, swings, engaged))
    return columns(rows, "x", "v", "shifts", "swings", "engaged")


VALLEY = requirements(
    valley,
    {
        "valley left": "G (x >= -1.1)",
        "valley swings": "G (swings <= 14)",
        "valley halts beyond the hill in gear 3": (
            "not F[0,35] G[0,5] (x >= 0.9 and abs(v) <= 0.3 and engaged >= 2.5)"
        ),
    },
    {"x": "real", "v": "real", "shifts": "integer", "swings": "integer", "engaged": "integer"},
    inputs=(held("throttle", -1, 1, 20), numbers("gear", 1, 3, 10)),
    stop=60.0,
    interval=0.1,
)
