"""Networks of the forward model: an ensemble of perceptrons, all computed at once, or networks of your own.

Each predicts an outcome and its noise: deep ensembles (Lakshminarayanan, Pritzel & Blundell, NeurIPS 2017).

    class Bottleneck(Network): ...                              # or any torch.nn.Module with the same ``forward``
    inverse = ProvedModel(problem, network=Bottleneck)          # sgimd run --inverse.network mine:Bottleneck
"""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, ClassVar, Final, NamedTuple

import torch
from torch.func import functional_call, stack_module_state

from sgimd_torch.calls import call_checked, function_of
from sgimd_torch.spaces import check_count
from sgimd_torch.texts import unknown_name_error

ACTIVATIONS: Final[dict[str, Callable[[torch.Tensor], torch.Tensor]]] = {
    "silu": torch.nn.functional.silu,
    "relu": torch.nn.functional.relu,
    "gelu": torch.nn.functional.gelu,
    "tanh": torch.tanh,
}
WIDTHS: Final = (64, 64)  # number of units of each hidden layer
ACTIVATION: Final = "silu"
LOG_VARIANCES: Final = (-9.0, 3.0)  # bounds: the noise is 1 % to 450 % of the spread of outcomes
_TRIED: Final = 5  # number of random movements with which a new network is tried

Output = tuple[torch.Tensor, torch.Tensor]


class Network(torch.nn.Module):
    """Network of your own for a member; it is made with ``(context_dim, theta_dim, outcome_dim)`` and options."""

    standardised: ClassVar[bool] = True  # whether inputs and outputs have mean 0 and spread 1; False: the robot's units

    def forward(self, context: torch.Tensor, theta: torch.Tensor) -> torch.Tensor | Output:
        """Mean ``(n, outcome_dim)``, or mean and log variance, for ``(n, context_dim)`` and ``(n, theta_dim)``."""
        raise NotImplementedError


class Scales(NamedTuple):
    """Means and spreads of inputs and outcomes, which standardise them."""

    input_mean: torch.Tensor  # (context_dim + theta_dim,)
    input_spread: torch.Tensor
    outcome_mean: torch.Tensor  # (outcome_dim,)
    outcome_spread: torch.Tensor


class Perceptrons(torch.nn.Module):
    """Multilayer perceptrons, with one batched matrix product for each layer.

    Args:
        n_inputs, n_outputs: dimensions of inputs and outputs.
        members: number of networks.
        generator: random stream of the first weights.
        widths: number of units of each hidden layer.
        activation: name of the activation function.
        noise_heads: false: each output has one noise for all inputs.
    """

    def __init__(
        self,
        n_inputs: int,
        n_outputs: int,
        members: int,
        generator: torch.Generator,
        widths: tuple[int, ...],
        activation: str,
        noise_heads: bool,
    ) -> None:
        super().__init__()
        for width in widths:
            check_count("widths", width, 1)
        if activation not in ACTIVATIONS:
            raise unknown_name_error("activation", activation, ACTIVATIONS)
        self.activation, self.noise_heads = ACTIVATIONS[activation], noise_heads
        self.weights, self.biases = torch.nn.ParameterList(), torch.nn.ParameterList()
        for n_in, n_out in itertools.pairwise([n_inputs, *widths, 2 * n_outputs]):
            self.weights.append(torch.randn(members, n_in, n_out, generator=generator) / math.sqrt(n_in))
            self.biases.append(torch.zeros(members, 1, n_out))

    def forward(self, x: torch.Tensor, scales: Scales) -> Output:
        """Mean and log variance ``(members, n, n_outputs)`` for standardised ``(members, n, n_inputs)``."""
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = torch.baddbmm(bias, self.activation(x) if layer else x, weight)
        mean, log_variance = x.chunk(2, dim=-1)
        if not self.noise_heads:
            # The noise is the last layer's bias alone.
            log_variance = self.biases[-1].chunk(2, dim=-1)[1].expand_as(mean)
        return mean, log_variance

    def rescale(self, old: Scales, new: Scales) -> None:
        """Change the weights so that other scales change no predicted mean."""
        first, last = self.weights[0].data, self.weights[-1].data
        self.biases[0].data += (((new.input_mean - old.input_mean) / old.input_spread) @ first)[:, None]
        first *= (new.input_spread / old.input_spread)[:, None]
        ratio, dim = old.outcome_spread / new.outcome_spread, len(old.outcome_mean)
        last[..., :dim] *= ratio
        shift = (old.outcome_mean - new.outcome_mean) / new.outcome_spread
        self.biases[-1].data[..., :dim] = self.biases[-1].data[..., :dim] * ratio + shift


class OwnNetworks(torch.nn.Module):
    """Networks of a user, one for each member; other scales have to be learnt.

    Members of one class are computed at once, by ``torch.vmap``: ``stacked`` has the weights of all, with a first axis
    more. ``one_by_one`` says why this is not possible; it is "" where it is.

    Args:
        make: function or class that makes a network from ``dims``, or a network, which is copied with its weights.
        dims: dimensions of context, theta and outcome.
        members: number of networks.
        generator: random stream of the first weights.
        noise_heads: false: each outcome has one noise for all inputs, as if the network returned a mean alone.

    Raises:
        ValueError: what is made is no Module, cannot be copied, or returns other shapes or numbers that are not finite.
    """

    def __init__(
        self,
        make: Callable[..., Any],
        dims: tuple[int, int, int],
        members: int,
        generator: torch.Generator,
        noise_heads: bool,
    ) -> None:
        super().__init__()
        self.context_dim, self.noise_heads, self.n = dims[0], noise_heads, members
        made = []
        for seed in torch.randint(2**62, (members,), generator=generator).tolist():
            with torch.random.fork_rng(devices=[]):
                torch.default_generator.manual_seed(seed)
                made.append(network_of(make, dims))
        self.one_by_one = why_one_by_one(made, dims)
        self.networks = torch.nn.ModuleList(made if self.one_by_one else [stacked(made)])
        self.standardised = not isinstance(made[0], Network) or made[0].standardised
        self.log_variance = torch.nn.Parameter(torch.zeros(members, 1, dims[2]))  # of networks without noise heads

    @property
    def members(self) -> list[torch.nn.Module]:
        """The networks; those that are computed at once are copied."""
        if self.one_by_one:
            return list(self.networks)
        copies = [copy.deepcopy(self.networks[0]) for _ in range(self.n)]
        for member, network in enumerate(copies):
            for values in state_of(network).values():
                values.data = values.data[member]
        return copies

    def forward(self, x: torch.Tensor, scales: Scales) -> Output:
        """Mean and log variance ``(members, n, outcome_dim)`` for standardised ``(members, n, n_inputs)``."""
        if not self.standardised:
            x = scales.input_mean + scales.input_spread * x
        inputs = x[..., : self.context_dim], x[..., self.context_dim :]
        answer = each(self.networks, *inputs) if self.one_by_one else at_once(self.networks[0], *inputs)
        mean, log_variance = answer if isinstance(answer, tuple) else (answer, None)
        if not self.standardised:
            mean = (mean - scales.outcome_mean) / scales.outcome_spread
        if log_variance is None or not self.noise_heads:
            return mean, self.log_variance.expand_as(mean)
        return mean, log_variance if self.standardised else log_variance - 2 * scales.outcome_spread.log()

    def rescale(self, old: Scales, new: Scales) -> None:
        """Change nothing."""


def state_of(network: torch.nn.Module) -> dict[str, torch.Tensor]:
    """Parameters and buffers by name."""
    return {**dict(network.named_parameters()), **dict(network.named_buffers())}


def stacked(networks: Sequence[torch.nn.Module]) -> torch.nn.Module:
    """A module with parameters and buffers of all ``networks``, along a first axis."""
    whole, (weights, buffers) = copy.deepcopy(networks[0]), stack_module_state(list(networks))
    for name, values in state_of(whole).items():
        values.data = {**weights, **buffers}[name].data
    return whole


def at_once(whole: torch.nn.Module, context: torch.Tensor, theta: torch.Tensor) -> torch.Tensor | Output:
    """Answers of the networks in ``whole``, which are `stacked`, each for its own ``(n, ...)`` inputs."""

    def one(state: dict[str, torch.Tensor], *inputs: torch.Tensor) -> Any:
        return functional_call(whole, state, inputs)

    answer: torch.Tensor | Output = torch.vmap(one, randomness="different")(state_of(whole), context, theta)
    return answer


def each(networks: Iterable[torch.nn.Module], context: torch.Tensor, theta: torch.Tensor) -> torch.Tensor | Output:
    """Answers of ``networks``, one after the other, each for its own ``(n, ...)`` inputs."""
    answers = [network(*inputs) for network, *inputs in zip(networks, context, theta, strict=True)]
    if isinstance(answers[0], tuple):
        mean, log_variance = map(torch.stack, zip(*answers, strict=True))
        return mean, log_variance
    return torch.stack(answers)


def why_one_by_one(networks: Sequence[torch.nn.Module], dims: tuple[int, int, int]) -> str:
    """Why ``networks`` cannot be computed at once, as a trial shows; "": they can."""
    ones, generator = copy.deepcopy(list(networks)), torch.Generator().manual_seed(0)
    inputs = [torch.rand(len(ones), _TRIED, dim, generator=generator) for dim in dims[:2]]
    with torch.random.fork_rng(devices=[]), torch.no_grad():
        try:
            whole = stacked(ones)
            for module in (*ones, whole):
                module.train()
            at_once(whole, *inputs), each(ones, *inputs)  # what they remember of training must be the same, too
            for module in (*ones, whole):
                module.eval()
            torch.testing.assert_close(at_once(whole, *inputs), each(ones, *inputs), rtol=1e-3, atol=1e-4)
        except Exception as error:  # vmap and a user's module may raise anything
            return f"{type(error).__name__}: {str(error).strip().partition(chr(10))[0]}"
    return ""


def network_of(make: Callable[..., Any], dims: tuple[int, int, int]) -> torch.nn.Module:
    """A copy of the network that ``make`` makes, after a trial; see `OwnNetworks`."""
    what = f"network {described(make)}"
    made = make if isinstance(make, torch.nn.Module) else call_checked(what, make, *dims)
    if not isinstance(made, torch.nn.Module):
        raise ValueError(f"{what} must make a torch.nn.Module, made a {type(made).__name__}")
    try:
        network = copy.deepcopy(made)
    except Exception as error:  # a user's module may raise anything
        raise ValueError(f"{what} cannot be copied: {type(error).__name__}: {error}") from error
    context, theta = torch.rand(_TRIED, dims[0]), torch.rand(_TRIED, dims[1], requires_grad=True)
    given = f"context {tuple(context.shape)} and theta {tuple(theta.shape)}"
    try:
        answer = network(context, theta)
    except Exception as error:
        raise ValueError(f"{what} fails for {given}: {type(error).__name__}: {error}") from error
    parts = answer if isinstance(answer, tuple) else (answer,)
    got = [tuple(part.shape) if isinstance(part, torch.Tensor) else type(part).__name__ for part in parts]
    wanted = _TRIED, dims[2]
    if got not in ([wanted], [wanted, wanted]):
        shapes = " and ".join(map(str, got))
        raise ValueError(f"{what} must return mean {wanted}, or mean and log variance, for {given}; got {shapes}")
    if not all(part.isfinite().all() for part in parts):
        raise ValueError(f"{what} returns NaN or infinity for {given} in [0, 1]")
    if not parts[0].requires_grad:
        raise ValueError(f"{what} returns a mean without gradient; is it detached, or computed by numpy?")
    return network


def described(make: Callable[..., Any]) -> str:
    """Place of the network or function ``make``, as ``package.module:name``, and its options."""
    kind = type(make) if isinstance(make, torch.nn.Module) else function_of(make)
    options = ", ".join(f"{name}={value}" for name, value in make.keywords.items()) if isinstance(make, partial) else ""
    return f"{kind.__module__}:{kind.__qualname__}{f'({options})' * bool(options)}"


def nll(mean: torch.Tensor, log_variance: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
    """Negative log likelihood of each of the ``values``, up to a constant."""
    return 0.5 * (log_variance + (values - mean) ** 2 * (-log_variance).exp())
