"""Evolutions against closed forms and independent numbers: errors, and orders where steps or meshes are refined.

    python benchmarks/evolution_verification.py
    python benchmarks/evolution_verification.py --case D5 D6 --slow

Cases: D1 relaxation, D2 memory of the penetration, D3 wear, D4 a fading bond, D5 a bar on a wall, D6 a bar on a spring,
D7 a bounce, D8 ring-down, D9 a sliding block, D10 stick-slip, D11 the loss of a rubbed sphere, D12 jumps, D13 a step of
the velocity in rate-and-state friction, D14 an earthquake cycle, D15 a manufactured motion in space and time, D16 a
ledger, D17 a screwed arch, D18 restarts, D19 rejected steps.  ``--slow`` takes the march of D14 along (minutes).

The problems stand in ``hemivar.gallery``, where the closed forms are derived.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg
from common import machine

import hemivar as hv
from hemivar import gallery
from hemivar.evolution import Evolution, History, March, Save, Scheme, march
from hemivar.evolution.discrete import discretize_evolution
from hemivar.evolution.initial import initial_state
from hemivar.evolution.march import marching
from hemivar.evolution.stepper import TimeStepper
from hemivar.gallery.known_evolutions import KnownEvolution
from hemivar.gallery.moving_bodies import CANTILEVER
from hemivar.solvers import Controls

Array = np.ndarray
Row = dict[str, Any]


def row(case: str, what: str, known: float, found: float, refined: str = "", order: float | None = None) -> Row:
    """One line of the table; the error is relative unless the known value is zero."""
    error = abs(found - known) / (abs(known) or 1.0)
    return {
        "case": case,
        "what": what,
        "known": known,
        "found": found,
        "error": error,
        "refined": refined,
        "order": order,
    }


def series(
    case: str, what: str, known: float, measure: Callable[[float], float], steps: Sequence[float], name: str = "tau"
) -> Row:
    """The finest of some runs, and the slope of log |error| over log step."""
    values = [measure(step) for step in steps]
    errors = np.abs(np.array(values) - known)
    order = None
    if len(steps) > 1 and (errors > 0.0).all():
        order = float(np.polyfit(np.log(np.array(steps)), np.log(errors), 1)[0])
    return row(case, what, known, values[-1], f"{name} = " + ", ".join(f"{step:g}" for step in steps), order)


def known_series(case: str, what: str, known: KnownEvolution, counts: Sequence[int], scheme: Scheme) -> Row:
    """A block of the gallery in numbers of steps."""

    def measure(step: float) -> float:
        history = march(known.evolution, known.until, step=step, stops=known.stops, scheme=scheme)
        if known.quantity == "bond":
            (state,) = history.state.memory.values()
            return float(next(values for name, values in state.items() if "bond" in name)[0])
        return float(history[known.quantity][-1])

    return series(case, what, known.exact(known.until), measure, [known.until / count for count in counts])


# ---- blocks ------------------------------------------------------------------------------------------------


def d1(counts: Sequence[int] = (20, 40, 80)) -> list[Row]:
    known = gallery.relaxing_block()
    return [
        known_series("D1", f"pressure of a relaxing block, {scheme.name}", known, counts, scheme)
        for scheme in (hv.evolution.ImplicitEuler(), hv.evolution.SDIRK2())
    ]


def d2(counts: Sequence[int] = (10, 20, 40)) -> list[Row]:
    known = gallery.penetration_memory_block()
    return [known_series("D2", "penetration that is remembered", known, counts, hv.evolution.ImplicitEuler())]


def d3(counts: Sequence[int] = (16, 32, 64)) -> list[Row]:
    return [known_series("D3", "pressure on what wears", gallery.wearing_block(), counts, hv.evolution.ImplicitEuler())]


def d4(counts: Sequence[int] = (10, 20, 40)) -> list[Row]:
    return [known_series("D4", "bond that fades", gallery.bonded_block(), counts, hv.evolution.ImplicitEuler())]


def d7(steps: Sequence[float] = (8e-3, 4e-3, 2e-3)) -> list[Row]:
    known = gallery.bouncing_block()
    duration, restitution = gallery.bounce(100.0, 4.0)
    runs: dict[float, History] = {}

    def run(step: float) -> History:
        if step not in runs:
            runs[step] = march(known.evolution, 0.304, step=step, scheme=hv.evolution.Midpoint())
        return runs[step]

    def up(step: float) -> float:
        return float(np.abs(run(step).state.body.velocity).max()) / 0.5

    def touching(step: float) -> float:  # where the last forces, those of the middles of steps, point to zero
        force = run(step)["normal_force"]
        last = int(np.flatnonzero(force > 1e-6 * force.max())[-1])
        return (last - 0.5) * step + step * float(force[last] / (force[last - 1] - force[last]))

    return [
        series("D7", "restitution with a damper that cannot pull", restitution, up, steps),
        series("D7", "time in contact", duration, touching, steps),
    ]


def d9(steps: Sequence[float] = (0.1, 0.05)) -> list[Row]:
    known = gallery.sliding_block()

    def velocity(step: float) -> float:  # the largest error of all velocities before it stops
        history = march(known.evolution, 3.2, step=step, save=Save(probes={"c": (0.5, 0.1)}))
        speed = np.diff(history["c.u_x"]) / step
        return float(np.abs(speed - [known.exact(t) for t in history.times[1:]]).max())

    what = "velocities of a sliding block, largest error"
    return [row("D9", what, 0.0, velocity(tau), f"tau = {tau:g}") for tau in steps]


def d10(decays: Sequence[float] = (0.04, 0.02, 0.01)) -> list[Row]:
    known = gallery.StickSlip()
    found = {decay: stick_slip(known, decay) for decay in decays}
    wanted = (known.sticks, known.slips, known.peak, known.loss)
    words = ("time of sticking", "time of slipping", "largest slip rate", "heat of a period")
    return [
        series("D10", f"stick-slip: {word}", value, lambda decay, k=k: found[decay][k], decays, "tau = decay")
        for k, (word, value) in enumerate(zip(words, wanted, strict=True))
    ]


def stick_slip(known: gallery.StickSlip, decay: float) -> tuple[float, float, float, float]:
    """Times of sticking and slipping, largest slip rate and heat of a period.

    Steps are as long as ``decay``, by a scheme of order two: what is seen is how friction that falls over rates up to
    ``decay`` differs from friction that jumps.
    """
    until = known.begins + 2.0 * known.slips + known.sticks + 0.3 + 15.0 * decay
    probe = Save(probes={"p": (0.5, 0.0)})
    history = march(known.evolution(decay), until, step=decay, scheme=hv.evolution.GeneralizedAlpha(0.0), save=probe)
    times, friction = history.times, np.abs(history["friction_force"])
    # Friction falls from Fs to Fk where it begins to slip, and, after a peak, to less than Fk where it sticks.
    held = friction < known.kinetic - 0.5 * (known.static - known.kinetic)
    window = round(0.5 * known.slips / decay)
    free = [not held[max(k - window, 0) : k].any() and times[k] > known.begins for k in range(len(held))]
    rests = np.flatnonzero(held & free)
    pulls = friction > 0.5 * (known.static + known.kinetic)
    first, second = (int(np.flatnonzero(pulls[: rest - window])[-1]) for rest in rests[:2])
    rate = np.diff(history["p.u_x"]) / np.diff(times)
    heat = history["friction"]
    return (
        float(times[second] - times[rests[0]]),
        float(times[rests[0]] - times[first]),
        float(rate.max()),
        float(heat[rests[1]] - heat[rests[0]]),
    )


def d12(steps: Sequence[float] = (0.01, 0.005)) -> list[Row]:
    known = gallery.jumping_block()
    rows = []
    for jump, (up, down) in (("local", (0.3, 0.2)), ("global", (math.sqrt(0.06), math.sqrt(0.06)))):
        runs = {step: march(known.evolution, 0.8, step=step, stops=known.stops, jump=jump) for step in steps}
        places = {step: jumps(history) for step, history in runs.items()}
        for k, (word, place) in enumerate((("in", up), ("out", down))):
            values = [places[step][k] for step in steps]
            rows.append(row("D12", f"{jump} jump on the way {word}", place, values[-1], f"tau = {steps[-1]:g}"))
        if jump == "local":
            lost = [runs[step].ledger["jumps"] for step in steps]
            rows.append(row("D12", "energy lost in local jumps", known.exact(0.8), lost[-1], f"tau = {steps[-1]:g}"))
    return rows


def jumps(history: History) -> tuple[float, float]:
    """Depths at which the pressure drops on the way in, and comes back on the way out."""
    pushed, force = np.minimum(history.times, 0.8 - history.times), history["normal_force"]
    inward = history.times <= 0.4
    gone = pushed[inward][np.flatnonzero(force[inward] > 0.05)[-1]]
    return float(gone), float(pushed[~inward][np.flatnonzero(force[~inward] > 0.05)[0]])


def d13(count: int = 40) -> list[Row]:
    known = gallery.VelocityStep()
    history = march(known.evolution(), 8e6, step=8e6 / count, stops=(100.0,))
    times, coefficient = history.times, np.abs(history["friction_force"]) / 50.0
    exact = np.array([known.coefficient(t) for t in times])
    return [
        row("D13", "coefficient 100 s after the step, near its peak", exact[1], float(coefficient[1])),
        row("D13", "coefficient at V2 t = 10 L", exact[-1], float(coefficient[-1])),
        row("D13", "largest error on the way", 0.0, float(np.abs(coefficient - exact)[2:].max()), f"{count} steps"),
    ]


YEAR = 365.25 * 86400.0


def d14(slow: bool = False, rtols: Sequence[float] = (4e-3, 2e-3)) -> list[Row]:
    known = gallery.EarthquakeSlider()
    period, peak, low, high = known.cycle(1e-9)
    finer = known.cycle(1e-11)
    rows = [
        row("D14", f"{word}, of the equations, at a hundredth of the tolerance", b * unit, a * unit)
        for word, a, b, unit in zip(
            ("period (years)", "largest V", "least stress (MPa)", "largest stress (MPa)"),
            (period, peak, low, high), finer, (1.0 / YEAR, 1.0, 1e-6, 1e-6), strict=True,
        )
    ]  # fmt: skip
    if slow:
        found = [earthquakes(known, rtol, 2.05 * period) for rtol in rtols]
        for k, word in enumerate(("period (years), by marching", "largest stress (MPa)")):
            exact = (period / YEAR, high * 1e-6)[k]
            rows.append(row("D14", word, exact, found[-1][k], "rtol = " + ", ".join(map(str, rtols))))
    return rows


def earthquakes(known: gallery.EarthquakeSlider, rtol: float, until: float) -> tuple[float, float]:
    """Period in years and largest friction in MPa of a march."""
    steps = hv.evolution.AdaptiveStep(rtol, first_step=1e4, least=1e-4)
    history = march(known.evolution(0.06), until, step=steps, save=Save(probes={"p": (0.5, 0.0)}))
    rate = np.diff(history["p.u_x"]) / np.diff(history.times)
    fast = rate > 1e-3
    begins = history.times[2:][fast[1:] & ~fast[:-1]]
    later = history.times > begins[0] + 0.1 * YEAR
    return float(begins[-1] - begins[-2]) / YEAR, float(np.abs(history["friction_force"][later]).max()) * 1e-6


# ---- bars and bodies ---------------------------------------------------------------------------------------


def d5(cells: Sequence[int] = (16, 32, 64)) -> list[Row]:
    rows = []
    for mass, scheme in (("redistributed", hv.evolution.Newmark()), ("consistent", hv.evolution.MoreauJean())):
        runs = {1.0 / n: march(gallery.bar_on_wall(n, mass), 3.0, step=0.25 / n, scheme=scheme) for n in cells}

        def pressure(h: float, runs: dict[float, History] = runs) -> float:
            inside = np.abs(runs[h].times - 1.5) < 0.4
            return float(runs[h]["normal_force"][inside].mean() / h)

        def place(h: float, runs: dict[float, History] = runs) -> float:
            return float(runs[h]["penetration"][-1])

        steps, name = [1.0 / n for n in cells], f"{scheme.name}, {mass} mass"
        rows.append(series("D5", f"mean pressure on the wall, {name}", 0.5, pressure, steps, "h = 4 tau"))
        rows.append(series("D5", f"place at t = 3, {name}", -0.5, place, steps, "h = 4 tau"))
        ledger = runs[steps[-1]].state.ledger
        rows.append(row("D5", f"energy at t = 3, {name}", ledger.start, ledger.stored, f"h = {steps[-1]:g}"))
    return rows


def d6(cells: Sequence[int] = (16, 32, 64)) -> list[Row]:
    exact = 0.025 * (1.0 - math.exp(-4.0))

    def deep(h: float) -> float:
        evolution = gallery.thrown_bar(round(1.0 / h))
        return float(march(evolution, 1.0, step=0.5 * h, scheme=hv.evolution.GeneralizedAlpha(0.8))["penetration"][-1])

    def leaves(h: float) -> float:
        evolution = gallery.thrown_bar(round(1.0 / h))
        history = march(
            evolution,
            1.6,
            step=0.5 * h,
            scheme=hv.evolution.GeneralizedAlpha(0.8),
            events=[hv.evolution.Release("stop")],
        )
        return history.state.time

    steps = [1.0 / n for n in cells]
    return [
        series("D6", "penetration of a thrown bar at t = 1", exact, deep, steps, "h = 2 tau"),
        series("D6", "time at which it leaves", 1.41821665, leaves, steps, "h = 2 tau"),
    ]


def d8(step: float = 0.05) -> list[Row]:
    evolution = gallery.moving_bar(3, clamped=True)
    body = discretize_evolution(evolution)
    assert body.mass is not None
    values, modes = scipy.linalg.eigh(body.stiffness.inner.toarray(), body.mass.inner.toarray())
    evolution = replace(evolution, displacement=body.full(modes[:, 1]))
    rows = []
    for scheme, left in (
        (hv.evolution.ImplicitEuler(), 1.0 / (1.0 + values[1] * step**2)),
        (hv.evolution.Midpoint(), 1.0),
    ):
        history = march(evolution, 1.0, step=step, scheme=scheme)
        stored = history["elastic"] + history["kinetic"]
        ratio = stored[1:] / stored[:-1]
        worst = float(ratio[np.argmax(np.abs(ratio - left))])
        rows.append(row("D8", f"energy kept in a step, {scheme.name}", float(left), worst, f"tau = {step:g}"))
    return rows


def d11(cells: Sequence[float] = (3, 4, 6, 8)) -> list[Row]:
    """The known value is that for the force that was measured, so that each row has its own."""
    known = gallery.MindlinSphere()
    rows = []
    for count in cells:
        share, lost = rubbed(known, count)
        rows.append(row("D11", f"loss of a cycle, Q/(mu P) = {share:.3f}", known.loss(share), lost, f"{count:g} cells"))
    return rows


def rubbed(known: gallery.MindlinSphere, cells: float) -> tuple[float, float]:
    """Largest force over mu P, and the heat of a cycle."""
    history = march(known.evolution(cells, sides=4.0), 5.0, step=1.0)
    contact = history.discrete.problem.contact
    local = history.frames[-1].multiplier * [0.0, 1.0, 1.0]
    force = 4.0 * abs(float(contact.weights @ contact.global_vectors(local)[:, 0]))
    first = int(np.flatnonzero(history.times == 1.0)[0])
    return force / (known.friction * known.force), 4.0 * float(history["friction"][-1] - history["friction"][first])


def d15(sizes: Sequence[int] = (4, 8, 16)) -> list[Row]:
    """Against the exact displacement at all nodes when t = 1, and the exact pressure."""
    known = gallery.ManufacturedMotion()
    rows = []
    for scheme in (hv.evolution.ImplicitEuler(), hv.evolution.GeneralizedAlpha(0.8)):
        ends = {1.0 / n: march(known.evolution(n), 1.0, step=1.0 / n, scheme=scheme) for n in sizes}

        def place(h: float, ends: dict[float, History] = ends) -> float:
            frame, nodes = ends[h].frames[-1], ends[h].discrete.field.nodes
            return float(np.sqrt(((frame.displacement - known.displacement(nodes, 1.0)) ** 2).mean()))

        def slope(h: float, ends: dict[float, History] = ends) -> float:  # energy norm against the interpolant, order 2
            fine = replace(ends[h].discrete.evolution.problem, order=2)
            linear = ends[h].discrete.evolution.problem.mesh
            exact = discretize_evolution(Evolution(fine, inertia=True))
            nodes = exact.field.nodes
            whole = known.displacement(nodes, 1.0) - interpolated(linear, ends[h].frames[-1].displacement, nodes)
            return math.sqrt(2.0 * exact.stiffness.energy(exact.restrict(whole, np.zeros(len(exact.moved)))))

        steps = [1.0 / n for n in sizes]
        rows.append(series("D15", f"mean square error of u at nodes, {scheme.name}", 0.0, place, steps, "h = tau"))
        rows.append(series("D15", f"error in the energy norm, {scheme.name}", 0.0, slope, steps, "h = tau"))
    return rows


def interpolated(mesh: hv.Mesh, values: Array, nodes: Array) -> Array:
    """Values at the nodes of quadratic elements: those of the vertices, and means at the middles of edges."""
    first = np.sort(mesh.cells[:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2), axis=1)
    edges = np.unique(first, axis=0)
    places = np.concatenate([mesh.points, mesh.points[edges].mean(axis=1)])
    known = np.concatenate([values, values[edges].mean(axis=1)])
    keys = {tuple(key): k for k, key in enumerate(np.rint(places * 1e7).astype(int))}
    return known[[keys[tuple(key)] for key in np.rint(nodes * 1e7).astype(int)]]


def d16() -> list[Row]:
    known = CANTILEVER
    rows = []
    for inertia, name in ((True, "with mass"), (False, "without")):
        probe = Save(probes={"tip": (2.5, 0.0)})
        history = march(gallery.viscoelastic_cantilever(inertia), 3.2, step=0.1, save=probe)
        for axis, value in zip("xy", known[name], strict=True):
            rows.append(row("D16", f"u_{axis}(2.5, 0), {name}", value, float(history[f"tip.u_{axis}"][-1])))
        if inertia:
            for entry, value in known["ledger"].items():
                rows.append(row("D16", f"energy balance: {entry}", value, history.ledger[entry]))
            rows.append(row("D16", "energy balance: error", 0.0, history.ledger["gap"]))
    return rows


def d17(steps: Sequence[float] = (1 / 16, 1 / 32, 1 / 64), n: int = 8) -> list[Row]:
    """The authors print pictures: what can be measured is the order in the step, and what every run says of itself."""
    rows = []
    for name in ("four screws", "friction"):
        evolution = gallery.screwed_arch(name, n)
        runs = {step: march(evolution, 0.25, step=step) for step in (*steps, steps[-1] / 4.0)}
        best = runs[steps[-1] / 4.0]

        def off(step: float, runs: dict[float, History] = runs, best: History = best) -> float:
            gone = runs[step].state.body.displacement - best.state.body.displacement
            return math.sqrt(2.0 * best.discrete.stiffness.energy(gone) / (2.0 * best.state.ledger.elastic))

        rows.append(series("D17", f"arch, {name}: against a fourth of the finest step", 0.0, off, steps))
        gap = max(abs(run.ledger["gap"]) / run.state.ledger.elastic for run in runs.values())
        rows.append(row("D17", f"arch, {name}: balance error, relative to the elastic energy", 0.0, gap))
        least = best.margin
        rows.append(
            row("D17", f"arch, {name}: 1 if each step has one solution", 1.0, float(least > 0.0), f"{least:.3g}")
        )
    return rows


# ---- restarts and rejections -------------------------------------------------------------------------------


def bumpy() -> Evolution:
    """A body with mass, viscosity and a branch that falls onto springs and rubs."""
    material = hv.Material.lame(
        4, 4, density=1.0, viscosity=(0.4, 0.4), branches=[hv.materials.Branch(lame=(2, 2), time=0.5)]
    )
    problem = hv.ContactProblem(
        mesh=hv.rectangle((2.0, 1.0), (6, 3)),
        material=material,
        supports={"left": hv.Clamped()},
        body_force=(0.0, -0.5),
        contact={"bottom": hv.Contact(hv.Compliance(20.0), hv.Tresca(0.05), gap=0.02)},
    )
    return Evolution(problem, inertia=True)


def d18(stops: Sequence[int] = (1, 7, 15)) -> list[Row]:
    """A march that is broken off after some steps, and goes on from its file."""
    options: dict[str, Any] = {"scheme": hv.evolution.GeneralizedAlpha(0.8), "step": hv.evolution.AdaptiveStep(3e-3)}
    whole = march(bumpy(), 0.5, **options)
    worst = 0.0
    for stop in stops:
        with tempfile.TemporaryDirectory() as folder:
            kept = hv.evolution.Checkpoint(Path(folder) / "run.ckpt", 0.0)
            begun = marching(bumpy(), March(0.5, checkpoint=kept, **options))
            for _ in range(stop):
                next(begun)
            begun.close()
            again = march(bumpy(), 0.5, checkpoint=kept, resume=True, **options)
        same = [np.array_equal(again[name], whole[name], equal_nan=True) for name in whole.columns]
        same.append(np.array_equal(again.state.body.displacement, whole.state.body.displacement))
        worst += float(not all(same))
    return [
        row("D18", f"restarts after {', '.join(map(str, stops))} steps that are not bit for bit the same", 0.0, worst)
    ]


def d19() -> list[Row]:
    """Steps that are taken and forgotten."""
    advance = TimeStepper.of(discretize_evolution(bumpy()), hv.evolution.GeneralizedAlpha(0.8), None, Controls())
    state = initial_state(advance)
    first = advance.take(state, 0.1).state
    for step in (0.4, 0.05, 0.013):
        advance.take(state, step)
    again = advance.take(state, 0.1).state
    off = max(
        float(np.abs(again.body.displacement - first.body.displacement).max()),
        float(np.abs(again.multiplier - first.multiplier).max()),
        *(abs(again.ledger.record()[name] - value) for name, value in first.ledger.record().items()),
    )
    return [row("D19", "a step after three that were rejected: largest difference", 0.0, off)]


CASES: dict[str, Callable[..., list[Row]]] = {
    case.__name__.upper(): case
    for case in (d1, d2, d3, d4, d5, d6, d7, d8, d9, d10, d11, d12, d13, d14, d15, d16, d17, d18, d19)
}


def shown(rows: Sequence[Row]) -> str:
    """The rows as a Markdown table."""
    lines = ["| case | what | known | found | error | refined | order |", "|---|---|---|---|---|---|---|"]
    for one in rows:
        order = "" if one["order"] is None else f"{one['order']:.2f}"
        lines.append(
            f"| {one['case']} | {one['what']} | {one['known']:.9g} | {one['found']:.9g} | {one['error']:.1e} | "
            f"{one['refined']} | {order} |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--case", nargs="+", choices=list(CASES), default=list(CASES))
    parser.add_argument("--slow", action="store_true", help="march through earthquake cycles too (D14)")
    parser.add_argument("--json", type=Path, default=None, help="also write the rows to this file")
    options = parser.parse_args()
    rows: list[Row] = []
    seconds: dict[str, float] = {}
    for case in options.case:
        start = time.perf_counter()
        rows += d14(options.slow) if case == "D14" else CASES[case]()
        seconds[case] = time.perf_counter() - start
    print(shown(rows))
    print("\nseconds: " + ", ".join(f"{case} {spent:.1f}" for case, spent in seconds.items()))
    if options.json is not None:
        options.json.write_text(json.dumps({"machine": machine(), "rows": rows, "seconds": seconds}, indent=1))


if __name__ == "__main__":
    main()
