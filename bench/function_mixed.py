"""Which engine finds the violations of twelve systems with inputs, parameters and initial states to search?

``python -m bench.function_mixed`` prints the table of ``bench/example_systems.py`` for 36 requirements, whose
author had not seen any engine: of the seven vehicles and plants in this file, and of the five controllers and
machines in ``bench/function_mixed_machines.py``; each has three, from the easiest to the hardest.
"""

from collections import deque
from collections.abc import Mapping
from math import cos, exp, pi, sin

from bench.example_systems import Array, compare
from bench.function_machines import columns, held, line, requirements, switch, whole
from bench.function_mixed_machines import CASCADE, CELL, CHARGER, HVAC, INSULIN
from falsifier.core.ranges import ParameterRange


def bounded(value: float, low: float, high: float) -> float:
    """Return the nearest value in a range."""
    return min(high, max(low, value))


def platoon(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Two trucks follow a leader; each brakes with its own mass, after a delay, better with radio."""
    dt = 0.2
    mass = (parameters["mass1"], parameters["mass2"])
    headway, lag = parameters["headway"], round(parameters["delay"] / dt)
    gap = [parameters["gap1"], parameters["gap2"]]
    speed = [parameters["speed"]] * 3
    pipes = [deque([0.0] * (lag + 1), maxlen=lag + 1) for _ in gap]
    drive, slope, radio = inputs["drive"].tolist(), inputs["slope"].tolist(), whole(inputs["radio"])
    done = [0.0, 0.0, 0.0]
    rows: list[tuple[float, ...]] = []
    for k, wanted in enumerate(drive):
        before = list(speed)
        speed[0] = bounded(speed[0] + dt * wanted, 0.0, 33.0)
        done[0] = (speed[0] - before[0]) / dt
        for j in (0, 1):
            error = gap[j] - 4.0 - headway * before[j + 1]
            ahead = 0.7 * done[j] if radio[k] else 0.0
            pipes[j].append(bounded(0.25 * error + 0.7 * (before[j] - before[j + 1]) + ahead, -6.0, 2.0))
            real = pipes[j][0] / mass[j] - 9.8 * slope[k]
            speed[j + 1] = bounded(before[j + 1] + dt * real, 0.0, 36.0)
            done[j + 1] = (speed[j + 1] - before[j + 1]) / dt
            gap[j] = max(-2.0, gap[j] + dt * (speed[j] - speed[j + 1]))
        rows.append((*gap, *speed[1:], speed[2] - speed[1], done[2]))
    return columns(rows, "gap1", "gap2", "v1", "v2", "closing", "a2")


PLATOON = requirements(
    platoon,
    {
        "platoon gap": "G (gap1 >= 2)",
        "platoon hard braking": "G[0,30] (a2 <= -3 -> F[0,8] (gap2 >= 12 or v2 <= 2))",
        "platoon last one crashes": "G (gap1 <= 20 or gap2 >= 1 or closing <= 4)",
    },
    {"gap1": "real", "gap2": "real", "v1": "real", "v2": "real", "closing": "real", "a2": "real"},
    inputs=(line("drive", -4, 2, 6), line("slope", -0.05, 0.05, 4), switch("radio", 5)),
    parameters=(
        ParameterRange("mass1", 0.7, 1.5),
        ParameterRange("mass2", 0.7, 1.5),
        ParameterRange("headway", 0.8, 2.0),
        ParameterRange("delay", 0.0, 0.8),
        ParameterRange("gap1", 15, 60),
        ParameterRange("gap2", 15, 60),
        ParameterRange("speed", 12, 28),
    ),
    stop=40.0,
    interval=0.2,
)


def battery(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Four cells in series: balanced while they rest, derated when hot, opened for 15 s at their limits."""
    charge = [parameters[f"charge{j}"] for j in range(4)]
    aged = (1.0, 1.0, parameters["resistance"], 1.0)
    size = (1.0, parameters["capacity"], 1.0, 1.0)
    cooling, balance, heat = parameters["cooling"], parameters["balance"], parameters["heat"]
    demand, ambient = inputs["demand"].tolist(), inputs["ambient"].tolist()
    derated, closed, bad, opens = 0, 0, 0, 0
    rows: list[tuple[float, ...]] = []
    for k, wanted in enumerate(demand):
        current = wanted * (0.4 if derated else 1.0) if closed == 0 else 0.0
        cold = 1.0 + max(0.0, 10.0 - heat) * 0.04
        volts = []
        low = min(charge)
        for j in range(4):
            leak = 0.0015 if charge[j] > low + balance and abs(current) < 0.4 else 0.0
            charge[j] = bounded(charge[j] - current * 0.005 / size[j] - leak, 0.0, 1.05)
            rest = 3.0 + 1.1 * charge[j] - 0.35 * exp(-18.0 * charge[j])
            volts.append(rest - 0.12 * aged[j] * cold * current)
        loss = sum(aged) * cold * current * current
        heat += 0.20 * loss - 0.03 * cooling * (heat - ambient[k])
        if heat > 45:
            derated = 1
        elif heat < 40:
            derated = 0
        bad = bad + 1 if min(volts) < 3.0 or max(volts) > 4.2 or heat > 60 else 0
        closed = max(0, closed - 1)
        if bad >= 3 and closed == 0:
            closed, bad = 15, 0
            opens += 1
        rows.append((min(volts), max(volts), heat, max(charge) - min(charge), opens, closed, derated))
    return columns(rows, "low", "high", "heat", "spread", "opens", "rest", "derated")


BATTERY = requirements(
    battery,
    {
        "battery spread": "G[100,200] (spread <= 0.36)",
        "battery cools": "G[0,150] (heat >= 45 -> F[0,50] (heat <= 42))",
        "battery full, then empty": "not F[0,140] (high >= 4.2 and F[0,60] (low <= 3.05))",
    },
    {
        "low": "real",
        "high": "real",
        "heat": "real",
        "spread": "real",
        "opens": "integer",
        "rest": "integer",
        "derated": "integer",
    },
    inputs=(line("demand", -1.5, 1.5, 8), line("ambient", -10, 40, 3)),
    parameters=(
        *(ParameterRange(f"charge{j}", 0.3, 0.8) for j in range(4)),
        ParameterRange("resistance", 1.0, 2.5),
        ParameterRange("capacity", 0.8, 1.0),
        ParameterRange("cooling", 0.6, 1.6),
        ParameterRange("balance", 0.01, 0.1),
        ParameterRange("heat", 10, 35),
    ),
    stop=200.0,
    interval=1.0,
)


def crane(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A gantry crane with a rope that is hoisted while it travels, and a damping of its swing."""
    dt = 0.1
    rope, load, damping = parameters["rope"], parameters["load"], parameters["damping"]
    angle, rate, place, speed = parameters["angle"], parameters["rate"], 0.0, 0.0
    travel, hoist, wind = inputs["travel"].tolist(), inputs["hoist"].tolist(), inputs["wind"].tolist()
    rows: list[tuple[float, ...]] = []
    for k, wanted in enumerate(travel):
        lift = hoist[k] if 3.0 < rope - dt * hoist[k] < 14.0 else 0.0
        if (place > 15 and wanted > 0) or (place < -15 and wanted < 0):
            wanted = 0.0
        pull = bounded(1.2 * (wanted - speed) + damping * angle * 4.0, -0.8, 0.8) / (1 + 0.04 * load)
        for _ in range(2):
            h = dt / 2
            speed += h * pull
            place += h * speed
            rope -= h * lift
            gust = 0.5 * wind[k] / load
            turn = -9.8 * sin(angle) - pull * cos(angle) + gust * cos(angle) + 2 * lift * rate
            rate += h * (turn / rope - 0.02 * rate)
            angle += h * rate
        rows.append((angle, place + rope * sin(angle), rope * cos(angle), place, speed))
    return columns(rows, "angle", "x", "depth", "trolley", "speed")


CRANE = requirements(
    crane,
    {
        "crane swing": "G (abs(angle) <= 0.2)",
        "crane calms down": "F[0,24] G[0,6] (abs(angle) <= 0.12)",
        "crane obstacle": "not F[0,20] (x <= -8 and F[0,10] (x >= 5 and depth <= 4))",
    },
    {"angle": "real", "x": "real", "depth": "real", "trolley": "real", "speed": "real"},
    inputs=(held("travel", -1.5, 1.5, 5), line("hoist", -0.5, 0.5, 4), line("wind", -1, 1, 4)),
    parameters=(
        ParameterRange("rope", 4, 12),
        ParameterRange("load", 0.5, 8),
        ParameterRange("damping", 0.0, 1.0),
        ParameterRange("angle", -0.08, 0.08),
        ParameterRange("rate", -0.05, 0.05),
    ),
    stop=30.0,
    interval=0.1,
)


def ship(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A ship that rolls in waves; it has no stabilizer (0), fins that need speed (1), or a tank (2)."""
    dt = 0.4
    stable, damping, fill = parameters["gm"], parameters["damping"], parameters["fill"]
    kind = int(parameters["stabilizer"])
    roll, rate, tank, flow, phase, speed, shift = parameters["roll"], 0.0, 0.0, 0.0, 0.0, 5.0, 0.0
    height, period, wind = inputs["height"].tolist(), inputs["period"].tolist(), inputs["wind"].tolist()
    rudder, engine = inputs["rudder"].tolist(), inputs["engine"].tolist()
    rows: list[tuple[float, ...]] = []
    for k, high in enumerate(height):
        for _ in range(2):
            h = dt / 2
            phase += h * 2 * pi / period[k]
            speed += h * 0.05 * (9.0 * engine[k] - speed)
            right = 0.40 * stable * (1 + 0.06 * high * cos(0.5 * phase)) * roll * (1 - (roll / 1.3) ** 2)
            force = 0.010 * high * sin(phase) + 0.0011 * wind[k] + 0.0004 * rudder[k] * speed
            fins = 0.005 * speed * speed * rate if kind == 1 else 0.0
            water = 0.0
            if kind == 2:
                own = 0.15 + 0.6 * fill
                flow += h * (-0.20 * flow - own * tank - 0.8 * roll)
                tank += h * flow
                water = 0.05 * fill * tank
            rate += h * (
                force - water - right - fins - damping * rate - 0.4 * rate * abs(rate) + 0.15 * shift
            )
            roll = bounded(roll + h * rate, -1.5, 1.5)
            if abs(roll) > 0.6:
                shift = bounded(shift + h * 0.15 * roll, -0.4, 0.4)
        rows.append((roll * 180 / pi, rate * 180 / pi, speed, tank, shift))
    return columns(rows, "roll", "rate", "speed", "tank", "shift")


SHIP = requirements(
    ship,
    {
        "ship slows down in waves": "G[0,100] (height >= 3 -> F[0,20] (speed <= 6.5))",
        "ship upright again": "G[0,70] (abs(roll) >= 20 -> F[0,40] G[0,10] (abs(roll) <= 15))",
        "ship cargo": "G[0,120] (abs(roll) <= 50)",
    },
    {"roll": "real", "rate": "real", "speed": "real", "tank": "real", "shift": "real"},
    inputs=(
        line("height", 0, 4, 5),
        line("period", 6, 16, 4),
        held("wind", -20, 20, 4),
        line("rudder", -20, 20, 5),
        held("engine", 0, 1, 4),
    ),
    parameters=(
        ParameterRange("gm", 0.9, 2.2),
        ParameterRange("damping", 0.03, 0.12),
        ParameterRange("fill", 0.0, 1.0),
        ParameterRange("roll", -0.15, 0.15),
        ParameterRange("stabilizer", 0, 2, kind="enumeration", items=(("none", 0), ("fins", 1), ("tank", 2))),
    ),
    stop=120.0,
    interval=0.4,
)


def flare(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """An airliner lands by itself: it holds its glide, flares at a height, and may bounce."""
    dt = 0.1
    mass, centre, begin, gain = (parameters[name] for name in ("mass", "centre", "begin", "gain"))
    height, air, path = parameters["height"], parameters["speed"], -parameters["sink"]
    wind, rise, bump = inputs["wind"].tolist(), inputs["rise"].tolist(), inputs["stick"].tolist()
    pitch, turn, flaring, contacts, impact, touching, last = 0.06, 0.0, 0, 0, 0.0, 0, wind[0]
    rows: list[tuple[float, ...]] = []
    for k, head in enumerate(wind):
        if height < begin and not flaring:
            flaring = 1
        wish = -parameters["sink"] if not flaring else -0.5 - 0.06 * max(0.0, height)
        idle = flaring or contacts
        air += (head - last) * 0.8 + dt * (-0.9 if idle else 0.3 * (parameters["speed"] - air))
        air = max(40.0, air)
        last = head
        command = 0.06 + gain * 0.03 * (wish - path) + 0.02 * bump[k]
        if contacts:
            command = 0.03 + 0.02 * bump[k]
        aft = 1.0 - 2.2 * (centre - 0.25)
        turn += dt * (4.0 * (command - pitch) - 2.8 * aft * turn)
        pitch = bounded(pitch + dt * turn, -0.15, 0.3)
        angle = pitch - (path - rise[k] * min(1.0, 0.2 + height / 40)) / air
        ground = 1 + 0.10 * exp(-max(0.0, height) / 10)
        lift = ground * (0.45 + 5.2 * min(angle, 0.24)) * (air / 72) ** 2 * 60 / mass / 0.775
        path += dt * 9.8 * (lift - 1)
        height += dt * path
        if height <= 0:
            if not touching:
                contacts += 1
                impact = max(impact, -path)
            touching = 1
            height = 0.0
            path = -0.39 * path if path < -0.9 else max(0.0, path * 0.2)
        elif height > 0.3:
            touching = 0
        rows.append((height, path, air, pitch * 180 / pi, contacts, impact))
    return columns(rows, "height", "path", "air", "pitch", "contacts", "impact")


FLARE = requirements(
    flare,
    {
        "flare hard landing": "G (impact <= 2.3)",
        "flare tail": "G (height <= 0.3 -> pitch <= 8)",
        "flare bounces": "G (contacts <= 1)",
    },
    {
        "height": "real",
        "path": "real",
        "air": "real",
        "pitch": "real",
        "contacts": "integer",
        "impact": "real",
    },
    inputs=(line("wind", -10, 10, 5), line("rise", -3, 3, 5), held("stick", -1, 1, 4)),
    parameters=(
        ParameterRange("mass", 50, 75),
        ParameterRange("centre", 0.15, 0.35),
        ParameterRange("begin", 6, 20),
        ParameterRange("gain", 0.4, 1.6),
        ParameterRange("height", 25, 50),
        ParameterRange("speed", 66, 80),
        ParameterRange("sink", 2.5, 4.5),
    ),
    stop=25.0,
    interval=0.1,
)


def reactor(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A semi-batch reactor: it is dosed after warming up, until an interlock closes the dosing."""
    p = parameters
    warm, sour, fed, product = p["warm"], p["charge"], 0.0, 0.0
    jacket, dosing, stops, closed = 40.0, 0, 0, 0.0
    fouled = 1.0 - p["fouling"]
    water, stir = inputs["water"].tolist(), inputs["stirrer"].tolist()
    left = p["dose"]
    rows: list[tuple[float, ...]] = []
    for k, cold in enumerate(water):
        if dosing == 0 and warm >= p["begin"]:
            dosing = 1
        if warm > p["limit"] and closed <= 0 and dosing:
            closed = 8.0
            stops += 1
        closed -= 0.5
        rate = p["rate"] if dosing and closed <= 0 and left > 0 else 0.0
        left -= 0.5 * rate
        mixed = 0.85 + 0.15 * stir[k]
        for _ in range(2):
            h = 0.25
            speed = p["activity"] * 0.05 * exp(min(6.0, p["energy"] * (1 - 330 / (273 + warm)))) * mixed
            reacted = min(fed / h * 0.9, speed * fed * sour)
            fed += h * (rate - reacted)
            sour -= h * min(sour * 0.5, reacted)
            product += h * reacted
            wanted = bounded(p["target"] + p["control"] * (p["target"] - warm), 20 + cold, 90)
            jacket += h * 0.15 * (wanted - jacket)
            warm += h * (p["heat"] * 60 * reacted - 0.06 * fouled * (warm - jacket))
            warm = min(400.0, warm)
        rows.append((warm, fed, product, stops, jacket))
    return columns(rows, "warm", "fed", "product", "stops", "jacket")


REACTOR = requirements(
    reactor,
    {
        "reactor warm": "G (warm <= 82)",
        "reactor cools": "G[0,120] (warm >= 85 -> F[0,25] (warm <= 75))",
        "reactor runaway": "G (fed <= 0.8 or warm <= 90)",
    },
    {"warm": "real", "fed": "real", "product": "real", "stops": "integer", "jacket": "real"},
    inputs=(line("water", -5, 5, 3), line("stirrer", 0, 1, 3)),
    parameters=(
        ParameterRange("warm", 15, 40),
        ParameterRange("charge", 0.8, 1.5),
        ParameterRange("fouling", 0.0, 0.5),
        ParameterRange("dose", 0.6, 1.4),
        ParameterRange("rate", 0.01, 0.05),
        ParameterRange("begin", 35, 50),
        ParameterRange("limit", 70, 90),
        ParameterRange("activity", 0.4, 1.6),
        ParameterRange("energy", 10, 25),
        ParameterRange("target", 50, 65),
        ParameterRange("control", 0.5, 3),
        ParameterRange("heat", 0.6, 1.4),
    ),
    stop=150.0,
    interval=0.5,
)


def motor(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A servo drive: speed controller, current limit, sags of the supply, a trip when its winding is hot."""
    dt = 0.0125
    inertia, friction, limit = parameters["inertia"], parameters["friction"], parameters["limit"]
    gain, reset, heat = parameters["gain"], parameters["reset"], parameters["heat"]
    wanted, load, sag = inputs["wanted"].tolist(), inputs["load"].tolist(), whole(inputs["sag"])
    speed = integral = current = 0.0
    tripped, trips, top, last = 0, 0, 0.0, wanted[0]
    rows: list[tuple[float, ...]] = []
    for k, reference in enumerate(wanted):
        if reference != last:
            top = 0.0
        last = reference
        for _ in range(2):
            h = dt / 2
            error = reference - speed
            command = gain * error + integral
            bound = 0.0 if tripped else limit
            if abs(command) < bound:
                integral += h * gain * reset * error
            elif tripped:
                integral = 0.0
            command = max(-bound, min(bound, command))
            supply = 150.0 if sag[k] else 300.0
            reach = max(0.0, (supply - 0.9 * abs(speed)) / 2.5)
            command = min(command, reach) if speed >= 0 else max(command, -reach)
            current += h * (command - current) / 0.01
            brake = load[k] * min(1.0, speed / 5.0) if speed > 0 else 0.0
            speed += h * (0.9 * current - brake - friction * speed) / inertia
            heat += h * (0.016 * current * current - 0.08 * (heat - 25.0))
        if not tripped and heat > 120:
            tripped = 1
            trips += 1
        elif tripped and heat < 110:
            tripped = 0
        top = max(top, speed - reference)
        rows.append((speed, reference - speed, top, current, heat, trips))
    return columns(rows, "speed", "error", "over", "current", "heat", "trips")


MOTOR = requirements(
    motor,
    {
        "motor overshoot": "G (speed <= 255)",
        "motor settles": "G[0,2.5] (abs(error) >= 50 -> F[0,2.5] (abs(error) <= 30))",
        "motor trips": "G (trips <= 1)",
    },
    {
        "speed": "real",
        "error": "real",
        "over": "real",
        "current": "real",
        "heat": "real",
        "trips": "integer",
    },
    inputs=(held("wanted", 0, 250, 5), line("load", 0, 15, 4), switch("sag", 5)),
    parameters=(
        ParameterRange("inertia", 0.02, 0.12),
        ParameterRange("friction", 0.0, 0.02),
        ParameterRange("gain", 0.2, 1.0),
        ParameterRange("reset", 1, 12),
        ParameterRange("limit", 20, 50),
        ParameterRange("heat", 20, 90),
    ),
    stop=5.0,
    interval=0.0125,
)


SYSTEMS = (
    *(PLATOON, BATTERY, CRANE, SHIP, FLARE, REACTOR),
    *(MOTOR, INSULIN, HVAC, CASCADE, CHARGER, CELL),
)
PROBLEMS = {name: make for system in SYSTEMS for name, make in system.items()}

if __name__ == "__main__":
    compare(PROBLEMS, __doc__)
