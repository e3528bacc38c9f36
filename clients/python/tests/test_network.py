"""Network files: writing and reading, errors, and the fixtures shared with Rust."""

import contextlib
import itertools
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import safetensors.numpy
from hand_made import hand_made

from chefshat import SeatInfo, VectorEnv, pb
from chefshat.learn import features, network
from chefshat.learn.__main__ import main, parse
from chefshat.learn.command import MAX_WIDTH
from chefshat.learn.network import Layer, Network, NetworkFileError, NetworkInfo
from chefshat.learn.play import NetworkAgent, RulesDoNotFit
from chefshat.vector_setup import MAX_NETWORK_BYTES

FIXTURES = Path(__file__).resolve().parents[3] / "tests" / "fixtures" / "network"
INFO = NetworkInfo("table", "actions", "none", True, 4, 11, 2, '{"preset":"paper"}', "a name", "a command --with ünïcode")


def chance_layers(info: NetworkInfo, hidden: int = 5) -> list[Layer]:
    chance = np.random.default_rng(5)
    widths = [info.input_width, hidden, hidden, info.output_width]
    return [
        Layer(chance.normal(size=(outputs, inputs)).astype(np.float32), chance.normal(size=outputs).astype(np.float32))
        for inputs, outputs in itertools.pairwise(widths)
    ]


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_a_network_survives_writing_and_reading(tmp_path: Path, dtype: type[np.float16] | type[np.float32]) -> None:
    layers = chance_layers(INFO)
    network.save(tmp_path / "n.safetensors", layers, INFO, dtype=dtype)
    read = network.load(tmp_path / "n.safetensors")
    assert read.info == INFO
    assert len(read.layers) == len(layers)
    for (weight, bias), (weight_read, bias_read) in zip(layers, read.layers, strict=True):
        np.testing.assert_array_equal(weight.astype(dtype).astype(np.float32), weight_read)
        np.testing.assert_array_equal(bias.astype(dtype).astype(np.float32), bias_read)
    assert [path.name for path in tmp_path.iterdir()] == ["n.safetensors"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": "other"}, "format"),
        ({"input": "picture"}, "input"),
        ({"faces": "3"}, "faces"),
        ({"faces": "12"}, "layer 0"),
        ({"players": "four"}, "players"),
        ({"output": "turns"}, "214 outputs, not the 200"),
        ({"masked": "yes"}, "masked"),
    ],
)
def test_wrong_metadata_is_refused_with_a_reason(tmp_path: Path, change: dict[str, str], words: str) -> None:
    path = tmp_path / "n.safetensors"
    tensors = {f"layer{i}.{key}": value for i, layer in enumerate(chance_layers(INFO)) for key, value in layer._asdict().items()}
    path.write_bytes(safetensors.numpy.save(tensors, metadata={**INFO.metadata(), **change}))
    with pytest.raises(NetworkFileError, match=words) as refused:
        network.load(path)
    assert "n.safetensors" in str(refused.value)


def test_other_files_are_refused_with_a_reason(tmp_path: Path) -> None:
    path = tmp_path / "n.safetensors"
    path.write_bytes(b"cards")
    with pytest.raises(NetworkFileError, match="is not a network"):
        network.load(path)
    layers = chance_layers(INFO)
    tensors = {f"layer{i}.{key}": value for i, layer in enumerate(layers) for key, value in layer._asdict().items()}
    path.write_bytes(safetensors.numpy.save({**tensors, "other": layers[0].bias}, metadata=INFO.metadata()))
    with pytest.raises(NetworkFileError, match="pairs"):
        network.load(path)
    path.write_bytes(safetensors.numpy.save({"a": layers[0].bias, "b": layers[0].bias}, metadata=INFO.metadata()))
    with pytest.raises(NetworkFileError, match=r"layer0\.weight"):
        network.load(path)
    path.write_bytes(safetensors.numpy.save({**tensors, "layer1.bias": layers[1].bias * np.nan}, metadata=INFO.metadata()))
    with pytest.raises(NetworkFileError, match="not finite"):
        network.load(path)
    with pytest.raises(FileNotFoundError, match=r"there is no file .*nothing: give a network, which .* writes"):
        network.load(tmp_path / "nothing")
    with pytest.raises(IsADirectoryError, match="is a folder: give the network itself"):
        network.load(tmp_path)


@pytest.mark.server
@pytest.mark.parametrize(
    "arguments",
    [
        ["evaluate", "trained"],
        ["value", "trained", "--out", "OUT"],
        ["play", "trained", "--address", "127.0.0.1:1", "--code", "ABCDEF", "--name", "Ada"],
        ["ppo", "--begin-with", "trained", "--out", "OUT", "--decisions", "1"],
    ],
)
def test_the_network_of_trained_needs_a_package(
    arguments: list[str], real_address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "chefshat_native", None)
    address = [] if "--address" in arguments else ["--address", real_address]
    out = str(tmp_path / "n.safetensors")
    assert main([*(out if argument == "OUT" else argument for argument in arguments), *address, "--json"]) == 1
    error = json.loads(capsys.readouterr().out)
    assert (error["event"], error["reason"]) == ("error", "NATIVE_MISSING")
    assert "pip install ./chefshat_native-*.whl" in error["message"]
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("widths", "words"), [((8193, 1), r"up to 8,193 units"), ((6000, 6000), r"74 MiB .* at most 64 MiB")])
def test_networks_that_no_agent_reads_are_not_written(widths: tuple[int, int], words: str) -> None:
    sizes = INFO.input_width, *widths, INFO.output_width
    layers = [
        (np.zeros((outputs, inputs), np.float16), np.zeros(outputs, np.float16)) for inputs, outputs in itertools.pairwise(sizes)
    ]
    with pytest.raises(ValueError, match=words):
        network.encoded(layers, INFO, dtype=np.float16)


@pytest.mark.parametrize("arguments", [["ppo", "--decisions", "1"], ["value", "trained"]])
def test_the_widest_networks_of_trainings_are_read(
    arguments: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = [*arguments, "--out", str(tmp_path / "n"), "--width"]
    assert parse([*command, "4096"]).width == MAX_WIDTH == 4096
    with pytest.raises(SystemExit):
        parse([*command, "4097"])
    assert "agents read no larger networks" in capsys.readouterr().err
    # The rules with the most players and faces.
    largest = replace(INFO, players=6, faces=15)
    sizes = largest.input_width, MAX_WIDTH, MAX_WIDTH, largest.output_width
    assert 2 * sum((inputs + 1) * outputs for inputs, outputs in itertools.pairwise(sizes)) < MAX_NETWORK_BYTES - (1 << 20)


def test_weights_that_float16_cannot_hold_are_not_written(tmp_path: Path) -> None:
    layers = chance_layers(INFO)
    layers[1].weight[0, 0] = 1e6
    with pytest.raises(ValueError, match="too large for float16"):
        network.save(tmp_path / "n.safetensors", layers, INFO, dtype=np.float16)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("output", ["actions", "turns"])
def test_actions_are_the_best_legal_ones(output: str) -> None:
    info = replace(INFO, output="turns" if output == "turns" else "actions")
    net = Network(chance_layers(info), info)
    case = hand_made(200, seed=6)
    actions = case.actions(net)
    outputs = net.outputs(net.inputs(case, case.seats, case.kinds, case.mask_bits))
    legal = np.unpackbits(case.mask_bits, axis=1, bitorder="little")[:, : features.num_actions(11)].astype(bool)
    seen = set()
    for row, action in enumerate(actions):
        assert legal[row, action]
        if case.kinds[row] == pb.DECISION_KIND_TURN or output == "actions":
            seen.add("best")
            assert outputs[row, action] == max(outputs[row, other] for other in np.flatnonzero(legal[row][: outputs.shape[1]]))
    assert seen == {"best"}


def test_outputs_are_compared_before_tanh() -> None:
    info = replace(INFO, output_activation="tanh")
    ascending = np.arange(20, 20 + info.output_width, dtype=np.float32)
    net = Network([(np.zeros((info.output_width, info.input_width), np.float32), ascending)], info)
    case = hand_made(50, seed=8)
    outputs = net.outputs(net.inputs(case, case.seats, case.kinds, case.mask_bits))
    np.testing.assert_allclose(outputs, 1, atol=1e-6)
    legal = np.unpackbits(case.mask_bits, axis=1, bitorder="little")
    assert (legal.sum(axis=1) > 1).any()
    last = [np.flatnonzero(row)[-1] for row in legal]
    assert net.actions(case, case.seats, case.kinds, case.mask_bits).tolist() == last


def test_nan_outputs_never_win() -> None:
    nan, inf = np.nan, np.inf
    outputs = np.array([[9, nan, 1, 2], [9, 1, nan, 2], [9, nan, 1, nan], [9, nan, nan, nan], [9, -inf, nan, -inf]], np.float32)
    masks = np.full((len(outputs), 1), 0b1110, np.uint8)
    assert network.best_legal(outputs, masks).tolist() == [3, 3, 2, 1, 1]
    assert network.best_legal(outputs, masks * 0).tolist() == [0] * 5


def test_a_nan_hidden_unit_counts_as_zero() -> None:
    """Finite weights may overflow to NaN (inf - inf). Both implementations use 0 there; otherwise all outputs would be NaN."""
    huge = np.finfo(np.float32).max
    layers = chance_layers(INFO)
    layers[0].weight[0, :2] = huge, -huge
    inputs = np.full((1, INFO.input_width), 10, np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        assert np.isnan(inputs @ layers[0].weight.T)[0].tolist() == [True, False, False, False, False]
        outputs = Network(layers, INFO).outputs(inputs)
    layers[0].weight[0] = layers[0].bias[0] = 0
    np.testing.assert_allclose(outputs, Network(layers, INFO).outputs(inputs), rtol=1e-5)


def test_a_network_fits_rules_with_as_many_players_faces_and_cards_dealt() -> None:
    """The Rust tests read the same file."""
    rows = json.loads((FIXTURES / "fits.json").read_text())
    assert {row["fits"] for row in rows} == {True, False}
    for row in rows:
        agent = NetworkAgent(network.load(FIXTURES / f"{row['network']}.safetensors"))
        rules = pb.RuleSet(players=row["players"], faces=row["faces"], jokers=row["jokers"])
        seat = SeatInfo("", "", 0)
        seat.game_started = pb.GameStarted(rules=rules, hand_size=row["hand_size"])
        with contextlib.nullcontext() if row["fits"] else pytest.raises(RulesDoNotFit):
            agent.check_rules(rules)
        with contextlib.nullcontext() if row["fits"] else pytest.raises(RulesDoNotFit):
            agent.on_attached(seat)


@pytest.mark.parametrize("name", ["table-actions", "classic-turns", "small-table"])
def test_the_fixtures_are_reproduced(name: str) -> None:
    net = network.load(FIXTURES / f"{name}.safetensors")
    assert net.info.name == name
    rows = json.loads((FIXTURES / f"{name}.json").read_text())
    assert len(rows) >= 10
    seed = ["table-actions", "classic-turns", "small-table"].index(name)
    case = hand_made(len(rows), seed=seed, players=net.info.players, faces=net.info.faces, jokers=net.info.jokers)
    np.testing.assert_array_equal(case.hands, [row["hands"] for row in rows])
    inputs = net.inputs(case, case.seats, case.kinds, case.mask_bits)
    np.testing.assert_array_equal(inputs, np.array([row["features"] for row in rows], np.float32))
    np.testing.assert_allclose(net.outputs(inputs), [row["outputs"] for row in rows], rtol=1e-5, atol=1e-5)
    assert case.actions(net) == [row["action"] for row in rows]


def test_the_built_in_network_is_loaded_by_its_name() -> None:
    built_in = network.load("trained")
    source = Path(__file__).parents[3] / "server" / "agents" / "src" / "network" / "trained.safetensors"
    file = network.load(source)
    assert built_in.info == file.info
    assert built_in.info.name == "trained"
    for (weight, bias), (weight_read, bias_read) in zip(file.layers, built_in.layers, strict=True):
        np.testing.assert_array_equal(weight, weight_read)
        np.testing.assert_array_equal(bias, bias_read)


def test_logits_are_those_of_legal_actions() -> None:
    net = network.load("trained")
    with VectorEnv(games=8, client_seats=[0], opponents="greedy", seed=3) as env:
        batch = env.reset()
        for _ in range(20):
            logits = net.logits_of(batch)
            np.testing.assert_array_equal(np.isfinite(logits), batch.masks)
            np.testing.assert_array_equal(np.argmax(logits, axis=1), net.actions_of(batch))
            batch = env.step(net.actions_of(batch))
