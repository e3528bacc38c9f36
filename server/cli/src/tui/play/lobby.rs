//! The lobby of a tournament, as values and words: the person's standing, the next game and what it
//! waits for. `lobby_view` draws it.

use chefshat_client::v1::{self, TournamentGameState as GameState};
use ratatui::crossterm::event::KeyCode;

use super::app::App;
use crate::narration::view::End;
use crate::narration::{MAX_NAME, clean};
use crate::numbers::{counted, ordinal};
use crate::tournament::tables::{Field, place_in_words};
use crate::tournament::words::is_over;

/// Lines per page of the standings.
const PAGE: usize = 5;

/// A tournament as last reported by the server.
#[derive(Debug, Clone, Default)]
pub(super) struct Report {
    pub(super) tournament: v1::Tournament,
    /// Best first.
    pub(super) standings: Vec<v1::TournamentStanding>,
    /// The games of the round, or those in progress.
    pub(super) games: Vec<v1::TournamentGame>,
    /// The person's next game, if not among those.
    pub(super) next: Option<v1::TournamentGame>,
    /// Whether it is not known yet if there is one.
    pub(super) is_searching: bool,
}

/// A tournament.
#[derive(Debug)]
pub(super) struct Lobby {
    pub(super) tournament_id: String,
    /// The person's participant number.
    pub(super) me: u32,
    pub(super) report: Option<Report>,
    /// The result of the last game, in words.
    pub(super) last: Option<String>,
    pub(super) notice: String,
    /// First visible line of the standings, if the person has scrolled.
    pub(super) first: Option<usize>,
}

impl Report {
    /// Reads a report; `None` for a heartbeat.
    pub(super) fn of(response: v1::FollowTournamentResponse) -> Option<Self> {
        Some(Self {
            tournament: response.tournament?,
            standings: response.standings,
            games: response.games,
            next: None,
            is_searching: false,
        })
    }

    pub(super) fn format(&self) -> v1::TournamentFormat {
        let settings = self.tournament.settings.as_ref();
        settings.map_or(v1::TournamentFormat::Unspecified, |it| it.format())
    }

    /// A participant's game in progress, or else the first that is due.
    pub(super) fn own_game(&self, me: u32) -> Option<&v1::TournamentGame> {
        let own = |state| {
            let mut games = self.games.iter().chain(&self.next);
            games.find(move |game| game.state() == state && sits(game, me))
        };
        own(GameState::Playing).or_else(|| own(GameState::Due))
    }

    pub(super) fn standing(&self, me: u32) -> Option<&v1::TournamentStanding> {
        let mut standings = self.standings.iter();
        standings.find(|standing| standing.participant == me)
    }

    pub(super) fn is_over(&self) -> bool {
        is_over(&self.tournament)
    }

    /// Whether a participant has been eliminated from a knockout.
    fn is_out(&self, me: u32) -> bool {
        let last = self.standing(me).map_or(0, |it| it.last_round);
        self.format() == v1::TournamentFormat::Knockout && self.tournament.round > last.max(1)
    }
}

/// Whether a participant has a seat in a game.
pub(super) fn sits(game: &v1::TournamentGame, me: u32) -> bool {
    game.seats.iter().any(|seat| seat.participant == me)
}

impl Lobby {
    pub(super) fn new(tournament_id: String, me: u32) -> Self {
        Self {
            tournament_id,
            me,
            report: None,
            last: None,
            notice: String::new(),
            first: None,
        }
    }

    pub(super) fn is_over(&self) -> bool {
        self.report.as_ref().is_some_and(Report::is_over)
    }

    /// Whether leaving now may lose games; true if unknown.
    pub(super) fn has_games_to_come(&self) -> bool {
        let Some(report) = &self.report else {
            return true;
        };
        let tournament = &report.tournament;
        let rounds = match report.format() {
            v1::TournamentFormat::Knockout => !report.is_out(self.me),
            v1::TournamentFormat::RoundRobin => false,
            _ => true,
        };
        let drawn = rounds && tournament.round < tournament.rounds;
        let open = tournament.state() == v1::TournamentState::Open;
        let has_game = report.is_searching || report.own_game(self.me).is_some();
        !report.is_over() && (open || drawn || has_game)
    }

    /// Notes the result of a game.
    pub(super) fn played(&mut self, game: &App) {
        self.last = Some(match &game.table.end {
            Some(End::Finished(standings)) => {
                let mine = standings.iter().find(|line| Some(line.seat) == game.me);
                let Some(line) = mine else { return };
                let points = counted(line.points, "point");
                let (place, all) = (ordinal(line.place), standings.len());
                format!("Your last game: {place} of {all}, {points} in it.")
            }
            Some(End::Aborted(_)) => {
                "Your last game was aborted; it is called again or does not count.".to_owned()
            }
            None => "Your last game is unavailable; see the standings for its result.".into(),
        });
    }

    /// Scrolls the standings.
    pub(super) fn key(&mut self, code: KeyCode) {
        let lines = self.report.as_ref().map_or(0, |it| it.standings.len());
        let first = self.first.unwrap_or(0);
        self.first = match code {
            KeyCode::PageUp => Some(first.saturating_sub(PAGE)),
            KeyCode::Up => Some(first.saturating_sub(1)),
            KeyCode::PageDown => Some((first + PAGE).min(lines.saturating_sub(1))),
            KeyCode::Down => Some((first + 1).min(lines.saturating_sub(1))),
            KeyCode::Home => Some(0),
            KeyCode::End => Some(lines.saturating_sub(1)),
            _ => self.first,
        };
    }

    /// The sentences of the lobby, most important first; `ended`: no more games, whatever the last
    /// report says.
    pub(super) fn words(&self, ended: bool) -> Vec<String> {
        let Some(report) = &self.report else {
            return vec!["Waiting for the state of the tournament.".to_owned()];
        };
        let mut lines = vec![self.own_standing(report)];
        lines.extend(self.last.clone());
        if ended && !report.is_over() {
            lines.push("The tournament is over.".to_owned());
        } else {
            lines.extend(self.what_comes(report));
        }
        lines
    }

    /// The person's standing in one line; `None` before a game has counted.
    pub(super) fn in_short(&self) -> Option<String> {
        let report = self.report.as_ref()?;
        let standing = report.standing(self.me).filter(|it| it.games > 0)?;
        let place = place_in_words(standing, report.standings.len())?;
        Some(format!("In the tournament: {place}"))
    }

    fn own_standing(&self, report: &Report) -> String {
        let name = Field::new(&report.tournament).name(self.me);
        let standing = report.standing(self.me).filter(|it| it.games > 0);
        let place = standing.and_then(|it| place_in_words(it, report.standings.len()));
        match place {
            Some(place) => format!("{name}, you are {place}."),
            None => format!("{name}, you take part."),
        }
    }

    /// The next game and what it waits for, or why there is none.
    fn what_comes(&self, report: &Report) -> Vec<String> {
        let tournament = &report.tournament;
        match tournament.state() {
            v1::TournamentState::Finished => return vec!["The tournament is over.".to_owned()],
            v1::TournamentState::Closed => {
                return vec!["The tournament was closed before its end.".to_owned()];
            }
            v1::TournamentState::Open => return vec![before_the_beginning(tournament)],
            v1::TournamentState::Playing | v1::TournamentState::Unspecified => {}
        }
        let Some(game) = report.own_game(self.me) else {
            let mut lines = vec![self.why_none(report)];
            lines.extend(self.still_playing(report));
            return lines;
        };
        let field = Field::new(tournament);
        let others = game.seats.iter().map(|seat| seat.participant);
        let others = others.filter(|other| *other != self.me);
        let names: Vec<String> = others.map(|it| field.name(it)).collect();
        let called = if game.state() == GameState::Playing {
            "Your game is called"
        } else {
            "Your next game"
        };
        let (round, table) = (game.round, game.table);
        let mut lines = vec![format!(
            "{called}: round {round}, table {table}, with {}.",
            listed(&names)
        )];
        lines.extend(self.awaited(report, game));
        lines
    }

    /// The participants a game waits for, with reasons.
    fn awaited(&self, report: &Report, game: &v1::TournamentGame) -> Option<String> {
        let field = Field::new(&report.tournament);
        // The game that keeps a participant busy at the limit of games.
        let busy = |who: &v1::TournamentParticipant| {
            let mut playing = report.games.iter().filter(|other| {
                other.game != game.game
                    && other.state() == GameState::Playing
                    && sits(other, who.participant)
            });
            let most = usize::try_from(who.max_games.max(1)).unwrap_or(usize::MAX);
            playing.nth(most - 1)
        };
        let seats = game.seats.iter().map(|seat| seat.participant);
        let whom = seats.filter(|who| *who != self.me).filter_map(|who| {
            let participant = field.get(who)?;
            let name = clean(&participant.name, MAX_NAME);
            if !participant.connected && participant.built_in_agent.is_empty() {
                return Some(format!("{name} (not here)"));
            }
            let other = busy(participant).filter(|_| game.state() == GameState::Due)?;
            Some(format!("{name} (plays at table {})", other.table))
        });
        let whom: Vec<String> = whom.collect();
        (!whom.is_empty()).then(|| format!("It waits for {}.", listed(&whom)))
    }

    /// The games in progress while the person waits.
    fn still_playing(&self, report: &Report) -> Option<String> {
        let playing = |game: &&v1::TournamentGame| game.state() == GameState::Playing;
        let games: Vec<_> = report.games.iter().filter(playing).collect();
        let field = Field::new(&report.tournament);
        match games.as_slice() {
            [] => None,
            [game] => {
                let seats = game.seats.iter().map(|seat| field.name(seat.participant));
                let names: Vec<String> = seats.collect();
                Some(format!("At table {}: {}.", game.table, listed(&names)))
            }
            games => Some(format!("{} games are being played.", games.len())),
        }
    }

    /// Why the person has no next game.
    fn why_none(&self, report: &Report) -> String {
        let tournament = &report.tournament;
        let (round, rounds) = (tournament.round, tournament.rounds);
        let left = tournament.games.saturating_sub(tournament.games_over);
        if report.is_searching {
            return "Your next game is not known yet.".to_owned();
        }
        if report.is_out(self.me) {
            return "You are eliminated; the others continue.".to_owned();
        }
        if report.format() == v1::TournamentFormat::RoundRobin || round >= rounds {
            let left = counted(left.into(), "game");
            return format!("All your games are over; {left} of the others remain.");
        }
        if report.games.iter().any(|game| sits(game, self.me)) {
            format!(
                "Your part of round {round} is over; round {} is drawn when the others have finished.",
                round.saturating_add(1)
            )
        } else {
            format!("You have a bye in round {round} of {rounds}.")
        }
    }
}

fn before_the_beginning(tournament: &v1::Tournament) -> String {
    let joined = counted(tournament.participants.len() as u64, "participant");
    let settings = tournament.settings.as_ref();
    match settings.map_or(0, |settings| settings.start_when_joined) {
        0 => format!("{joined} so far. It starts when its host starts it."),
        count => format!("{joined} so far. It starts when {count} have joined."),
    }
}

/// `Ada, Ben and Cleo`.
fn listed(names: &[String]) -> String {
    match names {
        [] => "nobody".to_owned(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}
