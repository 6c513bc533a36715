"""A check of an environment: does it keep every promise of the protocol `Environment`?

check_environment(Toss())    # raises ValueError with a line for each broken promise; the command is ``sgimd check``
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Final

import numpy as np

from sgimd_torch.environments.protocol import (
    BatchEnvironment,
    Environment,
    check_instance,
    check_robot,
    moves_in_batches,
)
from sgimd_torch.extras.previous.with_previous import WithPrevious
from sgimd_torch.spaces import Array, Box, check_count, stream

_FACTOR: Final = 10.0  # largest accepted ratio between announced and measured noise; a wrong unit exceeds it
_ROUNDING: Final = 1e-4  # share of T's longest side; outcomes of one movement that differ by less differ by rounding
Movements = Sequence[tuple[Array, Array]]


class _Remark(str):
    """A finding that breaks no promise."""


def check_environment(environment: Environment, *, movements: int = 3) -> list[str]:
    """Refuse an environment that breaks a promise of the protocol `Environment`; the result are remarks on others.

    Args:
        environment: environment to check; its methods are called about 8 times for each movement.
        movements: number of random movements to try; two corners of Pi are tried, too.

    Raises:
        ValueError: a promise is broken. The message has a line for each broken promise: what was found, what was
            expected, and the likely cause. Promises that depend on a broken promise are not checked.
    """
    check_count("movements", movements, 1)
    if isinstance(environment, type):
        check_instance(environment)
    stages: list[tuple[Callable[..., Iterable[str]], ...]] = [(_spaces,), (_contexts,), (_outcomes,), (_repeats,)]
    stages.append((_noise, _batches, _refusals))
    findings: list[str] = []
    tried: Movements = ()
    for stage in stages:
        for promise in stage:
            try:
                findings += promise(environment, tried)
            except _BrokenError as error:
                findings.append(str(error))
        if broken := [finding for finding in findings if not isinstance(finding, _Remark)]:
            raise ValueError("\n  ".join([f"{type(environment).__name__} is no environment yet:", *broken]))
        if stage == (_contexts,):
            tried = _movements(environment, movements)
    return findings


class _BrokenError(Exception):
    """A broken promise without which the rest of a check makes no sense."""


def _movements(environment: Environment, n: int) -> Movements:
    box = environment.policies
    thetas = [*(box.sample(stream(k, "theta")) for k in range(n)), box.low.copy(), box.high.copy()]
    return [(_call(environment, "observe", stream(k, "observe")), theta) for k, theta in enumerate(thetas)]


def _spaces(environment: Environment, _: Movements) -> Iterator[str]:
    for name, least in (("contexts", 0), ("policies", 1), ("outcomes", 1)):
        box = getattr(environment, name, None)
        if not isinstance(box, Box):
            hint = "; without contexts it is Box.cube(0, 1, 0)" if name == "contexts" else ""
            yield f"{name} must be a sgimd_torch.Box, got {type(box).__name__}{hint}"
        elif box.dim < least:
            yield f"{name} must have at least one dimension, got a Box without any"
    for name in ("observe", "execute"):
        if not callable(getattr(environment, name, None)):
            yield f"{name} must be a method, got {type(getattr(environment, name, None)).__name__}"
    noise: Any = getattr(environment, "outcome_noise", None)
    measured = isinstance(noise, int | float | np.number) and not isinstance(noise, bool) and 0 <= noise < np.inf
    if not measured:
        yield f"outcome_noise must be a number >= 0, got {noise!r}; it is the standard deviation of the outcomes"
    rest: Any = getattr(environment, "rest", None)
    if not isinstance(rest, np.ndarray):
        yield f"rest must be an array, the outcome of not moving, got {type(rest).__name__}; np.zeros(2), for example"
    elif measured and isinstance(getattr(environment, "outcomes", None), Box):
        try:
            check_robot(environment)
        except ValueError as error:
            yield f"{error}; rest is the outcome of not moving, one point of T (outcomes)"


def _contexts(environment: Environment, _: Movements) -> Iterator[str]:
    before = _global_streams()
    context = _call(environment, "observe", stream(1, "observe"))
    _check_shape("observe()", context, environment.contexts.dim)
    kept = context.copy()
    if not environment.contexts.contains(context):
        yield f"observe() gave {_text(context)}, outside C (contexts); contexts.sample(rng) gives points inside"
    _call(environment, "observe", stream(2, "observe"))
    if not np.array_equal(context, kept):
        yield _used_twice("observe()")
    if not np.array_equal(_call(environment, "observe", stream(1, "observe")), kept):
        yield "observe() gave two contexts for equal streams; does it draw from anything but its rng?"
    if _global_streams() != before:
        yield _drew_from_global("observe()")


def _outcomes(environment: Environment, tried: Movements) -> list[str]:
    for context, theta in tried:
        arguments = context.copy(), theta.copy()
        outcome = _call(environment, "execute", *arguments, stream(1, "execute"))
        _check_shape("execute()", outcome, environment.outcomes.dim)
        if not np.isfinite(outcome).all():
            gave = f"execute() gave {_text(outcome)} for theta {_text(theta)}"
            raise _BrokenError(f"{gave}; raise SimulationError if it diverges")
        for name, given, now in zip(("context", "theta"), (context, theta), arguments, strict=True):
            if not np.array_equal(given, now):
                slip = f"execute() changed the {name} that it was given"
                raise _BrokenError(f"{slip}; write x = x * 2 instead of x *= 2")
    return []


def _repeats(environment: Environment, tried: Movements) -> Iterator[str]:
    """Equal streams must give equal outcomes, whatever was executed before."""
    context, theta = tried[0]
    before, rng = _global_streams(), stream(1, "execute")
    untouched = rng.bit_generator.state
    _call(environment, "execute", context, theta, stream(1, "execute"))  # the next two calls then both follow this one
    first = _call(environment, "execute", context, theta, rng)
    kept, again = first.copy(), _call(environment, "execute", context, theta, stream(1, "execute")).copy()
    if _global_streams() != before:
        raise _BrokenError(_drew_from_global("execute()"))
    seen = f"execute() gave {_text(kept)}, then {_text(again)} for the same movement and equal streams"
    if environment.outcome_noise and rng.bit_generator.state == untouched and not np.array_equal(kept, again):
        raise _BrokenError(f"{seen}: nothing was drawn from rng; does its noise come from a generator of its own?")
    yield from _differ(environment, kept, again, seen)
    if np.abs(kept - again).max() > _rounding(environment):
        return
    _call(environment, "execute", *tried[1], stream(2, "execute"))
    if not np.array_equal(first, kept):
        yield _used_twice("execute()")
    last = _call(environment, "execute", context, theta, stream(1, "execute"))
    if np.array_equal(kept, again) or np.abs(kept - last).max() > _rounding(environment):  # else a remark says it
        yield from _differ(
            environment, kept, last, f"execute() gave {_text(kept)}, but {_text(last)} after another movement"
        )


def _differ(environment: Environment, one: Array, other: Array, seen: str) -> Iterator[str]:
    """A remark if two outcomes of a movement differ by rounding, a broken promise if they differ by more."""
    apart = float(np.abs(one - other).max())
    if apart > _rounding(environment) and isinstance(environment, WithPrevious):
        yield _Remark(f"{seen}: outcomes depend on older movements than the one before, too")
    elif apart > _rounding(environment):
        yield (
            f"{seen}: state carries over; does each movement reset positions, speeds and filters? If nothing can, "
            "outcomes depend on the movement before: give it as context (--context previous), or return to the same "
            "state first"
        )
    elif apart:
        yield _Remark(
            f"a repeated movement with an equal stream ends {apart:.2g} away, as by rounding: "
            "two runs with one seed will differ"
        )


def _rounding(environment: Environment) -> float:
    return _ROUNDING * float(environment.outcomes.sides.max())


def _noise(environment: Environment, tried: Movements) -> Iterator[str]:
    announced, dim = float(environment.outcome_noise), environment.outcomes.dim
    # The second time in another order, so that what a robot remembers counts as noise.
    once = [_call(environment, "execute", *movement, stream(1, "execute")).copy() for movement in tried]
    again = [_call(environment, "execute", *movement, stream(2, "execute")).copy() for movement in tried[::-1]]
    scatter = np.sqrt([np.mean(np.square(one - other)) / 2 for one, other in zip(once, again[::-1], strict=True)])
    negligible = announced <= _rounding(environment)  # as the trembling of a thing at rest in a simulation
    noisy = scatter[scatter > (_rounding(environment) if negligible else 0)]
    if not len(noisy):
        if not negligible:
            yield f"outcome_noise is {announced:g}, but no movement scatters; does execute() use its rng?"
        return
    # The median of a mean of ``dim`` squares of standard normal numbers is about (1 - 2 / (9 dim))^3.
    typical = float(np.median(noisy) / (1 - 2 / (9 * dim)) ** 1.5)
    if negligible:
        yield f"outcome_noise is {announced:g}, but outcomes of a movement scatter by about {typical:.2g}; announce it"
    elif not announced / _FACTOR <= typical <= announced * _FACTOR:
        yield f"outcome_noise is {announced:g}, but outcomes of a movement scatter by {typical:.2g}; a wrong unit?"
    elif scatter.max() > _FACTOR * typical:
        worst = int(scatter.argmax())
        yield _Remark(
            f"theta {_text(tried[worst][1])} scatters by {scatter[worst]:.2g}, a typical movement by {typical:.2g}: "
            "repeated outcomes of some movements lie far apart"
        )


def _batches(environment: Environment, tried: Movements) -> Iterator[str]:
    if not moves_in_batches(environment):
        if isinstance(environment, BatchEnvironment):
            yield _Remark("execute_many() is a parent's, execute() is not: movements are made one by one, by execute()")
        return
    contexts, thetas = (np.stack(part) for part in zip(*tried, strict=True))

    def rngs() -> list[np.random.Generator]:
        return [stream(row, "row") for row in range(len(tried))]

    together = _call(environment, "execute_many", contexts.copy(), thetas.copy(), rngs())
    _check_shape("execute_many()", together, len(tried), environment.outcomes.dim)
    kept = together.copy()
    for row, (movement, rng) in enumerate(zip(tried, rngs(), strict=True)):
        single = _call(environment, "execute", *movement, rng)
        if not np.array_equal(single, kept[row]):
            raise _BrokenError(
                f"row {row} of execute_many() is {_text(kept[row])}, execute() gives {_text(single)}; they must be "
                "equal to the last bit: does each row use its own rng, in the same order of draws and of sums?"
            )
    last = _call(environment, "execute_many", contexts[-1:].copy(), thetas[-1:].copy(), rngs()[-1:])
    if not np.array_equal(together, kept):
        yield _used_twice("execute_many()")
    if not np.array_equal(last, kept[-1:]):
        yield "a row of execute_many() depends on other rows of its batch; does the longest movement set their length?"


def _refusals(environment: Environment, tried: Movements) -> Iterator[str]:
    for position, (name, box) in enumerate((("context", environment.contexts), ("theta", environment.policies))):
        for value in _invalid(tried[0][position], box):
            context, theta = (value, tried[0][1]) if position == 0 else (tried[0][0], value)
            slip = f"execute() {{}} a {name} of shape {value.shape}, {_text(value)}"
            try:
                environment.execute(context, theta, stream(1, "execute"))
            except ValueError as error:
                if name in str(error) or "one movement" in str(error):
                    continue
                slip = slip.format("refused") + f" without naming it ({error})"
            except (Exception, SystemExit) as error:
                slip = slip.format("failed at") + f" with {type(error).__name__} instead of ValueError"
            else:
                slip = slip.format("accepted")
            yield f"{slip}; begin with context, theta = check_movement(self, context, theta)"
            break


def _invalid(point: Array, box: Box) -> list[Array]:
    """Values that are not one point of ``box``: another length, two points, and entries NaN, infinite or outside."""
    values = [np.append(point, 0.0), np.stack((point, point))]
    if len(point) > 0:
        outside = box.high[-1] + box.sides[-1]
        values += [point[:-1], *(np.append(point[:-1], entry) for entry in (np.nan, np.inf, outside))]
    return values


def _call(environment: Environment, name: str, *arguments: Any) -> Any:
    try:
        return getattr(environment, name)(*arguments)
    except (Exception, SystemExit) as error:  # code of the user may raise anything
        given = f" for theta {_text(arguments[1])}" if name == "execute" else ""
        raise _BrokenError(f"{name}() raised {type(error).__name__}{given}: {error}") from error


def _check_shape(what: str, value: Any, *shape: int) -> None:
    if not isinstance(value, np.ndarray) or isinstance(value, np.ma.MaskedArray):
        hint = "is its return missing?" if value is None else "np.array([x]) makes one"
        hint = "raise SimulationError where there is no outcome" if isinstance(value, np.ma.MaskedArray) else hint
        raise _BrokenError(f"{what} must give an array of shape {shape}, got {type(value).__name__}; {hint}")
    if value.shape != shape or value.dtype != np.float64:
        hint = "is it called with one movement?" if value.ndim != len(shape) else "was an axis or a dtype forgotten?"
        raise _BrokenError(f"{what} must give float64 of shape {shape}, got {value.dtype} {value.shape}; {hint}")


def _used_twice(what: str) -> str:
    return f"{what} changed an array that it gave before: one buffer is used twice; return a copy"


def _drew_from_global(what: str) -> str:
    return f"{what} drew from a global random stream; write rng.normal() instead of np.random.normal()"


def _global_streams() -> tuple[str, str]:
    return str(np.random.get_state()), str(random.getstate())  # noqa: NPY002 - only compared


def _text(point: Array) -> str:
    return str(np.asarray(point).round(4).tolist())
