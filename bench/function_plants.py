"""Which engine finds the violations of ten systems whose author had not seen any engine?

``python -m bench.function_plants`` prints the table of ``bench/example_systems.py`` for 34 requirements: of
the five systems in this file and of the five in ``bench/function_controllers.py``. ``bench/unseen.md``
says what was changed after them.
"""

from collections import deque
from collections.abc import Mapping
from math import copysign, exp, log10, sin

from bench.example_systems import Array, compare
from bench.function_controllers import CROSSROADS, HEATPUMP, LANEKEEPER, PARKING, VOTER
from bench.function_machines import columns, held, line, numbers, requirements, switch, whole
from falsifier.core.ranges import ParameterRange


def turbine(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A wind turbine: pitch by a PI controller with a limited rate, a tower that swings, a limited torque."""
    dt = 0.2
    rotor, pitch, integral, tower, sway = 1.0, 8.0, 8.0, 0.25, 0.0
    wind, gust, grid = inputs["wind"].tolist(), inputs["gust"].tolist(), inputs["grid"].tolist()
    rows: list[tuple[float, ...]] = []
    for k, mean in enumerate(wind):
        apparent = max(0.5, mean + gust[k] - sway)
        tip = rotor / apparent * 12
        power = max(0.0, 0.46 - 0.018 * max(pitch, 0) * (tip / 0.9) - 0.25 * (tip - 0.95) ** 2)
        aero = power * (apparent / 12) ** 3 / max(rotor, 0.2) / 0.46
        generator = min(1.0, rotor * rotor) * grid[k]
        rotor = max(0.1, rotor + dt * (aero - generator) / 5.0)
        error = rotor - 1.0
        schedule = 1 / (1 + pitch / 12)
        integral = min(25.0, max(0.0, integral + dt * 9 * schedule * error))
        command = min(25.0, max(0.0, integral + 55 * schedule * error))
        pitch += max(-3 * dt, min(3 * dt, command - pitch))
        thrust = (apparent / 12) ** 2 * max(0.1, 0.9 - 0.04 * pitch)
        sway += dt * (1.6 * thrust - 4.0 * tower - 0.12 * sway)
        tower += dt * sway
        rows.append((rotor, pitch, tower, generator * rotor))
    return columns(rows, "rotor", "pitch", "tower", "power")


TURBINE = requirements(
    turbine,
    {
        "turbine speed": "G (rotor <= 1.65)",
        "turbine tower": "G[5,60] (tower <= 0.5)",
        "turbine speed after a lull": "G[10,50] (rotor <= 0.6 -> G[0,10] (rotor <= 1.35))",
    },
    {"rotor": "real", "pitch": "real", "tower": "real", "power": "real"},
    inputs=(line("wind", 7, 20, 6), line("gust", -3, 3, 6), held("grid", 0.7, 1, 4)),
    stop=60.0,
    interval=0.2,
)


def solar(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A photovoltaic converter: perturb and observe, and a bus that curtails and sheds load."""
    dt = 0.05
    size, store = parameters["step"], parameters["capacity"]
    sun, cell, load = inputs["sun"].tolist(), inputs["cell"].tolist(), inputs["load"].tolist()
    voltage, wanted, direction, last = 30.0, 30.0, 1, 0.0
    bus, mode, sheds, off = 400.0, 0, 0, 0
    rows: list[tuple[float, ...]] = []
    for k, light in enumerate(sun):
        a = 1.9 * (1 + 0.004 * (cell[k] - 25))
        dark = 8.0 / exp((38 - 0.14 * (cell[k] - 25)) / a)
        voltage += dt / 0.08 * (wanted - voltage)
        current = max(0.0, 8.0 * light / 1000 - dark * (exp(voltage / a) - 1))
        power = voltage * current
        if k % 4 == 0:
            if mode == 1:
                wanted = min(45.0, wanted + 2 * size)
            else:
                if power < last:
                    direction = -direction
                wanted = min(42.0, max(12.0, wanted + direction * size))
            last = power
        if mode == 0 and bus > 430:
            mode = 1
        elif mode == 1 and bus < 405:
            mode = 0
        off = max(0, off - 1)
        if bus < 350 and not off:
            off = 30
            sheds += 1
        used = 230 * load[k] * (0.2 if off else 1)
        battery = max(-60.0, min(60.0, 2.0 * (400 - bus)))
        bus = max(100.0, bus + dt * (power + battery - used) / (store * bus))
        rows.append((bus, power, voltage, mode, sheds, light))
    return columns(rows, "bus", "power", "panel", "mode", "sheds", "light")


SOLAR = requirements(
    solar,
    {
        "solar bus": "G (bus <= 505)",
        "solar sheds": "G (sheds <= 5)",
        "solar long curtailment": "G[0,10] (mode >= 0.5 -> F[0,5] (mode <= 0.5))",
        "solar curtails and sheds": "G (sheds <= 2.5) or G (bus <= 460)",
    },
    {"bus": "real", "power": "real", "panel": "real", "mode": "integer", "sheds": "integer", "light": "real"},
    inputs=(line("sun", 100, 1000, 6), line("cell", 0, 60, 3), held("load", 0, 1, 5)),
    parameters=(ParameterRange("step", 0.1, 1.5), ParameterRange("capacity", 0.005, 0.02)),
    stop=15.0,
    interval=0.05,
)


def infusion(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """An infusion pump: a clamped line builds up pressure, an alarm stops it until it is acknowledged."""
    dt = 2.0
    rates, clamp, arm = inputs["rate"].tolist(), inputs["clamp"].tolist(), inputs["arm"].tolist()
    bubbles, ack = whole(inputs["bubble"]), whole(inputs["ack"])
    pressure, mode, high, alarms, air, given, last = 0.0, 0, 0.0, 0, 0.0, 0.0, 0
    short = 0.0
    rows: list[tuple[float, ...]] = []
    for k, rate in enumerate(rates):
        back = 3.0 * arm[k]
        opening = max(0.0, 1 - clamp[k]) ** 2
        pumped = rate if mode == 0 else (0.5 if mode == 3 else 0.0)
        flow = max(0.0, pressure - back) * (0.02 + 4.0 * opening)
        flow = min(flow, pressure / dt * 1.5 + pumped)
        pressure = max(0.0, pressure + dt * (pumped - flow) * 0.11)
        high = high + dt if pressure > 30 else 0.0
        air = max(0.0, air + dt * 0.004 * (bubbles[k] == 2) * pumped - dt * 0.002)
        if mode == 0:
            if high >= 10:
                mode = 1
                alarms += 1
            elif air > 0.5:
                mode = 2
                alarms += 1
        elif ack[k] and not last:
            if mode == 2:
                air = 0.0
            mode, high = 0, 0.0
        last = ack[k]
        given += dt * flow
        short = max(0.0, short + dt * (rate - flow) / 60)
        rows.append((pressure, flow, mode, alarms, air, given, short, flow - rate))
    return columns(rows, "pressure", "flow", "mode", "alarms", "air", "given", "short", "bolus")


INFUSION = requirements(
    infusion,
    {
        "infusion bolus": "G (bolus <= 12)",
        "infusion alarms": "G (alarms <= 3)",
        "infusion air, then pressure": "not F[0,480] (mode >= 1.5 and F[0,30] (mode >= 0.5 and mode <= 1.5))",
    },
    {
        "pressure": "real",
        "flow": "real",
        "mode": "integer",
        "alarms": "integer",
        "air": "real",
        "given": "real",
        "short": "real",
        "bolus": "real",
    },
    inputs=(
        held("rate", 0, 12, 5),
        line("clamp", 0, 1.2, 4),
        line("arm", 0, 4, 4),
        numbers("bubble", 0, 2, 6),
        switch("ack", 6),
    ),
    stop=600.0,
    interval=2.0,
)


def joint(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A joint of a robot: motor, backlash, a link that is loaded, and a cascade of controllers."""
    dt = 0.02
    gap, load, stiff = parameters["gap"], parameters["load"], parameters["stiffness"]
    reference, push = inputs["reference"].tolist(), inputs["push"].tolist()
    motor = motor_speed = link = link_speed = integral = 0.0
    rows: list[tuple[float, ...]] = []
    for k, wanted in enumerate(reference):
        torque = 0.0
        peak = 0.0
        for _ in range(3):
            h = dt / 3
            error = wanted - motor
            integral = max(-0.5, min(0.5, integral + h * error))
            drive = max(-12.0, min(12.0, 60 * error + 40 * integral - 6.0 * motor_speed))
            twist = motor - link
            play = twist - gap if twist > gap else (twist + gap if twist < -gap else 0.0)
            torque = stiff * play + (1.2 * (motor_speed - link_speed) if play else 0.0)
            if abs(torque) > abs(peak):
                peak = torque
            motor_speed += h * (drive - torque - 0.5 * motor_speed) / 0.25
            link_speed += h * (torque + push[k] - 0.4 * link_speed - 1.5 * load * sin(link)) / load
            motor += h * motor_speed
            link += h * link_speed
        rows.append((link, peak, wanted - link, link_speed))
    return columns(rows, "link", "torque", "error", "speed")


JOINT = requirements(
    joint,
    {
        "joint fast and far": "G (speed <= 4.7 or link <= 1.6)",
        "joint torque": "G (abs(torque) <= 31)",
        "joint settles": "G[0.5,4] (abs(error) >= 0.35 -> F[0,2] (abs(error) <= 0.2))",
        "joint swings over": "G[0.5,5] (link <= -1.4 -> G[0,1] (link <= 1.6))",
    },
    {"link": "real", "torque": "real", "error": "real", "speed": "real"},
    inputs=(held("reference", -1, 1, 5), line("push", -4, 4, 4)),
    parameters=(
        ParameterRange("gap", 0.0, 0.06),
        ParameterRange("load", 0.4, 2.0),
        ParameterRange("stiffness", 60, 250),
    ),
    stop=6.0,
    interval=0.02,
)


def dosing(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A neutralization with a dead time: base is dosed into acid waste water; a guard holds the outlet."""
    dt = 2.0
    delay, gain = int(parameters["delay"] / dt), parameters["gain"]
    flow, acid = inputs["flow"].tolist(), inputs["acid"].tolist()
    base = inputs["base"].tolist()
    # concentration of strong base minus acid, mmol/l
    pipe = deque([0.0] * (delay + 1), maxlen=delay + 1)
    excess, integral, dose, outlet, closings, hold = 0.0, 0.5, 0.5, 1, 0, 0
    rows: list[tuple[float, ...]] = []
    for k, stream in enumerate(flow):
        pipe.append(dose)
        excess += dt * (stream * (-acid[k] - excess) + pipe[0] * base[k]) / 60
        ph = 7 + copysign(log10(1 + abs(excess) * 1000 / 10), excess)
        error = 7 - ph
        integral = min(1.0, max(0.0, integral + dt * gain * 0.004 * error))
        dose = min(1.0, max(0.0, integral + gain * 0.06 * error))
        bad = abs(ph - 7) > 2
        hold = 15 if bad else max(0, hold - 1)
        if outlet and bad:
            outlet = 0
            closings += 1
        elif not outlet and hold == 0:
            outlet = 1
        rows.append((ph, dose, outlet, closings))
    return columns(rows, "ph", "dose", "outlet", "closings")


DOSING = requirements(
    dosing,
    {
        "dosing alkaline": "G (ph <= 9.5)",
        "dosing closings": "G (closings <= 5)",
        "dosing long closed": "G[0,360] F[0,240] (outlet >= 0.5)",
    },
    {"ph": "real", "dose": "real", "outlet": "integer", "closings": "integer"},
    inputs=(line("flow", 0.4, 2, 4), held("acid", 0, 3, 5), line("base", 4, 7, 3)),
    parameters=(ParameterRange("delay", 4, 40), ParameterRange("gain", 0.3, 2)),
    stop=600.0,
    interval=2.0,
)


SYSTEMS = (PARKING, HEATPUMP, TURBINE, CROSSROADS, SOLAR, INFUSION, LANEKEEPER, JOINT, DOSING, VOTER)
PROBLEMS = {name: make for system in SYSTEMS for name, make in system.items()}

if __name__ == "__main__":
    compare(PROBLEMS, __doc__)
