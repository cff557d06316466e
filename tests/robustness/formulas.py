"""Hostile formulas."""

from __future__ import annotations

import random

from tests.robustness.case import CANARY

__all__ = ["ATTACKS", "BOUNDS", "LAWS", "nested", "random_formula"]

#: Formulas that try to run code, and what is no formula at all, or no number.
ATTACKS = [
    f"__import__('os').system('touch {CANARY}')", f"open('{CANARY}','w')", f"exec('open(\"{CANARY}\",\"w\")')",
    "().__class__.__bases__[0].__subclasses__()", f"(lambda: open('{CANARY}','w'))()",
    f"[open('{CANARY}','w') for _ in [1]]",
    "r.__class__", "x if x else y", "x and y", "x or 1", "not x", "x < 1", "x @ y", "x // 2", "x % 2", "~x", "x[0]",
    "'a'*10**9",
    "9**9**9", "9**9**9**9", "2**10**10", "1e308*10", "10**400", "x**x**x", "(-1)**0.5", "1/0", "0/0", "log(0)",
    "log(-1)",
    "sqrt(-1)", "exp(1e9)", "tan(pi/2)", "0*log(0)", "x=1", "x:=1", "import os", "print(1)", "abs", "sin", "sin()",
    "sin(1,2)",
    "max()", "max(1)", "min(x=1)", "max(*[1])", "1_000", "0x10", "1j", "1e", "1e+", ".", "1..2", "x x", "xx", "π",
    "x\u2212y",
    "sin(x", "x)", "((", ",", "\"", "None", "True", "...", "f'{x}'", "lambda x: x", "await x", "x;y", "x\ny", "x#y",
    "\\", "a" * 2000,
    "1" * 500, "1" * 5000, "e", "inf", "nan", "-", "+x", "--x", "x--1", "1/x", "x/0", "x^0.5", "abs(x)^0.5", "z",
    "r", "s", "t",
]  # fmt: skip


def nested(rng: random.Random, variable: str) -> str:
    """A formula that is deep, or long."""
    depth = rng.choice([5, 20, 30, 40, 80, 150, 250, 5000])
    kind = rng.choice(
        ["abs", "sin", "brackets", "minus", "sum", "product", "sines", "power", "min", "piecewise", "sqrt"]
    )
    inner = variable
    match kind:
        case "abs" | "sin" | "sqrt":
            for i in range(depth):
                inner = f"{kind}({inner} - 0.{i})" if kind == "abs" else f"{kind}({inner})"
        case "brackets":
            inner = "(" * depth + inner + ")" * depth
        case "minus":
            inner = "-" * depth + inner
        case "sum":
            inner = "+".join([inner] * depth)
        case "product":
            inner = "*".join([inner] * depth)
        case "sines":
            inner = "*".join([f"sin({rng.choice(['', '2*', '7*'])}{inner})" for _ in range(min(depth, 120))])
        case "power":
            inner = "^".join([inner] * min(depth, 80))
        case "min":
            inner = f"min({', '.join(f'{variable}+{i}' for i in range(depth))})"
        case "piecewise":
            inner = (
                "piecewise(" + ", ".join(f"({i}*{variable}, {variable} < {i})" for i in range(depth)) + f", {variable})"
            )
    return inner


#: Potentials of r that are hard or no potentials.
LAWS = [
    "abs(sin(100*r))", "sin(1000*r)", "sqrt(abs(r))", "abs(r)^0.9", "-r^2", "r^3", "-abs(r)", "r^4", "exp(r)",
    "exp(100*r)",
    "-exp(r)", "log(1 + abs(r))", "1/r", "1/(r - 0.01)", "tan(r)", "tan(100*r)", "sin(1/r)", "r*sin(1/r)",
    "r^2*sin(1/r)",
    "piecewise((0, r < 0), (1, True))", "piecewise((r, True), (2*r, r < 1))", "piecewise((r, r < 0))", "piecewise()",
    "piecewise((1, 2))", "piecewise((r, r < 0), r)", "piecewise((0, r < 0), (1e6*r, r < 1e-9), (1, True))",
    "abs(abs(abs(r)))",
    "abs(r - 0.1) + abs(r + 0.1)", "max(r, 0)^1.5", "max(r, 0)^0.5", "max(r,0)^2 - max(r - 0.1,0)^2*2", "tanh(1000*r)",
    "tanh(1e6*r)/1e6", "min(r^2, 0.01)", "min(abs(r), 0.1)", "max(r, r^2, r^3)", "abs(r)*r", "1e300*r^2",
    "1e-300*r^2", "r^0",
    "0*r", "5", "r", "-r", "cos(r)^2 + sin(r)^2", "7/10*abs(r) - 3/10*exp(-abs(r))", "log(abs(r))", "r*log(abs(r))",
    "r^r",
    "abs(r)^1.0000001", "sqrt(r^2 + 1e-20)", "sqrt(r^2)", "(r^2)^0.5", "abs(r)^2^0.5", "exp(-1/r^2)", "exp(-r^2)*1e3",
    "6e-4*(1+tanh((r-1)/3e-4))", "max(r,0)*1e308", "abs(sin(abs(sin(abs(10*r)))))", "min(max(r,-1),1)^2",
]  # fmt: skip#: Friction bounds of s.
BOUNDS = [
    "8*s", "min(8*s, 0.8)", "-1", "-s", "s", "6e-4*(1+tanh((s-1)/3e-4))", "1/s", "sqrt(s)", "sqrt(abs(s))",
    "abs(sin(100*s))",
    "piecewise((0, s < 0), (1, True))", "1e300*s", "exp(s)", "exp(1000*s)", "log(s)", "tanh(1e6*s)", "max(s, 0)^0.5",
    "0", "0.2",
    "0.3 - s", "0.3 + 1000*max(s,0)", "x", "r", "nan", "inf", "s^2", "sin(s)", "abs(s)", "max(s - 1e-6, 0)*1e6",
]  # fmt: skip


def random_formula(rng: random.Random, variable: str, depth: int) -> str:
    """A formula of random operations."""
    if depth == 0 or rng.random() < 0.15:
        return rng.choice([variable, variable, f"{rng.uniform(-2, 2):.3g}", "0", "1", "1e-3", "pi"])
    inner = random_formula(rng, variable, depth - 1)
    if rng.random() < 0.5:
        return f"{rng.choice(['sin', 'cos', 'tanh', 'exp', 'log', 'sqrt', 'abs', '-', ''])}({inner})"
    other = random_formula(rng, variable, depth - 1)
    return rng.choice(
        [f"({inner}) + ({other})", f"({inner}) * ({other})", f"({inner}) / ({other})", f"min({inner}, {other})",
         f"max({inner}, {other})", f"({inner})^{rng.choice([2, 3, 0.5, -1])}",
         f"piecewise(({inner}, {variable} < {rng.uniform(-0.1, 0.2):.3g}), {other})"]
    )  # fmt: skip
