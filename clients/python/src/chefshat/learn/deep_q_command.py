"""The command `python -m chefshat.learn deep-q`: trains one Deep Q agent against three built-in ones, and writes what remains.

Two files: the network, which `play` and the server's own agents can play by, and what a training goes on from. The agent is in
`deep_q`, its games in `deep_q_training`.
"""

import argparse
import dataclasses
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from chefshat import pb
from chefshat.errors import ChefsHatError, failed
from chefshat.learn import checkpoint, deep_q, deep_q_training, features, network
from chefshat.learn.checkpoint import Training, TrainingFileError
from chefshat.learn.deep_q import DeepQConfig
from chefshat.learn.deep_q_training import Played
from chefshat.vector import VectorEnv

# A resumed training plays other games than those it has played: its seeds are this far apart.
SEED_STEP = 2**32


def run(options: argparse.Namespace) -> int:
    """The command. Returns the exit code."""
    out: Path = options.out
    state: Path = options.checkpoint or out.with_suffix(".training")
    try:
        for path in (out, state):
            if not path.parent.is_dir():
                raise ValueError(f"there is no folder {path.parent} to write {path.name} to")
        training, played = _trained(options, state)
        checkpoint.save(state, training)
        (net,) = training.networks(options.name)
        network.save(out, net.layers, net.info)
    except (ChefsHatError, TrainingFileError, OSError, ValueError) as error:
        return failed(error, as_json=options.json)
    told = _told(played)
    if options.json:
        print(json.dumps({"event": "trained", "file": str(out), "training": str(state), **told}))
    else:
        print(f"{out}: {options.shifts:,} Shifts against {options.opponents}, of which the last {told['last_shifts']:,}:")
        print(
            f"  won {told['won']:.1%}, mean place {told['mean_place']:.2f}, wrong actions per Shift {told['wrong_per_shift']:.2f}"
        )
        print(f"{state}: what the training goes on from with --resume")
    return 0


def _trained(options: argparse.Namespace, state: Path) -> tuple[Training, Played]:
    before = checkpoint.load(state) if options.resume else None
    parameters = _parameters(options)
    rules = pb.RuleSet(preset=options.rules)
    if before is not None:
        rules.CopyFrom(before.rules)
    rules.ClearField("target_points")
    rules.target_shifts = options.shifts
    updates = 0 if before is None else int(before.agents.updates[0])
    env = VectorEnv(
        options.address,
        1,
        client_seats=[0],
        opponents=options.opponents,
        rewards=options.rewards,
        episode="shift",
        decisions="turns",
        invalid="ask_again",
        total_games=1,
        seed=options.seed + SEED_STEP * updates,
        rules=rules,
        shift_statistics=True,
    )
    with env, tqdm(total=options.shifts, unit=" Shifts", file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar:
        if before is None:
            inputs, outputs = features.classic_width(env.faces, env.hand_size), env.turn_actions
            config = DeepQConfig(inputs=inputs, outputs=outputs, **parameters)
            agents = deep_q.start(config, [options.seed])
        else:
            config, agents = before.config, before.agents
        agents, played = deep_q_training.play(env, config, agents, advance=bar.update)
        return Training(config, agents, env.rules, options.trained_by), played


def _parameters(options: argparse.Namespace) -> dict[str, Any]:
    """The hyper-parameters that are not standard: those of a file, and the mask."""
    if options.parameters is None:
        return {"mask": options.mask}
    plain = json.loads(options.parameters.read_text(encoding="utf-8"))
    found = plain.get("parameters") if isinstance(plain, dict) else None
    known = {field.name for field in dataclasses.fields(DeepQConfig)} - {"inputs", "outputs", "mask"}
    if not isinstance(found, dict) or not found.keys() <= known:
        raise ValueError(f'{options.parameters} has no object "parameters" with some of {", ".join(sorted(known))}')
    return {**found, **({"hidden": tuple(found["hidden"])} if "hidden" in found else {}), "mask": options.mask}


def _told(played: Played) -> dict[str, float]:
    """How good it was in the last tenth of the Shifts."""
    seats = {name: counted[0, :, 0] for name, counted in played.of_seats.items()}
    last = max(1, len(seats["places"]) // 10)
    return {
        "last_shifts": last,
        "won": float(np.mean(seats["places"][-last:] == 1)),
        "mean_place": float(np.mean(seats["places"][-last:])),
        "wrong_per_shift": float(np.mean(seats["wrong"][-last:])),
    }
