"""The multilayer perceptron that both learners train, and its conversion to and from the layers of a network file."""

from collections.abc import Sequence
from typing import Any, TypeAlias

import flax.linen as nn
import jax
import jax.numpy as jnp
import numpy as np

from chefshat.learn.network import Layer

#: The parameters of an `Mlp`: {"Dense_0": {"kernel": (in, out), "bias": (out,)}, "Dense_1": ...}.
Params: TypeAlias = dict[str, dict[str, jax.Array]]


class Mlp(nn.Module):
    """Dense layers with ReLU between them and no activation after the last.

    Attributes:
        widths: units of each layer, the output layer included.
        kernel_init: initializer of the hidden layers' weights. Biases start at 0.
        output_init: initializer of the output layer's weights.
    """

    widths: tuple[int, ...]
    kernel_init: nn.initializers.Initializer = nn.initializers.glorot_uniform()
    output_init: nn.initializers.Initializer = nn.initializers.glorot_uniform()

    @nn.compact
    def __call__(self, inputs: jax.Array) -> jax.Array:
        """Computes the outputs of rows of inputs."""
        values = inputs
        for width in self.widths[:-1]:
            values = nn.relu(nn.Dense(width, kernel_init=self.kernel_init)(values))
        return nn.Dense(self.widths[-1], kernel_init=self.output_init)(values)

    def start(self, key: jax.Array, inputs: int) -> Params:
        """Returns new parameters for rows of `inputs` numbers."""
        params: Params = self.init(key, jnp.zeros((1, inputs)))["params"]
        return params

    def of(self, params: Params, inputs: jax.Array) -> jax.Array:
        """Computes the outputs by given parameters."""
        return self.apply({"params": params}, inputs)  # type: ignore[return-value]  # Not mutable: no variables with it.


def to_layers(params: Params) -> list[Layer]:
    """Converts parameters to the layers of a network file."""
    dense = (params[f"Dense_{number}"] for number in range(len(params)))
    return [Layer(np.array(layer["kernel"], np.float32).T.copy(), np.array(layer["bias"], np.float32)) for layer in dense]


def stack(networks: Sequence[Sequence[Layer]]) -> Params:
    """Converts the layers of networks of one shape to parameters with a leading axis, one entry per network."""
    params: Any = {
        f"Dense_{number}": {
            "kernel": jnp.stack([jnp.asarray(layer.weight.T) for layer in layers]),
            "bias": jnp.stack([jnp.asarray(layer.bias) for layer in layers]),
        }
        for number, layers in enumerate(zip(*networks, strict=True))
    }
    stacked: Params = params
    return stacked
