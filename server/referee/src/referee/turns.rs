//! Plays, passes and cleared boards: whose turn it is, what was missed, and what must be asked.

use chefshat_engine::{
    Action, DecisionKind, Face, Game, PlayRequirement, Requirement, Seat, Viewer,
};

use super::{Answer, Asked, Doubt, Judged, MAX_ANSWERS, MAX_HELD, QUESTION_PREFIX, Referee};
use crate::counts::counts_of_action;
use crate::judge::{as_play, check_play};
use crate::shift::{Act, Entry, Misfit, Shift, play};
use crate::words::{turn_text, typed_turn};
use crate::{Corrected, Question, Report, Ruling, ToLay, Verdict, ViolatedRule, Violation};

/// The most turns that may have been missed before a report.
const MAX_MISSED: usize = 24;
/// The most other explanations that a question about missed passes offers.
const MAX_INSTEAD: usize = 3;

/// A report about a turn.
#[derive(Debug, Clone, Copy)]
enum TurnReport {
    /// Cards on the board, or a pass.
    Acted {
        seat: Option<Seat>,
        action: Action,
        golden: Option<bool>,
    },
    /// The board was cleared.
    Cleared,
}

impl Referee {
    /// Judges a report about a turn; while a question is open, it may have to wait.
    pub(super) fn judge_turn(
        &mut self,
        number: u64,
        report: &Report,
        ruling: &mut Ruling,
    ) -> Judged {
        let Some(asked) = self.asked.clone() else {
            return self.take_turn(number, report);
        };
        // A turn that is possible now answers the question: nobody passed before it unseen. Unless it
        // is not known whose turn it is.
        let is_certain = matches!(report, Report::Cleared) || seat_of(report).is_some();
        let before = self.clone();
        self.asked = None;
        match is_certain.then(|| self.take_turn(number, report)) {
            Some(Ok(verdict @ (Verdict::Accepted | Verdict::Known))) if self.asked.is_none() => {
                if verdict == Verdict::Accepted {
                    self.close_question(&asked.id);
                    self.judge_held(ruling);
                } else {
                    self.asked = Some(asked);
                }
                Ok(verdict)
            }
            _ => {
                *self = before;
                if self.held.len() >= MAX_HELD {
                    return Err((
                        None,
                        (ViolatedRule::Turn, "Answer the open question first.".into()),
                    ));
                }
                self.held.push((number, report.clone()));
                Ok(Verdict::Held { question: asked.id })
            }
        }
    }

    /// Judges a report about a turn while no question is open.
    pub(super) fn take_turn(&mut self, number: u64, report: &Report) -> Judged {
        let turn = match report {
            Report::Laid { seat, cards } => TurnReport::Acted {
                seat: *seat,
                action: as_play(&self.rules, cards).map_err(|broken| (*seat, broken))?,
                golden: cards.golden,
            },
            Report::Pass { seat } => TurnReport::Acted {
                seat: *seat,
                action: Action::Pass,
                golden: None,
            },
            _ => TurnReport::Cleared,
        };
        match turn {
            TurnReport::Acted {
                seat,
                action,
                golden,
            } => {
                if let Some(judged) = self.confirm_turn(seat, action) {
                    return judged;
                }
                if self.is_repeated(seat, action) {
                    return Ok(Verdict::Known);
                }
                if self.game().is_over() {
                    let text = "The game is over. Correct the last play if it was misread.";
                    return Err((seat, (ViolatedRule::Turn, text.to_owned())));
                }
                if let Some(leader) = self.may_be_repeated(seat, action) {
                    return Ok(self.ask_if_again(number, report, leader));
                }
                self.or_undo(|it| it.act(number, report, seat, action, golden))
            }
            TurnReport::Cleared => self.clear(number, report),
        }
    }

    /// A report of what a remote seat decided; `None` if the report is not about a remote seat. A pass
    /// without a seat is one of the player who is to act.
    fn confirm_turn(&mut self, seat: Option<Seat>, action: Action) -> Option<Judged> {
        if seat.is_none() && action == Action::Pass {
            return None;
        }
        let awaited = |of: Seat| {
            let open = |it: &ToLay| it.seat == of && it.kind == DecisionKind::Turn;
            self.to_lay.iter().any(open)
        };
        let same = |entry: &Entry| match entry.act {
            Act::Turn(of, done) => {
                let named = seat.map_or_else(|| awaited(of), |seat| seat == of);
                self.remote[of] && named && done == action
            }
            _ => false,
        };
        let of_shift = |shift: usize| {
            let mut entries = self.shifts[shift].entries.iter();
            let open = |entry: &Entry| same(entry) && !entry.confirmed;
            // Earlier passes need not be shown any more.
            let index = match action {
                Action::Pass => entries.rposition(open),
                _ => entries.position(open),
            };
            Some((shift, index?))
        };
        let open = self.recent_shifts().find_map(of_shift);
        if let Some((shift, index)) = open {
            return Some(Ok(self.confirm(shift, index)));
        }
        let seat = seat.filter(|seat| self.remote[*seat])?;
        if self.is_repeated(Some(seat), action) {
            return Some(Ok(Verdict::Known));
        }
        let name = self.names.of(seat);
        let wanted = self
            .to_lay
            .iter()
            .find(|it| it.seat == seat && it.kind == DecisionKind::Turn);
        let shown = turn_text(action);
        let text = match wanted {
            Some(wanted) => format!("{}, not {shown}.", self.describe_to_lay(wanted)),
            None => format!("{name} has not decided to play {shown}: take the cards back."),
        };
        Some(Err((Some(seat), (ViolatedRule::Decision, text))))
    }

    /// Whether the report repeats the last turn of the seat: its cards still lie there, or it is
    /// still out of the pizza.
    fn is_repeated(&self, seat: Option<Seat>, action: Action) -> bool {
        let shift = self.shift();
        if !shift.has_turns() {
            // A late second report of the turn that ended the last Shift, unless it can open this one.
            let opens = |face: Face| face.get() == self.rules.faces();
            if matches!(action, Action::Pass)
                || matches!(action, Action::Play { face, .. } if opens(face))
            {
                return false;
            }
            let last = self.recent_shifts().rev().nth(1);
            let last = last.and_then(|last| self.shifts[last].turns().next_back());
            return last
                .is_some_and(|(of, done)| done == action && seat.is_none_or(|seat| seat == of));
        }
        let last = shift.turns().next_back();
        let last_play = shift.turns().rfind(|(_, done)| *done != Action::Pass);
        let now = self.game().observe(Viewer::Spectator);
        match (action, seat) {
            (Action::Pass, Some(seat)) => {
                let pass = Some((seat, Action::Pass));
                let is_out = now.passed[seat] && shift.turns().rfind(|(of, _)| *of == seat) == pass;
                (is_out || last == pass) && self.to_act() != Some(seat)
            }
            (Action::Pass, None) => false,
            (action, seat) => {
                let is_same = last_play
                    .is_some_and(|(of, done)| done == action && seat.is_none_or(|seat| seat == of));
                let ended_pizza = last == last_play && !self.is_cleared();
                let leads_again = || self.may_be_repeated(seat, action).is_some();
                is_same && (now.board.size > 0 || ended_pizza && !leads_again())
            }
        }
    }

    /// The seat that leads the next pizza, if a report may be another of the play that ended the last
    /// one: its cards lie there until the board is cleared.
    fn may_be_repeated(&self, seat: Option<Seat>, action: Action) -> Option<Seat> {
        let (of, last) = self.shift().turns().next_back()?;
        let lies_there =
            self.game().observe(Viewer::Spectator).board.size == 0 && !self.is_cleared();
        let leader = self.to_act().filter(|leader| !self.remote[*leader])?;
        let may_be = last == action && action != Action::Pass && lies_there;
        (may_be && seat.is_none_or(|seat| seat == leader && seat == of)).then_some(leader)
    }

    /// Whether the board was seen to be cleared after the last turn.
    fn is_cleared(&self) -> bool {
        self.cleared >= self.shift().turns().count()
    }

    /// Judges what a seat at the table did.
    fn act(
        &mut self,
        number: u64,
        report: &Report,
        seat: Option<Seat>,
        action: Action,
        golden: Option<bool>,
    ) -> Judged {
        self.end_exchange(number, seat)?;
        let refuse = |seat, broken| Err((Some(seat), broken));
        let opening = !self.shift().has_turns();
        let is_named = seat.is_some();
        let seat = match (seat, opening) {
            (Some(seat), _) => seat,
            (None, false) => self.to_act().expect("a Shift in progress has a turn"),
            (None, true) => match self.opener() {
                Some(seat) => seat,
                None => return Ok(self.ask_who_opened(number, report)),
            },
        };
        if !is_named && self.remote[seat] {
            let text = format!(
                "It is {}'s turn, who has not decided yet.",
                self.names.of(seat)
            );
            return refuse(seat, (ViolatedRule::Decision, text));
        }
        if opening || self.to_act() == Some(seat) {
            let required = self.requirement(self.game());
            check_play(&self.rules, &required, action, golden).map_err(|it| (Some(seat), it))?;
            // The Golden card shows who opened.
            let report = if opening {
                report.with_seat(seat)
            } else {
                report.clone()
            };
            let accepted = self.accept_turn(number, &report, seat, action);
            if accepted.is_err()
                && !is_named
                && let Some(missed) = self.missed_before_one_who_can(number, action)
            {
                return Ok(self.ask_if_passed(number, &report, missed, Vec::new()));
            }
            return accepted;
        }
        let to_act = self.to_act().expect("a Shift in progress has a turn");
        let out_of_turn = || {
            let (name, next) = (self.names.of(seat), self.names.of(to_act));
            (
                ViolatedRule::Turn,
                format!("It is {next}'s turn, not {name}'s."),
            )
        };
        let Some((missed, game)) = self.passes_before(|game| turn_of(game) == Some(seat)) else {
            return refuse(seat, out_of_turn());
        };
        let required = self.requirement(&game);
        let pizza = |game: &Game| game.observe(Viewer::Spectator).pizza;
        let same_pizza = pizza(&game) == pizza(self.game());
        if let Err(broken) = check_play(&self.rules, &required, action, golden) {
            // The play would break a rule even if the others had passed: say the simpler thing.
            return refuse(seat, if same_pizza { broken } else { out_of_turn() });
        }
        if let Some(remote) = missed.iter().find(|seat| self.remote[**seat]) {
            let text = format!("It is {}'s turn.", self.names.of(*remote));
            return refuse(seat, (ViolatedRule::Turn, text));
        }
        self.miss(number, report, missed, Some((seat, action)), !same_pizza)
    }

    fn accept_turn(&mut self, number: u64, report: &Report, seat: Seat, action: Action) -> Judged {
        let refuse = |text| Err((Some(seat), (ViolatedRule::Cards, text)));
        let name = self.names.of(seat).to_owned();
        let left = self.game().observe(Viewer::Spectator).cards_left[seat];
        let count: u8 = counts_of_action(action).iter().sum();
        if count > left {
            return refuse(format!("{name} has only {left} cards left."));
        }
        match self.try_act(number, Some(report), Act::Turn(seat, action)) {
            Ok(()) => Ok(Verdict::Accepted),
            Err(problem) => refuse(format!(
                "{name} cannot have {}: {}.",
                turn_text(action),
                self.names.replace_seats(&problem.text)
            )),
        }
    }

    /// Notes that the exchange is over, because somebody plays.
    fn end_exchange(
        &mut self,
        number: u64,
        seat: Option<Seat>,
    ) -> Result<(), (Option<Seat>, crate::judge::Broken)> {
        let shift = self.shift();
        let special = shift.open_special(&self.rules);
        let over = special.is_none() && shift.exchange_is_over(&self.rules, &self.remote);
        if shift.has_turns() || over {
            return Ok(());
        }
        if special.flatten().is_some_and(|seat| self.remote[seat]) {
            let text = "A special action has not been decided yet: wait for it.".to_owned();
            return Err((seat, (ViolatedRule::Turn, text)));
        }
        let pairs = shift.pairs(&self.rules);
        let undecided = pairs.iter().find(|pair| {
            let given = shift.gives(pair.chooser).count();
            self.remote[pair.chooser] && given < usize::from(pair.size)
        });
        if let Some(pair) = undecided {
            let name = self.names.of(pair.chooser);
            let text = format!("{name} has not given cards yet.");
            return Err((seat, (ViolatedRule::Turn, text)));
        }
        self.try_act(number, None, Act::ExchangeOver)
            .map_err(|problem| {
                (
                    seat,
                    (ViolatedRule::Gift, self.names.replace_seats(&problem.text)),
                )
            })
    }

    fn clear(&mut self, number: u64, report: &Report) -> Judged {
        let now = self.game().observe(Viewer::Spectator);
        let pizza = now.pizza;
        // A remote seat may decide on the next pizza before the cards of the last one are cleared.
        let on_table = |entry: &Entry| match entry.act {
            Act::Turn(_, Action::Pass) => false,
            Act::Turn(seat, _) => entry.pizza == pizza && (entry.confirmed || !self.remote[seat]),
            _ => false,
        };
        if now.board.size == 0 || !self.shift().entries.iter().any(on_table) {
            self.cleared = self.shift().turns().count();
            return Ok(Verdict::Known);
        }
        let is_done = |game: &Game| game.observe(Viewer::Spectator).pizza != pizza;
        let to_act = self.to_act();
        let (missed, _) = self.passes_before(is_done).ok_or_else(|| {
            let text = "The pizza is not over yet.".to_owned();
            (to_act, (ViolatedRule::Turn, text))
        })?;
        if let Some(remote) = missed.iter().find(|seat| self.remote[**seat]) {
            let text = format!(
                "The pizza is not over yet: it is {}'s turn.",
                self.names.of(*remote)
            );
            return Err((to_act, (ViolatedRule::Turn, text)));
        }
        self.miss(number, report, missed, None, true)
    }

    /// The seats that would have to pass until `done`, and the game then.
    fn passes_before(&self, done: impl Fn(&Game) -> bool) -> Option<(Vec<Seat>, Game)> {
        let mut game = self.game().clone();
        let shift = game.shift();
        let pass = self.rules.actions().pass();
        let mut missed = Vec::new();
        while !done(&game) {
            let seat = turn_of(&game)?;
            if missed.len() >= MAX_MISSED || game.shift() != shift {
                return None;
            }
            game.apply(pass, |_| {}).ok()?;
            missed.push(seat);
        }
        (game.shift() == shift && !game.is_over()).then_some((missed, game))
    }

    /// Seats must have passed unseen before a report. If nothing else is possible, they did;
    /// otherwise the referee asks.
    fn miss(
        &mut self,
        number: u64,
        report: &Report,
        missed: Vec<Seat>,
        then: Option<(Seat, Action)>,
        ends_pizza: bool,
    ) -> Judged {
        let instead = self.passes_before_plays(number, report);
        // After a violation or at the end of a pizza, an earlier report may be wrong: ask.
        let certain =
            self.violation.is_none() && !ends_pizza && then.is_some() && instead.is_empty();
        if certain && self.only_passes_fit(number, &missed, then) {
            for seat in &missed {
                self.try_act(number, None, Act::Turn(*seat, Action::Pass))
                    .map_err(|misfit| (Some(*seat), (ViolatedRule::Cards, misfit.text)))?;
            }
            return self.take_turn(number, report);
        }
        Ok(self.ask_if_passed(number, report, missed, instead))
    }

    fn ask_if_passed(
        &mut self,
        number: u64,
        report: &Report,
        missed: Vec<Seat>,
        instead: Vec<usize>,
    ) -> Verdict {
        let names = self.names.list(&missed);
        let text = format!("Did {names} pass?");
        let mut options = yes_or_no();
        options.extend(instead.iter().filter_map(|place| {
            let Act::Turn(seat, action) = self.shift().entries.get(*place)?.act else {
                return None;
            };
            let (name, play) = (self.names.of(seat), typed_turn(action));
            Some(format!("No, {name} passed before {play}"))
        }));
        let first = missed.first().copied();
        let doubt = Doubt::Passed(missed, instead);
        self.ask_and_hold(number, report, doubt, text, options, first)
    }

    fn ask_if_again(&mut self, number: u64, report: &Report, leader: Seat) -> Verdict {
        let text = format!("Is that a new play by {}?", self.names.of(leader));
        let doubt = Doubt::Again(leader);
        self.ask_and_hold(number, report, doubt, text, yes_or_no(), Some(leader))
    }

    /// The last plays that named no seat, by their places in the Shift, of which one may have been
    /// laid by the next player, after the assumed one had passed: then the report fits without a
    /// pass that was not seen. The newest first.
    fn passes_before_plays(&self, number: u64, report: &Report) -> Vec<usize> {
        let entries = &self.shift().entries;
        let assumed = entries
            .iter()
            .rev()
            .take_while(|it| it.is_assumed())
            .count();
        let places = (entries.len() - assumed..entries.len()).rev();
        let fits = |place: &usize| {
            let mut trial = self.clone();
            trial.violation = None;
            let fits = trial
                .pass_before(number, *place)
                .is_some_and(|void| void.is_empty());
            fits && trial.asked.is_none()
                && matches!(trial.take_turn(number, report), Ok(Verdict::Accepted))
                && trial.asked.is_none()
        };
        places.filter(fits).take(MAX_INSTEAD).collect()
    }

    /// Lets the assumed seat of the play at this place pass before it, and the next one lay it. Returns
    /// the reports that no longer fit; `None` if that seat cannot have passed.
    fn pass_before(&mut self, number: u64, place: usize) -> Option<Vec<u64>> {
        let entries = self.shift().entries.clone();
        let Act::Turn(seat, _) = entries.get(place)?.act else {
            return None;
        };
        self.set_entries(entries[..place].to_vec()).ok()?;
        self.insert_passes(number, &[seat]).ok()?;
        Some(self.replay(&entries[place..]))
    }

    /// The seats that must have passed before a play that named no seat, since they cannot have its
    /// cards, and another has.
    fn missed_before_one_who_can(&self, number: u64, action: Action) -> Option<Vec<Seat>> {
        let pizza = |referee: &Self| referee.game().observe(Viewer::Spectator).pizza;
        let mut trial = self.clone();
        let mut missed: Vec<Seat> = Vec::new();
        loop {
            let seat = trial.to_act().filter(|seat| !self.remote[*seat])?;
            if missed.contains(&seat) || pizza(&trial) != pizza(self) {
                return None;
            }
            let required = trial.requirement(trial.game());
            let fits = required.allows(action) && trial.can_be_played(number, &[(seat, action)]);
            if fits && !missed.is_empty() {
                return Some(missed);
            }
            trial.insert_passes(number, &[seat]).ok()?;
            missed.push(seat);
        }
    }

    fn ask_who_opened(&mut self, number: u64, report: &Report) -> Verdict {
        let seats: Vec<Seat> = (self.remote.seats())
            .filter(|seat| !self.hand_known(*seat))
            .collect();
        let options = seats
            .iter()
            .map(|seat| self.names.of(*seat).to_owned())
            .collect();
        let text = "Who opened the Shift?".to_owned();
        self.ask_and_hold(number, report, Doubt::Opener(seats), text, options, None)
    }

    fn ask_and_hold(
        &mut self,
        number: u64,
        report: &Report,
        doubt: Doubt,
        text: String,
        options: Vec<String>,
        seat: Option<Seat>,
    ) -> Verdict {
        self.questions_asked += 1;
        let id = format!("{QUESTION_PREFIX}{}", self.questions_asked);
        self.questions.push(Question {
            id: id.clone(),
            text,
            options,
            seat,
        });
        self.asked = Some(Asked {
            id: id.clone(),
            doubt,
        });
        self.held.insert(0, (number, report.clone()));
        Verdict::Held { question: id }
    }

    /// Whether no missed seat can have played instead of passing, by the rules and the cards.
    fn only_passes_fit(&self, number: u64, missed: &[Seat], then: Option<(Seat, Action)>) -> bool {
        let mut game = self.game().clone();
        let pass = self.rules.actions().pass();
        for (index, seat) in missed.iter().enumerate() {
            let required = self.requirement(&game);
            let instead = self.rules.actions().iter().filter_map(|id| {
                let action = self.rules.actions().decode(id)?;
                (action != Action::Pass && required.allows(action)).then_some(action)
            });
            for action in instead {
                let mut turns: Vec<(Seat, Action)> = Vec::new();
                turns.extend(missed[..index].iter().map(|seat| (*seat, Action::Pass)));
                turns.push((*seat, action));
                turns.extend(missed[index + 1..].iter().map(|seat| (*seat, Action::Pass)));
                turns.extend(then);
                if self.can_be_played(number, &turns) {
                    return false;
                }
            }
            if game.apply(pass, |_| {}).is_err() {
                return false;
            }
        }
        true
    }

    /// Whether turns can follow, as far as can be found out.
    fn can_be_played(&self, number: u64, turns: &[(Seat, Action)]) -> bool {
        let shift = self.shift();
        let entries = turns.iter().map(|(seat, action)| Entry {
            number,
            report: None,
            act: Act::Turn(*seat, *action),
            pizza: 0,
            confirmed: false,
        });
        let shift = Shift {
            start: shift.start.clone(),
            entries: shift.entries.iter().cloned().chain(entries).collect(),
        };
        match play(&self.rules, &self.remote, &shift) {
            Ok(_) => true,
            Err(misfit) => misfit.is_unresolved,
        }
    }

    fn insert_passes(&mut self, number: u64, missed: &[Seat]) -> Result<(), Misfit> {
        for seat in missed {
            let report = Report::Pass { seat: Some(*seat) };
            self.try_act(number, Some(&report), Act::Turn(*seat, Action::Pass))?;
        }
        Ok(())
    }

    /// Takes the answer to a question.
    pub(super) fn answer(
        &mut self,
        number: u64,
        id: &str,
        option: Option<usize>,
        ruling: &mut Ruling,
    ) -> Judged {
        let Some(question) = self.questions.iter().find(|it| it.id == id).cloned() else {
            return Ok(Verdict::Known);
        };
        if option.is_some_and(|option| option >= question.options.len()) {
            let text = "The question has no such answer.".to_owned();
            return Err((question.seat, (ViolatedRule::Form, text)));
        }
        let asked = self.asked.clone().filter(|asked| asked.id == id);
        self.close_question(id);
        if self.answers.len() == MAX_ANSWERS {
            self.answers.pop_front();
        }
        self.answers.push_back(Answer {
            question: id.to_owned(),
            option,
        });
        let Some(asked) = asked else {
            return Ok(Verdict::Accepted);
        };
        match (asked.doubt, option) {
            (Doubt::Passed(missed, _), Some(0)) => {
                // If they do not fit, nothing changes.
                let _ = self.or_undo(|it| it.insert_passes(number, &missed));
                self.judge_held(ruling);
            }
            (Doubt::Passed(_, instead), Some(option @ 2..)) => {
                if let Some(place) = instead.get(option - 2) {
                    let waiting = std::mem::take(&mut self.held);
                    let before = self.clone();
                    match self.pass_before(number, *place) {
                        Some(void_reports) => {
                            let text = question.options[option].clone();
                            ruling.corrected = Some(Corrected {
                                number,
                                void_events: 0,
                                void_reports,
                                text,
                            });
                        }
                        None => *self = before,
                    }
                    self.held.extend(waiting);
                }
                self.judge_held(ruling);
            }
            (Doubt::Again(seat), option) => {
                if !self.held.is_empty() {
                    let (held, report) = self.held.remove(0);
                    if option == Some(0) {
                        // Not a second report of the first: what is seen now is the new one.
                        self.cleared = self.shift().turns().count();
                        let judged = self.take_turn(held, &report.with_seat(seat));
                        note(held, judged, ruling);
                    }
                }
                self.judge_held(ruling);
            }
            (Doubt::Opener(seats), Some(index)) => {
                if let (Some(seat), Some((_, first))) = (seats.get(index), self.held.first_mut()) {
                    *first = first.with_seat(*seat);
                }
                self.judge_held(ruling);
            }
            // They did not pass: the first report was out of turn.
            (Doubt::Passed(..) | Doubt::Opener(_), _) => {
                if !self.held.is_empty() {
                    let (held, report) = self.held.remove(0);
                    let seat = seat_of(&report);
                    let next = self
                        .to_act()
                        .map_or("the other player", |seat| self.names.of(seat));
                    let violation = Violation {
                        seat,
                        rule: ViolatedRule::Turn,
                        text: format!("It is {next}'s turn."),
                    };
                    ruling.violations.push((held, violation));
                }
                self.judge_held(ruling);
            }
        }
        Ok(Verdict::Accepted)
    }

    fn close_question(&mut self, id: &str) {
        self.questions.retain(|question| question.id != id);
        self.asked = self.asked.take().filter(|asked| asked.id != id);
    }

    /// Judges the reports that waited, until one must wait again.
    pub(super) fn judge_held(&mut self, ruling: &mut Ruling) {
        let held = std::mem::take(&mut self.held);
        let mut held = held.into_iter();
        let shift = self.shifts.len();
        for (number, report) in held.by_ref() {
            let judged = match self.shifts.len() == shift {
                true => self.take_turn(number, &report),
                false => {
                    let text = "The Shift was over before this.".to_owned();
                    Err((seat_of(&report), (ViolatedRule::Turn, text)))
                }
            };
            if let Ok(Verdict::Held { .. }) = judged {
                break;
            }
            note(number, judged, ruling);
        }
        self.held.extend(held);
    }

    fn requirement(&self, game: &Game) -> PlayRequirement {
        match game.requirement() {
            Some(Requirement::Play(required)) => required,
            _ => unreachable!("a turn is open"),
        }
    }
}

/// Notes that a report that waited is not allowed.
fn note(number: u64, judged: Judged, ruling: &mut Ruling) {
    if let Err((seat, (rule, text))) = judged {
        let violation = Violation { seat, rule, text };
        ruling.violations.push((number, violation));
    }
}

fn yes_or_no() -> Vec<String> {
    vec!["Yes".to_owned(), "No".to_owned()]
}

fn turn_of(game: &Game) -> Option<Seat> {
    let open = game.decision()?;
    (open.kind == DecisionKind::Turn).then_some(open.seat)
}

/// The seat a report about a turn names.
pub(super) fn seat_of(report: &Report) -> Option<Seat> {
    match report {
        Report::Laid { seat, .. } | Report::Pass { seat } => *seat,
        _ => None,
    }
}
