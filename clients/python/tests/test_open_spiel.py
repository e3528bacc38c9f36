"""The game in OpenSpiel: its own simulation test, and the same game as without it. Runs where OpenSpiel is installed."""

import importlib
import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import chefshat
from chefshat import history

pyspiel = pytest.importorskip("pyspiel")
pytest.importorskip("chefshat_native")
# Registers the game.
importlib.import_module("chefshat.envs.open_spiel")

RULES = {"preset": "paper", "target_shifts": 2}


@pytest.fixture(scope="module")
def game() -> Any:
    return pyspiel.load_game("python_chefshat", {"deals": 20, "shifts": 2})


@pytest.fixture(scope="module")
def smallest() -> Any:
    """A game with a tree that fits into memory, with all deals."""
    rules = {"players": 2, "faces": 4, "jokers": 0, "max_idle_pizzas": 1, "max_turns": 4}
    return pyspiel.load_game("python_chefshat", {"deals": 0, **rules})


def test_openspiel_accepts_the_game(game: Any, smallest: Any) -> None:
    for it in (game, smallest):
        pyspiel.random_sim_test(it, num_sims=1, serialize=True, verbose=False)


def test_a_game_is_that_of_a_vector_env(game: Any) -> None:
    state = game.new_initial_state()
    assert state.is_chance_node()
    state.apply_action(7)
    with chefshat.VectorEnv(seed=7, rules=RULES, episode="game", total_games=1) as env:
        batch = env.batch
        while not batch.done:
            assert state.current_player() == batch.seats[0]
            legal = np.flatnonzero(batch.masks[0]).tolist()
            assert state.legal_actions() == legal
            batch = env.step([legal[0]])
            state.apply_action(legal[0])
        assert state.is_terminal()
        assert state.returns() == batch.endings.observations.points[0].tolist()
        assert sum(state.returns()) == game.utility_sum()


def test_rules_are_parameters() -> None:
    chosen = {"players": 3, "faces": 5, "jokers": 1, "max_idle_pizzas": 1, "max_turns": 60}
    small = pyspiel.load_game("python_chefshat", {"deals": 2, **chosen})
    assert small.num_players() == 3
    assert small.max_game_length() == 60 + 4 * 3
    with chefshat.VectorEnv(seed=1, rules={"preset": "paper", "target_shifts": 1, **chosen}, total_games=1) as env:
        assert small.num_distinct_actions() == env.num_actions
        state = small.new_initial_state()
        state.apply_action(1)
        while not state.is_terminal():
            assert state.legal_actions() == np.flatnonzero(env.batch.masks[0]).tolist()
            action = state.legal_actions()[-1]
            state.apply_action(action)
            env.step([action])
    # Without jokers, as distinct from the preset's number.
    assert pyspiel.load_game("python_chefshat", {"jokers": 0}).sizes.card_kinds == 12
    with pytest.raises(chefshat.ChefsHatError, match="choose 4 to 15"):
        pyspiel.load_game("python_chefshat", {"faces": 3})


@pytest.mark.parametrize("history", [0, -5])
def test_a_tensor_without_actions_is_refused(history: int) -> None:
    with pytest.raises(Exception, match=f"1 or more, not {history}"):
        pyspiel.load_game("python_chefshat", {"history": history})


def test_clones_are_independent_and_observations_are_those_of_the_player(game: Any) -> None:
    state = game.new_initial_state()
    state.apply_action(3)
    for _ in range(5):
        state.apply_action(state.legal_actions()[-1])
    player = state.current_player()
    before = state.observation_tensor(player)
    clone = state.clone()
    assert clone.history() == state.history()
    assert clone.observation_tensor(player) == before
    clone.apply_action(clone.legal_actions()[0])
    assert state.current_player() == player
    assert state.observation_tensor(player) == before
    assert len(clone.history()) == len(state.history()) + 1


def test_an_illegal_action_costs_no_other_state(game: Any) -> None:
    state = game.new_initial_state()
    state.apply_action(3)
    (illegal, *_) = set(range(game.num_distinct_actions())) - set(state.legal_actions())
    clone = state.clone()
    with pytest.raises(ValueError, match=f"action {illegal} is not legal here"):
        state.apply_action(illegal)
    clone.apply_action(clone.legal_actions()[0])


def test_information_states_have_perfect_recall(game: Any) -> None:
    chance = np.random.default_rng(2)
    legal_of: dict[str, list[int]] = {}
    tensor_of: dict[str, bytes] = {}
    gifts = 0
    for deal in (1, 2):
        state = game.new_initial_state()
        state.apply_action(deal)
        taken: list[list[str]] = [[] for _ in range(4)]
        with chefshat.VectorEnv(seed=deal, rules=RULES, total_games=1, history=512) as env:
            while not state.is_terminal():
                player, legal = state.current_player(), state.legal_actions()
                text = state.information_state_string(player)
                # What the player did since the game began; a seat without a choice also gives.
                own = [entry for line in text.splitlines()[1:] for entry in line.split("; ")[2].split(", ") if entry]
                own = [entry[2:] for entry in own if entry.startswith(str(player))]
                if any(action.startswith("give") for action in taken[player]):
                    gifts += 1
                else:
                    own = [action for action in own if not action.startswith("give")]
                assert own == taken[player]
                # The last line has all actions of the Shift, as the column has them.
                done = history.actions(env.batch)[0]
                entries = [entry.split(" ", 1)[1] for entry in text.splitlines()[-1].split("; ")[2].split(", ") if entry]
                assert entries == [env.action_texts[action] if action < env.num_actions else "give ?" for action in done[done >= 0]]
                assert legal_of.setdefault(text, legal) == legal
                tensor_of[text] = np.asarray(state.information_state_tensor(player), np.float32).tobytes()
                action = int(chance.choice(legal))
                taken[player].append(state.action_to_string(player, action))
                state.apply_action(action)
                env.step([action])
    assert len(legal_of) > 200
    assert gifts > 20
    assert len(set(tensor_of.values())) == len(tensor_of)


def test_an_information_state_shows_a_gift_to_giver_and_receiver_alone(game: Any) -> None:
    state = game.new_initial_state()
    state.apply_action(0)
    while not state.action_to_string(state.legal_actions()[0]).startswith("give"):
        state.apply_action(state.legal_actions()[-1])
    worlds = [state.clone(), state.clone()]
    for world, gift in zip(worlds, state.legal_actions()[:2], strict=True):
        world.apply_action(gift)
    same_for: dict[str, bool] = {}
    env = chefshat.VectorEnv(seed=0, rules=RULES, total_games=1, history=1024)
    while len(same_for) < 4:
        first, second = worlds
        player = first.current_player()
        assert second.current_player() == player
        seen = env.restore([0], [first.position.state])
        if seen.kinds[0] == chefshat.pb.DECISION_KIND_TURN:
            texts = [world.information_state_string(player) for world in worlds]
            tensors = [world.information_state_tensor(player) for world in worlds]
            assert (texts[0] == texts[1]) == (tensors[0] == tensors[1])
            same_for[chefshat.pb.Role.Name(seen.observations.roles[0, player])] = texts[0] == texts[1]
        action = max(set(first.legal_actions()) & set(second.legal_actions()))
        for world in worlds:
            world.apply_action(action)
    env.close()
    assert same_for == {"ROLE_CHEF": False, "ROLE_SOUS_CHEF": True, "ROLE_WAITER": True, "ROLE_DISHWASHER": False}


def test_resampling_draws_what_the_player_cannot_tell_apart(game: Any) -> None:
    state = game.new_initial_state()
    state.apply_action(5)
    chance = np.random.default_rng(5)
    drawn_hands: set[str] = set()
    checked = 0
    while not state.is_terminal():
        player = state.current_player()
        if chance.random() < 0.2:
            before = state.information_state_string(player)
            drawn = state.resample_from_infostate(player, chance.random)
            assert drawn.information_state_string(player) == before
            assert drawn.information_state_tensor(player) == state.information_state_tensor(player)
            assert drawn.observation_tensor(player) == state.observation_tensor(player)
            assert drawn.current_player() == player
            assert drawn.legal_actions() == state.legal_actions()
            drawn_hands.add(drawn.information_state_string((player + 1) % 4))
            # As it was before, although the other is played to the end.
            while not drawn.is_terminal():
                drawn.apply_action(int(chance.choice(drawn.legal_actions())))
            assert sum(drawn.returns()) == game.utility_sum()
            assert state.information_state_string(player) == before
            checked += 1
        state.apply_action(int(chance.choice(state.legal_actions())))
    assert checked > 20
    assert len(drawn_hands) > 10


def test_other_players_know_nothing_of_the_true_deal_in_a_drawn_one() -> None:
    """Who holds both jokers is asked before the others; where the drawn deal gives it other cards, it was not."""
    rules = {"players": 3, "faces": 4, "jokers": 2, "shifts": 6}
    game = pyspiel.load_game("python_chefshat", rules)
    chance = np.random.default_rng(1)
    checked = gone = 0
    with chefshat.VectorEnv(history=1024, all_hands=True, **game.games.options) as env:
        for deal in range(40):
            state = game.new_initial_state()
            state.apply_action(deal)
            while not state.is_terminal():
                current = list(state.position.known[state.current_player()])[-1]
                others = [seat for seat in range(3) if seat != state.current_player()]
                asked = [seat for seat in others if current in state.position.known.get(seat, {})]
                # Before the first turn.
                if asked and state.legal_actions()[0] >= env.turn_actions:
                    drawn = state.resample_from_infostate(state.current_player(), chance.random)
                    env.restore([0], [drawn.position.state])
                    for seat in asked:
                        known = drawn.position.known.get(seat, {}).get(current)
                        if known is None:
                            gone += 1
                            seen = drawn.position.seen.get(seat, {})
                            assert any(drawn.observation_tensor(seat)) == bool(seen)
                            assert current not in seen
                        else:
                            # It may have given two cards since.
                            held = env.batch.all_hands.reshape(3, -1)[seat].astype(int)
                            assert np.maximum(known.hand.astype(int) - held, 0).sum() <= 2
                        checked += 1
                state.apply_action(int(chance.choice(state.legal_actions())))
    assert checked > gone > 5


def test_resampling_is_for_the_player_who_decides(game: Any) -> None:
    state = game.new_initial_state()
    with pytest.raises(ValueError, match="player 0 does not decide here"):
        state.resample_from_infostate(0, lambda: 0.5)
    state.apply_action(1)
    other = (state.current_player() + 1) % 4
    with pytest.raises(ValueError, match=f"resample for current_player\\(\\), {state.current_player()}"):
        state.resample_from_infostate(other, lambda: 0.5)


def test_drawn_deals_are_as_likely_as_those_of_the_sampler() -> None:
    """On a deck so small that each deal is drawn often."""
    small = pyspiel.load_game("python_chefshat", {"players": 3, "faces": 4, "jokers": 0, "deals": 5})
    state = small.new_initial_state()
    state.apply_action(4)
    player = state.current_player()
    left = (player + 1) % 3
    hands, counts = np.unique(state.position.possible().sample(20_000, seed=1)[:, left], axis=0, return_counts=True)
    expected = {" ".join(map(str, hand)): count / 20_000 for hand, count in zip(hands.tolist(), counts, strict=True)}
    assert len(expected) > 5
    chance = np.random.default_rng(9)
    drawn_counts = dict.fromkeys(expected, 0)
    for _ in range(800):
        drawn = state.resample_from_infostate(player, chance.random)
        drawn.apply_action(drawn.legal_actions()[0])
        assert drawn.current_player() == left
        drawn_counts[drawn.information_state_string(left).split("hand ")[1].split(";")[0]] += 1
    for hand, share in expected.items():
        assert abs(drawn_counts[hand] - 800 * share) < 4 * np.sqrt(800 * share * (1 - share)) + 1


def test_is_mcts_of_openspiel_plays() -> None:
    game = pyspiel.load_game("python_chefshat", {"deals": 3})
    mcts = importlib.import_module("open_spiel.python.algorithms.mcts")
    ismcts = importlib.import_module("open_spiel.python.algorithms.ismcts")
    random = np.random.RandomState(3)
    evaluator = mcts.RandomRolloutEvaluator(n_rollouts=1, random_state=random)
    bot = ismcts.ISMCTSBot(game=game, uct_c=5.0, evaluator=evaluator, max_simulations=8, random_state=random)
    state = game.new_initial_state()
    state.apply_action(2)
    for _ in range(5):
        action = bot.step(state)
        assert action in state.legal_actions()
        state.apply_action(action)


def test_all_deals_are_as_likely_as_in_a_deck(smallest: Any) -> None:
    outcomes = smallest.new_initial_state().chance_outcomes()
    assert sum(chance for _, chance in outcomes) == pytest.approx(1)
    # By dealing each order of the ten cards: player 0 has five of them, and the last is the Golden card.
    cards = [1, 2, 2, 3, 3, 3, 4, 4, 4, 5]
    counted: dict[tuple[int, ...], int] = {}
    for chosen in itertools.combinations(cards, 5):
        counted[chosen] = counted.get(chosen, 0) + 1
    found = {}
    for script, chance in zip(smallest.starts, smallest.chances, strict=True):
        cards_of = list(script.hands[0].cards)
        found[(*cards_of[:-1], 5) if script.hands[0].golden else tuple(cards_of)] = chance
    assert found == pytest.approx({hand: count / 252 for hand, count in counted.items()})


def test_all_deals_are_for_one_shift_of_a_small_deck() -> None:
    for parameters, words in [
        ({"shifts": 2}, "is for one Shift"),
        ({}, "more than 10000 deals"),
        ({"deals": -1}, "1 or more deals"),
    ]:
        with pytest.raises(ValueError, match=words):
            pyspiel.load_game("python_chefshat", {"deals": 0, **parameters})


def test_cfr_of_openspiel_finds_what_brute_force_confirms(smallest: Any) -> None:
    """The distance from an equilibrium falls, and is what a search of all best responses in this game finds."""
    gambit = importlib.import_module("open_spiel.python.algorithms.gambit")
    # The same tree as a game of OpenSpiel's own, which is fast.
    tree = pyspiel.load_efg_game(gambit.export_gambit(smallest))
    solver = pyspiel.CFRPlusSolver(tree)
    iterations = 0
    # Those of docs/learning.md.
    for until, published in [(1, 3.261), (10, 0.0806), (100, 0.00088)]:
        while iterations < until:
            solver.evaluate_and_update_policy()
            iterations += 1
        policy = solver.average_policy()
        distance = pyspiel.nash_conv(tree, policy, use_state_get_policy=True)
        assert distance == pytest.approx(published, rel=0.01)
        root = tree_of(smallest.new_initial_state(), tree.new_initial_state(), policy)
        found = sum(best_response(root, player) for player in range(2)) - smallest.utility_sum()
        assert found == pytest.approx(distance, abs=1e-9)


@dataclass
class Node:
    """A state of a game tree, with the chances of its children under a policy; a player is negative where none decides."""

    player: int
    known: str
    returns: list[float]
    children: list[tuple["Node", float]]


def tree_of(state: Any, same: Any, policy: Any) -> Node:
    """Returns a state and all that follow; `same`: this state in the game that the policy is for."""
    chances: dict[int, float] = {}
    if state.is_chance_node():
        chances = dict(state.chance_outcomes())
    elif not state.is_terminal():
        chances = policy.action_probabilities(same)
    # Actions of the two games have the same order.
    children = [
        (tree_of(state.child(action), same.child(other), policy), chances[action if state.is_chance_node() else other])
        for action, other in zip(state.legal_actions(), same.legal_actions(), strict=True)
    ]
    player = state.current_player()
    return Node(player, state.information_state_string() if player >= 0 else "", state.returns(), children)


def best_response(root: Node, player: int) -> float:
    """Returns the most that a player gets against the others' policy, by trying all that it can do with what it knows."""

    def best(histories: list[tuple[Node, float]]) -> float:
        found = 0.0
        undecided: dict[str, list[tuple[Node, float]]] = {}
        while histories:
            node, reach = histories.pop()
            if node.player == player:
                undecided.setdefault(node.known, []).append((node, reach))
            elif not node.children:
                found += reach * node.returns[player]
            else:
                histories += [(child, reach * chance) for child, chance in node.children]
        for same in undecided.values():
            choices = range(len(same[0][0].children))
            found += max(best([(node.children[choice][0], reach) for node, reach in same]) for choice in choices)
        return found

    return best([(root, 1.0)])
