"""Names and colours of algorithms in figures and tables.

Colours after Okabe & Ito: distinct with any colour vision, and in greyscale.
"""

from __future__ import annotations

from typing import Final

_DRAWN: Final = {
    "random": ("Random", "#7f7f7f"),
    "sagg-riac": ("SAGG-RIAC", "#0072b2"),
    "sagg-riac-letter": ("SAGG-RIAC, to the letter", "#117733"),
    "practice": ("Practice", "#332288"),
    "practice-wide": ("Practice, begun uniformly", "#ddcc77"),
    "practice-interest": ("Practice, by interest", "#88ccee"),
    "practice-taught": ("Practice, taught", "#aa4499"),
    "observation": ("Observation", "#cc79a7"),
    "imitation": ("Imitation", "#009e73"),
    "sgim-d": ("SGIM-D", "#d55e00"),
    "sgim-d-letter": ("SGIM-D, to the letter", "#b8860b"),
    "sgim-im": ("SGIM-IM", "#661100"),
    "sgim-im-search": ("SGIM-IM, search", "#a05a2c"),
    "sgim-acts": ("SGIM-ACTS", "#cc6677"),
    "sgim-acts-search": ("SGIM-ACTS, search", "#e8a0a8"),
    "uniform-nearest": ("Standard baseline", "#44aa99"),
    "map-elites": ("MAP-Elites", "#56b4e9"),
    "map-elites-taught": ("MAP-Elites, taught", "#1f78a8"),
    "isoline": ("Isoline", "#999933"),
    "isoline-taught": ("Isoline, taught", "#5c5c1f"),
    "cma-me": ("CMA-ME", "#e69f00"),
    "cma-me-taught": ("CMA-ME, taught", "#8f6300"),
    "cma-mae": ("CMA-MAE", "#882255"),
    "cma-mae-taught": ("CMA-MAE, taught", "#4d1330"),
}
NAMES: Final = {word: name for word, (name, _) in _DRAWN.items()}
COLOURS: Final = {word: colour for word, (_, colour) in _DRAWN.items()}


def label(algorithm: str) -> str:
    """Name of an algorithm in figures; if it has none, its name in the catalogue."""
    return NAMES.get(algorithm, algorithm)


def colour(algorithm: str) -> str:
    """Colour of an algorithm in figures."""
    return COLOURS.get(algorithm, "black")
