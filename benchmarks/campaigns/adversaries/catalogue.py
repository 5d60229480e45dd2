"""All families, and the problem of each number."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from campaigns.adversaries import (
    beams,
    bottomless,
    curves,
    eigenvalues,
    energy,
    fast,
    kinked,
    landscapes,
    layers,
    ledges,
    narrow,
    obstacles,
    slopes,
    switches,
)
from campaigns.statement import Adversary, Disguise, Statement, disguised

SEED = 1696
"""The year of Johann Bernoulli's challenge."""


@dataclass(frozen=True)
class Family:
    """Problems of one kind; ``shifted`` where their origin may be moved without blurring a singularity."""

    title: str
    drawn: Callable[[np.random.Generator], Statement]
    shifted: bool = True


FAMILIES = {
    "jumps": Family("jumps of a stiffness in x", switches.jumps),
    "stairs": Family("floor and fmod of x", switches.stairs),
    "kinks": Family("kinks of a stiffness in x", switches.kinks),
    "loads": Family("kinks and jumps of a load in x", switches.loads),
    "friction": Family("kinks in the slope", kinked.friction),
    "total variation": Family("total variation beside data", kinked.total_variation),
    "crossings": Family("kinks in y that are crossed", kinked.crossed_levels),
    "dead cores": Family("kinks in y that may be followed", kinked.dead_cores),
    "refraction": Family("layers of different index", layers.refraction),
    "steps": Family("floor, ceil and remainder of y", layers.stairs),
    "spots": Family("soft spots of width 1e-6 to 0.1", narrow.spots),
    "grains": Family("loads on a width of 1e-6 to 0.1", narrow.grains),
    "slots": Family("slots in y of width 1e-6 to 0.1", narrow.slots),
    "switched slots": Family("slots in y with kinks and jumps", narrow.switched_slots),
    "ledges": Family("bodies at rest beside jumps", ledges.ledges),
    "stops": Family("bodies at rest at a bound", ledges.stops),
    "fast loads": Family("loads of frequency 10 to 1e5", fast.fast_loads),
    "fast coefficients": Family("stiffnesses of frequency 10 to 1e5", fast.fast_coefficients),
    "walls": Family("walls and wells in y", energy.walls),
    "double wells": Family("long kinks of a double well", energy.double_wells),
    "heteroclinic": Family("long kinks of no energy", energy.heteroclinic),
    "sine-Gordon": Family("long kinks of a pendulum", energy.sine_gordon),
    "superquadratic": Family("no bound: v² - cyᵖ", bottomless.superquadratic),
    "oscillators": Family("oscillators about their conjugate length", bottomless.oscillators),
    "weights": Family("singular weights |x|ᵃ", bottomless.weights, shifted=False),
    "polar": Family("straight lines about an origin", bottomless.polar, shifted=False),
    "rims": Family("films that tear at a rim", bottomless.rims),
    "films": Family("films next to their fold", curves.films),
    "torn": Family("films beyond their fold", curves.torn),
    "descents": Family("descents with a guard", curves.guarded_descents, shifted=False),
    "corners": Family("non-convex slopes under a load", slopes.loaded_corners),
    "sectors": Family("slopes at which L jumps", slopes.sectors),
    "zigzags": Family("non-convex slopes alone", slopes.zigzags),
    "Bolza": Family("Bolza's example", slopes.bolza),
    "bumps": Family("strings over narrow bumps", obstacles.bumps),
    "tents": Family("strings over sharp tents", obstacles.tents),
    "posts": Family("strings over narrow posts", obstacles.posts),
    "beams": Family("beams over obstacles", beams.over_obstacles),
    "steep beams": Family("beams under a bound on the slope", beams.steep),
    "bent": Family("beams through kinks and jumps", beams.bent),
    "oscillating": Family("eigenvalues of wide and periodic wells", eigenvalues.oscillating),
    "wells": Family("eigenvalues of pairs of wells", eigenvalues.wells),
    "hills": Family("landscapes of hills", landscapes.hills),
    "tilted wells": Family("tilted double wells", landscapes.tilted_wells),
    "distant wells": Family("wells that barely pay for the way", landscapes.distant_wells),
}


def statement(family: str, number: int) -> Statement:
    """The problem of a family that has this number, as its least value is known."""
    seeds = [SEED, *family.encode(), number]
    return FAMILIES[family].drawn(np.random.default_rng(seeds))


@lru_cache(maxsize=8)
def adversary(family: str, number: int) -> Adversary:
    """The problem of a family that has this number, in coordinates of its own; the same in every process."""
    seeds = [SEED, *family.encode(), number, 1]
    return disguised(statement(family, number), Disguise.drawn(np.random.default_rng(seeds), FAMILIES[family].shifted))
