"""The random agent: legal, uniform, repeatable."""

from collections import Counter

from test_decision import decision

from chefshat import RandomAgent

LEGAL = (0, 7, 8, 100, 199, 213)


def test_random_agent_is_uniform_over_the_legal_actions() -> None:
    agent = RandomAgent(seed=1)
    request = decision(legal=LEGAL)
    draws = 6_000
    counts = Counter(agent.decide(request) for _ in range(draws))
    assert set(counts) == set(LEGAL)
    # The seed is fixed, so this cannot fail by chance; the bound is six standard deviations.
    assert all(abs(count - draws / len(LEGAL)) < 6 * (draws * 5 / 36) ** 0.5 for count in counts.values())


def test_random_agent_is_repeatable() -> None:
    request = decision(legal=LEGAL)
    one, same, other = RandomAgent(5), RandomAgent(5), RandomAgent(6)
    draws = [[agent.decide(request) for _ in range(50)] for agent in (one, same, other)]
    assert draws[0] == draws[1]
    assert draws[0] != draws[2]


def test_random_agent_takes_the_only_action() -> None:
    assert RandomAgent().decide(decision(legal=(213,))) == 213
