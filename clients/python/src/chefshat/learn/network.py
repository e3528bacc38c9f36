"""A trained network as a safetensors file, read by this package and by `chefshat` (the program).

The file's tensors are `layer0.weight` (out, in), `layer0.bias` (out,), `layer1.weight` and so on, in float32 or float16. Between
layers is max(0, x), which is 0 where x is NaN. The metadata are texts and describe the network: `NetworkInfo`. Also here: computing
the outputs with numpy, and choosing an action. Training is elsewhere, and so are checkpoints of a training.
"""

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal, NamedTuple, Self, TypeAlias, cast

import numpy as np
import numpy.typing as npt
import safetensors
import safetensors.numpy

from chefshat.columns import Observations, Situations
from chefshat.errors import ChefsHatError
from chefshat.files import check_readable, write_atomically
from chefshat.learn import features
from chefshat.masks import unpack
from chefshat.vector_setup import MAX_NETWORK_BYTES

FORMAT = "chefshat-network-1"
# The built-in agent that is a network.
TRAINED = "trained"
# Its value network.
TRAINED_POINTS = "trained_points"
# Maximum number of units or inputs of a layer that `chefshat` reads.
MAX_UNITS = 8192

Floats = npt.NDArray[np.float32]
Actions = npt.NDArray[np.uint16]


class NetworkFileError(ValueError):
    """A file is not a network of this format. The message names the file and the problem."""


class Layer(NamedTuple):
    """One layer: weight (out, in) and bias (out,)."""

    weight: npt.NDArray[np.floating]
    bias: npt.NDArray[np.floating]


AnyLayer: TypeAlias = Layer | tuple[npt.NDArray[np.floating], npt.NDArray[np.floating]]


@dataclass(frozen=True)
class NetworkInfo:
    """The description of a network.

    Attributes:
        input: the function of `features` that computes its input.
        output: "actions": an output for each of the A actions; "turns": for the T actions of a turn; at other decisions the agent
            takes the default action; "points": a value network, the points that the seat expects of the Shift, at decisions among
            several actions.
        output_activation: activation of the last layer. It does not affect the actions chosen.
        masked: whether it was trained to choose only among legal actions. Agents that play it always do.
        players: seats of the rule set, N.
        faces: faces of the deck, F.
        jokers: jokers of the deck.
        rules: the rule set it was trained under, as canonical protobuf JSON of `pb.RuleSet`.
        name: name of the agent.
        trained_by: the command that trained it.
    """

    input: Literal["classic", "table"]
    output: Literal["turns", "actions", "points"]
    output_activation: Literal["none", "tanh"]
    masked: bool
    players: int
    faces: int
    jokers: int
    rules: str
    name: str
    trained_by: str

    @property
    def hand_size(self) -> int:
        """Cards dealt to a hand, H."""
        return features.dealt(self.players, self.faces, self.jokers)

    @property
    def input_width(self) -> int:
        """Numbers of one row of features."""
        if self.input == "classic":
            return features.classic_width(self.faces, self.hand_size)
        return features.table_width(self.players, self.faces)

    @property
    def output_width(self) -> int:
        """Numbers of one row of outputs."""
        if self.output == "points":
            return 1
        return features.turn_actions(self.faces) if self.output == "turns" else features.num_actions(self.faces)

    def fits(self, players: int, faces: int, hand_size: int) -> bool:
        """Whether games of this size have the features the network was trained on. The jokers only matter through the hand size."""
        return (players, faces, hand_size) == (self.players, self.faces, self.hand_size)

    @classmethod
    def of(cls, metadata: Mapping[str, str]) -> Self:
        """Reads the metadata of a file. Raises `ValueError` if something is missing or wrong."""

        def one_of(key: str, *allowed: str) -> str:
            value = metadata.get(key)
            if value not in allowed:
                raise ValueError(f"its {key} is {value!r}, not one of {', '.join(allowed)}")
            return value

        def number(key: str, low: int, high: int) -> int:
            value = metadata.get(key, "")
            if not (value.isascii() and value.isdigit() and low <= int(value) <= high):
                raise ValueError(f"its {key} is {value!r}, not a number in {low}..={high}")
            return int(value)

        one_of("format", FORMAT)
        return cls(
            input="classic" if one_of("input", "classic", "table") == "classic" else "table",
            output=cast(Literal["turns", "actions", "points"], one_of("output", "turns", "actions", "points")),
            output_activation="tanh" if one_of("output_activation", "none", "tanh") == "tanh" else "none",
            masked=one_of("masked", "true", "false") == "true",
            players=number("players", 2, 6),
            faces=number("faces", 4, 15),
            jokers=number("jokers", 0, features.MAX_JOKERS),
            rules=metadata.get("rules", ""),
            name=metadata.get("name", ""),
            trained_by=metadata.get("trained_by", ""),
        )

    def metadata(self) -> dict[str, str]:
        """Returns the metadata of a file."""
        texts = {key: str(value) for key, value in asdict(self).items()}
        return {"format": FORMAT, **texts, "masked": json.dumps(self.masked)}


class Network:
    """A network, computed with numpy in float32.

    Attributes:
        layers: the layers in float32, first to last.
        info: the description.
    """

    def __init__(self, layers: Sequence[AnyLayer], info: NetworkInfo) -> None:
        """Raises `ValueError` if the layers do not fit each other or the description."""
        self.layers = tuple(Layer(weight.astype(np.float32), bias.astype(np.float32)) for weight, bias in layers)
        self.info = info
        if not self.layers:
            raise ValueError("it has no layers")
        width = info.input_width
        for number, (weight, bias) in enumerate(self.layers):
            if weight.ndim != 2 or bias.ndim != 1 or weight.shape != (len(bias), width):
                raise ValueError(f"layer {number} has weights {weight.shape} and biases {bias.shape} for {width} inputs")
            if not (np.isfinite(weight).all() and np.isfinite(bias).all()):
                raise ValueError(f"layer {number} has numbers that are not finite")
            width = len(bias)
        if width != info.output_width:
            raise ValueError(f"its last layer has {width} outputs, not the {info.output_width} of its {info.output}")

    def inputs(self, observations: Observations, seats: features.Bytes, kinds: features.Bytes, mask_bits: features.Bytes) -> Floats:
        """Computes the network's input, (R, `info.input_width`) float32."""
        info = self.info
        if info.input == "classic":
            return features.classic(observations, mask_bits, faces=info.faces, hand_size=info.hand_size)
        return features.table(
            observations, seats, kinds, mask_bits, players=info.players, faces=info.faces, hand_size=info.hand_size
        )

    def outputs(self, inputs: Floats) -> Floats:
        """Computes the network's output for each row of features, (R, `info.output_width`) float32."""
        sums = self._sums(inputs)
        return np.tanh(sums) if self.info.output_activation == "tanh" else sums

    def _sums(self, inputs: Floats) -> Floats:
        """Computes the outputs before their activation."""
        values = inputs
        for number, (weight, bias) in enumerate(self.layers):
            values = (np.fmax(values, 0) if number else values) @ weight.T + bias
        return values

    def _sums_of(self, situations: Situations) -> Floats:
        observations, seats, kinds, masks = situations.observations, situations.seats, situations.kinds, situations.mask_bits
        return self._sums(self.inputs(observations, seats, kinds, masks))

    def points_of(self, situations: Situations) -> Floats:
        """Returns the points that the seat of each row expects of the Shift, (R,) float32, by a value network.

        It has learned from decisions among several actions. A `leaf` of `search.Position.evaluate`.
        """
        if self.info.output != "points":
            raise ValueError(f"the network {self.info.name!r} has outputs for {self.info.output}: `value` trains one for points")
        return self._sums_of(situations)[:, 0]

    def logits_of(self, situations: Situations) -> Floats:
        """Returns the outputs of each row before their activation, (R, `info.output_width`) float32; -inf at illegal actions.

        The softmax of a row is the policy that `ppo` trained, of which `actions_of` takes the most likely action.
        """
        self._check_chooses()
        sums = self._sums_of(situations)
        return np.where(unpack(situations.mask_bits, sums.shape[1]), sums, np.float32(-np.inf))

    def actions(
        self, observations: Observations, seats: features.Bytes, kinds: features.Bytes, mask_bits: features.Bytes
    ) -> Actions:
        """Returns the action of each row, (R,) u16: the legal one with the highest output, the lowest index of equal ones.

        A network of output "turns" has no outputs for other decisions, at which agents take the server's default action.
        """
        self._check_chooses()
        # Before the tanh, which preserves order but rounds values far from 0 to the same number.
        return best_legal(self._sums(self.inputs(observations, seats, kinds, mask_bits)), mask_bits)

    def _check_chooses(self) -> None:
        if self.info.output == "points":
            raise ValueError(f"the value network {self.info.name!r} chooses no actions")

    def actions_of(self, situations: Situations) -> Actions:
        """Returns the action of each row of a batch, or of `Decision.situations`: (R,) u16. See `actions`."""
        return self.actions(situations.observations, situations.seats, situations.kinds, situations.mask_bits)


def best_legal(outputs: Floats, mask_bits: features.Bytes) -> Actions:
    """Returns the legal action with the highest output, (R,) u16: the lowest index of equal ones; 0 where no output is legal.

    NaN, from the overflow of large weights, counts as the lowest output.
    """
    legal = unpack(mask_bits, outputs.shape[1])
    best = np.argmax(np.where(legal & ~np.isnan(outputs), outputs, -np.inf), axis=1)
    # Where every legal output is the lowest, illegal ones are equal to them.
    allowed = np.take_along_axis(legal, best[:, np.newaxis], axis=1)[:, 0]
    chosen: Actions = np.where(allowed, best, np.argmax(legal, axis=1)).astype(np.uint16)
    return chosen


def save(
    path: str | os.PathLike[str],
    layers: Sequence[AnyLayer],
    info: NetworkInfo,
    *,
    dtype: type[np.float16] | type[np.float32] = np.float32,
) -> None:
    """Writes a network to a file atomically; an existing one is replaced.

    Raises ValueError as `encoded`, OSError if the file cannot be written.
    """
    write_atomically(path, encoded(layers, info, dtype=dtype))


def encoded(layers: Sequence[AnyLayer], info: NetworkInfo, *, dtype: type[np.float16] | type[np.float32] = np.float32) -> bytes:
    """Returns the content of a network's file.

    Args:
        layers: (weight, bias) of each layer, first to last.
        info: the description.
        dtype: type of the numbers in the file.

    Raises:
        ValueError: the layers do not fit each other or the description, contain numbers out of the range of `dtype`, or are too
            large for the agents of `chefshat`.
    """
    tensors: dict[str, npt.NDArray[np.floating]] = {}
    for number, (weight, bias) in enumerate(Network(layers, info).layers):
        # Overflow gives infinity, which is refused below.
        with np.errstate(over="ignore"):
            tensors[f"layer{number}.weight"], tensors[f"layer{number}.bias"] = weight.astype(dtype), bias.astype(dtype)
    if not all(np.isfinite(tensor).all() for tensor in tensors.values()):
        raise ValueError(f"its weights are too large for {dtype.__name__}")
    file = safetensors.numpy.save(tensors, metadata=info.metadata())
    most = max(size for tensor in tensors.values() for size in tensor.shape)
    if most > MAX_UNITS or len(file) > MAX_NETWORK_BYTES:
        raise ValueError(
            f"a network of {len(file) >> 20} MiB with layers of up to {most:,} units: agents read at most "
            f"{MAX_NETWORK_BYTES >> 20} MiB and {MAX_UNITS:,} units"
        )
    return file


def load(path: str | os.PathLike[str]) -> Network:
    """Reads a network from a file, or that of the built-in agent: "trained", which is in chefshat-native.

    "trained_points" is the value network of `trained`, in this package.

    Raises:
        NetworkFileError: the file is not a network.
        OSError: it cannot be read.
        ChefsHatError: "trained" without chefshat-native.
    """
    if os.fspath(path) == TRAINED:
        try:
            import chefshat_native
        except ModuleNotFoundError as error:
            words = f"the network of `{TRAINED}` is in the package chefshat-native: pip install ./chefshat_native-*.whl"
            raise ChefsHatError("NATIVE_MISSING", words) from error
        file = chefshat_native.trained_network()
    elif os.fspath(path) == TRAINED_POINTS:
        file = Path(__file__).with_name(f"{TRAINED_POINTS}.safetensors").read_bytes()
    else:
        check_readable(path, "network", "`python -m chefshat.learn ppo` or `deep-q` writes")
        file = Path(path).read_bytes()
    return parse(file, os.fspath(path))


def parse(file: bytes, name: str) -> Network:
    """Reads a network from the content of a file, which error messages name. Raises NetworkFileError if it is none."""
    try:
        tensors = safetensors.numpy.load(file)
        info = NetworkInfo.of(_metadata(file))
        layers = [Layer(tensors[f"layer{number}.weight"], tensors[f"layer{number}.bias"]) for number in range(len(tensors) // 2)]
        if len(tensors) % 2 or any(tensor.dtype not in (np.float16, np.float32) for tensor in tensors.values()):
            raise ValueError("its tensors are not pairs of weight and bias in float16 or float32")
        return Network(layers, info)
    except KeyError as missing:
        raise NetworkFileError(f"{name} is not a network: it has no tensor {missing}") from missing
    except (ValueError, safetensors.SafetensorError) as error:
        raise NetworkFileError(f"{name} is not a network: {error}") from error


def _metadata(file: bytes) -> dict[str, str]:
    """Returns the texts of a safetensors file: its header is JSON, after its length in 8 bytes, little-endian."""
    length = int.from_bytes(file[:8], "little")
    texts: dict[str, str] = json.loads(file[8 : 8 + length]).get("__metadata__", {})
    return texts
