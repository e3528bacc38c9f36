//! The referee of a physical table: judges reports, runs the game that follows from them, and says
//! what the table waits for. The modules: `turns` (plays, passes, missed turns), `before` (hands,
//! special actions, gifts), `corrections`, `state` (what the table waits for, cards to lay).

mod before;
mod corrections;
mod refusal;
mod state;
mod turns;

use std::collections::VecDeque;
use std::sync::Arc;

use chefshat_engine::{
    Action, ActionId, BySeat, Event, Game, Observation, Opening, RuleSet, Seat, Viewer,
};

pub use refusal::Refusal;
pub use state::{Accepted, ShiftStory};

use crate::judge::Broken;
use crate::shift::{Act, Entry, Misfit, Played, Shift, play};
use crate::words::Names;
use crate::{
    Corrected, Question, Report, Ruling, StartState, ToLay, Verdict, ViolatedRule, Violation,
};

/// The most open questions of bridges.
pub const MAX_QUESTIONS: usize = 16;
/// How the ids of the referee's own questions begin.
const QUESTION_PREFIX: &str = "referee-";
/// The most answers that are kept for the bridge that asked.
const MAX_ANSWERS: usize = 16;
/// The most reports that wait for an answer.
pub const MAX_HELD: usize = 32;

/// The referee of a physical table. A clone, which a report makes to go back if it is refused, shares
/// the Shifts.
#[derive(Debug, Clone)]
pub struct Referee {
    rules: RuleSet,
    /// Seats whose decisions come from a connected participant or a built-in agent.
    remote: BySeat<bool>,
    names: Names,
    /// The Shifts so far, the one in progress last.
    shifts: Vec<Arc<Shift>>,
    /// The games of the Shifts.
    played: Vec<Arc<Played>>,
    /// Events of each Shift that were reported.
    published: Vec<Arc<[Event]>>,
    /// The question of the referee, if one is open.
    asked: Option<Asked>,
    /// Number of turns of the Shift when the board was last seen to be cleared.
    cleared: usize,
    /// Reports that wait for its answer.
    held: Vec<(u64, Report)>,
    /// Open questions, those of bridges and of the referee.
    questions: Vec<Question>,
    /// Number of questions that the referee has asked.
    questions_asked: u64,
    /// The last answers.
    answers: VecDeque<Answer>,
    violation: Option<(u64, Violation)>,
    to_lay: Vec<ToLay>,
    paused: bool,
    /// Whether the play that ended the game stands for good.
    end_confirmed: bool,
}

/// The answer to a question.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    /// The question.
    pub question: String,
    /// Index of the right option; `None`: the question was withdrawn.
    pub option: Option<usize>,
}

/// A question of the referee.
#[derive(Debug, Clone)]
struct Asked {
    id: String,
    doubt: Doubt,
}

/// What the referee is not certain of.
#[derive(Debug, Clone)]
enum Doubt {
    /// Whether these seats passed, in order; or whether instead the play at one of these places of
    /// the Shift, which named no seat, was laid only after the assumed seat had passed.
    Passed(Vec<Seat>, Vec<usize>),
    /// Whether the cards of the play that ended a pizza, which lie there, are a play of this seat.
    Again(Seat),
    /// Which of these seats opened the Shift.
    Opener(Vec<Seat>),
}

/// What a report came to, before its violation has a seat and a number.
type Judged = Result<Verdict, (Option<Seat>, Broken)>;

impl Referee {
    /// Checks whether a rule set can be refereed.
    ///
    /// # Errors
    /// Why not, for people.
    pub fn check_rules(rules: &RuleSet) -> Result<(), &'static str> {
        if rules.opening() != Opening::Golden {
            return Err(
                "a physical table needs the opening with the Golden card: nobody draws a seat there",
            );
        }
        if rules.exchange() && rules.hand_size() < rules.jokers() + 2 {
            return Err(
                "with real cards, hands need at least two cards more than there are jokers",
            );
        }
        Ok(())
    }

    /// Creates the referee of a game.
    ///
    /// # Panics
    /// If [`Referee::check_rules`] refuses the rule set, or `remote` has not one value for each
    /// seat.
    pub fn new(rules: RuleSet, remote: BySeat<bool>, names: Vec<String>) -> Self {
        assert!(
            Self::check_rules(&rules).is_ok() && remote.len() == rules.players(),
            "rules and seats are checked before the room is created"
        );
        let mut referee = Self {
            rules,
            remote,
            names: Names(names),
            shifts: Vec::new(),
            played: Vec::new(),
            published: Vec::new(),
            asked: None,
            cleared: 0,
            held: Vec::new(),
            questions: Vec::new(),
            questions_asked: 0,
            answers: VecDeque::new(),
            violation: None,
            to_lay: Vec::new(),
            paused: false,
            end_confirmed: false,
        };
        referee.push_shift(StartState {
            shift: 1,
            last_order: None,
            scores: BySeat::filled(rules.players(), 0),
        });
        referee
    }

    /// The events at the start: of the first Shift.
    pub fn start(&mut self) -> Vec<Event> {
        self.publish().1
    }

    /// Judges a report. `number` identifies it. One that [`Referee::check`] refuses is a violation.
    pub fn report(&mut self, number: u64, report: &Report) -> Ruling {
        let mut ruling = Ruling::default();
        ruling.verdict = self.judge(number, report, &mut ruling);
        if let Verdict::Violation(violation) = &ruling.verdict {
            ruling.violations.push((number, violation.clone()));
        }
        self.finish(number, &mut ruling);
        ruling
    }

    /// Applies the decision of a remote seat, which [`Referee::game`] has checked.
    pub fn decide(&mut self, number: u64, seat: Seat, action: ActionId) -> Ruling {
        let mut ruling = Ruling::default();
        let act = match self.rules.actions().decode(action) {
            Some(give @ (Action::Give(_) | Action::GiveJoker)) => Act::Give(seat, give),
            Some(Action::Declare) => Act::Special(seat, true),
            Some(Action::Decline) => Act::Special(seat, false),
            Some(turn) => Act::Turn(seat, turn),
            None => return ruling,
        };
        if self.try_act(number, None, act).is_ok() {
            self.judge_held(&mut ruling);
        }
        self.finish(number, &mut ruling);
        ruling
    }

    fn finish(&mut self, number: u64, ruling: &mut Ruling) {
        if let Some(last) = ruling.violations.last() {
            self.violation = Some(last.clone());
        }
        self.update_to_lay();
        let (void_events, events) = self.publish();
        ruling.events = events;
        if void_events > 0 {
            let corrected = ruling.corrected.get_or_insert_with(|| Corrected {
                number,
                ..Corrected::default()
            });
            corrected.void_events = void_events;
        }
    }

    /// Changes the game; if that is refused, everything stays as it was.
    fn or_undo<T, E>(&mut self, change: impl FnOnce(&mut Self) -> Result<T, E>) -> Result<T, E> {
        let before = self.clone();
        let changed = change(self);
        if changed.is_err() {
            *self = before;
        }
        changed
    }

    fn judge(&mut self, number: u64, report: &Report, ruling: &mut Ruling) -> Verdict {
        if self.game().is_over() && !self.counts_after_the_end(report) {
            return Verdict::Known;
        }
        let judged = match report {
            Report::Laid { .. } | Report::Pass { .. } | Report::Cleared => {
                self.judge_turn(number, report, ruling)
            }
            Report::PassWithdrawn { seat } => self.withdraw_pass(*seat, ruling),
            Report::Hand { seat, cards } => self.see_hand(number, *seat, cards, ruling),
            Report::Special { seat } => self.see_special(number, *seat),
            Report::Gift { seat, cards } => self.see_gift(number, *seat, cards.as_ref()),
            Report::Role { seat, role } => self.see_role(*seat, *role),
            Report::Correction {
                number: corrected,
                instead,
            } => self.correct(*corrected, None, instead.as_deref(), ruling),
            Report::Question(question) => self.ask(question),
            Report::Answer { id, option } => self.answer(number, id, *option, ruling),
            Report::Pause(paused) => {
                let known = self.paused == *paused;
                self.paused = *paused;
                Ok(if known {
                    Verdict::Known
                } else {
                    Verdict::Accepted
                })
            }
            Report::EndConfirmed => {
                self.end_confirmed = self.game().is_over();
                Ok(Verdict::Accepted)
            }
        };
        judged.unwrap_or_else(|(seat, (rule, text))| {
            Verdict::Violation(Violation { seat, rule, text })
        })
    }

    /// Whether a report can change something after the play that ended the game.
    fn counts_after_the_end(&self, report: &Report) -> bool {
        let may_be = !matches!(
            report,
            Report::Cleared
                | Report::Pass { .. }
                | Report::Hand { .. }
                | Report::Special { .. }
                | Report::Gift { .. }
                | Report::Role { .. }
        );
        may_be && !self.end_confirmed
    }

    fn ask(&mut self, question: &Question) -> Judged {
        if self.questions.iter().any(|open| open.id == question.id) {
            return Ok(Verdict::Known);
        }
        if question.id.starts_with(QUESTION_PREFIX) {
            let text = format!("Only the referee's questions begin with `{QUESTION_PREFIX}`.");
            return Err((question.seat, (ViolatedRule::Form, text)));
        }
        if self.questions.len() >= MAX_QUESTIONS {
            return Err((
                question.seat,
                (
                    ViolatedRule::Form,
                    "Too many questions are open: answer them first.".into(),
                ),
            ));
        }
        self.questions.push(question.clone());
        Ok(Verdict::Accepted)
    }

    /// The Shift in progress.
    fn shift(&self) -> &Shift {
        self.shifts.last().expect("a game has a Shift")
    }

    fn now(&self) -> &Played {
        self.played.last().expect("a game has a Shift")
    }

    fn push_shift(&mut self, start: StartState) {
        let shift = Shift::new(start);
        let played = play(&self.rules, &self.remote, &shift)
            .expect("a Shift of which nothing is known can be played");
        self.shifts.push(Arc::new(shift));
        self.played.push(Arc::new(played));
        self.cleared = 0;
    }

    /// Replaces what counts in the Shift in progress.
    ///
    /// # Errors
    /// No game contains it; nothing is changed.
    fn set_entries(&mut self, entries: Vec<Entry>) -> Result<(), Misfit> {
        let shift = Shift {
            start: self.shift().start.clone(),
            entries,
        };
        let played = play(&self.rules, &self.remote, &shift)?;
        let next = played.next.clone();
        *self.shifts.last_mut().expect("a game has a Shift") = Arc::new(shift);
        *self.played.last_mut().expect("a game has a Shift") = Arc::new(played);
        if let Some(next) = next {
            self.push_shift(next);
        }
        Ok(())
    }

    /// Adds something that counts.
    fn try_act(&mut self, number: u64, report: Option<&Report>, act: Act) -> Result<(), Misfit> {
        let pizza = self.game().observe(Viewer::Spectator).pizza;
        let mut entries = self.shift().entries.clone();
        entries.push(Entry {
            number,
            report: report.cloned(),
            act,
            pizza,
            confirmed: false,
        });
        self.set_entries(entries)?;
        if matches!(act, Act::Turn(..)) {
            self.violation = None;
        }
        Ok(())
    }

    /// How many of the published events are void, and the events that follow. The end of the game is
    /// published once it is confirmed.
    fn publish(&mut self) -> (usize, Vec<Event>) {
        let public = |event: &Event| event.seen_by(Viewer::Spectator);
        let first = self
            .shifts
            .len()
            .min(self.published.len())
            .saturating_sub(2);
        let (mut void, mut new) = (0, Vec::new());
        let played = self.played[first..].iter().map(|it| self.publishable(it));
        let current: Vec<Arc<[Event]>> = played.map(Arc::from).collect();
        let former = self.published.split_off(first);
        for index in 0..current.len().max(former.len()) {
            let old = former.get(index).map_or(&[][..], Arc::as_ref);
            let events = current.get(index).map_or(&[][..], Arc::as_ref);
            let common = match void {
                0 => (old.iter().zip(events))
                    .take_while(|(old, new)| public(old) == public(new))
                    .count(),
                _ => 0,
            };
            void += old.len() - common;
            new.extend_from_slice(&events[common..]);
        }
        self.published.extend(current);
        (void, new)
    }

    /// The events of a Shift, without the end of the game until it is confirmed.
    fn publishable<'a>(&self, shift: &'a Played) -> &'a [Event] {
        let is_end = |event: &Event| matches!(event, Event::GameEnded { .. });
        let end = (shift.events.iter().position(is_end)).filter(|_| !self.end_confirmed);
        &shift.events[..end.unwrap_or(shift.events.len())]
    }

    /// The game, with unknown hands completed: of hands, only known ones are true.
    pub fn game(&self) -> &Game {
        &self.now().game
    }

    /// The observation of a viewer, without cards that are only assumed.
    pub fn observe(&self, viewer: Viewer) -> Observation {
        let now = self.now();
        let mut observation = now.game.observe(viewer);
        if let Viewer::Seat(seat) = viewer {
            let pairs = self.shift().pairs(&self.rules);
            let partner = pairs.iter().find(|pair| pair.has(seat)).map(|pair| {
                if pair.chooser == seat {
                    pair.forced
                } else {
                    pair.chooser
                }
            });
            now.hide_assumed(&mut observation, seat, partner);
        }
        observation
    }

    /// Whether the hand of a seat is known.
    pub fn hand_known(&self, seat: Seat) -> bool {
        self.now().hands_known[seat] && self.now().golden_known[seat]
    }

    /// Whether the game is paused.
    pub fn paused(&self) -> bool {
        self.paused
    }

    /// The last violation, until a turn is accepted.
    pub fn last_violation(&self) -> Option<&(u64, Violation)> {
        self.violation.as_ref()
    }

    /// Open questions of bridges and of the referee, oldest first.
    pub fn questions(&self) -> &[Question] {
        &self.questions
    }

    /// The last answers to questions, oldest first.
    pub fn answers(&self) -> impl Iterator<Item = &Answer> {
        self.answers.iter()
    }

    /// Decisions of remote seats that nobody has carried out yet, oldest first.
    pub fn to_lay(&self) -> &[ToLay] {
        &self.to_lay
    }
}

#[cfg(test)]
mod tests {
    use chefshat_engine::RuleSetSpec;

    use super::*;

    /// A report costs the same in a long game: it clones the referee, but not what Shifts hold.
    #[test]
    fn clones_share_the_shifts() {
        let rules = RuleSetSpec::default().validate().expect("the standard");
        let names = vec!["a player".to_owned(); 4];
        let mut referee = Referee::new(rules, BySeat::filled(4, false), names);
        referee.start();
        let clone = referee.clone();
        assert!(Arc::ptr_eq(&referee.shifts[0], &clone.shifts[0]));
        assert!(Arc::ptr_eq(&referee.played[0], &clone.played[0]));
        assert!(Arc::ptr_eq(&referee.published[0], &clone.published[0]));
    }
}
