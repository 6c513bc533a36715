"""One variant in a report: its curve, its maps, its films, its runs."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from sgimd_torch.catalogue import ROD
from sgimd_torch.views.report import figures
from sgimd_torch.views.report.data import GOALS, Life, Variant
from sgimd_torch.views.report.films import Film, command
from sgimd_torch.views.report.html import Html, data_uri, details, picture, table, tag
from sgimd_torch.views.report.words import sentence


def section(variant: Variant, others: Sequence[Variant], number: int, films: Sequence[Film]) -> Html:
    """One variant: its curve, its maps, its film, its runs."""
    life, single = variant.typical, not others and len(variant.lives) == 1
    shown: list[Html] = []
    if variant.last:
        figure = figures.one_curve(life) if single else figures.curve(variant, [v for v in others if v.last])
        words = "The distances to the benchmark's goals." if single else _seeds_drawn(variant)
        shown.append(drawn(figure, f"Error curve of {variant.label}", f"How the error falls. {words}"))
    if any(len(each.landed) for each in variant.lives):
        figure, missing = figures.landing(variant)
        whose = "" if single else f", in all {len(variant.lives)} runs together" if len(variant.lives) > 1 else ""
        shown.append(drawn(figure, f"Landing points of {variant.label}", f"Where movements landed{whose}. {missing}"))
    of = "" if single else f" in seed {life.seed}"
    if figures.has_plane_map(life):
        when = int(life.regions["movements"].max()) if life.regions else 0
        words = f"Interest{of} after {when} movements, and the last goals it chose, {GOALS} at most."
        shown.append(drawn(figures.interest(life), f"Interest map of {variant.label}", words))
        words = f"How the interest map split{of}."
        shown.append(drawn(figures.splitting(life), f"Interest maps over time of {variant.label}", words))
    stands = f" Seed {life.seed}, whose last error is the middle one, stands for all where one run is shown."
    about = sentence(variant) + (stands if len(variant.used) > 1 else "")
    return tag(
        "section",
        tag("h2", "Curve and maps" if single else variant.label, id=f"variant-{number}"),
        Html() if single else tag("p", about),
        tag("div", *shown, class_="maps")
        if shown
        else tag("p", "Nothing has landed yet, so there is nothing to draw."),
        Html() if figures.has_plane_map(life) else tag("p", "This learner has no interest map.", class_="soft"),
        _films(films, life, variant.label),
        details(f"Its {len(variant.lives)} runs" if len(variant.lives) > 1 else "The run", _runs(variant)),
        details(
            "Its full configuration", tag("pre", tag("code", json.dumps(life.config, indent=2, ensure_ascii=False)))
        ),
        class_="variant",
    )


def drawn(figure: Figure, alt: str, words: str, *, wide: bool = False) -> Html:
    """A figure in the page, with ``words`` below."""
    return picture(figures.image(figure), alt, words.strip(), wide=wide)


def _seeds_drawn(variant: Variant) -> str:
    n = len(variant.used)
    return "One seed." if n == 1 else f"Interquartile mean over {n} seeds with its 95 % interval; thin: seeds."


def _films(films: Sequence[Film], life: Life, label: str) -> Html:
    """Those of the run that stands for the variant; without any, how to make one."""
    if not films and life.environment != ROD:
        return Html()
    if not films:
        asks = tag("code", command(life.path))
        return tag("p", "No film of it yet. To make one: ", asks, ", then write this page again.", class_="soft")
    shown = []
    for film in films:
        poster = data_uri("image/jpeg", film.poster) if film.poster else False
        source = data_uri("video/mp4", film.data)
        name = f"Film of {label}, {film.path.stem}"
        video = tag("video", controls=True, preload="metadata", poster=poster, src=source, aria_label=name)
        shown.append(tag("figure", video, tag("figcaption", f"{name}: what it has learnt, cast for chosen goals.")))
    return tag("div", *shown, class_="maps")


def _runs(variant: Variant) -> Html:
    head = ["seed", "movements", "state", "evaluated after", "last error (m)", "noise floor (m)", "physics (s)"]
    rows = []
    for life in variant.lives:
        when = life.evaluation["movements"]
        last = int(when[-1]) if len(when) else 0
        numbers = [life.at(last), life.at(last, "noise_floor_m")]
        parts = [life.seconds(part) for part in ("physics", "learner", "evaluation")]
        rows.append(
            [
                *(
                    str(life.seed),
                    f"{life.movements} of {life.wanted}",
                    "finished" if life.finished else "not finished",
                ),
                *(str(last or "–"), *(f"{value:.4f}" if np.isfinite(value) else "–" for value in numbers)),
                *(f"{value:.1f}" if np.isfinite(value) else "–" for value in parts),
            ]
        )
    return table([*head, "learning (s)", "evaluation (s)"], rows, caption=f"Every run of {variant.label}")
