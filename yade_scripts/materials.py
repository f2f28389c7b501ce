"""Materials, masses and contact laws: one normal stiffness at every contact, rolling resistance truly on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

try:  # the arithmetic below needs no YADE, and `--help` must work without it
    import yade
except ImportError:
    yade = None


class ContactRules(NamedTuple):
    """What two touching discs, or a disc and a wall, do to each other. SI units."""

    normal_stiffness: float
    tangential_stiffness_ratio: float
    rolling_stiffness_ratio: float
    friction: float
    rolling_friction: float
    wall_friction: float

    @property
    def bears_moment(self) -> bool:
        """Whether contacts between discs resist rolling at all."""
        return self.rolling_stiffness_ratio > 0 and self.rolling_friction > 0


def contact_rules(values: Mapping[str, Any]) -> ContactRules:
    """Contact rules from a run's checked parameters."""
    return ContactRules(
        normal_stiffness=values["normal_stiffness"],
        tangential_stiffness_ratio=values["tangential_stiffness_ratio"],
        rolling_stiffness_ratio=values["rolling_stiffness_ratio"],
        friction=values["friction"],
        rolling_friction=values["rolling_friction"],
        wall_friction=values["wall_friction"],
    )


def frictionless(normal_stiffness: float, friction: float = 0.0) -> ContactRules:
    """Contact rules of the preparation: no rolling resistance, and no friction unless asked for."""
    return ContactRules(normal_stiffness, 0.5, 0.0, friction, 0.0, 0.0)


def radii_of(values: Mapping[str, Any], generator: np.random.Generator) -> np.ndarray:
    """(particle_count,) radii [m] in random order: two sizes in equal numbers, or uniform between them."""
    count, small, large = values["particle_count"], values["smallest_radius"], values["largest_radius"]
    if values["size_distribution"] == "uniform":
        # The quantiles of the distribution rather than draws from it, so that every seed has the same sizes.
        radii = small + (large - small) * (np.arange(count) + 0.5) / count
    else:
        radii = np.where(np.arange(count) < count // 2, large, small)
    return generator.permutation(radii)


def masses_and_inertias(
    radii: np.ndarray, density: float, mass: str, shape: str = "sphere"
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) masses [kg] and (n,) moments of inertia [kg m^2] of discs of radii (n,) [m] and one density [kg/m^3].

    `shape` "sphere": spheres; "cylinder": cylinders as high as the mean diameter. `mass` "true": each by its size;
    "equal": every disc the mean of the masses, and the inertia of a cylinder of that mass and its own radius.

    >>> masses, inertias = masses_and_inertias(np.array([1.0, 2.0]), 3 / (4 * math.pi), "equal")
    >>> masses.tolist(), inertias.tolist()
    ([4.5, 4.5], [2.25, 9.0])
    """
    if shape == "sphere":
        masses = density * 4 / 3 * math.pi * radii**3
    else:
        masses = density * math.pi * radii**2 * 2 * radii.mean()
    if mass == "equal":
        masses = np.full(len(radii), masses.mean())
    round_ones = shape == "sphere" and mass == "true"
    return masses, masses * radii**2 * (2 / 5 if round_ones else 1 / 2)


def add_discs(
    radii: np.ndarray, positions: np.ndarray, masses: np.ndarray, inertias: np.ndarray, rules: ContactRules
) -> None:
    """Put the discs into the simulation as bodies 0 to n-1, free to move in the plane alone."""
    materials: dict[float, Any] = {}
    for number in range(len(radii)):
        radius = float(radii[number])
        if radius not in materials:
            materials[radius] = yade.O.materials.append(_disc_material(radius, rules))
        disc = yade.utils.sphere(
            (float(positions[number, 0]), float(positions[number, 1]), 0.0), radius, material=materials[radius]
        )
        disc.state.mass = float(masses[number])
        disc.state.inertia = (float(inertias[number]),) * 3
        disc.state.blockedDOFs = "zXY"
        if yade.O.bodies.append(disc) != number:
            raise RuntimeError("discs must be the first bodies of the simulation")


def _disc_material(radius: float, rules: ContactRules) -> Any:
    # YADE makes a contact's stiffness 2 Ea Ra Eb Rb/(Ea Ra + Eb Rb): with E = kn/R it is kn for every pair of sizes.
    # Its rolling stiffness is Ra Rb times the tangential stiffness times alphaKr. The switch is off where no moment
    # is wanted, because the meaning of a zero or negative limit differs between releases.
    return yade.CohFrictMat(
        young=rules.normal_stiffness / radius,
        poisson=rules.tangential_stiffness_ratio,
        frictionAngle=math.atan(rules.friction),
        density=1.0,  # masses are set disc by disc
        isCohesive=False,
        momentRotationLaw=rules.bears_moment,
        alphaKr=rules.rolling_stiffness_ratio / rules.tangential_stiffness_ratio if rules.bears_moment else 1.0,
        alphaKtw=1.0,
        etaRoll=rules.rolling_friction if rules.bears_moment else 0.0,
        etaTwist=0.0,
    )


def wall_material(rules: ContactRules) -> Any:
    """Material of the walls: a plain frictional one, whose contacts have stiffnesses of their own and no moment."""
    return yade.FrictMat(
        young=1.0, poisson=0.5, density=1.0, frictionAngle=math.atan(rules.wall_friction), label="wall"
    )


def engines(rules: ContactRules, damping: float) -> list[Any]:
    """Engines of a step: move the bodies by the forces of the last one, then find contacts and their new forces.

    The integrator comes first so that between two steps everything belongs to one instant: positions, contact points
    and the forces that follow from them. (With the usual order the bodies have moved once since the forces were found.)
    """
    kn = yade.MatchMaker(algo="val", val=rules.normal_stiffness)
    kt = yade.MatchMaker(algo="val", val=rules.normal_stiffness * rules.tangential_stiffness_ratio)
    return [
        yade.NewtonIntegrator(damping=damping, warnNoForceReset=False, label="integrator"),
        yade.ForceResetter(),
        yade.InsertionSortCollider([yade.Bo1_Sphere_Aabb(), yade.Bo1_Box_Aabb()], label="collider"),
        yade.InteractionLoop(
            # The incremental rolling law reads angular velocities only: the orientations' history is dead weight.
            [yade.Ig2_Sphere_Sphere_ScGeom6D(updateRotations=False), yade.Ig2_Box_Sphere_ScGeom6D()],
            [
                yade.Ip2_CohFrictMat_CohFrictMat_CohFrictPhys(),
                yade.Ip2_FrictMat_FrictMat_FrictPhys(kn=kn, ks=kt),  # disc and wall
            ],
            [
                # The defaults of this law switch rolling resistance, and the memory of its plasticity, silently off.
                yade.Law2_ScGeom6D_CohFrictPhys_CohesionMoment(always_use_moment_law=True, useIncrementalForm=True),
                yade.Law2_ScGeom_FrictPhys_CundallStrack(),
            ],
        ),
    ]


def keep_rolling_stiffness(values: Mapping[str, Any], rules: ContactRules, mean_radius: float) -> None:
    """Set the rolling stiffness of every contact anew where `values` ask for the mean radius [m] in it."""
    if values["rolling_stiffness_radius"] == "mean" and rules.bears_moment:
        set_rolling_stiffness(values["rolling_stiffness_ratio"] * values["normal_stiffness"] * mean_radius**2)


def set_rolling_stiffness(stiffness: float) -> None:
    """Give every contact that resists rolling this stiffness [N m/rad], also where YADE made it from the pair's radii.

    YADE knows no other rule than the pair's, so new contacts have to be set again and again.
    """
    for interaction in yade.O.interactions:
        physics = interaction.phys
        if isinstance(physics, yade.CohFrictPhys):
            physics.kr = stiffness


def elastic_energy(rules: ContactRules, at_walls: Sequence[Any]) -> float:
    """Energy [J] stored in all contacts, in normal, tangential and rolling springs. `at_walls`: those with walls."""
    # These two sums read of a wall's contact only what every contact has, at the same place.
    law = yade.O.engines[3].lawDispatcher.functors[0]
    springs = law.normElastEnergy() + law.shearElastEnergy()
    if not rules.bears_moment:
        return float(springs)
    # YADE's sum takes every contact for one between discs, and would read what a wall's contact does not have.
    with _hidden(at_walls):
        return float(springs + law.bendingElastEnergy())


@contextmanager
def _hidden(contacts: Sequence[Any]) -> Iterator[None]:
    # Without its physics a contact is none for YADE's sums; the same object is put back.
    physics = [contact.phys for contact in contacts]
    try:
        for contact in contacts:
            contact.phys = None
        yield
    finally:
        for contact, kept in zip(contacts, physics, strict=True):
            contact.phys = kept
