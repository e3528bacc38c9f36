"""Generates tests/fixtures/network: small networks of random weights; observations with their features, outputs and actions.

Run it with the package's `learn` extra installed: `python tools/network_fixtures.py`. The Rust and the Python tests read the same
files, so that both compute the same. The observations are random (tests/hand_made.py). The JSON has single-precision numbers in
full.
"""

import itertools
import json
import sys
from pathlib import Path

import numpy as np

from chefshat import pb
from chefshat.files import write_atomically
from chefshat.learn import network
from chefshat.learn.network import Layer, Network, NetworkInfo

HERE = Path(__file__).resolve().parent
OUT = HERE.parents[2] / "tests" / "fixtures" / "network"
ROWS = 12
HIDDEN = 6

sys.path.insert(0, str(HERE.parent / "tests"))
from hand_made import HandMade, hand_made  # noqa: E402 (imported from the path above)

CASES = {
    "table-actions": NetworkInfo("table", "actions", "none", True, 4, 11, 2, '{"preset":"paper"}', "table-actions", "chance"),
    "classic-turns": NetworkInfo("classic", "turns", "tanh", False, 4, 11, 2, '{"preset":"paper"}', "classic-turns", "chance"),
    "small-table": NetworkInfo(
        "table", "actions", "none", True, 3, 5, 1, '{"players":3,"faces":5,"jokers":1}', "small-table", "chance"
    ),
}
COLUMNS = ("hands", "boards", "cards_left", "passed", "places", "roles", "points", "played", "gave", "received")


def layers(info: NetworkInfo, chance: np.random.Generator) -> list[Layer]:
    """Draws two layers of numbers that float16 represents exactly."""
    widths = [info.input_width, HIDDEN, info.output_width]
    return [
        Layer(*(chance.integers(-64, 65, shape).astype(np.float32) / 64 for shape in ((outputs, inputs), (outputs,))))
        for inputs, outputs in itertools.pairwise(widths)
    ]


def row(case: HandMade, net: Network, index: int) -> dict[str, object]:
    """Returns one row as JSON: the observation, then what follows from it."""
    inputs = net.inputs(case, case.seats, case.kinds, case.mask_bits)
    return {
        "seat": int(case.seats[index]),
        "kind": pb.DecisionKind.Name(pb.DecisionKind.ValueType(int(case.kinds[index]))),
        "pizza": int(case.pizzas[index]),
        "golden": bool(case.golden[index]),
        **{name: getattr(case, name)[index].tolist() for name in COLUMNS},
        "legal": np.flatnonzero(np.unpackbits(case.mask_bits[index], bitorder="little")).tolist(),
        "features": inputs[index].tolist(),
        "outputs": net.outputs(inputs)[index].tolist(),
        "action": case.actions(net)[index],
    }


def main() -> None:
    """Writes the folder."""
    OUT.mkdir(parents=True, exist_ok=True)
    for number, (name, info) in enumerate(CASES.items()):
        net = Network(layers(info, np.random.default_rng(number)), info)
        network.save(OUT / f"{name}.safetensors", net.layers, info, dtype=np.float16 if number == 0 else np.float32)
        case = hand_made(ROWS, seed=number, players=info.players, faces=info.faces, jokers=info.jokers)
        rows = ",\n".join(json.dumps(row(case, net, index)) for index in range(ROWS))
        write_atomically(OUT / f"{name}.json", f"[\n{rows}\n]\n")


if __name__ == "__main__":
    main()
