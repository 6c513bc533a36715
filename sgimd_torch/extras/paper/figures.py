"""The figures of the page of ``sgimd paper``, after those of section 6 of Nguyen & Oudeyer (2014).

source = goals(study)    # a png as a data URL, for <img src=...>
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from sgimd_torch.extras.paper.replication import BY, LEARNERS, SMALL, TAUGHT, TILE, Replication
from sgimd_torch.extras.pictures.sections import sections
from sgimd_torch.extras.report.figures import draw_curves, png
from sgimd_torch.extras.report.maps import landing_points
from sgimd_torch.extras.table.names import COLOURS, NAMES

THREE: Final = ("random", "sagg-riac", "sgim-d")
OF_DEMONSTRATOR: Final = {1: "#0072b2", 2: "#e69f00", 3: "#d55e00"}
EXAMPLES: Final = 2  # number of runs of each learner with a histogram
WITHIN: Final = 0.99  # share of outcomes that a histogram shows


def five_learners(study: Replication) -> str:
    """Error curves of the five learners."""
    return _panels(study, {"": {name: name for name in LEARNERS}})


def by_demonstrator(study: Replication) -> str:
    """Error curves of the three taught learners, a panel for each demonstrator."""
    return _panels(study, {f"demonstrator {k}": {name: name + end for name in TAUGHT} for k, end in BY.items()})


def both_spaces(study: Replication) -> str:
    """Error curves of three learners in the paper's T, and in a larger one."""
    large = {name: name if name == "random" else f"{name}-large" for name in THREE}
    return _panels(study, {"T = [-1, 1]²": {name: name for name in THREE}, "T = [-100, 100]²": large})


@png
def _panels(figure: Figure, study: Replication, panels: Mapping[str, Mapping[str, str]]) -> None:
    """Error curves in panels beside each other; of each panel its title, and its variants by learner."""
    figure.set_size_inches(max(7.0, 3.9 * len(panels)), 4.6)
    axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for ax, (title, names) in zip(axes, panels.items(), strict=True):
        variants = [study.variants[name] for name in names.values()]
        draw_curves(ax, variants, {name: COLOURS[learner] for learner, name in names.items()})
        ax.set_title(title)
        if ax is not axes[0]:
            ax.set_ylabel("")
    axes[0].set_ylim(bottom=0)  # after all curves, because it ends the automatic scale
    lines = axes[0].lines
    figure.legend(
        lines,
        [NAMES[name] for name in next(iter(panels.values()))],
        loc="outside upper center",
        ncols=len(lines),
        frameon=False,
    )


@png
def outcomes(figure: Figure, study: Replication) -> None:
    """Histograms of outcomes side by side: a column for each learner, a row for each of two runs."""
    variants = [study.variants[name] for name in THREE]
    everywhere = np.abs(np.concatenate([variant.landed for variant in variants])).max(axis=1)
    half = np.ceil(10 * float(np.quantile(everywhere, WITHIN))) / 10
    plane = replace(variants[0].space, low=np.full(2, -half), high=np.full(2, half))
    (section,), n = sections(plane), min(EXAMPLES, *(len(variant.runs) for variant in variants))
    figure.set_size_inches(12, 0.4 + 4 * n)
    axes = figure.subplots(n, len(THREE), sharex=True, sharey=True, squeeze=False)
    meshes = []
    for column, (name, variant) in enumerate(zip(THREE, variants, strict=True)):
        for ax, run in zip(axes[:, column], variant.runs[:n], strict=True):
            landed = run.outcomes[plane.contains(run.outcomes)]
            shown = np.array([demonstration.outcome for demonstration in run.demonstrations])
            meshes.append(landing_points(ax, landed, plane, section, demonstrated=shown, side=TILE))
            ax.set_title(f"{NAMES[name]}, seed {run.config['seed']}", pad=22)  # above the legend
            ax.label_outer()
    most, bars = max(float(mesh.get_clim()[1]) for mesh in meshes), [mesh.colorbar for mesh in meshes if mesh.colorbar]
    label = bars[0].ax.get_ylabel()
    for mesh, bar in zip(meshes, bars, strict=True):  # one scale and one bar for all
        bar.remove()
        mesh.set_clim(1, most)
    figure.colorbar(meshes[0], ax=axes, label=label, shrink=0.7, format="{x:g}")


@png
def joint_paths(figure: Figure, study: Replication) -> None:
    """Angles of joint 1 against time in all recordings of each demonstrator."""
    figure.set_size_inches(11.7, 4)
    axes = figure.subplots(1, len(BY), sharex=True, sharey=True)
    for ax, (k, shown) in zip(axes, study.demonstrators.items(), strict=True):
        for demonstration in shown:
            ax.plot(
                demonstration.times, demonstration.trajectory[:, 0], color=OF_DEMONSTRATOR[k], linewidth=0.8, alpha=0.5
            )
        ax.set(title=f"demonstrator {k}", xlabel="time (s)")
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("joint 1, yaw (rad)")


@png
def parameters(figure: Figure, study: Replication) -> None:
    """Mean of each parameter of theta, with its standard deviation: recordings, and movements of SGIM-D."""
    figure.set_size_inches(11.7, 4.6)
    axes = figure.subplots(1, 2, sharey=True)
    titles = {"recordings": study.demonstrated, "movements of SGIM-D, by demonstrator": study.taught}
    for ax, (title, groups) in zip(axes, titles.items(), strict=True):
        for k, thetas in groups.items():
            points = np.arange(thetas.shape[1]) + 0.22 * (k - 2)
            ax.errorbar(
                points,
                thetas.mean(axis=0),
                thetas.std(axis=0),
                fmt="o",
                markersize=4,
                linewidth=1,
                color=OF_DEMONSTRATOR[k],
                label=f"demonstrator {k}",
            )
        for edge in range(0, 25, 4):
            ax.axvline(edge - 0.5, color="0.8", linewidth=0.8, zorder=0)
        ax.axhline(0.5, color="black", linewidth=0.8, linestyle="--", zorder=0)
        ax.set_xticks([*range(1, 24, 4), 24], [*(f"joint {joint}" for joint in range(1, 7)), "δ"], rotation=45)
        ax.set_title(title)
    axes[0].set_ylabel("parameter of θ")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)


@png
def goals(figure: Figure, study: Replication) -> None:
    """Goals that SAGG-RIAC and SGIM-D chose in the large T; below, those in the paper's T, if there are any."""
    chosen = {name: study.chosen(name) for name in THREE[1:]}
    parts = [study.variants["sgim-d-large"].space, SMALL]
    shown = [part for part in parts if any(part.contains(goals).any() for goals in chosen.values())]
    figure.set_size_inches(8.6, 4.1 * len(shown))
    for column, (name, goals) in zip(figure.subplots(len(shown), 2, squeeze=False).T, chosen.items(), strict=True):
        for ax, part in zip(column, shown, strict=True):
            inside = goals[part.contains(goals)]
            ax.plot(*inside.T, ".", color=COLOURS[name], markersize=6, alpha=0.6, markeredgewidth=0)
            title = f"{NAMES[name]}: {len(inside)} of {len(goals)} goals"
            ax.set(title=title, xlabel="x (m)", ylabel="y (m)", aspect="equal")
            ax.set(xlim=(part.low[0], part.high[0]), ylim=(part.low[1], part.high[1]))


@png
def mapping(figure: Figure, study: Replication) -> None:
    """Two joints of a recording: as recorded, as the robot repeats them, and the knots of theta_d."""
    figure.set_size_inches(8.6, 4)
    for ax, mapped in zip(figure.subplots(1, 2, sharex=True), study.mapped(), strict=True):
        ax.plot(mapped.times, mapped.recorded, "--", color="0.4", label="recorded")
        ax.plot(mapped.times, mapped.repeated, color=OF_DEMONSTRATOR[3], label="repeated by the robot")
        ax.plot(np.linspace(0, mapped.times[-1], len(mapped.knots)), mapped.knots, "ko", label="knots")
        ax.set(title=f"joint {mapped.joint}, misfit {mapped.misfit:.3f} rad", xlabel="time (s)", ylabel="angle (rad)")
        ax.grid(alpha=0.3)
    figure.legend(*ax.get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)


@png
def maps(figure: Figure, study: Replication) -> None:
    """Benchmark goals in T, and the outcomes that each demonstrator shows."""
    figure.set_size_inches(11.7, 3.6)
    points = {"0.3": ("benchmark", study.variants["sgim-d"].runs[0].benchmark)}
    for k, shown in study.demonstrators.items():
        points[OF_DEMONSTRATOR[k]] = f"demonstrator {k}", np.array([demonstration.outcome for demonstration in shown])
    axes = figure.subplots(1, len(points), sharex=True, sharey=True)
    for ax, (colour, (name, outcomes)) in zip(axes, points.items(), strict=True):
        ax.plot(*outcomes.T, ".", color=colour, markersize=4)
        ax.set(title=f"{name}: {len(outcomes)} points", xlabel="x (m)", aspect="equal", xlim=(-1, 1), ylim=(-1, 1))
    axes[0].set_ylabel("y (m)")


@png
def repeated(figure: Figure, study: Replication) -> None:
    """Outcomes of three random policies, each repeated: in T, and around the mean of each policy."""
    figure.set_size_inches(8.6, 4.3)
    whole, near = figure.subplots(1, 2)
    landed = study.repeated[: len(OF_DEMONSTRATOR)]
    around = landed - landed.mean(axis=1, keepdims=True)
    for ax, points in ((whole, landed), (near, around)):
        for (k, colour), outcomes in zip(OF_DEMONSTRATOR.items(), points, strict=True):
            ax.plot(*outcomes.T, ".", color=colour, markersize=5, label=f"policy {k}")
    whole.set(xlim=(-1, 1), ylim=(-1, 1), title="in T", xlabel="x (m)", ylabel="y (m)", aspect="equal")
    most = 1.1 * float(np.abs(around).max())
    near.set(
        xlim=(-most, most),
        ylim=(-most, most),
        title="around the mean of each policy",
        xlabel="x - mean (m)",
        ylabel="y - mean (m)",
        aspect="equal",
    )
    near.locator_params(nbins=5)
    whole.legend(frameon=False)
