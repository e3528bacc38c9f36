//! The games of a task in this process, with an agent that is built in or a network file.

use chefshat_agents::{BuiltInAgent, DecisionNotes, play_agents};
use chefshat_engine::{BySeat, Seat};
use chefshat_proto::v1;
use chefshat_record::convert::Played;
use chefshat_search::named_agent;

use crate::task::{BENCHMARK, Task};

/// Plays the game of a deal, by its index from 0, and returns its record. `agent` makes the agent
/// of a seed; `name` names it in the record.
pub fn play_offline(
    task: &Task,
    deal: usize,
    name: &str,
    agent: impl FnOnce([u8; 32]) -> BuiltInAgent,
) -> Vec<v1::RecordLine> {
    let (rules, seed) = (task.rule_set(), task.seed(deal));
    let opponents = task.opponents(deal);
    let mut agents: Vec<BuiltInAgent> = Vec::with_capacity(opponents.len());
    let mut own_agent = Some(agent);
    for seat in (0..opponents.len()).map(Seat::new) {
        let seed = task.agent_seed(deal, seat);
        agents.push(match opponents[seat.index()] {
            Some(opponent) => named_agent(opponent, &rules, seed),
            None => own_agent.take().expect("it has one seat")(seed),
        });
    }
    let mut notes = DecisionNotes::default();
    play_agents(rules, seed, None, &mut agents, &mut notes);
    let names: Vec<String> = (opponents.iter())
        .map(|opponent| opponent.map_or_else(|| name.to_owned(), |agent| agent.name()))
        .collect();
    let played = Played {
        by: BENCHMARK,
        rules: &rules,
        agents: &BySeat::from_fn(names.len(), |seat| Some(names[seat.index()].as_str())),
        seed,
        scheme: None,
        policy: &task.policy(),
        decisions: notes.decisions(),
    };
    played.record()
}
