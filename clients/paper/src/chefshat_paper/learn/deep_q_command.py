"""The command `python -m chefshat_paper.learn deep-q`: trains one Deep Q agent against three built-in ones.

Writes two files: the network, which `play` and the server's agents can use, and a checkpoint to resume from. They are written every
`--save-every` Shifts, at the end, and on Ctrl-C. The agent is in `deep_q`, its games are in `deep_q_training`.
"""

import argparse
import dataclasses
import json
import logging
import sys
from pathlib import Path
from typing import Any

import numpy as np
from chefshat import join_options, pb
from chefshat.errors import ChefsHatError, failed
from chefshat.files import check_readable
from chefshat.learn import features, network, runs
from chefshat.learn.training_file import TrainingFileError
from chefshat.vector import VectorEnv
from tqdm import tqdm

from chefshat_paper.learn import checkpoint, deep_q, deep_q_training
from chefshat_paper.learn.checkpoint import Training
from chefshat_paper.learn.deep_q import Agents, DeepQConfig
from chefshat_paper.learn.deep_q_training import Played

LOG = logging.getLogger("chefshat.learn")


class Stopped(Exception):
    """Ctrl-C stopped the training, which has been saved."""

    def __init__(self, shifts: int) -> None:
        super().__init__(f"stopped after {shifts:,} Shifts")
        self.shifts = shifts


def run(options: argparse.Namespace) -> int:
    """Runs the command. Returns the exit code."""
    out: Path = options.out
    state: Path = options.checkpoint or out.with_suffix(".training")
    try:
        with runs.reserved(out, state, replace=options.resume or options.force):
            played = _train(options, state)
    except Stopped as stopped:
        if options.json:
            print(json.dumps({"event": "interrupted", "file": str(out), "training": str(state), "shifts": stopped.shifts}))
        else:
            print(
                f"interrupted after {stopped.shifts:,} of {options.shifts:,} Shifts; {out} and {state} are saved: "
                "resume by the same command with --resume",
                file=sys.stderr,
            )
        return runs.INTERRUPTED
    except (ChefsHatError, TrainingFileError, OSError, ValueError) as error:
        return failed(error, as_json=options.json)
    summary = _summary(played)
    if options.json:
        print(json.dumps({"event": "trained", "file": str(out), "training": str(state), **summary}))
    else:
        # Counts, because percentages of a few Shifts would suggest false precision.
        won = f"won {summary['won'] * summary['last_shifts']:,.0f} of the last {summary['last_shifts']:,}"
        print(f"{out}: {options.shifts:,} Shifts")
        print(f"  {won}, mean place {summary['mean_place']:.2f}, {summary['wrong_per_shift']:.2f} illegal actions per Shift")
        print(f"{state}: checkpoint for --resume")
    return 0


def _train(options: argparse.Namespace, state: Path) -> Played:
    """Plays the remaining Shifts, and writes the files. Raises `Stopped` on Ctrl-C."""
    before = _resumed(options, state) if options.resume else None
    parameters = _parameters(options)
    rules = pb.RuleSet(preset=options.rules)
    opponents, rewards, seed, shifts, updates = options.opponents, options.rewards, options.seed, 0, 0
    if before is not None:
        rules.CopyFrom(before.rules)
        opponents, rewards, seed, shifts = before.opponents, before.rewards, before.seed, before.shifts
        updates = int(before.agents.updates[0])
    rules.ClearField("target_points")
    rules.target_shifts = options.shifts - shifts
    env = VectorEnv(
        join_options.server_if_any(options),
        1,
        client_seats=[0],
        opponents=opponents,
        rewards=rewards,
        episode="shift",
        decisions="turns",
        invalid="ask_again",
        total_games=1,
        # A resumed training plays other games.
        seed=seed + runs.SEED_STEP * updates,
        rules=rules,
        shift_statistics=True,
    )
    hidden = not sys.stderr.isatty()
    with (
        runs.Interrupts() as interrupts,
        env,
        tqdm(total=options.shifts, initial=shifts, unit=" Shifts", file=sys.stderr, disable=hidden, leave=False) as bar,
    ):
        if before is None:
            inputs, outputs = features.classic_width(env.faces, env.hand_size), env.turn_actions
            config = DeepQConfig(inputs=inputs, outputs=outputs, **parameters)
            agents, commands = deep_q.start(config, [seed]), ""
        else:
            config, agents, commands = before.config, before.agents, before.trained_by
        rules.CopyFrom(env.rules)
        rules.target_shifts = options.shifts
        commands = runs.trained_by(commands, options.trained_by)
        files = _Files(options, state, Training(config, agents, rules, commands, opponents, rewards, seed, shifts))

        def advance(more: int) -> None:
            files.shifts += more
            bar.update(more)

        def on_decision(agents: Agents) -> None:
            if interrupts.asked:
                files.write(agents)
                raise Stopped(files.shifts)
            files.write_if_due(agents)

        agents, played = deep_q_training.play(env, config, agents, advance=advance, on_decision=on_decision)
        files.write(agents)
        return played


class _Files:
    """Writes the files of a training.

    Attributes:
        shifts: Shifts played so far.
    """

    def __init__(self, options: argparse.Namespace, state: Path, begun: Training) -> None:
        self.shifts = begun.shifts
        self._options = options
        self._state = state
        # Its agents are stale: learning consumes them.
        self._begun = begun
        self._written = begun.shifts

    def write_if_due(self, agents: Agents) -> None:
        """Writes the files if enough Shifts have been played since the last time."""
        if self.shifts - self._written >= self._options.save_every:
            self.write(agents)

    def write(self, agents: Agents) -> None:
        """Writes the files."""
        training = dataclasses.replace(self._begun, agents=agents, shifts=self.shifts)
        checkpoint.save(self._state, training)
        (net,) = training.networks(self._options.name)
        network.save(self._options.out, net.layers, net.info)
        self._written = self.shifts
        LOG.info("saved %s after %d Shifts", self._state, self.shifts)


def _resumed(options: argparse.Namespace, state: Path) -> Training:
    """Loads the training to resume. Raises ValueError if the options contradict it."""
    before = checkpoint.load(runs.existing(state))
    config = before.config
    fixed = {"opponents": before.opponents, "rewards": before.rewards, "seed": before.seed, "mask": config.mask}
    runs.refuse_contradictions(options.given, fixed)
    if "parameters" in options.given:
        asked = DeepQConfig(inputs=config.inputs, outputs=config.outputs, **{**_parameters(options), "mask": config.mask})
        runs.refuse_contradictions(dataclasses.asdict(asked), dataclasses.asdict(config))
    if "rules" in options.given:
        runs.refuse_other_rules(runs.full_rules(options.rules, join_options.server_if_any(options)), before.rules)
    if before.shifts >= options.shifts:
        raise ValueError(f"the training has played {before.shifts:,} Shifts already: give more than that with --shifts")
    return before


def _parameters(options: argparse.Namespace) -> dict[str, Any]:
    """Returns the hyper-parameters that differ from the default: those of a file, and the mask."""
    if options.parameters is None:
        return {"mask": options.mask}
    check_readable(options.parameters, "file of hyper-parameters", "`python -m chefshat_paper.learn tune` writes")
    try:
        plain = json.loads(options.parameters.read_text(encoding="utf-8"))
    except ValueError:  # Not UTF-8 or not JSON.
        plain = None
    found = plain.get("parameters") if isinstance(plain, dict) else None
    known = {field.name for field in dataclasses.fields(DeepQConfig)} - {"inputs", "outputs", "mask"}
    if not isinstance(found, dict) or not found.keys() <= known:
        raise ValueError(
            f'{options.parameters} has no object "parameters" with some of {", ".join(sorted(known))}: `tune` writes such files'
        )
    return {**found, **({"hidden": tuple(found["hidden"])} if "hidden" in found else {}), "mask": options.mask}


def _summary(played: Played) -> dict[str, float]:
    """Summarises the last tenth of the Shifts."""
    seats = {name: counted[0, :, 0] for name, counted in played.of_seats.items()}
    last = max(1, len(seats["places"]) // 10)
    return {
        "last_shifts": last,
        "won": float(np.mean(seats["places"][-last:] == 1)),
        "mean_place": float(np.mean(seats["places"][-last:])),
        "wrong_per_shift": float(np.mean(seats["wrong"][-last:])),
    }
