"""A training in a file: safetensors with every array that learning continues from, to the last bit, and texts as metadata.

The meaning of the arrays and texts is in `checkpoint` (Deep Q) and `ppo_checkpoint`. The network alone, which is what an agent
needs, is in a file of its own (see `network`).
"""

import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Literal, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
import safetensors
import safetensors.numpy
from google.protobuf import json_format

from chefshat import pb
from chefshat.files import check_readable, write_atomically
from chefshat.learn.network import NetworkInfo

State = TypeVar("State")


class TrainingFileError(ValueError):
    """A file is not a training of the expected format. The message names the file and the problem."""


class Contents:
    """The contents of an open file.

    Attributes:
        form: the format.
        texts: the texts by name.
    """

    def __init__(self, file: Any, texts: Mapping[str, str]) -> None:  # noqa: ANN401 - safetensors has no types.
        self._file = file
        self.texts = texts
        self.form = texts["format"]

    @property
    def rules(self) -> pb.RuleSet:
        """The rule set."""
        return json_format.Parse(self.texts["rules"], pb.RuleSet())

    def tensor(self, name: str) -> np.ndarray[Any, Any]:
        """Reads one array."""
        return np.asarray(self._file.get_tensor(name))

    def state(self, make: Callable[[], State], *, transposed: bool = False) -> State:
        """Reads the arrays into the structure that `make` would return. `make` is only traced.

        Args:
            make: returns a state of the right structure and shapes.
            transposed: whether the file has weights as (out, in).
        """
        template = jax.eval_shape(make)
        # Keys have a type of their own, which the plain numbers of the file do not show.
        are_keys = [_is_key(leaf) for leaf in jax.tree.leaves(template)]
        leaves = []
        for (name, leaf), is_key in zip(_named(jax.eval_shape(lambda: _plain(make()))), are_keys, strict=True):
            tensor = self.tensor(name)
            if transposed and tensor.ndim == 2:
                tensor = tensor.T
            if (tensor.shape, tensor.dtype) != (leaf.shape, leaf.dtype):
                raise ValueError(f"its {name} is {tensor.dtype}{list(tensor.shape)}, not {leaf.dtype}{list(leaf.shape)}")
            leaves.append(jax.random.wrap_key_data(jnp.asarray(tensor)) if is_key else jnp.asarray(tensor))
        state: State = jax.tree.unflatten(jax.tree.structure(template), leaves)
        return state


def save(path: str | os.PathLike[str], form: str, state: object, rules: pb.RuleSet, texts: Mapping[str, str]) -> None:
    """Writes a training to a file atomically.

    Args:
        path: the file; an existing one is replaced.
        form: the name of the format.
        state: arrays of jax in tuples and dictionaries.
        rules: the rule set.
        texts: further metadata.

    Raises:
        OSError: the file cannot be written.
    """
    metadata = {"format": form, "rules": rules_text(rules), **texts}
    tensors = {name: np.asarray(leaf) for name, leaf in _named(_plain(state))}
    write_atomically(path, safetensors.numpy.save(tensors, metadata=metadata))


@contextmanager
def opened(path: str | os.PathLike[str], *forms: str) -> Iterator[Contents]:
    """Opens a file of one of the formats, the current one first.

    Raises:
        TrainingFileError: the file is not of these formats, or its contents are wrong.
        OSError: the file cannot be read.
    """
    check_readable(path, "training", "`python -m chefshat.learn ppo` or `deep-q` writes beside its network")
    try:
        with safetensors.safe_open(path, framework="np") as file:
            metadata = file.metadata() or {}
            if metadata.get("format") not in forms:
                raise ValueError(f"its format is {metadata.get('format')!r}, not {forms[0]!r}")
            yield Contents(file, metadata)
    except KeyError as missing:
        raise TrainingFileError(f"{os.fspath(path)} is not a training: it has no {missing}") from missing
    except (ValueError, TypeError, safetensors.SafetensorError, json_format.ParseError) as error:
        raise TrainingFileError(f"{os.fspath(path)} is not a training: {error}") from error


def network_info(
    rules: pb.RuleSet,
    name: str,
    trained_by: str,
    *,
    input: Literal["classic", "table"],
    output: Literal["turns", "actions", "points"],
    masked: bool,
) -> NetworkInfo:
    """Describes a network trained under a rule set, without an activation of its outputs."""
    return NetworkInfo(
        input=input,
        output=output,
        output_activation="none",
        masked=masked,
        players=rules.players,
        faces=rules.faces,
        jokers=rules.jokers,
        rules=rules_text(rules),
        name=name,
        trained_by=trained_by,
    )


def rules_text(rules: pb.RuleSet) -> str:
    """Formats a rule set as canonical protobuf JSON on one line."""
    return json_format.MessageToJson(rules, indent=None)


def _is_key(leaf: Any) -> bool:  # noqa: ANN401 - An array or its shape.
    return bool(jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key))


def _plain(state: State) -> State:
    """Converts keys to plain numbers, which a file can hold."""
    plain: State = jax.tree.map(lambda leaf: jax.random.key_data(leaf) if _is_key(leaf) else leaf, state)
    return plain


def _named(state: object) -> list[tuple[str, Any]]:
    """Returns the arrays with their names in files, such as "online.0.1" for the bias of the first layer."""

    def short(found: re.Match[str]) -> str:
        return f"{found[1]}.{'0' if found[2] == 'kernel' else '1'}"

    leaves = jax.tree_util.tree_leaves_with_path(state)
    names = (jax.tree_util.keystr(path, simple=True, separator=".") for path, _ in leaves)
    return [(re.sub(r"Dense_(\d+)\.(kernel|bias)", short, name), leaf) for name, (_, leaf) in zip(names, leaves, strict=True)]
