"""The numbers that the 2020 paper reports for its experiments, as printed. Its "game" is a Shift, its "round" a lap."""

# "For each of our experiments, we run 250 games" (Metrics).
SHIFTS = 250

# Experiment 1, table of results: by condition, the share of Shifts that the starter wins, and laps per Shift.
STARTER_WINS = {"all": 0.28, "without_jokers": 0.35, "without_exchange": 0.60, "without_special_actions": 0.28}
LAPS = {"all": 35, "without_jokers": 33, "without_exchange": 31, "without_special_actions": 35}

# Experiment 2, text: mean reward of the learning agent and of the best random one, ...
RULES_REWARD_LEARNER = 0.5
RULES_REWARD_BEST_RANDOM = -0.82
# ... wrong actions ("almost half of the random agents"), and Shifts won by seat, of 250 (the text says 100).
RULES_WRONG_ACTIONS_RATIO = 0.5
RULES_WINS = (65, 62, 63, 60)

# Experiment 3, text: Shifts won by the learning agent against three random ones, all of them after the 50th, ...
WINNING_WINS_LEARNER = 215
WINNING_ALL_WON_AFTER = 50
# ... Shifts won by seat of four learning agents, and the share that the starter wins among random agents ("around 30%").
WINNING_WINS_FOUR = (117, 45, 55, 33)
WINNING_STARTER_WINS = 0.30
