//! Built-in agents and network files play in this process.

use std::sync::atomic::{AtomicBool, Ordering};

use chefshat_benchmark::{AgentInfo, Task, TaskResult, check, play_offline};
use chefshat_cli::error::CommandError;
use chefshat_cli::progress;
use chefshat_engine::RuleSet;
use chefshat_proto::v1;
use chefshat_record::jsonl;
use chefshat_simulation::Contender;
use chefshat_simulation::vector::Opponent;
use rayon::prelude::*;

use super::folder::Folder;
use crate::compare::Entrant;

/// Plays the game of a deal and returns the text of its record.
pub(super) fn play(task: &Task, deal: usize, entrant: &Entrant) -> Vec<v1::RecordLine> {
    let rules = task.rule_set();
    let name = match &entrant.contender {
        Contender::Network(network) => Opponent::Network(network.id()).name().into_owned(),
        Contender::Kind(_) | Contender::Made(_) => entrant.label.clone(),
    };
    play_offline(task, deal, &name, |seed| {
        entrant.contender.agent(&rules, seed)
    })
}

/// Plays the games of these deals, and writes their records; none is begun after `stopped`.
pub(super) fn play_all(
    folder: &Folder,
    entrant: &Entrant,
    deals: Vec<usize>,
    stopped: &AtomicBool,
) -> Result<(), CommandError> {
    let bar = progress::of_items(deals.len() as u64, "games");
    deals.into_par_iter().try_for_each(|deal| {
        if stopped.load(Ordering::Relaxed) {
            return Ok(());
        }
        let lines = play(&folder.task, deal, entrant);
        bar.inc(1);
        jsonl::write(&folder.record(deal), &lines)
    })?;
    bar.finish_and_clear();
    Ok(())
}

/// Refuses a network that was trained for other games: it would play as another agent.
pub(super) fn check_fits(task: &Task, entrant: &Entrant) -> Result<(), CommandError> {
    match fits(entrant, &task.rule_set()) {
        true => Ok(()),
        false => Err(format!(
            "{} was trained for games of another size than those of the task {}",
            entrant.given, task.name
        )
        .into()),
    }
}

/// Whether an agent can play games of the size of these rules.
pub(super) fn fits(entrant: &Entrant, rules: &RuleSet) -> bool {
    match &entrant.contender {
        Contender::Network(network) => network.fits(rules),
        _ => true,
    }
}

/// The result of an agent, without a folder.
pub(super) fn result(
    task: &Task,
    entrant: &Entrant,
    deals: usize,
) -> Result<TaskResult, CommandError> {
    let bar = progress::of_items(deals as u64, "deals");
    let games = (0..deals).into_par_iter().map(|deal| {
        let lines = play(task, deal, entrant);
        let text = jsonl::text(&lines)?;
        let record = jsonl::read_text("".as_ref(), text.as_slice())?;
        bar.inc(1);
        Ok(Some(check(task, deal, &record)?))
    });
    let games = games.collect::<Result<Vec<_>, CommandError>>()?;
    bar.finish_and_clear();
    let agent = AgentInfo {
        name: entrant.label.clone(),
        ..AgentInfo::default()
    };
    Ok(TaskResult::of(task, agent, &games))
}

/// The result of a built-in agent with which those of the task are compared, of as many deals as one
/// of them has.
pub(super) fn reference(
    task: &Task,
    entrant: &Entrant,
    results: &[TaskResult],
) -> Result<TaskResult, CommandError> {
    check_fits(task, entrant)?;
    let same = (&*task.name, &task.deals_commitment());
    let compared = results
        .iter()
        .filter(|it| (&*it.task, &it.deals_commitment) == same);
    let deals = compared.map(|it| it.by_deal.len()).max();
    result(task, entrant, deals.unwrap_or(task.deals))
}
