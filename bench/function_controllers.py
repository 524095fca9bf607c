"""Five machines and controllers as Python functions, and what they must not do.

They belong to the collection that ``bench/function_plants.py`` searches.
"""

from collections.abc import Mapping
from math import copysign, exp

from bench.example_systems import Array
from bench.function_machines import columns, held, line, numbers, requirements, switch, whole
from falsifier.core.ranges import ParameterRange


def parking(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """An electric parking brake: lever, pedal, drive-away release, and an actuator that needs rests."""
    dt = 0.1
    grade, mass = parameters["grade"], parameters["mass"]
    lever = whole(inputs["lever"])
    pedal, throttle = inputs["pedal"].tolist(), inputs["throttle"].tolist()
    speed = position = 0.0
    clamp, mode, since, acts, heat, inhibited = 18.0, 2, 100, 0, 0.0, 0
    rows: list[tuple[float, ...]] = []
    for k in range(len(times)):
        since += 1
        inhibited = max(0, inhibited - 1)
        pull, push = lever[k] == 1, lever[k] == 2
        before = mode
        if not inhibited:
            if mode in (0, 3) and pull and abs(speed) < 2.0:
                mode = 1
            elif (mode in (1, 2) and push and pedal[k] > 0.3) or (
                mode == 2 and throttle[k] > 0.45 and pedal[k] < 0.2 and since > 10
            ):
                mode = 3
        if mode == 1:
            clamp += 7 * dt
            if clamp >= 18:
                mode = 2
        elif mode == 3:
            clamp -= 11 * dt
            if clamp <= 0:
                mode = 0
        clamp = min(18.0, max(0.0, clamp))
        if mode != before:
            since = 0
            if mode in (1, 3):
                acts += 1
                heat += 1
                if heat > 3.2:
                    inhibited = 50
        heat = max(0.0, heat - 0.12 * dt)
        drive = (4.2 * throttle[k] - 9.8 * grade) * 1500 / mass
        grip = (9.0 * pedal[k] + 0.36 * clamp + 0.12) * 1500 / mass
        if abs(speed) < 0.05 and abs(drive) <= grip:
            speed = 0.0
        else:
            direction = copysign(1.0, speed if abs(speed) >= 0.05 else drive)
            new = speed + dt * (drive - direction * grip - 0.03 * speed)
            speed = 0.0 if speed * new < 0 else new
        position += dt * speed
        rows.append((speed, position, clamp, mode, acts))
    return columns(rows, "speed", "position", "clamp", "mode", "acts")


PARKING = requirements(
    parking,
    {
        "parking applies": "G[0,26] (abs(mode - 1) <= 0.5 -> F[0,4] (mode >= 1.5 and mode <= 2.5))",
        "parking actuations": "G (acts <= 6)",
        "parking ninth actuation": "G (acts <= 8)",
        "parking dragging": "G (not (speed >= 2.4 and clamp >= 9))",
    },
    {"speed": "real", "position": "real", "clamp": "real", "mode": "integer", "acts": "integer"},
    inputs=(numbers("lever", 0, 2, 6), line("pedal", 0, 1, 5), line("throttle", 0, 1, 5)),
    parameters=(ParameterRange("grade", -0.2, 0.2), ParameterRange("mass", 1200, 2400)),
    stop=30.0,
    interval=0.1,
)


def heatpump(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A heat pump with minimum run and pause times; frost is melted with heat of the room."""
    dt = 20.0
    room, frost, mode, since, running, starts, defrosts = 20.0, 0.2, 0, 600.0, 0.0, 0, 0
    outdoor, humid = inputs["outdoor"].tolist(), inputs["humidity"].tolist()
    wanted, window = inputs["setpoint"].tolist(), whole(inputs["window"])
    rows: list[tuple[float, ...]] = []
    for k, out in enumerate(outdoor):
        since += dt
        if mode == 0 and room < wanted[k] - 0.5 and since >= 300:
            mode, since = 1, 0.0
            starts += 1
        elif mode == 1:
            running += dt
            if frost > 1.0 and running >= 1200:
                mode, since, running = 2, 0.0, 0.0
                defrosts += 1
            elif room > wanted[k] + 0.5 and since >= 300:
                mode, since = 0, 0.0
        elif mode == 2 and (frost <= 0.05 or since >= 600):
            mode, since = (1, 0.0) if room < wanted[k] else (0, 0.0)
        heat = 0.0
        if mode == 1:
            heat = max(1.5, (7.0 + 0.15 * out) * (1 - 0.45 * min(frost, 1.6)))
            coil = out - 7
            wet = max(0.0, humid[k] - 0.45) * exp(-(((out - 1.0) / 5.0) ** 2))
            if coil < 0:
                frost += dt * 0.0016 * wet
        elif mode == 2:
            heat = -3.0
            frost = max(0.0, frost - dt * 0.003)
        elif out > 3:
            frost = max(0.0, frost - dt * 0.00008 * (out - 3))
        loss = (0.20 + 0.30 * window[k]) * (room - out)
        room += dt * (heat - loss) / 2500
        rows.append((room, frost, mode, starts, defrosts, room - wanted[k]))
    return columns(rows, "room", "frost", "mode", "starts", "defrosts", "deviation")


HEATPUMP = requirements(
    heatpump,
    {
        "heatpump starts": "G (starts <= 4)",
        "heatpump rests": "G[0,5400] (mode <= 0.5 -> F[0,1800] (mode >= 0.5 or deviation >= 1.6))",
        "heatpump cold defrost": "G (not (mode >= 1.5 and room <= 10.5))",
    },
    {
        "room": "real",
        "frost": "real",
        "mode": "integer",
        "starts": "integer",
        "defrosts": "integer",
        "deviation": "real",
    },
    inputs=(
        line("outdoor", -12, 12, 4),
        line("humidity", 0.3, 1, 4),
        held("setpoint", 18, 23, 5),
        switch("window", 6),
    ),
    stop=7200.0,
    interval=20.0,
)


def crossroads(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A traffic light with detectors, a button for pedestrians and a tram that takes precedence."""
    main, side = whole(inputs["main"]), whole(inputs["side"])
    button, tram = whole(inputs["button"]), whole(inputs["tram"])
    # 0 main green, 1 main amber, 2 side green, 3 side amber, 4 pedestrians, 5 clearing, 6 tram
    phase, since, request, waited, queue, served, skips = 0, 0.0, 0, 0.0, 0.0, 0, 0
    last_button = last_tram = taken = 0
    goal = 2
    rows: list[tuple[float, ...]] = []
    for k in range(len(times)):
        since += 0.5
        if button[k] and not last_button and phase != 4:
            request = 1
        called = tram[k] and not last_tram
        last_button, last_tram = button[k], tram[k]
        waited = waited + 0.5 if request else 0.0
        queue = max(0.0, queue + 0.5 * (0.35 * side[k] + 0.03) - (0.5 * 0.6 if phase == 2 else 0))
        before = phase
        if phase == 0:
            extend = main[k] and since < 28
            if tram[k] and since >= 4 and not taken:
                phase, goal = 1, 6
            elif since >= 10 and not extend and (queue >= 1 or request):
                phase = 1
                goal = 4 if request and (queue < 4 or skips >= 1) else 2
                if request and goal == 2:
                    skips += 1
        elif phase == 1 and since >= 3:
            phase = goal
        elif phase == 2:
            if (tram[k] and since >= 4) or (since >= 6 and queue < 0.5) or since >= 18:
                phase = 3
        elif phase == 3 and since >= 3:
            phase = 6 if tram[k] else (4 if request and skips >= 1 else 0)
        elif phase == 4:
            request = 0
            skips = 0
            if since >= 7:
                phase = 5
                served += 1
        elif phase == 5 and since >= 5:
            phase = 6 if tram[k] else 0
        elif phase == 6 and (since >= 20 or (not tram[k] and since >= 5)):
            phase = 0
        if called and phase == 6:
            since = 0.0
        taken = 1 if phase == 6 else 0 if phase in (2, 4) else taken
        if phase != before:
            since = 0.0
        rows.append((phase, waited, queue, served, skips))
    return columns(rows, "phase", "waited", "queue", "served", "skips")


CROSSROADS = requirements(
    crossroads,
    {
        "crossroads pedestrian waits": "G (waited <= 108)",
        "crossroads thrice": "G (served <= 2)",
        "crossroads until side": "(queue <= 23) U[0,150] (phase >= 1.5 and phase <= 2.5)",
    },
    {"phase": "integer", "waited": "real", "queue": "real", "served": "integer", "skips": "integer"},
    inputs=(switch("main", 6), switch("side", 6), switch("button", 6), switch("tram", 5)),
    stop=150.0,
    interval=0.5,
)


def lanekeeper(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A lane keeper that warns and hands over when its camera is bad or the hands are off the wheel."""
    dt = 0.1
    bends, wind = inputs["bend"].tolist(), inputs["wind"].tolist()
    quality, torque, hands = inputs["camera"].tolist(), inputs["torque"].tolist(), whole(inputs["hands"])
    offset = heading = steering = 0.0
    mode, poor, free, warnings, authority = 1, 0.0, 0.0, 0, 1.0
    speed = 25.0
    rows: list[tuple[float, ...]] = []
    for k, bend in enumerate(bends):
        poor = poor + dt if quality[k] < 0.35 else max(0.0, poor - 2 * dt)
        free = 0.0 if hands[k] else free + dt
        driver = torque[k] if hands[k] else 0.0
        if mode == 1 and (poor > 0.8 or free > 6.0):
            mode = 2
            warnings += 1
            since = 0.0
        elif mode == 2:
            since += dt
            if poor <= 0 and free < 6.0:
                mode = 1
            elif since > 2.5:
                mode = 3
        elif mode == 3 and hands[k] and quality[k] > 0.6 and abs(driver) < 1.0:
            mode = 1
        if mode == 1 and abs(driver) > 2.6:
            mode = 0
        elif mode == 0 and abs(driver) < 0.5 and quality[k] > 0.5 and hands[k]:
            mode = 1
        wanted = {0: 0.1, 1: 1.0, 2: 0.8, 3: 0.0}[mode]
        authority += max(-0.5 * dt, min(1.0 * dt, wanted - authority))
        trust = 0.5 + 0.5 * min(1.0, quality[k] / 0.5)
        command = authority * (bend * 2.8 * trust - 0.02 * offset - 0.5 * heading)
        if mode in (0, 3) and hands[k]:
            command += bend * 2.8 * 0.8 - 0.008 * offset - 0.3 * heading
        command += 0.0015 * driver
        steering += max(-0.05 * dt, min(0.05 * dt, command - steering))
        heading += dt * speed * (steering / 2.8 - bend) + dt * 0.004 * wind[k]
        offset += dt * speed * heading
        offset = max(-6.0, min(6.0, offset))
        rows.append((offset, mode, warnings, steering, authority))
    return columns(rows, "offset", "mode", "warnings", "steering", "authority")


LANEKEEPER = requirements(
    lanekeeper,
    {
        "lanekeeper warnings": "G (warnings <= 3)",
        "lanekeeper taken over": "not F[0,22] (mode <= 0.5 and F[0,6] (mode >= 2.5))",
        "lanekeeper left then right": "not F[0,20] (offset <= -5 and F[0,3] (offset >= 4))",
    },
    {"offset": "real", "mode": "integer", "warnings": "integer", "steering": "real", "authority": "real"},
    inputs=(
        line("bend", -0.004, 0.004, 6),
        line("wind", -2, 2, 4),
        line("camera", 0, 1, 5),
        held("torque", -3, 3, 5),
        switch("hands", 6),
    ),
    stop=30.0,
    interval=0.1,
)


def voter(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Three redundant sensors: one that differs is excluded; a reset admits those that agree again."""
    truth = inputs["truth"].tolist()
    drift = [inputs[f"drift{j}"].tolist() for j in range(3)]
    stuck = [whole(inputs[f"stuck{j}"]) for j in range(3)]
    reset = whole(inputs["reset"])
    value = [truth[0]] * 3
    valid, apart = [1, 1, 1], [0, 0, 0]
    output, safe, exclusions, last, differ = truth[0], 0, 0, 0, 0
    rows: list[tuple[float, ...]] = []
    for k, real in enumerate(truth):
        for j in range(3):
            if not stuck[j][k]:
                value[j] = real + drift[j][k]
        good = [j for j in range(3) if valid[j]]
        if len(good) == 3:
            voted = sorted(value)[1]
            differ = 0
        elif len(good) == 2:
            voted = 0.5 * (value[good[0]] + value[good[1]])
            differ = differ + 1 if abs(value[good[0]] - value[good[1]]) > 1.5 else 0
            if differ >= 5:
                safe = 1
        else:
            voted = output
        if len(good) == 3:
            for j in good:
                apart[j] = apart[j] + 1 if abs(value[j] - voted) > 1.0 else 0
            worst = max(range(3), key=lambda j: apart[j])
            if apart[worst] >= 8:
                valid[worst] = 0
                exclusions += 1
                apart = [0, 0, 0]
        if reset[k] and not last:
            for j in range(3):
                if not valid[j] and abs(value[j] - voted) < 0.4:
                    valid[j] = 1
            if safe and abs(max(value) - min(value)) < 0.8:
                safe = 0
        last = reset[k]
        if not safe:
            output += max(-0.4, min(0.4, voted - output))
        rows.append((output, output - real, sum(valid), safe, exclusions))
    return columns(rows, "output", "error", "valid", "safe", "exclusions")


VOTER = requirements(
    voter,
    {
        "voter error": "G (safe >= 0.5 or abs(error) <= 8.5)",
        "voter exclusions": "G (exclusions <= 2)",
        "voter excluded again": "not F[0,24] (valid <= 2.5 and X (valid >= 2.5 and F[0,1] (valid <= 2.5)))",
        "voter leaves safety": "G[0,20] (safe >= 0.5 -> G[0,10] (safe >= 0.5))",
    },
    {"output": "real", "error": "real", "valid": "integer", "safe": "integer", "exclusions": "integer"},
    inputs=(
        line("truth", 0, 10, 5),
        *(line(f"drift{j}", -2, 2, 4) for j in range(3)),
        *(switch(f"stuck{j}", 4) for j in range(3)),
        switch("reset", 5),
    ),
    stop=30.0,
    interval=0.1,
)
