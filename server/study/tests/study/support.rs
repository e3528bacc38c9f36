//! A study that tests move on, with the changes it has folded.

use chefshat_study::{
    Answer, At, Change, Content, Device, DueGame, ItemAnswer, ItemKind, NewParticipants, Outcome,
    Participant, Pointer, Refusal, Settings, Study,
};

pub(crate) struct Lab {
    pub(crate) study: Study,
    pub(crate) changes: Vec<Change>,
    pub(crate) now_ms: u64,
}

/// Test participants.
pub(crate) fn tests(count: usize) -> NewParticipants {
    NewParticipants {
        test: true,
        ..NewParticipants::numbered(count)
    }
}

/// Everybody's device.
pub(crate) fn device() -> Device {
    Device {
        width: 390,
        height: 844,
        pixels: 300,
        pointer: Pointer::Coarse as u32,
        time_zone: "Europe/Rome".to_owned(),
    }
}

impl Lab {
    /// A study with this number of invited participants.
    pub(crate) fn new(settings: Settings, invited: usize) -> Self {
        let mut lab = Self {
            study: Study::new(settings).unwrap(),
            changes: Vec::new(),
            now_ms: 1_000_000,
        };
        lab.add(invited);
        lab
    }

    /// Folds a change, and the end of a participant whom it screens out.
    pub(crate) fn fold(&mut self, change: Change) {
        let mut next = Some(change);
        while let Some(change) = next {
            self.study.fold(&change);
            let number = change.number();
            self.changes.push(change);
            next = number.and_then(|it| self.study.screen_out(it, self.now_ms));
        }
    }

    pub(crate) fn fold_all(&mut self, changes: impl IntoIterator<Item = Change>) {
        changes.into_iter().for_each(|change| self.fold(change));
    }

    pub(crate) fn add(&mut self, count: usize) {
        self.invite(&NewParticipants::numbered(count));
    }

    pub(crate) fn invite(&mut self, participants: &NewParticipants) {
        self.fold_all(self.study.add(participants).unwrap());
    }

    pub(crate) fn answer(&mut self, number: u32, answers: Vec<ItemAnswer>) {
        let answered = self.study.answer(self.at(number), answers, self.now_ms);
        self.fold(answered.unwrap());
    }

    pub(crate) fn withdraw(&mut self, number: u32, delete_data: bool) {
        let withdrew = self.study.withdraw(number, delete_data, self.now_ms);
        self.fold(withdrew.unwrap().unwrap());
    }

    pub(crate) fn remove(&mut self, number: u32) {
        let removed = self.study.remove(number, self.now_ms);
        self.fold(removed.unwrap().unwrap());
    }

    /// Removes the data of a participant from the changes. Returns how many contained some.
    pub(crate) fn forget(&mut self, number: u32) -> usize {
        let changed = self.changes.iter_mut().map(|change| change.forget(number));
        changed.filter(|changed| *changed).count()
    }

    pub(crate) fn open(&mut self, number: u32) -> Result<(), Refusal> {
        if let Some(opened) = self.study.open(number, Some(device()), self.now_ms)? {
            self.fold(opened);
            self.study.set_connected(number, true, self.now_ms);
        }
        Ok(())
    }

    /// A participant opens the study and consents.
    pub(crate) fn begin(&mut self, number: u32) {
        self.open(number).unwrap();
        self.act(number);
    }

    /// Folds what follows by itself.
    pub(crate) fn wait(&mut self, ms: u64) {
        self.now_ms += ms;
        loop {
            let changes = self.study.next(self.now_ms, self.now_ms);
            if changes.is_empty() {
                return;
            }
            self.fold_all(changes);
        }
    }

    /// In how many milliseconds something follows by itself.
    pub(crate) fn wake_in(&self) -> Option<u64> {
        self.study.wake_in(self.now_ms, self.now_ms)
    }

    pub(crate) fn participant(&self, number: u32) -> &Participant {
        self.study.participant(number).unwrap()
    }

    /// What a participant sees.
    pub(crate) fn content(&self, number: u32) -> Content {
        self.study.view(number).unwrap().content
    }

    /// Where a participant is.
    pub(crate) fn at(&self, number: u32) -> At {
        let participant = self.participant(number);
        At {
            number,
            session: participant.session,
            step: participant.step(),
        }
    }

    /// A participant does what comes next. Returns the game that it began, if it is one.
    pub(crate) fn act(&mut self, number: u32) -> Option<DueGame> {
        let due = self.study.due(number);
        let (at, now_ms) = (self.at(number), self.now_ms);
        let change = match self.content(number) {
            Content::Consent(_) => match self.study.consent(at, now_ms) {
                Err(Refusal::Full) => return None,
                consented => consented.unwrap(),
            },
            Content::Questionnaire(shown) => {
                let answers = shown.items.iter();
                let answers = answers.map(|it| answer(it.item, valid(&it.kind))).collect();
                self.study.answer(at, answers, now_ms).unwrap()
            }
            Content::Game(game) if game.place.is_none() => {
                let placed = self.place(number);
                self.fold_all(placed);
                return due;
            }
            // Its group comes by itself.
            Content::Arrival(_) => return None,
            Content::Game(game) if !game.ended => self.ended(number, Outcome::Finished),
            Content::Game(_) | Content::External(_) | Content::Text(_) => {
                self.study.proceed(at, now_ms).unwrap()
            }
            Content::End { .. } => return None,
        };
        self.fold(change);
        due
    }

    /// The changes by which the due game of a participant, and of its group, begins.
    pub(crate) fn place(&self, number: u32) -> Vec<Change> {
        // Every game has its own id: there are fewer than 256 changes of a participant in a test.
        let games = self.participant(number).games.len() as u8;
        let game = [games, number as u8].repeat(8).try_into().unwrap();
        self.study.place(number, [9; 16], game)
    }

    /// The change by which a participant's running game ends.
    pub(crate) fn ended(&self, number: u32, outcome: Outcome) -> Change {
        let games = &self.participant(number).games;
        let game = games.last().unwrap().placed.game;
        let ended = self.study.game_ended(number, game, outcome, self.now_ms);
        ended.unwrap()
    }

    /// A participant opens its link and does everything to the end. Returns its games.
    pub(crate) fn complete(&mut self, number: u32) -> Vec<DueGame> {
        self.open(number).unwrap();
        let mut games = Vec::new();
        while self.participant(number).ended_at_ms.is_none() {
            games.extend(self.act(number));
        }
        games
    }

    /// The same study, from its changes.
    pub(crate) fn folded_again(&self) -> Study {
        let mut study = Study::new(self.study.settings().clone()).unwrap();
        self.changes.iter().for_each(|change| study.fold(change));
        study
    }
}

pub(crate) fn answer(item: usize, value: Answer) -> ItemAnswer {
    ItemAnswer {
        item: item as u32,
        value: Some(value),
        answered_after_ms: None,
    }
}

/// A valid answer to an item.
pub(crate) fn valid(kind: &ItemKind) -> Answer {
    match kind {
        ItemKind::Likert { points, .. } | ItemKind::SemanticDifferential { points, .. } => {
            Answer::Number(*points as i32)
        }
        ItemKind::Slider { min, step, .. } => Answer::Number(min + *step as i32),
        ItemKind::Number { min, .. } => Answer::Number(*min),
        ItemKind::Choice { .. } => Answer::options(vec![1]),
        ItemKind::FreeText { .. } => Answer::Text("It was\nfun.".to_owned()),
    }
}
