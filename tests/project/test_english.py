"""Plain English: a description makes sense alone, and one word has one meaning (see the table in CONTRIBUTING.md).

``pytest tests/project/test_english.py -k environments`` tests one place: a folder, or a file in no folder.
"""

import ast
import re
from pathlib import Path

import docstring_parser
import pytest

from sgimd_torch.options.catalogue import WORDS, about

ROOT = Path(__file__).parents[2]
# First words of a description that only continues the name before it; _ stands for a space.
CONTINUING = """
    the_same that which what who whom whose whoever whatever why when where how as such see also
    all_of all_that one_of one_or both_of it its they their them his those these this others about
    from by for to of in on at with without beyond below above between within under over after before during until
    since through into onto around against among like relative_to eq. default (default
"""
# First words of a description without a noun: verbs of which the parameter is the subject, participles, and units.
VERBS = """
    is are was were has have had does did may can must called drawn made given shown told asked used executed freshly
    draws gives decides refines keeps makes moves_a predicts replaces shows showed says serves asks tells wants goes
    name_the go send fill keep show only any another s rad m metre metres Hz degrees
"""
VERB_AND_OBJECT = "(?!(?:half|twice|whether|all|double) )[a-z]+ (?:the|a|an|its|it|them|their|how|nothing) "
RELATIVE = "which|that|who|whose|where|when|what|how|if|as|whether"
SENTENCE = rf"(?:(?!\b(?:{RELATIVE})\b)[^,;.:])*?\b(?:is|are)\b"  # "a region with more goals is cut in two"
THE_SAME = r"(?:.*[,;:.(] )?(?:and )?the same(?=[,;:.]|$| (?:in|with|along|as|where|but|by|for|if|from)\b)"  # no noun
QUAINT = re.compile(r"\b(?:lest|for want of|foretold|is no matter of|who has no|whom it)\b", re.IGNORECASE)
# Names of parameters and functions that mean something else elsewhere, and names to write instead.
AMBIGUOUS = {"measure": "performance or interest", "def record": "trajectory, film or play"}


def starts_with(words: str, *patterns: str) -> re.Pattern[str]:
    listed = "|".join(re.escape(word).replace("_", " ") for word in words.split())
    return re.compile("|".join([rf"(?:{listed})(?![\w-])", *patterns]), re.IGNORECASE)


HELP = starts_with(CONTINUING, THE_SAME)
AFTER_A_SHAPE = r"``\([^`]*\)``,? *(?:(?:in|by|of|at|from|to|on) which|what|as|its|that)\b"
DESCRIPTION = starts_with(CONTINUING + VERBS, VERB_AND_OBJECT, SENTENCE, AFTER_A_SHAPE, "$")
PLACES: dict[str, list[Path]] = {}
for file in sorted(path for top in ("sgimd_torch", "experiments", "scripts") for path in (ROOT / top).rglob("*.py")):
    folder = file.parent if file.parent.name != "sgimd_torch" else file.with_suffix("")
    PLACES.setdefault(folder.relative_to(ROOT).as_posix().removeprefix("sgimd_torch/"), []).append(file)


def descriptions(tree: ast.AST):
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (text := ast.get_docstring(node)):
            for parameter in docstring_parser.parse(text, docstring_parser.DocstringStyle.GOOGLE).params:
                yield parameter.arg_name, " ".join((parameter.description or "").split())


def helps(tree: ast.AST):
    """Help texts of options, ``help="..."``; of an f-string only its first part."""
    for node in ast.walk(tree):
        if isinstance(node, ast.keyword) and node.arg in ("help", "about"):
            value = node.value.values[0] if isinstance(node.value, ast.JoinedStr) else node.value
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                yield value.value


@pytest.mark.parametrize("place", PLACES)
def test_descriptions_make_sense_alone_and_words_have_one_meaning(place):
    bad = []
    for path in PLACES[place]:
        tree = ast.parse(source := path.read_text("utf-8"))
        wrong = [f"{name}: {text}" for name, text in descriptions(tree) if DESCRIPTION.match(text)]
        wrong += [f"help: {text}" for text in helps(tree) if HELP.match(text)]
        named = [
            node.arg if isinstance(node, ast.arg) else f"def {getattr(node, 'name', '')}" for node in ast.walk(tree)
        ]
        wrong += [f"{name}: write {AMBIGUOUS[name]}" for name in named if name in AMBIGUOUS]
        bad += [f"{path.name}: {text}" for text in wrong + QUAINT.findall(source)]
    assert not bad, "\n".join(bad)


def test_every_word_and_command_is_explained_alone():
    texts = {f"{kind} {word}": about(kind, word) for kind, words in WORDS.items() for word in words}
    assert not {name: text for name, text in texts.items() if HELP.match(text)}


@pytest.mark.parametrize(
    "text",
    ["draws the noise.", "of the learner.", "The same, but wide.", "weighs the errors", "a region of this is cut"],
)
def test_a_description_that_continues_the_name_is_found(text):
    assert DESCRIPTION.match(text)
