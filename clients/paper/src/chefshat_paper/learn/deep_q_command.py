"""The command `python -m chefshat_paper.learn deep-q`: trains one Deep Q agent against three built-in ones.

Writes three files: the network, which `play` and the server's agents can use, and a checkpoint to resume from, both every
`--save-every` Shifts, before each evaluation, and on Ctrl-C; and a log with the evaluations, like that of `ppo`. The agent is in
`deep_q`, its games are in `deep_q_training`.
"""

import argparse
import dataclasses
import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from chefshat import join_options, pb
from chefshat.errors import INTERRUPTED, ChefsHatError, failed
from chefshat.files import check_readable
from chefshat.learn import features, network, runs, training_log
from chefshat.learn.evaluation import Evaluation
from chefshat.learn.training_file import TrainingFileError
from chefshat.learn.training_log import Progress
from chefshat.vector import VectorEnv
from tqdm import tqdm

from chefshat_paper.learn import checkpoint, deep_q, deep_q_training
from chefshat_paper.learn.checkpoint import Training
from chefshat_paper.learn.deep_q import Agents, DeepQConfig
from chefshat_paper.learn.deep_q_training import Played

# The settings for which `tune` has found its hyper-parameters.
TUNED_FOR = ("mask", "opponents", "rewards")


class Stopped(Exception):
    """Ctrl-C stopped the training, which has been saved."""

    def __init__(self, shifts: int) -> None:
        super().__init__(f"stopped after {shifts:,} Shifts")
        self.shifts = shifts


def run(options: argparse.Namespace) -> int:
    """Runs the command. Returns the exit code."""
    out: Path = options.out
    state: Path = options.checkpoint or out.with_suffix(".training")
    log: Path = options.log or out.with_suffix(".jsonl")
    try:
        with runs.reserved(out, log, state, replace=options.resume or options.force):
            training, played, evaluations = _train(options, state, log)
    except Stopped as stopped:
        if options.json:
            print(json.dumps({"event": "interrupted", "file": str(out), "training": str(state), "shifts": stopped.shifts}))
        else:
            of = "" if options.decisions else f" of {options.shifts:,}"
            print(
                f"interrupted after {stopped.shifts:,}{of} Shifts; {out} and {state} are saved: "
                "resume by the same command with --resume",
                file=sys.stderr,
            )
        return INTERRUPTED
    except (ChefsHatError, TrainingFileError, OSError, ValueError) as error:
        return failed(error, as_json=options.json)
    summary = {} if played is None else _summary(played)
    if options.json:
        more = training_log.summary(training.progress, evaluations)
        print(json.dumps({"event": "trained", "file": str(out), "training": str(state), **summary, **more}))
    else:
        print(f"{out}: {training.shifts:,} Shifts, {training.progress.decisions:,} decisions")
        if summary:
            # Counts, because percentages of a few Shifts would suggest false precision.
            won = f"won {summary['won'] * summary['last_shifts']:,.0f} of the last {summary['last_shifts']:,}"
            print(f"  {won}, mean place {summary['mean_place']:.2f}, {summary['wrong_per_shift']:.2f} illegal actions per Shift")
        for evaluation in evaluations:
            print(f"  {evaluation}")
        print(f"{state}: checkpoint for --resume")
    return 0


def _train(options: argparse.Namespace, state: Path, log: Path) -> tuple[Training, Played | None, list[Evaluation]]:
    """Trains until the budget is used up, and writes the files. Raises `Stopped` on Ctrl-C.

    Returns the training, its games since it was started or resumed (None: there were none left to play), and its last evaluations.
    """
    tuned = _tuned(options)
    before = _resumed(options, tuned, state, log) if options.resume else None
    if before is not None and (finished := _Running(options, state, before)).done >= 1:
        with training_log.written(log, append=True):
            # The process may have ended between the two files.
            finished.write(before.agents)
            return before, None, finished.evaluate(before.agents)
    rules, seed = options.rules, options.seed
    mask, opponents, rewards = (tuned[name] for name in TUNED_FOR)
    if before is not None:
        rules, opponents, rewards, seed = before.rules, before.opponents, before.rewards, before.seed
    address = join_options.server_if_any(options)
    rules = runs.full_rules(rules, address)
    lasting = pb.RuleSet()
    lasting.CopyFrom(rules)
    lasting.ClearField("target_points")
    shifts, updates = (0, 0) if before is None else (before.shifts, int(before.agents.updates[0]))
    # A Shift has more than one decision.
    lasting.target_shifts = options.decisions or options.shifts - shifts
    env = VectorEnv(
        address,
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
        rules=lasting,
        shift_statistics=True,
    )
    hidden = not sys.stderr.isatty()
    total, unit = (options.decisions, " decisions") if options.decisions else (options.shifts, " Shifts")
    with (
        runs.Interrupts() as interrupts,
        env,
        tqdm(total=total, unit=unit, file=sys.stderr, disable=hidden, leave=False) as bar,
        training_log.written(log, append=options.resume),
    ):
        if before is None:
            inputs, outputs = features.classic_width(env.faces, env.hand_size), env.turn_actions
            config = DeepQConfig(inputs=inputs, outputs=outputs, mask=mask, **tuned["parameters"])
            agents = deep_q.start(config, [seed])
            before = Training(config, agents, rules, "", opponents, rewards, seed, evaluation_due=True)
        begun = dataclasses.replace(
            before,
            trained_by=runs.trained_by(before.trained_by, options.trained_by),
            progress=dataclasses.replace(before.progress, runs=before.progress.runs + 1),
        )
        plan = {"opponents": opponents, "rewards": rewards, "evaluation_games": options.evaluation_games}
        plan |= {"evaluations": options.evaluations, "hyper": dataclasses.asdict(begun.config)}
        training_log.log_setup("deep-q", plan, seed, rules, begun.trained_by)
        running = _Running(options, state, begun)

        def on_decision(agents: Agents, decisions: int) -> bool:
            running.decisions = begun.progress.decisions + decisions
            bar.update((running.decisions if options.decisions else running.shifts) - bar.n)
            if interrupts.asked or running.done >= 1:
                return True
            running.do_due(agents)
            return False

        agents, played = deep_q_training.play(env, begun.config, begun.agents, advance=running.advance, on_decision=on_decision)
        running.write(agents)
        if running.done < 1:
            raise Stopped(running.shifts)
        return running.training(agents), played, running.evaluate(agents)


class _Running:
    """A running training: its progress, when its files are written, and when its network is evaluated.

    Attributes:
        shifts: Shifts played so far.
        decisions: decisions taken so far, as `Progress` counts them.
    """

    def __init__(self, options: argparse.Namespace, state: Path, begun: Training) -> None:
        self.shifts = begun.shifts
        self.decisions = begun.progress.decisions
        self._options = options
        self._state = state
        # Its agents are stale: learning consumes them.
        self._begun = begun
        self._began = time.monotonic()
        self._written = begun.shifts
        self._next_evaluation = self.done if begun.evaluation_due else training_log.next_evaluation(self.done, options.evaluations)

    @property
    def done(self) -> float:
        """The share of the budget that is used up."""
        options = self._options
        return float(self.decisions / options.decisions if options.decisions else self.shifts / options.shifts)

    def advance(self, shifts: int) -> None:
        """Counts further Shifts."""
        self.shifts += shifts

    def do_due(self, agents: Agents) -> None:
        """Evaluates the network and writes the files, each if it is time."""
        if self.done >= self._next_evaluation:
            # First the files: a training that ends during the evaluation, or after it, resumes from here.
            self.write(agents)
            self._next_evaluation = training_log.next_evaluation(self.done, self._options.evaluations)
            self.evaluate(agents)
        if self.shifts - self._written >= self._options.save_every:
            self.write(agents)

    def training(self, agents: Agents) -> Training:
        """Returns the training as it is now."""
        before = self._begun.progress
        seconds = before.seconds + time.monotonic() - self._began
        progress = Progress(int(agents.updates[0]), self.decisions, seconds, before.runs)
        is_due = self.done >= self._next_evaluation
        return dataclasses.replace(self._begun, agents=agents, shifts=self.shifts, progress=progress, evaluation_due=is_due)

    def evaluate(self, agents: Agents) -> list[Evaluation]:
        """Plays against the built-in agents, and logs the results."""
        options = self._options
        (net,) = self.training(agents).networks(options.name)
        address = join_options.server_if_any(options)
        evaluations = training_log.evaluate_all(net, options.evaluation_games, self._begun.rules, address)
        training_log.log_evaluations(self.training(agents).progress, evaluations, {})
        return evaluations

    def write(self, agents: Agents) -> None:
        """Writes the files."""
        training = self.training(agents)
        checkpoint.save(self._state, training)
        (net,) = training.networks(self._options.name)
        network.save(self._options.out, net.layers, net.info)
        self._written = self.shifts


def _resumed(options: argparse.Namespace, tuned: Mapping[str, Any], state: Path, log: Path) -> Training:
    """Loads the training to resume. Its evaluation is due if the log lacks it. Raises ValueError if the options contradict it."""
    before = checkpoint.load(runs.existing(state))
    evaluated = training_log.last_evaluated(log)
    is_missing = before.evaluation_due and evaluated != before.progress.decisions
    before = dataclasses.replace(before, evaluation_due=is_missing or evaluated is None)
    config = before.config
    fixed = {"opponents": before.opponents, "rewards": before.rewards, "seed": before.seed, "mask": config.mask}
    runs.refuse_contradictions(options.given, fixed)
    if "parameters" in options.given:
        asked = DeepQConfig(inputs=config.inputs, outputs=config.outputs, mask=config.mask, **tuned["parameters"])
        runs.refuse_contradictions(dataclasses.asdict(asked), dataclasses.asdict(config))
    asked_rules = runs.full_rules(options.rules, join_options.server_if_any(options))
    if "rules" in options.given:
        runs.refuse_other_rules(asked_rules, before.rules)
    if before.rules.target_shifts:
        # In earlier versions, the rules had the length of the training.
        before.rules.ClearField("target_shifts")
        before.rules.target_points = asked_rules.target_points
    done, budget = (before.progress.decisions, "decisions") if options.decisions else (before.shifts, "shifts")
    if done >= getattr(options, budget) and not is_missing:
        what = f"taken {done:,} decisions" if options.decisions else f"played {done:,} Shifts"
        raise ValueError(f"the training has {what} already: give more than that with --{budget}")
    return before


def _tuned(options: argparse.Namespace) -> dict[str, Any]:
    """Returns the hyper-parameters and the settings of a file of `tune`; options that were given replace its settings."""
    settings = {name: getattr(options, name) for name in TUNED_FOR}
    if options.parameters is None:
        return {"parameters": {}, **settings}
    check_readable(options.parameters, "file of hyper-parameters", "`python -m chefshat_paper.learn tune` writes")
    try:
        plain = json.loads(options.parameters.read_text(encoding="utf-8"))
    except ValueError:  # Not UTF-8 or not JSON.
        plain = None
    found = plain.get("parameters") if isinstance(plain, dict) else None
    known = {field.name for field in dataclasses.fields(DeepQConfig)} - {"inputs", "outputs", "mask"}
    if not isinstance(plain, dict) or not isinstance(found, dict) or not found.keys() <= known:
        raise ValueError(
            f'{options.parameters} has no object "parameters" with some of {", ".join(sorted(known))}: `tune` writes such files'
        )
    # Files of earlier versions have no settings.
    settings |= {name: plain[name] for name in TUNED_FOR if name in plain and name not in options.given}
    return {"parameters": {**found, **({"hidden": tuple(found["hidden"])} if "hidden" in found else {})}, **settings}


def _summary(played: Played) -> dict[str, float]:
    """Summarises the last tenth of the Shifts; empty if none has ended."""
    seats = {name: counted[0, :, 0] for name, counted in played.of_seats.items()}
    if len(seats["places"]) == 0:
        return {}
    last = max(1, len(seats["places"]) // 10)
    return {
        "last_shifts": last,
        "won": float(np.mean(seats["places"][-last:] == 1)),
        "mean_place": float(np.mean(seats["places"][-last:])),
        "wrong_per_shift": float(np.mean(seats["wrong"][-last:])),
    }
