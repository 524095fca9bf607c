"""Five controllers and machines whose inputs, settings and initial states are searched together.

They belong to the collection of ``bench/function_mixed.py``.
"""

from collections import deque
from collections.abc import Mapping

from bench.example_systems import Array
from bench.function_machines import columns, held, line, numbers, requirements, switch, whole
from falsifier.core.ranges import ParameterRange


def insulin(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """An insulin pump and its patient; a second stands for two minutes, and meals are announced or not."""
    dt = 2.0
    sense, weight, slow = parameters["sensitivity"], parameters["weight"], parameters["absorption"]
    sugar, target = parameters["sugar"], parameters["target"]
    meal, told, sport = inputs["meal"].tolist(), inputs["told"].tolist(), inputs["sport"].tolist()
    bias = inputs["bias"].tolist()
    gut = depot = plasma = effect = waiting = 0.0
    suspended, suspensions = 0, 0
    pipe = deque([sugar] * 6, maxlen=6)
    rows: list[tuple[float, ...]] = []
    for k, grams in enumerate(meal):
        if k % 40 == 5 and grams > 15:
            gut += grams
            if not suspended:
                waiting += told[k] * grams / parameters["ratio"]
        pipe.append(sugar + bias[k])
        shown = pipe[0]
        trend = (shown - pipe[-1]) / -5.0
        if not suspended and shown + 6 * trend < parameters["suspend"]:
            suspended = 1
            suspensions += 1
        elif suspended and shown > parameters["suspend"] + 15:
            suspended = 0
        basal = 0.0 if suspended else max(0.0, 0.012 + 0.00022 * (shown - target) + 0.0006 * trend)
        given = min(waiting, 0.3)
        waiting -= given
        depot += dt * basal + given - dt * depot / slow
        plasma += dt * (depot / slow - 0.09 * plasma)
        effect += dt * 0.025 * (plasma * 70 / weight - effect)
        fed = 0.022 * gut
        gut -= dt * fed
        fall = (0.004 + 0.020 * sense * effect * (1 + 1.5 * sport[k]) + 0.002 * sport[k]) * sugar
        sugar = max(20.0, sugar + dt * (1.0 + 4.3 * fed * 70 / weight - fall))
        rows.append((sugar, shown, plasma, suspended, suspensions))
    return columns(rows, "sugar", "shown", "insulin", "suspended", "suspensions")


INSULIN = requirements(
    insulin,
    {
        "insulin high": "G (sugar <= 300)",
        "insulin recovers": "G[0,150] (sugar <= 52 -> F[0,50] (sugar >= 70))",
        "insulin low and high": "not F[0,150] (sugar <= 55 and F[0,50] (sugar >= 300))",
    },
    {
        "sugar": "real",
        "shown": "real",
        "insulin": "real",
        "suspended": "integer",
        "suspensions": "integer",
    },
    inputs=(
        held("meal", 0, 80, 5),
        line("told", 0, 1.5, 5),
        line("sport", 0, 1, 4),
        line("bias", -20, 20, 4),
    ),
    parameters=(
        ParameterRange("sensitivity", 0.5, 2.0),
        ParameterRange("weight", 50, 110),
        ParameterRange("absorption", 25, 70),
        ParameterRange("sugar", 80, 200),
        ParameterRange("ratio", 8, 20),
        ParameterRange("target", 90, 130, kind="integer"),
        ParameterRange("suspend", 60, 90),
    ),
    stop=200.0,
    interval=1.0,
)


def hvac(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Two rooms share a fan of four stages and a compressor: eco (0), comfort (1) or boost (2)."""
    mode, least, limit = int(parameters["mode"]), int(parameters["least"]), parameters["limit"]
    band, leak = parameters["band"], parameters["leak"]
    warm = [parameters["warm0"], parameters["warm1"]]
    air = [500.0, 500.0]
    people = [whole(inputs["people0"]), whole(inputs["people1"])]
    outdoor, windows, wish = inputs["outdoor"].tolist(), whole(inputs["window"]), inputs["wish"].tolist()
    stage, running, since, starts, changes, purge, purges = 1, 0, 30, 0, 0, 0, 0
    rows: list[tuple[float, ...]] = []
    for k, out in enumerate(outdoor):
        since += 1
        worst = max(air)
        before = stage
        if purge > 0:
            purge -= 1
            stage = 4
        elif k % int(parameters["period"]) == 0:
            if worst > limit and stage < (2, 3, 4)[mode]:
                stage += 1
            elif worst < limit - 200 and stage > 0:
                stage -= 1
            if worst > limit + 700 and since >= least:
                purge = 12
                purges += 1
        changes += stage != before
        hottest = max(warm) - wish[k]
        wait = least if mode < 2 else least // 2
        if since >= wait and not running and hottest > band and not windows[k]:
            running, since = 1, 0
            starts += 1
        elif since >= wait and running and (hottest < -band or windows[k]):
            running, since = 0, 0
        for j in (0, 1):
            flow = 0.008 * stage + 0.004 + (0.05 if windows[k] and j == 0 else 0.0)
            air[j] += 2.6 * people[j][k] - flow * (air[j] - 420)
            fresh = (0.2 * flow + 0.006 * leak) * (out - warm[j])
            cool = 0.16 * (0.5 + 0.25 * stage) * (0.7, 1.0, 1.4)[mode] if running else 0.0
            warm[j] += fresh + 0.012 * people[j][k] - cool + 0.03 * (warm[1 - j] - warm[j])
        rows.append((*warm, *air, stage, running, starts, changes, purges))
    return columns(rows, "warm0", "warm1", "air0", "air1", "stage", "running", "starts", "changes", "purges")


HVAC = requirements(
    hvac,
    {
        "hvac fresh air": "G (air1 <= 1700)",
        "hvac cools": "G[0,150] (warm0 >= 30 and window <= 0.5 -> F[0,50] (warm0 <= 29.5 or window >= 0.5))",
        "hvac purges": "G (purges <= 2) or G (starts <= 5)",
    },
    {
        "warm0": "real",
        "warm1": "real",
        "air0": "real",
        "air1": "real",
        "stage": "integer",
        "running": "integer",
        "starts": "integer",
        "changes": "integer",
        "purges": "integer",
    },
    inputs=(
        numbers("people0", 0, 15, 5),
        numbers("people1", 0, 15, 5),
        line("outdoor", 5, 36, 4),
        switch("window", 5),
        held("wish", 20, 25, 4),
    ),
    parameters=(
        ParameterRange("mode", 0, 2, kind="enumeration", items=(("eco", 0), ("comfort", 1), ("boost", 2))),
        ParameterRange("least", 3, 15, kind="integer"),
        ParameterRange("period", 2, 10, kind="integer"),
        ParameterRange("limit", 800, 1200),
        ParameterRange("band", 0.3, 1.5),
        ParameterRange("leak", 0.5, 2.0),
        ParameterRange("warm0", 18, 30),
        ParameterRange("warm1", 18, 30),
    ),
    stop=200.0,
    interval=1.0,
)


def cascade(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Three tanks one below the other, a pump between high and low marks, and a return to the first."""
    dt = 0.5
    level = [parameters[f"level{j}"] for j in range(3)]
    valve = (parameters["valve0"], parameters["valve1"])
    low, high = parameters["low"], parameters["low"] + parameters["span"]
    pipe = deque([0.0] * (int(parameters["delay"] / dt) + 1), maxlen=int(parameters["delay"] / dt) + 1)
    feed, use, back = inputs["feed"].tolist(), inputs["use"].tolist(), whole(inputs["back"])
    pump, starts, spilled, dry, last = 0, 0, 0.0, 0.0, -99
    rows: list[tuple[float, ...]] = []
    for k, inflow in enumerate(feed):
        if not pump and level[2] > high and k - last > 30:
            pump, last = 1, k
            starts += 1
        elif pump and level[2] < low:
            pump = 0
        lifted = 0.45 if pump and level[2] > 0.05 else 0.0
        returned = lifted if back[k] else 0.0
        first = valve[0] * 0.30 * max(0.0, level[0]) ** 0.5
        second = valve[1] * 0.30 * max(0.0, level[1]) ** 0.5
        pipe.append(first)
        level[0] += dt * (inflow + returned - first) / 2.0
        level[1] += dt * (pipe[0] - second) / 1.5
        level[2] += dt * (second - lifted - 0.2 * use[k] * min(1.0, level[2] * 4)) / 2.5
        for j in range(3):
            spilled += max(0.0, level[j] - 3.0)
            level[j] = min(3.0, max(0.0, level[j]))
        dry = dry + dt if level[2] <= 0.1 else 0.0
        rows.append((*level, pump, starts, spilled, dry))
    return columns(rows, "level0", "level1", "level2", "pump", "starts", "spilled", "dry")


CASCADE = requirements(
    cascade,
    {
        "cascade spills": "G (spilled <= 3)",
        "cascade fills in order": "(level1 <= 2.9) U[0,150] (level2 >= 1)",
        "cascade dry below a full tank": "G (dry <= 5 or level0 <= 2.5)",
    },
    {
        "level0": "real",
        "level1": "real",
        "level2": "real",
        "pump": "integer",
        "starts": "integer",
        "spilled": "real",
        "dry": "real",
    },
    inputs=(line("feed", 0, 0.35, 5), line("use", 0, 1, 4), switch("back", 6)),
    parameters=(
        *(ParameterRange(f"level{j}", 0.2, 2.5) for j in range(3)),
        ParameterRange("valve0", 0.5, 1.5),
        ParameterRange("valve1", 0.5, 1.5),
        ParameterRange("low", 0.3, 1.0),
        ParameterRange("span", 0.2, 1.5),
        ParameterRange("delay", 0, 15),
    ),
    stop=150.0,
    interval=0.5,
)


def charger(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A charging point: idle 0, handshake 1, charging 2, waiting before a retry 3, locked 4."""
    retries, pause, patience = (int(parameters[name]) for name in ("retries", "pause", "patience"))
    again, amps = int(parameters["again"]), (16, 32, 63)[int(parameters["socket"])]
    plug, line_, stop = whole(inputs["plug"]), whole(inputs["answer"]), whole(inputs["stop"])
    demand, hot = whole(inputs["demand"]), parameters["hot"]
    mode, since, failed, attempts, locks, answers, sessions, energy = 0, 0, 0, 0, 0, 0, 0, 0.0
    last_plug = last_stop = 0
    rows: list[tuple[float, ...]] = []
    for k, plugged in enumerate(plug):
        since += 1
        before = mode
        pressed = stop[k] and not last_stop
        inserted = plugged and not last_plug
        last_plug, last_stop = plugged, stop[k]
        if mode == 0 and inserted:
            mode, failed = 1, 0
        elif mode == 1:
            answers = answers + 1 if line_[k] else 0
            if not plugged:
                mode = 0
            elif answers >= 6:
                mode = 2
                sessions += 1
            elif since >= patience:
                failed += 1
                mode = 3 if failed <= retries else 4
        elif mode == 2:
            failed = 0 if since >= 30 else failed
            if not plugged or pressed:
                mode = 0
            elif not line_[k] or hot > 80:
                failed += 1
                mode = 3 if failed <= retries else 4
        elif mode == 3:
            if not plugged:
                mode = 0
            elif since >= pause:
                mode = 1
        elif mode == 4 and ((again and since >= 60) or (pressed and plugged)):
            mode, failed = (1, 0) if plugged else (0, 0)
        if mode != before:
            since, answers = 0, 0
            attempts += mode == 1
            locks += mode == 4
        used = min(amps, 21 * demand[k]) if mode == 2 else 0
        energy += used / 100
        hot += 0.5 * (0.0022 * used * used - 0.06 * (hot - 25))
        rows.append((mode, failed, attempts, locks, sessions, hot, energy, plugged))
    return columns(rows, "mode", "failed", "attempts", "locks", "sessions", "hot", "energy", "in")


CHARGER = requirements(
    charger,
    {
        "charger lock": "G (locks <= 0)",
        "charger hot": "G (hot <= 82)",
        "charger attempts": "G (attempts <= 9) or G (locks <= 1)",
    },
    {
        "mode": "integer",
        "failed": "integer",
        "attempts": "integer",
        "locks": "integer",
        "sessions": "integer",
        "hot": "real",
        "energy": "real",
        "in": "integer",
    },
    inputs=(switch("plug", 6), switch("answer", 12), switch("stop", 8), numbers("demand", 0, 3, 5)),
    parameters=(
        ParameterRange("retries", 1, 6, kind="integer"),
        ParameterRange("pause", 2, 20, kind="integer"),
        ParameterRange("patience", 8, 30, kind="integer"),
        ParameterRange("again", 0, 1, kind="boolean"),
        ParameterRange("socket", 0, 2, kind="integer"),
        ParameterRange("hot", 20, 60),
    ),
    stop=100.0,
    interval=0.5,
)


def cell(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A robot behind a door and a curtain: automatic (0), setup (1) or service (2), with a muting time."""
    dt = 0.2
    kind, muting, brake = int(parameters["kind"]), int(parameters["muting"]), parameters["brake"]
    place, speed = parameters["place"], 0.0
    door, curtain, enable = whole(inputs["door"]), whole(inputs["curtain"]), whole(inputs["enable"])
    start, confirm, part = whole(inputs["start"]), whole(inputs["confirm"]), whole(inputs["part"])
    override = inputs["override"].tolist()
    mode, mute, goal, parts, stops, danger, armed = 0, 0, 1, 0, 0, 0.0, 0
    last = [0, 0, 0]
    entries, pressed, shut = 0, -99, 1
    rows: list[tuple[float, ...]] = []
    for k, opened in enumerate(door):
        now = [start[k], confirm[k], part[k]]
        begun, agreed, arrived = (new and not old for new, old in zip(now, last, strict=True))
        last = now
        pressed = k if begun else pressed
        if opened and shut and not enable[k] and k - pressed <= 10:
            entries += 1
        shut = not opened
        mute = muting if arrived and mode == 1 else max(0, mute - 1)
        broken = curtain[k] and not mute
        safe = (not opened and not broken) or (kind > 0 and enable[k])
        if mode == 0 and begun and safe:
            mode, armed = 1, 0
        elif mode == 1 and not safe:
            mode = 2
            stops += 1
        elif mode == 2 and agreed and not opened:
            armed = 1
        elif mode == 2 and armed and begun and safe:
            mode, armed = 1, 0
        top = (2.0, 0.4, 0.8)[kind] * override[k]
        wanted = (top if goal else -top) if mode == 1 else 0.0
        change = wanted - speed
        speed += max(-brake * dt, min(brake * dt, change))
        place = min(3.0, max(0.0, place + dt * speed))
        if (goal and place >= 2.5) or (not goal and place <= 0.5):
            goal = 1 - goal
            parts += goal
        inside = (opened or curtain[k]) and place > 1.5
        danger = danger + dt if inside and abs(speed) > 0.25 else 0.0
        rows.append((mode, place, abs(speed), parts, stops, danger, mute, entries, armed))
    return columns(rows, "mode", "place", "speed", "parts", "stops", "danger", "mute", "entries", "armed")


CELL = requirements(
    cell,
    {
        "cell danger": "G (danger <= 3)",
        "cell entries": "G (entries <= 2)",
        "cell stops": "G (stops <= 2)",
    },
    {
        "mode": "integer",
        "place": "real",
        "speed": "real",
        "parts": "integer",
        "stops": "integer",
        "danger": "real",
        "mute": "integer",
        "entries": "integer",
        "armed": "integer",
    },
    inputs=(
        *(switch(name, 10) for name in ("door", "curtain", "enable", "start", "confirm", "part")),
        line("override", 0, 1, 4),
    ),
    parameters=(
        ParameterRange(
            "kind", 0, 2, kind="enumeration", items=(("automatic", 0), ("setup", 1), ("service", 2))
        ),
        ParameterRange("muting", 0, 30, kind="integer"),
        ParameterRange("brake", 0.8, 4.0),
        ParameterRange("place", 0.0, 3.0),
    ),
    stop=60.0,
    interval=0.2,
)
