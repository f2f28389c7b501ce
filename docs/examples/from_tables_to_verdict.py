"""From tables to verdict: the way of `forcechain compare`, on foot, with the Python API.

Read tables, find drops of the stress ratio, chains and buckled segments, average, put the model beside, judge.

    python from_tables_to_verdict.py STUDY [FIGURES]

or cell by cell in an editor that knows `# %%`. STUDY is a study's folder (results/demo), or any folder of tables.
"""

# %%
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from forcechain.observe.averages import average_by_increment, bootstrap_error, class_shares
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.transitions import find_drops, snapshots_of_drop
from forcechain.observe.window import observe_drop
from forcechain.theory.parameters import ChainParameters
from forcechain.theory.three_particle import loading
from harness.comparing.verdicts import judge, tolerance_for_a_mean
from harness.figures.packing import plot_discs, plot_forces, plot_segments
from harness.figures.style import style
from harness.reading.exports import read_run, run_folders

study = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("results/demo")
figures = Path(sys.argv[2]) if len(sys.argv) > 2 else Path("figures")
figures.mkdir(parents=True, exist_ok=True)
plt.switch_backend("agg")  # files, no windows

# %% [markdown]
# ## 1. Tables
#
# A run is a history, one row a sample, and snapshots: tables of particles and contacts, checked when they are
# read.

# %%
runs = [read_run(folder) for folder in run_folders(study)]
for run in runs:
    print(f"{run.name}: {run.n_snapshots} snapshots to an axial strain of {run.axial_strain[-1]:.3f}")

snapshot = runs[0].snapshot(0)
print(f"{snapshot.n_particles} discs, {len(snapshot.contact_ids)} contacts, mean radius {snapshot.radius.mean():.3g} m")

# %% [markdown]
# ## 2. Drops of the stress ratio
#
# Every choice is an option with a name. Here all have their defaults: a drop is 0.007 of axial strain long and is
# looked at in 28 increments.

# %%
options = AnalysisOptions()
drops = [
    (run, drop)
    for run in runs
    for drop in find_drops(run.history["axial_strain"].to_numpy(), run.history["stress_ratio"].to_numpy(), options)
]
for run, drop in drops:
    print(
        f"{run.name}: from {drop.start:.4f} to {drop.end:.4f} the ratio falls by {drop.fall:.3f} from {drop.peak:.3f}"
    )

# %% [markdown]
# ## 3. Chains and segments that buckle
#
# The three filters, one after the other: in a force chain at the start, potential energy lost, buckling angle
# grown. What each leaves is kept.

# %%
observed = {run.name: [] for run, _ in drops}
for run, drop in drops:
    rows = snapshots_of_drop(run.axial_strain, drop, options)
    seen = observe_drop([run.snapshot(int(row)) for row in rows], options)
    observed[run.name].append(seen)
    ledger = seen.ledger
    print(f"{ledger.particles} discs, {ledger.in_chains} in chains, {ledger.buckled_segments} segments buckle")

# %%
run, drop = drops[0]
seen = observed[run.name][0]
first = run.snapshot(int(snapshots_of_drop(run.axial_strain, drop, options)[0]))
with style():
    figure, ax = plt.subplots(figsize=(5.5, 5.5), layout="constrained")
    plot_discs(first, ax=ax, members=seen.chains.in_chain, colour="#BBD7EA")
    plot_forces(first, ax=ax)
    plot_segments(first, seen.buckled, seen.yielding.buckling_class, ax=ax)
    ax.set_title("force chains, and the segments that will buckle by class")
    figure.savefig(figures / "segments.png", dpi=120)

# %% [markdown]
# ## 4. Averages, and how sure they are
#
# Segments of one packing share neighbours and history: the error over packings is the honest one, and the larger
# of the two is quoted.


# %%
def of_runs(measure: str) -> list[np.ndarray]:
    """Return one array (increments + 1, segments) a run, its drops side by side."""
    return [np.hstack([getattr(seen.measures, measure) for seen in run]) for run in observed.values()]


angle = average_by_increment(of_runs("buckling_angle"))
force = average_by_increment(of_runs("axial_force"))
force_error = bootstrap_error(of_runs("axial_force")).larger
grown = np.degrees(angle.mean[[0, -1]])
print(f"{force.count[0]} segments: the buckling angle grows from {grown[0]:.1f} to {grown[1]:.1f} degrees")
print(f"while the axial force falls from {force.mean[0]:.1f} to {force.mean[-1]:.1f} N")

shares = class_shares([seen.yielding.buckling_class for run in observed.values() for seen in run])
for number, share in enumerate(shares.share, start=1):
    print(f"class {number}: {share:.0%}")

# %% [markdown]
# ## 5. The model
#
# Parameters of the simulation's own contacts; the three that the paper calibrated come from its Table 3.

# %%
chain = ChainParameters.from_ratios(
    radius=float(first.radius.mean()),
    normal_stiffness=float(np.median(first.normal_stiffness)),
    rolling_friction=0.2,
)
model = loading(chain, angle.mean)
print("stages the model goes through:", *dict.fromkeys(model.stage))

# %%
with style():
    figure, ax = plt.subplots(figsize=(5.5, 4), layout="constrained")
    angles = np.radians(np.linspace(0.1, 30, 200))
    ax.plot(np.degrees(angles), loading(chain, angles).axial_force, "k--", label="model, parameters of Table 3")
    ax.errorbar(
        np.degrees(angle.mean),
        force.mean,
        yerr=2 * force_error,
        fmt="o",
        label=f"segments, 2 s.e., n = {force.count[0]}",
    )
    ax.set(xlabel="buckling angle [deg]", ylabel="axial force [N]", ylim=(0, None))
    ax.legend()
    figure.savefig(figures / "force.png", dpi=120)

# %% [markdown]
# ## 6. A verdict
#
# Expected, found, tolerance: a quarter of the model's value, or two standard errors where those are larger. Within one
# standard error of the tolerance it is undecided.

# %%
found, expected = force.mean.mean(), model.axial_force.mean()
error = bootstrap_error([values.mean(axis=0, keepdims=True) for values in of_runs("axial_force")]).larger[0]
tolerance, source = tolerance_for_a_mean(0.25 * expected, error)
verdict = judge(found, expected, tolerance, error)
print(f"axial force, mean over the drop: model {expected:.2f} N, data {found:.2f} ± {2 * error:.2f} N: {verdict.value}")
