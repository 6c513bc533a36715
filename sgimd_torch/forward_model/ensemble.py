"""An ensemble of networks; each network predicts a value and its noise.

Deep ensembles (Lakshminarayanan, Pritzel & Blundell, NeurIPS 2017). One batched matrix product per layer computes all
networks. `Ensemble` is a plain LightningModule, which any loop of Lightning can train; ``model.py`` trains it online.
    means, log_variances = Ensemble(25, 2, torch.Generator(), members=3)(inputs)
"""

from __future__ import annotations

import itertools
import math
from typing import Final

import torch
from lightning import LightningModule

_HIDDEN: Final = (64, 64)  # number of units of each hidden layer
_LOG_VARIANCES: Final = (-9.0, 3.0)  # bounds: the noise is 1 % to 450 % of the spread of outcomes


class Ensemble(LightningModule):
    """Networks that predict outputs and their noise. The caller standardises inputs and outputs.

    Args:
        n_inputs: dimension of the inputs.
        n_outputs: dimension of the outputs.
        generator: random stream of the weights.
        members: number of networks, which differ in their first weights.
        noise_heads: true: the predicted noise depends on the input; false: each output has one noise for all inputs.
        lr: learning rate of Adam.
        beta: exponent; the loss of an exemplar is its negative log likelihood times (noise variance)^beta. With 0 noisy
            exemplars hardly count; with .5 they are learnt, too (Seitzer et al., ICLR 2022).
    """

    def __init__(
        self,
        n_inputs: int,
        n_outputs: int,
        generator: torch.Generator,
        members: int,
        noise_heads: bool = True,
        *,
        lr: float = 1e-2,
        beta: float = 0.5,
    ) -> None:
        super().__init__()
        self.members, self.noise_heads, self.lr, self.beta = members, noise_heads, lr, beta
        self.weights, self.biases = torch.nn.ParameterList(), torch.nn.ParameterList()
        for n_in, n_out in itertools.pairwise([n_inputs, *_HIDDEN, 2 * n_outputs]):
            self.weights.append(torch.randn(members, n_in, n_out, generator=generator) / math.sqrt(n_in))
            self.biases.append(torch.zeros(members, 1, n_out))

    def forward(self, inputs: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Mean and log variance ``(members, n, n_outputs)`` for ``(n, n_inputs)``, or ``(members, n, n_inputs)``."""
        x = inputs.expand(self.members, *inputs.shape[-2:])
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = torch.baddbmm(bias, torch.nn.functional.silu(x) if layer else x, weight)
        mean, log_variance = x.chunk(2, dim=-1)
        if not self.noise_heads:
            # The noise is the last layer's bias alone.
            log_variance = self.biases[-1].chunk(2, dim=-1)[1].expand_as(mean)
        return mean, log_variance.clamp(*_LOG_VARIANCES)

    def training_step(self, batch: tuple[torch.Tensor, torch.Tensor], batch_idx: int = 0) -> torch.Tensor:
        """Loss for ``(inputs, outputs)``, ``(members, n, ...)`` each: negative log likelihood, weighted by ``beta``."""
        inputs, outputs = batch
        mean, log_variance = self(inputs)
        loss = nll(mean, log_variance, outputs)
        return (loss * (self.beta * log_variance).exp().detach()).mean()

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """Adam, in the fused implementation."""
        return torch.optim.Adam(self.parameters(), lr=self.lr, fused=True)


def nll(mean: torch.Tensor, log_variance: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
    """Negative log likelihood of each of the ``values``, up to a constant."""
    return 0.5 * (log_variance + (values - mean) ** 2 * (-log_variance).exp())
