"""Which engine finds the violations of fourteen systems from as many fields, by an author who saw no engine?

``python -m bench.function_fields`` prints the table of ``bench/example_systems.py`` for 42 requirements: of
the seven systems in this file and of the seven in ``bench/function_fields_more.py``. Of each system, uniform
samples violate the first requirement in one of 6 to 25 and the second in one of 75 to 2000. Of 4000 to 20,000
uniform samples, none violates the third, except one of 6000 with the boost converter. The engine was not
changed after the first look at them.
"""

from collections import deque
from collections.abc import Mapping
from math import cos, hypot, pi, sin

from bench.example_systems import Array, compare
from bench.function_fields_more import DUFFING, HAMMER, LIFT, PACK, PRESS, ROUTER, VALLEY
from bench.function_machines import columns, held, line, numbers, requirements, switch, whole
from falsifier.core.ranges import ParameterRange


def drum(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """The drum of a boiler: swell and shrink, a feed that misreads them, a trip that cuts the fire."""
    demand, fire, cold = inputs["demand"].tolist(), inputs["fire"].tolist(), inputs["cold"].tolist()
    mass, pressure, lag, integral, low, trip, trips = 0.0, 1.0, 0.6, 0.6, 0, 0, 0
    rows: list[tuple[float, ...]] = []
    for k, wanted in enumerate(demand):
        steam = wanted * pressure
        lag += (steam - lag) / 15
        level = mass + 0.5 * (steam - lag) - 0.25 * (cold[k] * integral)
        integral = min(1.2, max(0.0, integral - 0.012 * level))
        feed = min(1.2, max(0.0, integral - 0.4 * level))
        mass += 0.02 * (feed - steam)
        pressure = max(0.2, pressure + 0.01 * ((0.05 if trip else fire[k]) - steam - 0.2 * cold[k] * feed))
        low = low + 1 if level < -0.35 else 0
        if not trip and low >= 5:
            trip, trips = 1, trips + 1
        elif trip and level > -0.1:
            trip = 0
        rows.append((level, pressure, trip, trips, steam))
    return columns(rows, "level", "pressure", "trip", "trips", "steam")


DRUM = requirements(
    drum,
    {
        "drum swells": "G (level <= 0.65)",
        "drum trips": "G (trips <= 2)",
        "drum trips, then swells at high pressure": (
            "not F[0,200] (trip >= 0.5 and F[20,60] (level >= 0.4 and F[0,40] (pressure >= 1.6)))"
        ),
    },
    {"level": "real", "pressure": "real", "trip": "integer", "trips": "integer", "steam": "real"},
    inputs=(held("demand", 0.2, 1, 10), line("fire", 0.2, 1.1, 5), line("cold", 0, 1, 4)),
    stop=300.0,
    interval=1.0,
)


def handshake(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A server: 1 SYN, 2 ACK, 3 DATA, 4 FIN, 5 RST; it waits 4 s for an ACK, and 5 s after a FIN."""
    messages, lost = whole(inputs["message"]), whole(inputs["lost"])
    state, since, last, words, sessions, leaked, old, stale = 0, 0.0, 0, 0, 0, 0, 0, 0
    rows: list[tuple[float, ...]] = []
    for message, gone in zip(messages, lost, strict=True):
        since += 0.25
        got = message if message != last and not gone else 0
        last = message
        if state == 1 and since > 4:
            state, leaked = 0, leaked + 1
        elif state == 3 and since > 5:
            state, old = 0, 0
        if got == 5:
            state, old = 0, 0
        elif state == 0 and got == 1:
            state, since = 1, 0.0
        elif state == 1 and got == 2:
            state, since, words = 2, 0.0, 0
        elif state == 2 and got == 3:
            words += 1
            stale += old >= 1
        elif state == 2 and got == 4:
            state, since = 3, 0.0
            sessions += words > 0
            old = words
        elif state == 3 and got == 1:
            state, since = 1, 0.0
        rows.append((state, sessions, leaked, stale, words))
    return columns(rows, "state", "sessions", "leaked", "stale", "words")


HANDSHAKE = requirements(
    handshake,
    {
        "handshake leaks": "G (leaked <= 1)",
        "handshake session": "G (sessions <= 0)",
        "handshake accepts stale data": "G (stale <= 1)",
    },
    dict.fromkeys(("state", "sessions", "leaked", "stale", "words"), "integer"),
    inputs=(numbers("message", 0, 6, 18), switch("lost", 9)),
    stop=36.0,
    interval=0.25,
)


def boost(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A boost converter, averaged: too much current stops it for a while, and often so locks it out."""
    dt, coil, capacity = 0.02, parameters["coil"], parameters["capacity"]
    duty, load, supply = inputs["duty"].tolist(), inputs["load"].tolist(), inputs["supply"].tolist()
    current, voltage, off, hiccups, heat = 0.0, 12.0, 0, 0, 0.0
    rows: list[tuple[float, ...]] = []
    for k, ratio in enumerate(duty):
        for _ in range(2):
            on = 0.0 if off else ratio
            current = max(0.0, current + dt / 2 * (supply[k] - (1 - on) * voltage - 0.3 * current) / coil)
            voltage += dt / 2 * ((1 - on) * current - load[k] * voltage / 10) / capacity
        heat += dt * (0.004 * current * current - 0.3 * heat)
        off = max(0, off - 1)
        if current > 14 + 6 * parameters["core"] and not off:
            off, hiccups = 25, hiccups + 1
        rows.append((current, voltage, hiccups, heat))
    return columns(rows, "current", "voltage", "hiccups", "heat")


BOOST = requirements(
    boost,
    {
        "boost voltage": "G (voltage <= 45)",
        "boost hiccups": "G (hiccups <= 5)",
        "boost collapses from above": "G[0,8] (voltage >= 75 -> G[0,2] (voltage >= 8))",
    },
    {"current": "real", "voltage": "real", "hiccups": "integer", "heat": "real"},
    inputs=(held("duty", 0, 0.8, 12), held("load", 0.1, 3, 8), line("supply", 8, 16, 3)),
    parameters=(
        ParameterRange("coil", 0.1, 0.6),
        ParameterRange("capacity", 0.02, 0.2),
        ParameterRange("core", 0, 1),
    ),
    stop=10.0,
    interval=0.02,
)


def toggle(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A genetic toggle switch: two repressors, an inducer and a warmth push it over; toxin while between."""
    dt, rate = 0.1, parameters["rate"]
    inducer, warmth = inputs["inducer"].tolist(), inputs["warmth"].tolist()
    first, second, side, flips, toxin = parameters["start"], 1.0, 0, 0, 0.0
    rows: list[tuple[float, ...]] = []
    for k, sugar in enumerate(inducer):
        free = second / (1 + (sugar / 0.4) ** 2)
        damp = 1 + 2.5 * max(0.0, warmth[k] - 0.5)
        first += dt * (rate / (1 + free**2.5) + 0.05 - first * damp)
        second += dt * (rate / (1 + first**2) + 0.05 - second)
        if side <= 0 and first > 2.5 * second:
            side, flips = 1, flips + (side != 0)
        elif side >= 0 and second > 2.5 * first:
            side, flips = -1, flips + (side != 0)
        toxin += dt * (0.4 * min(first, second) - 0.1 * toxin)
        rows.append((first, second, flips, toxin))
    return columns(rows, "first", "second", "flips", "toxin")


TOGGLE = requirements(
    toggle,
    {
        "toggle toxin": "G (toxin <= 3.5)",
        "toggle flips": "G (flips <= 4)",
        "toggle flips, is poisoned and rests": (
            "G (flips <= 5) or G[20,50] (toxin <= 3.2) or G[40,60] (second <= 2.5)"
        ),
    },
    {"first": "real", "second": "real", "flips": "integer", "toxin": "real"},
    inputs=(line("inducer", 0, 1, 9), held("warmth", 0, 1, 7)),
    parameters=(ParameterRange("rate", 2, 5), ParameterRange("start", 0.2, 4)),
    stop=60.0,
    interval=0.1,
)


def rocket(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A sounding rocket that is designed by fourteen numbers and two whole ones; it weathercocks."""
    p, dt = parameters, 0.1
    motor, fins = whole(inputs["motor"])[0], whole(inputs["fins"])[0]
    mass, x, y, vx, vy = p["shell"] + p["payload"] + p["fuel"], 0.0, 0.0, 0.0, 0.0
    tilt, spin, open_at, parachute = p["rail"], 0.0, -1.0, 0
    thrust, burn = p["thrust"] * (0.8 + 0.1 * motor), p["fuel"] * p["impulse"] / p["thrust"]
    rows: list[tuple[float, ...]] = []
    for time in times.tolist():
        wind = p["wind"] * min(1.0, max(0.0, y) / p["layer"]) ** 0.3
        rx, ry = vx - wind, vy
        speed = hypot(rx, ry)
        pressure = 0.6 * speed * speed
        push = thrust if time < burn else 0.0
        area = 0.008 * p["calibre"] ** 2
        drag = pressure * area * (p["roughness"] * 0.4 + 0.05 * fins * p["fin"])
        if open_at < 0 < time and vy < 0 and y > 5:
            open_at = time + p["delay"]
        if not parachute and 0 <= open_at <= time and y > 0:
            parachute = 1
        drag += pressure * p["canopy"] * parachute
        slip = (rx * cos(tilt) - ry * sin(tilt)) / max(speed, 1.0)
        spin += dt * (0.02 * min(pressure, 900) * fins * p["fin"] * p["margin"] * slip - 1.5 * spin)
        tilt = max(-pi, min(pi, tilt + dt * spin * (1 - parachute)))
        ax = (push * sin(tilt) - drag * rx / max(speed, 0.1)) / mass
        ay = (push * cos(tilt) - drag * ry / max(speed, 0.1)) / mass - 9.8
        if y <= 0 and time > 1:
            ax = ay = vx = vy = y = 0.0
        limit = 0.5 / dt
        ax = max(-limit * max(10, abs(rx)), min(limit * max(10, abs(rx)), ax))
        ay = max(-limit * max(10, abs(ry)), min(limit * max(10, abs(ry)), ay))
        vx, vy = vx + dt * ax, vy + dt * ay
        x, y = x + dt * vx, max(0.0, y + dt * vy)
        mass -= dt * p["fuel"] / burn if time < burn else 0.0
        rows.append((x, y, pressure / 1000, abs(slip) * min(1, pressure / 500), vy, parachute))
    return columns(rows, "x", "y", "load", "slip", "climb", "parachute")


ROCKET = requirements(
    rocket,
    {
        "rocket height": "G (y <= 3500)",
        "rocket turns up high": "G (y <= 2000 or slip <= 0.5)",
        "rocket hits the stand": (
            "not (F (y >= 1200) and F[5,60] (1 <= y <= 20 and abs(x + 200) <= 8 and climb <= -50))"
        ),
    },
    {"x": "real", "y": "real", "load": "real", "slip": "real", "climb": "real", "parachute": "integer"},
    inputs=(numbers("motor", 0, 4, 1), numbers("fins", 3, 6, 1)),
    parameters=(
        ParameterRange("shell", 4, 10),
        ParameterRange("payload", 0.5, 4),
        ParameterRange("fuel", 1, 4),
        ParameterRange("thrust", 200, 900),
        ParameterRange("impulse", 1200, 2200),
        ParameterRange("calibre", 0.7, 1.5),
        ParameterRange("roughness", 0.8, 2),
        ParameterRange("fin", 0.5, 2),
        ParameterRange("margin", 0.5, 3),
        ParameterRange("rail", -0.15, 0.15),
        ParameterRange("wind", -12, 12),
        ParameterRange("layer", 50, 500),
        ParameterRange("delay", 0, 20),
        ParameterRange("canopy", 0.2, 1.5),
    ),
    stop=60.0,
    interval=0.1,
)


def offices(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Three rooms and their air; the frost guard of the coil shuts the damper. Six inputs do little."""
    dt = 2.0
    rooms, coil, frost, guards, stuffy = [20.0, 20.0, 20.0], 20.0, 0, 0, 400.0
    value = {name: series.tolist() for name, series in inputs.items()}
    rows: list[tuple[float, ...]] = []
    for k in range(len(times)):
        outside, people, pump = value["outside"][k], value["people"][k], value["pump"][k]
        damper = 0.0 if frost else value["damper"][k]
        small = sum(value[f"lamp{n}"][k] for n in range(1, 6)) * 0.01
        supply = coil * (1 - damper) + damper * (0.7 * outside + 0.3 * coil) + small
        heat = max(0.0, 22 - supply) * (0.1 + 0.9 * pump)
        coil += dt / 10 * (0.5 * outside * damper + (1 - 0.5 * damper) * rooms[0] + 0.9 * heat - coil)
        if not frost and coil < 5:
            frost, guards = 1, guards + 1
        elif frost and coil > 12:
            frost = 0
        for n, gain in enumerate((2.0, 4.0, 7.0)):
            sun = value["sun"][k] * gain if n else 1.0
            blind = 1 - 0.7 * value["blind"][k]
            rooms[n] += (
                dt / 60 * (0.8 * (supply - rooms[n]) + 0.2 * (outside - rooms[n]) + sun * blind + 2 * people)
            )
        stuffy += dt * (12 * people - 0.06 * (damper + 0.05) * (stuffy - 400))
        rows.append((*rooms, coil, guards, stuffy / 1000))
    return columns(rows, "north", "east", "south", "coil", "guards", "stuffy")


OFFICES = requirements(
    offices,
    {
        "offices stuffy": "G[60,480] F[0,120] (stuffy <= 0.92)",
        "offices frost": "G (guards <= 1)",
        "offices frost, then heat": "G[0,400] (coil <= 4 -> G[60,200] (south <= 24 or stuffy <= 1.5))",
    },
    {
        "north": "real",
        "east": "real",
        "south": "real",
        "coil": "real",
        "guards": "integer",
        "stuffy": "real",
    },
    inputs=(
        line("outside", -15, 30, 5),
        held("damper", 0, 1, 6),
        held("pump", 0, 1, 4),
        line("people", 0, 1, 5),
        line("sun", 0, 1, 4),
        line("blind", 0, 1, 2),
        switch("radio", 3),
        *(line(f"lamp{n}", 0, 1, 2) for n in range(1, 6)),
    ),
    stop=600.0,
    interval=2.0,
)


def insulin(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """An artificial pancreas: slow insulin, a biased sensor, suspension when low."""
    dt, sensitive = 5.0, parameters["sensitive"]
    meal, effort, bias = inputs["meal"].tolist(), inputs["effort"].tolist(), inputs["bias"].tolist()
    glucose, gut, depot, plasma, action, held_off, rescues = 120.0, 0.0, 1.0, 1.0, 1.0, 0, 0
    past = deque([120.0] * (1 + int(parameters["delay"] / dt)), maxlen=1 + int(parameters["delay"] / dt))
    rows: list[tuple[float, ...]] = []
    for k, carbs in enumerate(meal):
        past.append(glucose + bias[k])
        seen, slope = past[0], past[-1] - past[0]
        dose = max(0.0, 1 + 0.02 * (seen - 120) + 0.03 * slope - 0.15 * (plasma - 1))
        if seen < 75:
            held_off, rescues = 12, rescues + (held_off == 0)
        dose = 0.0 if held_off else min(6.0, dose)
        held_off = max(0, held_off - 1)
        gut += dt / 40 * (max(0.0, carbs - 40) - gut)
        depot += dt / 50 * (dose - depot)
        plasma += dt / 40 * (depot - plasma)
        action += dt / 60 * (plasma * sensitive - action)
        glucose += dt * (
            0.045 * gut
            + 1.4
            - 0.9 * action * glucose / 120
            - 0.9 * effort[k] * (glucose > 60)
            - 0.004 * (glucose - 120)
        )
        glucose = max(20.0, glucose)
        rows.append((glucose, plasma, action, rescues))
    return columns(rows, "glucose", "plasma", "action", "rescues")


INSULIN = requirements(
    insulin,
    {
        "insulin high": "G (glucose <= 300)",
        "insulin low for long": "G[0,1380] F[0,60] (glucose >= 64)",
        "insulin low, then high": "G[0,1140] (glucose <= 57 -> G[0,300] (glucose <= 240))",
    },
    {"glucose": "real", "plasma": "real", "action": "real", "rescues": "integer"},
    inputs=(held("meal", 0, 120, 12), line("effort", 0, 1, 8), line("bias", -30, 30, 6)),
    parameters=(ParameterRange("sensitive", 0.7, 1.6), ParameterRange("delay", 5, 40)),
    stop=1440.0,
    interval=5.0,
)


FIRST = (DRUM, HANDSHAKE, BOOST, TOGGLE, ROCKET, OFFICES, INSULIN)
SYSTEMS = (*FIRST, LIFT, PRESS, ROUTER, DUFFING, HAMMER, PACK, VALLEY)
PROBLEMS = {name: make for system in SYSTEMS for name, make in system.items()}

if __name__ == "__main__":
    compare(PROBLEMS, __doc__)
